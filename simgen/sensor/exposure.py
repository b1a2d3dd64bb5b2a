"""Absolute exposure: how many photons a pixel catches of a scene's light.

The image of a surface of luminance L through a lens of f-number N, focused far away, has the
illuminance pi L / (4 N^2) (ISO 12232). In RGB mode radiance is in cd/m^2, and a channel's light is
counted in photons of 555 nm, of which a lumen second has most meaning: 1 lm is 1/683 W there. In spectral
mode radiance is already in terms of these (see `filters`), and the photons are those that are detected.
"""

import math

from simgen.spec.recipe import Exposure

PHOTONS_PER_LUMEN_SECOND = 555e-9 / (683 * 6.62607015e-34 * 299792458)
"""Photons of 555 nm; CODATA values of h and c, SI value of the luminous efficacy."""


def photons_per_radiance(exposure: Exposure, pixel_mm: float) -> float:
    """Photons that arrive at a pixel during the exposure for each cd/m^2 that it looks at."""
    illuminance_per_luminance = math.pi / (4 * exposure.f_number**2)
    pixel_m2 = (pixel_mm * 1e-3) ** 2
    return PHOTONS_PER_LUMEN_SECOND * illuminance_per_luminance * pixel_m2 * exposure.time_s
