"""Parts of the pictures of `preview` and `sheet`: where to look, depth and objects, and the file."""

import io
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pcii.base.errors import InputError
from pcii.figures.maps import draw_depth
from pcii.figures.object_maps import draw_objects
from pcii.figures.panels import hide_frame
from pcii.store.safe_files import write_bytes_safely

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SUFFIXES = (".png", ".jpg", ".jpeg")
MARGIN = 0.03
"""Around the objects, as a share of the picture's longer side."""


def check_picture_path(out: Path) -> None:
    """Raise `InputError` unless a picture can be written there: before anything takes time."""
    if out.suffix.lower() not in SUFFIXES:
        raise InputError(f"{out}: name a .png or .jpg file")
    if out.is_dir():
        raise InputError(f"{out}: this is a folder; name a file in it")
    if not out.parent.is_dir():
        raise InputError(f"{out}: there is no folder {out.parent}; make it first")


def part_of_interest(mask: np.ndarray, away_px: float = 0.0) -> tuple[slice, slice]:
    """Rows and columns around what is True in `mask` (H, W), in the film's aspect; all if nothing is.

    There is a margin, and as much room for what is up to `away_px` from there in other views.
    """
    height, width = mask.shape
    if not mask.any():
        return slice(0, height), slice(0, width)
    margin_px = MARGIN * max(mask.shape) + away_px
    lines = [np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0)]
    spans = [(line[0] - margin_px, line[-1] + 1 + margin_px) for line in lines]
    scale = min(1.0, max((b - a) / size for (a, b), size in zip(spans, mask.shape, strict=True)))
    box = []
    for (a, b), size in zip(spans, mask.shape, strict=True):
        length = max(1, round(scale * size))
        start = int(np.clip(round((a + b - length) / 2), 0, size - length))
        box.append(slice(start, start + length))
    return box[0], box[1]


def draw_truth(
    depth: "Axes", objects: "Axes", z_mm: np.ndarray, object_id: np.ndarray, names: Mapping[int, str]
) -> None:
    """Depth of the objects (H, W) with a scale as high as the picture, and the objects by name."""
    things = object_id > 0
    scale = depth.inset_axes((1.03, 0.05, 0.05, 0.9)) if things.any() else None
    draw_depth(depth, np.where(things, z_mm, np.inf), None, None, "planar depth of the objects", scale)
    hide_frame(depth)
    draw_objects(objects, object_id, names)


def encoded(figure: "Figure", kind: str, dots_per_inch: float | None = None) -> bytes:
    """A figure as the bytes of a "png" or "jpeg"."""
    buffer = io.BytesIO()
    dpi = dots_per_inch or "figure"
    figure.savefig(buffer, format=kind, dpi=dpi, bbox_inches="tight", pad_inches=0.15)
    return buffer.getvalue()


def save_figure(figure: "Figure", out: Path, dots_per_inch: float | None = None) -> None:
    """Write a figure whole or not at all; `InputError` where writing is not allowed."""
    content = encoded(figure, "png" if out.suffix.lower() == ".png" else "jpeg", dots_per_inch)
    try:
        write_bytes_safely(out, content)
    except PermissionError as fault:
        raise InputError(f"{out}: cannot be written here ({fault.strerror})") from None


def frame_part(axes: "Axes", box: tuple[slice, slice]) -> None:
    """A thin frame around the part of a picture that others show enlarged."""
    rows, cols = box
    left, right, top, bottom = cols.start - 0.5, cols.stop - 0.5, rows.start - 0.5, rows.stop - 0.5
    axes.plot([left, right, right, left, left], [top, top, bottom, bottom, top], color="0.6", linewidth=0.8)
