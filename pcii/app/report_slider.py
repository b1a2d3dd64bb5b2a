"""Sections through the whole depth range, for the slider of a report.

Lights (photon counts, full light) have a picture at every plane of the slider. Points (those that a method
claims, those in focus in truth) have masks at the planes of the analysis, which are among them.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from pcii.app.pipeline import Outcome
from pcii.app.report_pictures import Estimate, Pictures, block_estimate, smoothing_words
from pcii.base.compiled_loops import each_in_threads
from pcii.base.progress import Report
from pcii.figures.exposure import encoded
from pcii.figures.pictures import agreement_image, drawing_uri, mask_image, photo_uri
from pcii.imaging.blocks import evenly_chosen
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
colours. Each such group reads all full-light views."""


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
    """Content of the slider: depths, pictures by light, masks by points.

    Photons are shown smoothed, and as they are too.
    """
    dataset, crop = pictures.outcome.dataset, pictures.crop
    planes, own = slider_planes(pictures.outcome)
    lights: list[dict[str, Any]] = []
    if dataset.has_counts:
        estimates: dict[float, list[Estimate]] = {pictures.smoothing_px: [], 0.0: []}
        for sections, plane in _each_section(dataset.counts, planes):
            for width_px, images in estimates.items():
                images.append(block_estimate(sections, plane, crop, width_px))
            report("pictures of photon counts", len(estimates[0.0]), len(planes))
        for width_px, images in estimates.items():
            words = smoothing_words(width_px) or " as they are" * (len(estimates) > 1)
            lights.append(_light(f"photon counts{words}", images))
    if dataset.views is not None:
        images = []
        for sections, plane in _each_section(dataset.views, planes):
            images.append(block_estimate(sections, plane, crop))
            report("pictures of full light", len(images), len(planes))
        lights.append(_light("full light", images))
    z_mm = [f"{z:g}" for z in planes.z_mm]
    return {"z_mm": z_mm, "own": sorted(own), "lights": lights, "points": _points(pictures, own)}


def _light(label: str, estimates: list[Estimate]) -> dict[str, Any]:
    return {"label": label, "images": each_in_threads(photo_uri, encoded(estimates))}


def _each_section(source: PhotonCounts | Views, planes: FocalPlanes) -> Iterator[tuple[Sections, int]]:
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
        claims = {here: crop.middles(focus.in_focus[there]) for here, there in own.items()}
        compared = {here: drawing_uri(agreement_image(claims[here], mask)) for here, mask in true.items()}
        points.append({"label": f"kept by {focus.method}", "masks": _mask_uris(claims), "compared": compared})
    if true:
        points.append({"label": "in focus in truth", "masks": _mask_uris(true), "compared": {}})
    return points


def _mask_uris(masks: dict[int, np.ndarray]) -> dict[int, str]:
    return {plane: drawing_uri(mask_image(mask)) for plane, mask in masks.items()}
