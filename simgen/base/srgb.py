"""sRGB primaries (IEC 61966-2-1) from CIE XYZ."""

import numpy as np

FROM_XYZ = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])
"""From CIE XYZ to linear sRGB."""
