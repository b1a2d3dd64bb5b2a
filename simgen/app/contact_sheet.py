"""A contact sheet of a finished dataset: its truth, its photons and its full-light images on one page."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pcii.core.bayer import colours_and_samples
from pcii.core.photon_counts import PhotonCounts
from pcii.figures.object_maps import named_width
from pcii.figures.panels import hide_frame, new_figure, write_in_middle
from pcii.io.dataset import Dataset, open_dataset
from pcii.io.dataset_layout import COUNTS
from simgen.app.picture_parts import check_picture_path, draw_truth, part_of_interest, save_figure
from simgen.cameras.disparities import shifts_px

if TYPE_CHECKING:
    from matplotlib.axes import Axes
from collections.abc import Iterator, Sequence

from pcii.core.camera_grid import CameraGrid
from pcii.core.images import Views
from pcii.figures.exposure import block_px, exposed
from pcii.imaging.blocks import evenly_chosen

Box = tuple[slice, slice]
"""Rows and columns of a film."""
GAP_PX = 2
MOST_TILES = 12
"""So many tiles stand in a row or column at most; of more views some are left out."""
COUNTS_PER_BLOCK = 1.5
LIT_SHARE = 0.25
BLOCKS = (24, 128)
"""Blocks along the longer side of a photon tile, at least and at most."""
MOST_BARS = 40
HEAD_IN, TITLE_IN, GAP_IN, LABELS_IN = 0.65, 0.4, 0.3, 0.8
"""Room for the lines above all panels, a panel's title, between columns, and for numbers beside a scale."""
WIDEST_IN, HIGHEST_IN, LEAST_IN = 4.6, 4.2, 1.6
"""Sides of a film's picture: at most, and at least that of a long and narrow one."""
PHOTONS_IN = 12.0, 4.5
"""Width of the photons of all views beside the other panels, at most, and of their column at least."""
WIDE = 3.0
"""Photons of views that together are so many times as wide as high stand above the other panels."""
HISTOGRAM_IN = 7.0
"""Width of the histogram with its numbers."""
RADIANCE_VIEWS, RADIANCE_PX = 3, 256
"""Full-light views to a side of the sheet, and pixels to the longer side of each."""


def chosen_cameras(grid: CameraGrid, most: int) -> list[list[int]]:
    """Rows and columns of cameras that are shown, at most so many of each."""
    return [evenly_chosen(number, most) for number in (grid.rows, grid.cols)]


def photon_block_px(counts: PhotonCounts, box: Box) -> int:
    """Side of the blocks in which photons in a part of the views are shown.

    A block is large enough to hold a photon or two where there is light: on a quarter of the pixels, one
    guesses.
    """
    events = counts.events
    inside = np.ones(events.n.size, dtype=bool)
    for at, part in zip((events.i, events.j), box, strict=True):
        inside &= (at >= part.start) & (at < part.stop)
    sizes = [part.stop - part.start for part in box]
    pixels_with_light = LIT_SHARE * sizes[0] * sizes[1] / max(sizes) ** 2
    photons = events.n[inside].sum() / counts.grid.view_count
    return block_px(sizes, int(np.clip(np.sqrt(photons / (COUNTS_PER_BLOCK * pixels_with_light)), *BLOCKS)))


def photon_tiles(counts: PhotonCounts, box: Box, block_side_px: int) -> np.ndarray:
    """Photons in the part `box` of at most `MOST_TILES` views to a side, as one 8-bit picture (h, w, 3)."""
    rows, cols = chosen_cameras(counts.grid, MOST_TILES)
    views = (counts.view(k, l)[..., None] for k in rows for l in cols)
    return joined(_pictures(views, counts.cfa, box, block_side_px), len(cols))


def radiance_tiles(views: Views, most: int, side_px: int, box: Box) -> np.ndarray:
    """The part `box` of at most `most` full-light views to a side, none longer than `side_px`, as one."""
    rows, cols = chosen_cameras(views.grid, most)
    step_px = block_px([part.stop - part.start for part in box], side_px)
    images = (views.view(k, l) for k in rows for l in cols)
    return joined(_pictures(images, views.cfa, box, step_px), len(cols))


