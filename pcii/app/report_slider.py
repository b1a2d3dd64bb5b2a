"""Sections through the whole depth range, for the slider of a report, and what is read out at a pixel.

Lights (photon counts, full light) have a picture at every plane of the slider. Points (those that a method
claims, those in focus in truth) have masks at the planes of the analysis, which are among them.
"""

import base64
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from pcii.app.pipeline import Outcome
from pcii.app.report_pictures import Crop, Pictures, block_estimate, smoothing_words
from pcii.base.compiled_loops import each_in_threads
from pcii.base.progress import Report
from pcii.figures.exposure import encoded
from pcii.figures.pictures import agreement_image, drawing_uri, mask_image, photo_uri
from pcii.imaging.blocks import evenly_chosen
from pcii.sections.dense_sections import views_around
from pcii.sections.reconstruction import reconstruct
from pcii.types.focal_planes import FocalPlanes
from pcii.types.geometry import total_disparity_px
from pcii.types.images import Views
from pcii.types.photon_counts import PhotonCounts
from pcii.types.section_stack import Sections

MAX_PLANES = 20
"""Planes of the slider beside those of the analysis: a report of 1024 x 1024 pixels is then below 8 MB."""
MIN_STEP_PX = 1.0
"""Sections whose total disparities differ by less look the same."""
MAX_VOXELS = 40_000_000
"""Voxels of the sections in memory at once, 1.2 GB of radiance: 13 planes of 1024 x 1024 pixels in three
colours, of a part of the film more. Each such group reads all full-light views."""
MAX_BLOCKS = 40_000
"""Blocks of pixels that are read out."""
MAX_CODE = 65_535
"""The largest number of two bytes."""


def slider_planes(outcome: Outcome) -> tuple[FocalPlanes, dict[int, int]]:
    """Planes from near to far, and which of them are planes of the analysis: index there, by index here.

    Between the ends of the depth range they are evenly spaced in total disparity, at depths of four digits.
    Those next to a plane of the analysis are left out, and of very many planes of the analysis some.
    """
    grid, own = outcome.dataset.grid, outcome.sections.z_mm
    chosen = evenly_chosen(len(own), MAX_PLANES)
    near, far = min(outcome.z_range_mm[0], own.min()), max(outcome.z_range_mm[1], own.max())
    own_px = total_disparity_px(grid, own[chosen])
    span_px = float(total_disparity_px(grid, near) - total_disparity_px(grid, far))
    depths = {float(own[index]): int(index) for index in chosen}
    if span_px > 0:
        step_px = max(span_px / (MAX_PLANES - 1), MIN_STEP_PX)
        for z in FocalPlanes.between(grid, near, far, step_px).z_mm:
            rounded = float(f"{z:.4g}")
            if (np.abs(total_disparity_px(grid, rounded) - own_px) > step_px / 2).all():
                depths.setdefault(rounded, -1)
    z_mm = sorted(depths)
    planes = FocalPlanes.at_depths(grid, z_mm)
    return planes, {number: depths[z] for number, z in enumerate(z_mm) if depths[z] >= 0}


def slider(pictures: Pictures, report: Report) -> dict[str, Any]:
    """Content of the slider: depths, pictures by light, masks by points, maps to read out.

    Photons are shown smoothed, and as they are too.
    """
    outcome, crop = pictures.outcome, pictures.crop
    dataset = outcome.dataset
    planes, own = slider_planes(outcome)
    blocks = replace(crop, step_px=int(np.ceil(np.sqrt(crop.height_px * crop.width_px / MAX_BLOCKS))))
    lights: list[dict[str, Any]] = []
    maps = _maps(outcome, blocks)
    if dataset.has_counts:
        estimates: dict[float, list[tuple[np.ndarray, np.ndarray]]] = {pictures.smoothing_px: [], 0.0: []}
        for number, (sections, plane) in enumerate(_each(dataset.counts, planes)):
            for width, images in estimates.items():
                images.append(block_estimate(sections, plane, crop, width))
            photons = blocks.sums(sections.counts[plane]).sum(axis=-1)
            maps.append(_coded(f"plane{number}", np.minimum(photons, MAX_CODE - 1), is_whole=True))
            report("pictures of photon counts", number + 1, len(planes))
        for width, images in estimates.items():
            words = smoothing_words(width) or " as they are" * (len(estimates) > 1)
            lights.append(_light(f"photon counts{words}", images))
    if dataset.views is not None:
        part, part_planes, sides = views_around(dataset.views, planes, crop.rows, crop.cols)
        images = []
        for sections, plane in _each(part, part_planes):
            images.append(block_estimate(sections, plane, Crop(*sides, crop.step_px)))
            report("pictures of full light", len(images), len(planes))
        lights.append(_light("full light", images))
    step_mm = max(each["step"] for each in maps if each["name"] in ("estimate", "truth"))
    return {
        "z_mm": [f"{z:g}" for z in planes.z_mm],
        "own": sorted(own),
        "lights": lights,
        "points": _points(pictures, own),
        "crop": blocks,
        "readings": _readings(outcome),
        "digits": int(np.clip(np.ceil(-np.log10(step_mm)) - 1, 0, 3)),
        "maps": maps,
        "names": ["none", *_names(outcome).values()],
    }


