"""Sections through the whole depth range, for the slider of a report, and what is read out at a pixel.

Lights (photon counts, full light) have a picture at every plane of the slider. Points (those that a method
keeps, those in focus in truth) have masks at the planes of the analysis, which are among them.
"""

import base64
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from pcii.app.pipeline import Outcome
from pcii.app.report_figures import Crop, Shown, block_estimate, smoothing_words
from pcii.base.progress import Report
from pcii.figures import pictures as picture
from pcii.figures.exposure import encoded
from pcii.imaging.blocks import evenly_chosen
from pcii.sections.dense_sections import views_around
from pcii.sections.reconstruction import reconstruct
from pcii.types.focal_planes import FocalPlanes
from pcii.types.geometry import total_disparity_px
from pcii.types.images import Views
from pcii.types.photon_counts import PhotonCounts
from pcii.types.section_stack import Sections

MOST_PLANES = 20
"""Planes of the slider beside those of the analysis: a report of 1024 x 1024 pixels is then below 8 MB."""
FINEST_STEP_PX = 1.0
"""Sections whose total disparities differ by less look the same."""
MOST_VOXELS = 40_000_000
"""Voxels of the sections in memory at once, 1.2 GB of radiance: 13 planes of 1024 x 1024 pixels in three
colours, of a part of the film more. Each such group reads all full-light views."""
MOST_BLOCKS = 40_000
"""Blocks of pixels that are read out."""


def slider_planes(outcome: Outcome) -> tuple[FocalPlanes, dict[int, int]]:
    """Planes from near to far, and which of them are planes of the analysis: index there, by index here.

    Between the ends of the depth range they are evenly spaced in total disparity, at depths of four digits.
    Those next to a plane of the analysis are left out, and of very many planes of the analysis some.
    """
    grid, own = outcome.dataset.grid, outcome.sections.z_mm
    chosen = evenly_chosen(len(own), MOST_PLANES)
    near, far = min(outcome.z_range_mm[0], own.min()), max(outcome.z_range_mm[1], own.max())
    own_px = total_disparity_px(grid, own[chosen])
    span_px = float(total_disparity_px(grid, near) - total_disparity_px(grid, far))
    depths = {float(own[index]): int(index) for index in chosen}
    if span_px > 0:
        step_px = max(span_px / (MOST_PLANES - 1), FINEST_STEP_PX)
        for z in FocalPlanes.between(grid, near, far, step_px).z_mm:
            rounded = float(f"{z:.4g}")
            if (np.abs(total_disparity_px(grid, rounded) - own_px) > step_px / 2).all():
                depths.setdefault(rounded, -1)
    z_mm = sorted(depths)
    planes = FocalPlanes.at_depths(grid, z_mm)
    return planes, {number: depths[z] for number, z in enumerate(z_mm) if depths[z] >= 0}


def slider(shown: Shown, report: Report) -> dict[str, Any]:
    """Content of the slider: depths, pictures by light, masks by points, maps to read out.

    Photons are shown smoothed, and as they are too.
    """
    from pcii.base.compiled_loops import each_in_threads

    outcome, crop = shown.outcome, shown.crop
    dataset = outcome.dataset
    planes, own = slider_planes(outcome)
    blocks = replace(crop, step_px=int(np.ceil(np.sqrt(crop.height_px * crop.width_px / MOST_BLOCKS))))
    sources: list[tuple[str, PhotonCounts | Views]] = []
    if dataset.has_counts:
        sources.append(("photon counts", dataset.counts))
    if dataset.views is not None:
        sources.append(("full light", dataset.views))
    lights: list[dict[str, Any]] = []
    read: list[np.ndarray] = []
    for number, (label, source) in enumerate(sources):
        ways = dict.fromkeys((shown.smoothing_px, 0.0) if isinstance(source, PhotonCounts) else (0.0,))
        seen: dict[float, list[tuple[np.ndarray, np.ndarray]]] = {way: [] for way in ways}
        part, part_planes, inside = source, planes, crop
        if isinstance(source, Views):
            part, part_planes, sides = views_around(source, planes, crop.rows, crop.cols)
            inside = Crop(*sides, crop.step_px)
        own_blocks = replace(inside, step_px=blocks.step_px)
        for done, (sections, plane) in enumerate(_each(part, part_planes), start=1):
            for way, estimates in seen.items():
                estimates.append(block_estimate(sections, plane, inside, way))
            if number == 0:
                read.append(_read_values(sections, plane, own_blocks))
            report(f"pictures of {label}", done, len(planes))
        for way, estimates in seen.items():
            words = smoothing_words(way) or " as they are" * (len(seen) > 1)
            images = each_in_threads(picture.photo_uri, encoded(estimates))
            lights.append({"label": f"{label}{words}", "images": images})
    maps = _maps(outcome, blocks)
    step_mm = max(each["step"] for each in maps if each["name"] in ("estimate", "truth"))
    return {
        "z_mm": [f"{z:g}" for z in planes.z_mm],
        "own": sorted(own),
        "lights": lights,
        "points": _points(shown, own),
        "crop": blocks,
        "readings": _readings(outcome),
        "resolution": _resolution(outcome, blocks, step_mm),
        "digits": int(np.clip(np.ceil(-np.log10(step_mm)) - 1, 0, 3)),
        "maps": maps,
        "planes": [_coded("counts", values, 0.0 if dataset.has_counts else None) for values in _alike(read)],
        "names": ["none", *_names(outcome).values()],
    }


