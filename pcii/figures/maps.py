"""Maps over pixels with a scale or names: depth, entropy, objects."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from pcii.figures.exposure import THUMBNAIL_PX, block_px
from pcii.figures.palette import COLOURS, plot_label
from pcii.figures.panels import figure_of, show_picture, write_in_middle
from pcii.figures.pictures import data_uri, depth_image

if TYPE_CHECKING:
    from matplotlib.axes import Axes

OUTLYING = 0.01
"""Share of the depths, at either end, that may lie outside the scale."""
LEAST_DEPTH_MM = 1.0
"""A scale of depth spans so much at least: what is flat is no picture of rounding errors."""
MOST_NAMES = 20
"""Objects that are named in a picture: the largest."""
OBJECT_COLOURS = COLOURS[:-1]
"""Black is where no object is."""


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
) -> None:
    """Depth (H, W) in mm with a colour bar, near is bright; greyer where less sure, black where not known."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    limits = depth_limits_mm(z_mm) if limits_mm is None else limits_mm
    show_picture(axes, depth_image(z_mm, *(limits or (0.0, 1.0)), confidence), z_mm.shape, title)
    if not np.isfinite(z_mm).any():
        write_in_middle(axes, "no depth is known")
    if limits is not None:
        scale = ScalarMappable(Normalize(*limits), "viridis_r")
        bar = figure_of(axes).colorbar(scale, ax=axes, label="depth z (mm)")
        bar.ax.invert_yaxis()


def depth_thumbnail(z_mm: np.ndarray, confidence: np.ndarray, limits_mm: tuple[float, float]) -> str:
    """A small picture of depth (H, W) as a data URI: single pixels, since depths have no mean."""
    few = np.s_[:: block_px(z_mm.shape, THUMBNAIL_PX), :: block_px(z_mm.shape, THUMBNAIL_PX)]
    return data_uri(depth_image(z_mm[few], *limits_mm, confidence[few]))


def entropy_image(bits: np.ndarray, most_bits: float) -> np.ndarray:
    """Entropy (h, w) in cividis, 8-bit RGB (h, w, 3): blue for 0, yellow for `most_bits`."""
    from matplotlib import colormaps

    share = np.clip(np.nan_to_num(bits) / max(most_bits, 1e-30), 0, 1)
    return np.round(255 * colormaps["cividis"](share)[..., :3]).astype(np.uint8)


def entropy_thumbnail(bits: np.ndarray, most_bits: float) -> str:
    """A small picture of entropy (h, w) as a data URI."""
    step = block_px(bits.shape, THUMBNAIL_PX)
    return data_uri(entropy_image(bits[::step, ::step], most_bits))


def draw_entropy(axes: "Axes", bits: np.ndarray, most_bits: float, film: Sequence[int], side_px: int) -> None:
    """Entropy (h, w) in bits of blocks, `side_px` wide, with a colour bar from 0 to `most_bits`."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    show_picture(axes, entropy_image(bits, most_bits), film, "uncertainty of depth", side_px)
    scale = ScalarMappable(Normalize(0, most_bits), "cividis")
    figure_of(axes).colorbar(scale, ax=axes, label="entropy (bits)")


def draw_objects(axes: "Axes", object_id: np.ndarray, names: Mapping[int, str]) -> None:
    """Objects (H, W) in colours with their names; black where none is."""
    image = np.zeros((*object_id.shape, 3))
    ids, sizes = np.unique(object_id[object_id > 0], return_counts=True)
    for place, number in enumerate(ids.tolist()):
        image[object_id == number] = _rgb(OBJECT_COLOURS[place % len(OBJECT_COLOURS)])
    show_picture(axes, image, object_id.shape, "objects")
    box = {"boxstyle": "round,pad=0.15", "facecolor": "white", "alpha": 0.8, "linewidth": 0}
    for number in ids[np.argsort(-sizes, kind="stable")][:MOST_NAMES].tolist():
        i, j = _middle(object_id == number)
        axes.text(
            j, i, plot_label(names[number]), bbox=box, clip_on=True, ha="center", va="center", color="black"
        )
    if not ids.size:
        write_in_middle(axes, "no object is seen")


def _rgb(colour: str) -> np.ndarray:
    from matplotlib.colors import to_rgb

    return np.array(to_rgb(colour))


def _middle(mask: np.ndarray) -> tuple[int, int]:
    """The pixel of a mask that is nearest to its centre of mass: a place for a name."""
    pixels = np.argwhere(mask)
    i, j = pixels[((pixels - pixels.mean(axis=0)) ** 2).sum(axis=1).argmin()]
    return int(i), int(j)