def _pictures(light: Iterator[np.ndarray], cfa: str | None, box: Box, step_px: int) -> list[np.ndarray]:
    """Pictures of images (H, W, C), which may be mosaics, in blocks at the same exposure."""
    even = tuple(slice(part.start - part.start % 2, part.stop) for part in box)  # where the mosaic begins
    return exposed((colours_and_samples(image[even], cfa) for image in light), step_px)


def joined(tiles: Sequence[np.ndarray], columns: int) -> np.ndarray:
    """8-bit pictures (h, w, 3), row by row, as one with gaps of white."""
    framed = np.pad(np.stack(tiles), ((0, 0), (0, GAP_PX), (0, GAP_PX), (0, 0)), constant_values=255)
    _, h, w, _ = framed.shape
    sheet = framed.reshape(-1, columns, h, w, 3).transpose(0, 2, 1, 3, 4)
    return sheet.reshape(-1, columns * w, 3)[:-GAP_PX, :-GAP_PX]


def write_sheet(path: Path, out: Path) -> None:
    """Write the contact sheet of a dataset as PNG or JPEG; nothing is rendered.

    Raises `InputError` for a folder that is no finished dataset, or a picture that cannot be written.
    """
    check_picture_path(out)
    dataset = open_dataset(path)
    counts = dataset.counts if dataset.has(COUNTS) else None
    truth_box, view_box = _parts(dataset)
    height, width = (part.stop - part.start for part in view_box)
    rows, cols = (min(number, MOST_TILES) for number in (dataset.grid.rows, dataset.grid.cols))
    size, places = layout(width / height, width * cols / (height * rows))
    figure = new_figure(*size, None)
    axes = {name: figure.add_axes(tuple(place / np.array([*size, *size]))) for name, place in places.items()}
    for panel in axes.values():
        panel.set_anchor("N")  # the titles of a row are at one height
    _draw_counts(axes["photons"], counts, view_box)
    _draw_truth(axes["depth"], axes["objects"], dataset, truth_box)
    _draw_radiance(axes["full light"], dataset, view_box)
    _draw_histogram(axes["histogram"], counts)
    title = str(dataset.manifest.get("title") or dataset.name)
    figure.suptitle("\n".join((title, *facts(dataset, counts))), y=1, va="top", fontsize=12, parse_math=False)
    save_figure(figure, out)


def layout(film: float, views: float) -> tuple[tuple[float, float], dict[str, np.ndarray]]:
    """Width and height of the sheet, and left, bottom, width and height (4,) of each panel, all in inches.

    `film` is the width of the part of a film that is shown over its height, `views` the same of the photons
    of all views together, which are beside the other panels, or above them if they are far wider than high.
    """
    seen = min(WIDEST_IN, HIGHEST_IN * film)
    width, named = max(seen, LEAST_IN), max(seen * named_width(film), LEAST_IN)
    height = max(min(HIGHEST_IN, WIDEST_IN / film), LEAST_IN)
    second = width + LABELS_IN + GAP_IN
    across = second + max(named, HISTOGRAM_IN)
    down = 2 * (TITLE_IN + height) + LABELS_IN
    if views > WIDE:
        first, photons = 0.0, np.array([0, down, across, across / views])
        size = across, down + across / views + TITLE_IN + HEAD_IN
    else:
        high = min(down - TITLE_IN, PHOTONS_IN[0] / views)
        column = max(high * views, PHOTONS_IN[1])
        first, photons = column + GAP_IN, np.array([0, down - TITLE_IN - high, column, high])
        size = first + across, down + HEAD_IN
    upper, second = down - TITLE_IN - height, first + second
    return size, {
        "photons": photons,
        "depth": np.array([first, upper, width, height]),
        "objects": np.array([second, upper, named, height]),
        "full light": np.array([first, LABELS_IN, width, height]),
        "histogram": np.array([second + LABELS_IN, LABELS_IN, HISTOGRAM_IN - LABELS_IN, height]),
    }