def _light(label: str, estimates: list[tuple[np.ndarray, np.ndarray]]) -> dict[str, Any]:
    return {"label": label, "images": each_in_threads(photo_uri, encoded(estimates))}


def _each(source: PhotonCounts | Views, planes: FocalPlanes) -> Iterator[tuple[Sections, int]]:
    at_once = max(1, MAX_VOXELS // (planes.grid.height * planes.grid.width * source.channel_count))
    for first in range(0, len(planes), at_once):
        sections = reconstruct(source, planes.take(slice(first, first + at_once)))
        for plane in range(len(sections.planes)):
            yield sections, plane


def _points(pictures: Pictures, own: dict[int, int]) -> list[dict[str, Any]]:
    """For each method and the truth: masks at each plane, and their comparison with the truth."""
    crop, points = pictures.crop, list[dict[str, Any]]()
    true: dict[int, np.ndarray] = {}
    if pictures.true_masks is not None:
        true = {here: crop.middles(pictures.true_masks[there]) for here, there in own.items()}
    for focus in pictures.outcome.focus:
        claimed = {here: crop.middles(focus.in_focus[there]) for here, there in own.items()}
        compared = {here: drawing_uri(agreement_image(claimed[here], mask)) for here, mask in true.items()}
        points.append({"label": f"kept by {focus.method}", "masks": _drawn(claimed), "compared": compared})
    if true:
        points.append({"label": "in focus in truth", "masks": _drawn(true), "compared": {}})
    return points


def _drawn(masks: dict[int, np.ndarray]) -> dict[int, str]:
    return {plane: drawing_uri(mask_image(mask)) for plane, mask in masks.items()}


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
        places = np.where(ids > 0, np.searchsorted(list(_names(outcome)), ids) + 1, 0)
        maps.append(_coded("object", places, is_whole=True))
    return maps


def _readings(outcome: Outcome) -> list[tuple[str, str]]:
    """What is read out at a pixel: names that the page's script knows, and labels."""
    readings = [("estimate", "estimated depth"), ("confidence", "confidence")]
    if outcome.dataset.truth is not None:
        readings += [("truth", "true depth"), ("error", "error"), ("object", "object")]
    if outcome.dataset.has_counts:
        readings.append(("counts", "photons in the section"))
    return readings


def _coded(name: str, values: np.ndarray, *, is_whole: bool = False) -> dict[str, Any]:
    """A map (h, w) as base64 of whole numbers of two bytes, the lower one first.

    The code c > 0 stands for origin + (c - 1) step, 0 for no number. Whole numbers from 0 on are their own
    codes less 1; others are rounded to steps between the least and the greatest.
    """
    known = np.isfinite(values)
    finite = values[known]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)
    step = (high - low) / (MAX_CODE - 1) or 1e-3
    if is_whole:
        low, step = 0.0, 1.0
    codes = np.zeros(values.shape, "<u2")
    codes[known] = 1 + np.round((finite - low) / step)
    content = base64.b64encode(codes.tobytes()).decode("ascii")
    return {"name": name, "origin": low, "step": step, "values": content}
