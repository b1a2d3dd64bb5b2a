"""Parts of the pictures of `preview` and `sheet`: where to look, depth, objects by name, and the file."""

import colorsys
import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np

from pcii.base.errors import InputError
from pcii.base.safe_files import write_bytes_safely

SUFFIXES = (".png", ".jpg", ".jpeg")
EMPTY = "0.93"
"""Grey where no object is."""
GOLDEN = 0.6180339887
MARGIN = 0.42
"""Room for names on either side of a picture, as a share of its longer side."""
DOTS_PER_INCH = 110
LEAST_DEPTH_MM = 1.0
"""The colours of a picture of depth span so much at least."""


def check_picture_path(out: Path) -> None:
    """Raise `InputError` unless a picture can be written there: before anything takes time."""
    if out.suffix.lower() not in SUFFIXES:
        raise InputError(f"{out}: name a .png or .jpg file")
    if out.is_dir():
        raise InputError(f"{out}: this is a folder; name a file in it")
    if not out.parent.is_dir():
        raise InputError(f"{out}: there is no folder {out.parent}; make it first")


def part_of_interest(mask: np.ndarray, margin_px: float) -> tuple[slice, slice]:
    """Rows and columns around what is True in `mask` (H, W), in the film's aspect; all if nothing is."""
    height, width = mask.shape
    if not mask.any():
        return slice(0, height), slice(0, width)
    lines = [np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0)]
    spans = [(line[0] - margin_px, line[-1] + 1 + margin_px) for line in lines]
    scale = min(1.0, max((b - a) / size for (a, b), size in zip(spans, mask.shape, strict=True)))
    box = []
    for (a, b), size in zip(spans, mask.shape, strict=True):
        length = max(1, round(scale * size))
        start = int(np.clip(round((a + b - length) / 2), 0, size - length))
        box.append(slice(start, start + length))
    return box[0], box[1]


def named_width(aspect: float) -> float:
    """How many times as wide as a picture it is together with names, for its width over its height."""
    return 1 + 2 * MARGIN * max(1.0, 1 / aspect)


