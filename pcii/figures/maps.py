"""Maps over pixels with a scale: depth, entropy."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pcii.figures.panels import figure_of, show_picture, write_in_middle
from pcii.figures.pictures import depth_image

if TYPE_CHECKING:
    from matplotlib.axes import Axes

OUTLYING = 0.01
"""Share of the depths, at either end, that may lie outside the scale."""
LEAST_DEPTH_MM = 1.0
"""A scale of depth spans so much at least: what is flat is no picture of rounding errors."""


def depth_limits_mm(z_mm: np.ndarray) -> tuple[float, float] | None:
    """Near and far end of a scale that holds all but outlying depths; None without depths."""
    known = z_mm[np.isfinite(z_mm)]
    if not known.size:
        return None
    near, far = np.quantile(known, [OUTLYING, 1 - OUTLYING])
    middle, half = (near + far) / 2, max((far - near) / 2, LEAST_DEPTH_MM / 2)
    return float(middle - half), float(middle + half)


def draw_depth(
    axes: "Axes",
    z_mm: np.ndarray,
    confidence: np.ndarray | None,
    limits_mm: tuple[float, float] | None,
    title: str,
    scale_axes: "Axes | None" = None,
) -> None:
    """Depth (H, W) in mm with a colour bar, near is bright; greyer where less sure, black where not known.

    The bar is drawn into `scale_axes`, by default into a part of `axes`.
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    limits = depth_limits_mm(z_mm) if limits_mm is None else limits_mm
    show_picture(axes, depth_image(z_mm, *(limits or (0.0, 1.0)), confidence), z_mm.shape, title)
    if not np.isfinite(z_mm).any():
        write_in_middle(axes, "no depth is known")
    if limits is not None:
        scale = ScalarMappable(Normalize(*limits), "viridis_r")
        beside = axes if scale_axes is None else None
        bar = figure_of(axes).colorbar(scale, cax=scale_axes, ax=beside, label="depth z (mm)")
        bar.ax.invert_yaxis()


def entropy_image(bits: np.ndarray, most_bits: float) -> np.ndarray:
    """Entropy (h, w) in cividis, 8-bit RGB (h, w, 3): blue for 0, yellow for `most_bits`."""
    from matplotlib import colormaps

    share = np.clip(np.nan_to_num(bits) / max(most_bits, 1e-30), 0, 1)
    return np.round(255 * colormaps["cividis"](share)[..., :3]).astype(np.uint8)


def draw_entropy(
    axes: "Axes", bits: np.ndarray, most_bits: float, shape_HW: Sequence[int], side_px: int
) -> None:
    """Entropy (h, w) in bits of blocks, `side_px` wide, with a colour bar from 0 to `most_bits`."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    show_picture(axes, entropy_image(bits, most_bits), shape_HW, "uncertainty of depth", side_px)
    scale = ScalarMappable(Normalize(0, most_bits), "cividis")
    figure_of(axes).colorbar(scale, ax=axes, label="entropy (bits)")