def _parts(dataset: Dataset) -> tuple[Box, Box]:
    """Where the objects are in the virtual centre's picture, and in that of any view."""
    grid, truth = dataset.grid, dataset.truth
    if truth is None:
        return (slice(0, grid.height), slice(0, grid.width)), (slice(0, grid.height), slice(0, grid.width))
    mask = truth.object_id > 0
    near = float(truth.z_mm[mask].min()) if mask.any() else np.inf
    away = max(np.abs(shift).max() for shift in shifts_px(grid, near)) if mask.any() else 0
    return part_of_interest(mask), part_of_interest(mask, away)


def _draw_truth(depth: "Axes", objects: "Axes", dataset: Dataset, box: Box) -> None:
    truth = dataset.truth
    if truth is None:
        _left_out(depth, "truth")
        _left_out(objects, "truth")
        return
    draw_truth(depth, objects, truth.z_mm[box], truth.object_id[box], truth.names)


def _draw_counts(axes: "Axes", counts: PhotonCounts | None, box: Box) -> None:
    if counts is None:
        _left_out(axes, "photon counts")
        return
    grid, side_px = counts.grid, photon_block_px(counts, box)
    K, L = map(len, chosen_cameras(grid, MOST_TILES))
    some = "" if (grid.rows, grid.cols) == (K, L) else f"{K} x {L} of "
    blocks = f"in blocks of {side_px} x {side_px} pixels" if side_px > 1 else "pixel by pixel"
    axes.set_title(f"photons of {some}{grid.rows} x {grid.cols} views, {blocks}")
    hide_frame(axes)
    axes.imshow(photon_tiles(counts, box, side_px), interpolation="nearest")


def _draw_radiance(axes: "Axes", dataset: Dataset, box: Box) -> None:
    views = dataset.views
    if views is None:
        _left_out(axes, "full-light images")
        return
    K, L = map(len, chosen_cameras(views.grid, RADIANCE_VIEWS))
    axes.set_title(f"full light, {K} x {L} of the views")
    hide_frame(axes)
    axes.imshow(radiance_tiles(views, RADIANCE_VIEWS, RADIANCE_PX, box))


def _draw_histogram(axes: "Axes", counts: PhotonCounts | None) -> None:
    if counts is None:
        _left_out(axes, "photon counts")
        return
    n = counts.events.n
    pixels = int(np.prod(counts.grid.shape_KLHW))
    most = int(n.max()) if n.size else 0
    width = max(1, -(-(most + 1) // MOST_BARS))
    bars = np.bincount(n // width, minlength=1).astype(float)
    bars[0] += pixels - n.size
    axes.bar(np.arange(bars.size) * width, bars, width=0.85 * width, align="edge" if width > 1 else "center")
    axes.set_yscale("log")
    axes.set_ylim(0.5, 3 * pixels)
    axes.set_title("counts per pixel, all views")
    axes.set_xlabel("photons in a pixel" + ("" if width == 1 else f", in steps of {width}"))
    axes.set_ylabel("pixels")
    if width == 1:
        axes.set_xticks(np.arange(0, bars.size, max(1, bars.size // 10)))
    axes.spines[["top", "right"]].set_visible(False)


def facts(dataset: Dataset, counts: PhotonCounts | None) -> list[str]:
    """What the sheet says in words: a line on the cameras, and one on the light."""
    grid, recipe = dataset.grid, dataset.manifest.get("recipe") or {}
    cameras = [
        f"{grid.rows} x {grid.cols} views of {grid.height} x {grid.width} pixels",
        f"pixel {1000 * grid.pixel_mm:.4g} um",
        dataset.cfa or "monochrome",
        f"pitch {grid.pitch_mm[0]:g} x {grid.pitch_mm[1]:g} mm",
        f"focal length {grid.focal_mm:g} mm",
    ]
    lines = [", ".join(cameras)]
    if counts is not None:
        photons, pixels = recipe.get("photons") or {}, int(np.prod(grid.shape_KLHW))
        light = [f"{counts.total:,} photons counted, {counts.total / grid.view_count:,.4g} per view"]
        if "budget" in photons and photons.get("scope") != "exposure":
            light.insert(0, f"budget {photons['budget']:g} per {photons.get('scope')}")
        light.append(f"in {counts.events.n.size / pixels:.2g} of the pixels")
        lines.append(", ".join(light))
    return lines


def _left_out(axes: "Axes", product: str) -> None:
    hide_frame(axes)
    write_in_middle(axes, f"this dataset has no {product}")