def _each(source: PhotonCounts | Views, planes: FocalPlanes) -> Iterator[tuple[Sections, int]]:
    at_once = max(1, MOST_VOXELS // (planes.grid.height * planes.grid.width * source.channel_count))
    for first in range(0, len(planes), at_once):
        sections = reconstruct(source, planes.take(slice(first, first + at_once)))
        for plane in range(len(sections.planes)):
            yield sections, plane


def _points(shown: Shown, own: dict[int, int]) -> list[dict[str, Any]]:
    """For each method and the truth: masks at each plane, and their comparison with the truth."""
    crop, points = shown.crop, list[dict[str, Any]]()
    true: dict[int, np.ndarray] = {}
    if shown.true is not None:
        true = {here: crop.middles(shown.true.by_object[there]) for here, there in own.items()}
    for focus in shown.outcome.focus:
        kept = {here: crop.middles(focus.in_focus[there]) for here, there in own.items()}
        compared = {
            here: picture.data_uri(picture.agreement_image(kept[here], mask)) for here, mask in true.items()
        }
        points.append({"label": f"kept by {focus.method}", "kept": _masks(kept), "compared": compared})
    if shown.true is not None and shown.true.by_object.any():
        points.append({"label": "in focus in truth", "kept": _masks(true), "compared": {}})
    return points


def _masks(masks: dict[int, np.ndarray]) -> dict[int, str]:
    return {plane: picture.data_uri(picture.mask_image(mask)) for plane, mask in masks.items()}


def _names(outcome: Outcome) -> dict[int, str]:
    truth = outcome.dataset.truth
    return {} if truth is None else dict(sorted(truth.names.items()))


def _maps(outcome: Outcome, blocks: Crop) -> list[dict[str, Any]]:
    """Depth, truth, confidence and objects of the pixels in the middle of the blocks."""
    truth, depth = outcome.dataset.truth, outcome.depth
    maps = [_coded("estimate", blocks.middles(depth.z_mm))]
    maps.append(_coded("confidence", blocks.middles(depth.confidence)))
    if truth is not None:
        maps.append(_coded("truth", blocks.middles(truth.z_mm)))
        ids = blocks.middles(truth.object_id)
        if ids.any():
            places = np.searchsorted(list(_names(outcome)), ids)
            maps.append(_coded("object", np.where(ids > 0, places + 1, 0), 0.0))
    return maps


def _readings(outcome: Outcome) -> list[tuple[str, str]]:
    """What is read out at a pixel: names that the page's script knows, and labels."""
    truth = outcome.dataset.truth
    readings = [("estimate", "estimated depth")]
    if truth is not None:
        readings += [("truth", "true depth"), ("error", "error")]
    readings.append(("confidence", "confidence"))
    if truth is not None and truth.has_objects:
        readings.append(("object", "object"))
    in_section = ("counts", "photons in the section")
    return [*readings, in_section if outcome.dataset.has_counts else ("light", "light, share of the most")]


def _resolution(outcome: Outcome, blocks: Crop, step_mm: float) -> str:
    """Where values are read out, and how exactly they are kept."""
    size, what = blocks.step_px, "photons" if outcome.dataset.has_counts else "light"
    where = "Point at a picture, or move its cross-hair by the arrow keys (with Shift ten times as far). "
    if size == 1:
        where += "Values are of single pixels, "
    else:
        where += f"Depths are of the middle of {size} × {size} pixels, {what} of all of them, "
    return where + f"and depths are kept to within {step_mm / 2:.1g} mm."


def _read_values(sections: Sections, plane: int, blocks: Crop) -> np.ndarray:
    """Photons in each block of one section, over all colours; of radiance its mean."""
    if sections.counts.dtype.kind == "f":
        return block_estimate(sections, plane, blocks)[0].mean(axis=-1)
    return blocks.sums(sections.counts[plane]).sum(axis=-1)


def _alike(stack: list[np.ndarray]) -> list[np.ndarray]:
    """The planes of a stack of radiance as shares of its brightest block; counts as they are."""
    top = max((float(values.max()) for values in stack), default=0.0)
    if not stack or stack[0].dtype.kind != "f" or top <= 0:
        return stack
    return [np.maximum(values, 0) / top for values in stack]


def _coded(name: str, values: np.ndarray, whole_from: float | None = None) -> dict[str, Any]:
    """A map (h, w) as base64 of whole numbers of one or two bytes, the lower one first.

    The code c > 0 stands for origin + (c - 1) step, 0 for no number. Values are rounded to 65 535 steps
    between the least and the greatest; whole numbers from `whole_from` on are kept as they are up to 65 534.
    """
    known = np.isfinite(values)
    finite = values[known]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)
    if whole_from is not None:
        low, step, high = whole_from, 1.0, min(high, whole_from + 65_534)
    else:
        step = (high - low) / 65_534 or 1e-3
    codes = np.zeros(values.shape, np.int64)
    codes[known] = 1 + np.round((np.minimum(finite, high) - low) / step)
    size = 1 if codes.max(initial=0) < 256 else 2
    return {
        "name": name,
        "origin": low,
        "step": step,
        "bytes": size,
        "values": base64.b64encode(codes.astype(f"<u{size}").tobytes()).decode("ascii"),
    }