def new_figure(width_in: float, height_in: float, layout: Literal["compressed"] | None = "compressed") -> Any:
    """An empty Matplotlib figure that needs no display and no global state."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in), layout=layout, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def save_figure(figure: Any, out: Path, dots_per_inch: int = DOTS_PER_INCH) -> None:
    """Write a figure whole or not at all; `InputError` where writing is not allowed."""
    kind = "png" if out.suffix.lower() == ".png" else "jpeg"
    buffer = io.BytesIO()
    figure.savefig(buffer, format=kind, dpi=dots_per_inch, bbox_inches="tight", pad_inches=0.15)
    try:
        write_bytes_safely(out, buffer.getvalue())
    except PermissionError as fault:
        raise InputError(f"{out}: cannot be written here ({fault.strerror})") from None


def hide_frame(axes: Any) -> None:
    """No ticks and no lines around a picture."""
    axes.set_xticks([])
    axes.set_yticks([])
    axes.spines[:].set_visible(False)


def frame_part(axes: Any, box: tuple[slice, slice]) -> None:
    """A thin frame around the part of a picture that others show enlarged."""
    rows, cols = box
    left, right, top, bottom = cols.start - 0.5, cols.stop - 0.5, rows.start - 0.5, rows.stop - 0.5
    axes.plot([left, right, right, left, left], [top, top, bottom, bottom, top], color="0.6", linewidth=0.8)


def draw_depth(axes: Any, z_mm: np.ndarray, shown: np.ndarray) -> None:
    """Planar depth (H, W) where `shown`, with a colour bar; near is bright."""
    axes.set_title("planar depth of the objects")
    hide_frame(axes)
    axes.set_facecolor(EMPTY)
    values = np.where(shown, z_mm, np.nan)
    image = axes.imshow(values, cmap="viridis_r", interpolation="nearest")
    if shown.any():
        middle, half = (z_mm[shown].max() + z_mm[shown].min()) / 2, np.ptp(z_mm[shown]) / 2
        half = max(half, LEAST_DEPTH_MM / 2)  # what is flat is no picture of rounding errors
        image.set_clim(middle - half, middle + half)
        scale = axes.inset_axes((1.03, 0.05, 0.05, 0.9))  # as high as the picture, whatever room there is
        bar = axes.figure.colorbar(image, cax=scale, label="z (mm)")
        bar.ax.invert_yaxis()
    else:
        axes.text(0.5, 0.5, "no object in view", transform=axes.transAxes, ha="center")


def draw_objects(axes: Any, object_id: np.ndarray, names: Mapping[int, str]) -> None:
    """Objects (H, W) in colours, their names in two columns beside the picture, each with a line to it.

    Names stand in the order of the objects' rows, evenly apart where they would touch, so that two
    dozen can be read.
    """
    axes.set_title("objects")
    hide_frame(axes)
    height, width = object_id.shape
    room = MARGIN * max(height, width)
    seen = [number for number in names if (object_id == number).any()]
    picture = np.full((height, width, 3), float(EMPTY))
    for place, number in enumerate(seen):
        picture[object_id == number] = _colour(place)
    axes.imshow(picture, interpolation="nearest")
    anchors = {number: _inside(object_id == number) for number in seen}
    by_column = sorted(seen, key=lambda number: anchors[number][1])
    half = len(seen) // 2
    for side, group in ((-1, by_column[:half]), (1, by_column[half:])):
        group = sorted(group, key=lambda number: anchors[number][0])
        rows = spread_out(np.array([anchors[number][0] for number in group], dtype=float), height)
        x = width + 0.1 * room if side > 0 else -0.1 * room
        for number, row in zip(group, rows, strict=True):
            i, j = anchors[number]
            edge = width if side > 0 else 0
            axes.plot([j, edge, x], [i, row, row], color="0.25", linewidth=0.6, clip_on=False)
            axes.plot([j], [i], marker="o", markersize=2.2, color="0.1")
            axes.text(
                x + side * 0.02 * room,
                row,
                names[number],
                ha="left" if side > 0 else "right",
                va="center",
                fontsize=8,
            )
    axes.set_xlim(-0.5 - room, width - 0.5 + room)
    axes.set_ylim(height - 0.5, -0.5)


def spread_out(places: np.ndarray, length: float, most: int = 20) -> np.ndarray:
    """Sorted places (N,) moved as little as it takes to be length / max(most, N) apart, in 0 .. length."""
    gap = length / max(most, places.size, 1)
    steps = gap * np.arange(places.size)
    # Less their steps, places must not fall: pooling neighbours that do is isotonic regression.
    pools: list[list[float]] = []
    for place in np.clip(places, gap / 2, length - gap / 2) - steps:
        pools.append([float(place)])
        while len(pools) > 1 and np.mean(pools[-2]) > np.mean(pools[-1]):
            pools[-2:] = [pools[-2] + pools[-1]]
    level = np.array([np.mean(pool) for pool in pools for _ in pool])
    return np.clip(level, gap / 2, length - gap / 2 - steps[-1] if places.size else 0) + steps


def _inside(mask: np.ndarray) -> tuple[int, int]:
    """The pixel of a mask that is farthest from its border: a place for a label."""
    from scipy.ndimage import distance_transform_edt

    depth = np.asarray(distance_transform_edt(np.pad(mask, 1)))[1:-1, 1:-1]
    i, j = np.unravel_index(int(depth.argmax()), mask.shape)
    return int(i), int(j)


def _colour(place: int) -> tuple[float, float, float]:
    """The colour of the object in this place: hues of neighbours far apart, brightness in turns."""
    return colorsys.hls_to_rgb((0.58 + place * GOLDEN) % 1, (0.58, 0.45, 0.7)[place % 3], 0.6)
