"""A contact sheet of a finished dataset: its truth, its photons and its full-light images on one page."""

from pathlib import Path
from typing import Any

import numpy as np

from pcii.dataset import Dataset, open_dataset
from pcii.photon_counts import PhotonCounts
from pcii.store import COUNTS
from simgen.figures import (
    check_picture_path,
    draw_depth,
    draw_objects,
    hide_frame,
    new_figure,
    save_figure,
)
from simgen.thumbnails import count_tiles, joined, radiance_tiles

MOST_BARS = 40
RADIANCE_VIEWS, RADIANCE_PX = 3, 256
"""Full-light views to a side of the sheet, and pixels to the longer side of each."""


def write_sheet(path: Path, out: Path) -> None:
    """Write the contact sheet of a dataset as PNG or JPEG; nothing is rendered.

    Raises `InputError` for a folder that is no finished dataset, or a picture that cannot be written.
    """
    check_picture_path(out)
    dataset = open_dataset(path)
    counts = dataset.counts if dataset.has(COUNTS) else None
    figure = new_figure(17.0, 10.6)
    axes = figure.subplots(2, 3, width_ratios=(1, 1.15, 1.8))
    _draw_counts(axes[0, 0], counts)
    _draw_truth(figure, axes[0, 1], axes[0, 2], dataset)
    _draw_radiance(axes[1, 0], dataset)
    _draw_histogram(axes[1, 1], counts)
    _write_facts(axes[1, 2], dataset, counts)
    figure.suptitle(str(dataset.manifest.get("title") or dataset.name), fontsize=15)
    save_figure(figure, out)


def _draw_truth(figure: Any, depth: Any, objects: Any, dataset: Dataset) -> None:
    truth = dataset.truth
    if truth is None:
        _left_out(depth, "truth")
        _left_out(objects, "truth")
        return
    draw_depth(figure, depth, truth.z_mm, truth.object_id > 0)
    draw_objects(objects, truth.object_id, truth.names)


def _draw_counts(axes: Any, counts: PhotonCounts | None) -> None:
    if counts is None:
        _left_out(axes, "photon counts")
        return
    tiles = count_tiles(counts)
    K, L, h, w = tiles.shape[:4]
    grid = counts.grid
    some = "" if (grid.rows, grid.cols) == (K, L) else f"{K} x {L} of "
    axes.set_title(
        f"photon counts of {some}{grid.rows} x {grid.cols} views,\n"
        f"in bins of {grid.height / h:.3g} x {grid.width / w:.3g} pixels"
    )
    hide_frame(axes)
    axes.imshow(joined(tiles), interpolation="nearest")


def _draw_radiance(axes: Any, dataset: Dataset) -> None:
    views = dataset.views
    if views is None:
        _left_out(axes, "full-light images")
        return
    tiles = radiance_tiles(views, RADIANCE_VIEWS, RADIANCE_PX)
    axes.set_title(f"full light, {tiles.shape[0]} x {tiles.shape[1]} of the views")
    hide_frame(axes)
    axes.imshow(joined(tiles))


def _draw_histogram(axes: Any, counts: PhotonCounts | None) -> None:
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
    axes.set_box_aspect(0.8)
    axes.set_title("counts per pixel, all views")
    axes.set_xlabel("photons in a pixel" + ("" if width == 1 else f", in steps of {width}"))
    axes.set_ylabel("pixels")
    if width == 1:
        axes.set_xticks(np.arange(0, bars.size, max(1, bars.size // 10)))
    axes.spines[["top", "right"]].set_visible(False)


def _write_facts(axes: Any, dataset: Dataset, counts: PhotonCounts | None) -> None:
    hide_frame(axes)
    rows = facts(dataset, counts)
    width = max(len(name) for name in rows)
    text = "\n".join(f"{name:<{width}}  {value}" for name, value in rows.items())
    axes.text(
        0.02, 0.95, text, family="monospace", fontsize=11, va="top", transform=axes.transAxes, linespacing=1.6
    )


def facts(dataset: Dataset, counts: PhotonCounts | None) -> dict[str, str]:
    """What the sheet says in words: the grid, the sensor, the light and where the data come from."""
    grid, recipe = dataset.grid, dataset.manifest.get("recipe") or {}
    photons = recipe.get("photons") or {}
    rows = {
        "dataset": dataset.name,
        "scene": str(recipe.get("scene", "unknown")),
        "views": f"{grid.rows} x {grid.cols}",
        "pixels": f"{grid.height} x {grid.width} of {1000 * grid.pixel_mm:.4g} um",
        "sensor": dataset.cfa or "monochrome",
        "pitch": f"{grid.pitch_mm[0]:g} x {grid.pitch_mm[1]:g} mm",
        "focal length": f"{grid.focal_mm:g} mm",
    }
    if counts is not None:
        if photons.get("scope") == "exposure":
            rows["light"] = "as much as the exposure gives"
        elif "budget" in photons:
            rows["light"] = (
                f"{photons['budget']:g} photons per {photons.get('scope')}, {photons.get('statistics')}"
            )
        pixels = int(np.prod(grid.shape_KLHW))
        rows["photons"] = f"{counts.total:,} counted, {counts.total / grid.view_count:,.4g} per view"
        rows["pixels lit"] = (
            f"{counts.events.n.size / pixels:.2%}, at most {max(counts.events.n, default=0)} in one"
        )
    if dataset.truth is not None:
        seen = dataset.truth.z_mm[dataset.truth.object_id > 0]
        if seen.size:
            rows["depth"] = f"{seen.min():.0f} to {seen.max():.0f} mm"
    backend = dataset.manifest.get("backend") or {}
    if "seed" in recipe:
        rows["seed"] = str(recipe["seed"])
    if "variant" in backend:
        rows["made with"] = f"{backend['variant']}, Mitsuba {backend.get('mitsuba')}"
    return rows


def _left_out(axes: Any, product: str) -> None:
    hide_frame(axes)
    axes.text(0.5, 0.5, f"this dataset has no {product}", ha="center", transform=axes.transAxes)
