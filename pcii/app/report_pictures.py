"""Pictures of a report: a view, sections through the depths, masks and truth of each plane, depth and error.

All show the same part of the frame, in blocks of `step_px` x `step_px` pixels if it is large: around the true
objects or, without any, around what the methods claim.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from pcii.app.pipeline import Outcome
from pcii.base import box_around, each_in_threads
from pcii.figures import (
    DEPTH_COLOURS,
    ERROR_COLOURS,
    SHARE_COLOURS,
    agreement_image,
    block_px,
    colour_bar_uri,
    drawing_uri,
    exposed,
    map_image,
    mask_image,
    photo_uri,
    photon_picture,
    smoothing_for,
)
from pcii.metrics import TrueFocus
from pcii.sections import reconstruct
from pcii.types import FocalPlanes, Sections, colours_and_samples, total_disparity_px

COARSE_PX = 320
"""Smaller pictures are enlarged with sharp pixels."""
LONGEST_PX = 640
"""Longer sides of pictures are shown in blocks of 2 x 2 pixels, or of more."""
MAX_SLIDER_PLANES = 20
"""Pictures of the slider: a report of 1024 x 1024 pixels is then below 8 MB."""
MIN_SLIDER_STEP_PX = 1.0
"""Sections whose total disparities differ by less look the same."""
SECTIONS_AT_ONCE = 4
"""Sections of the slider in memory at once; each such group reads all views."""
UNSATURATED_SHARE = 0.95
"""Share of the errors of depth that lie within the scale of their colours."""

Panel = dict[str, str]
"""An `image` as a data URI and its `caption`; of maps also the colour `bar`."""


@dataclass(frozen=True, eq=False)
class Pictures:
    """The results that a report shows, rows and columns of the frame, the side of its blocks, and smoothing.

    `smoothing_px` is the standard deviation in pixels of the Gaussian, 0 for none.
    """

    outcome: Outcome
    box: tuple[slice, slice]
    step_px: int
    smoothing_px: float

    @classmethod
    def of(cls, outcome: Outcome) -> "Pictures":
        """The part around objects or claims, else all; a Gaussian by the number of photons."""
        truth, smoothing_px = outcome.dataset.truth, 0.0
        region = np.zeros(outcome.dataset.grid.shape_HW, dtype=bool)
        if truth is not None and truth.has_objects:
            region = truth.object_id > 0
        elif outcome.focus:
            region = np.any([focus.in_focus.any(axis=0) for focus in outcome.focus], axis=0)
        box = box_around(region)
        if outcome.dataset.has_counts:
            smoothing_px = smoothing_for([counts[box] for counts in outcome.sections.counts])
        return cls(outcome, box, block_px([side.stop - side.start for side in box], LONGEST_PX), smoothing_px)

    @property
    def light(self) -> str:
        """What sections show, in words."""
        if not self.outcome.dataset.has_counts:
            return "full light (Eq. 2)"
        smoothing = f", smoothed by {self.smoothing_px:g} px" if self.smoothing_px else ""
        return f"photon counts (Eq. 3){smoothing}"

    def middles(self, image: np.ndarray) -> np.ndarray:
        """The pixel in the middle of each block of an image (H, W, ...): ids and depths have no mean."""
        image = image[self.box]
        starts = (np.arange(0, size, self.step_px) for size in image.shape[:2])
        middles = (
            np.minimum(start + self.step_px // 2, image.shape[axis] - 1) for axis, start in enumerate(starts)
        )
        return image[np.ix_(*middles)]

    def of_sections(self, stacks: Iterable[Sections], smoothing_px: float) -> list[np.ndarray]:
        """8-bit pictures of all sections of some stacks, at the same exposure.

        At some depths no view has a sample of a colour at every second voxel, as in a Bayer mosaic: these
        have the mean of the blocks around.
        """
        images = (
            (counts[self.box], coverage[self.box])
            for stack in stacks
            for counts, coverage in zip(stack.counts, stack.coverage, strict=True)
        )
        return exposed(images, self.step_px, smoothing_px)


def report_panels(outcome: Outcome) -> dict[str, Any]:
    """What the page has of pictures: panels, rows and columns of the frame, light and smoothing."""
    pictures = Pictures.of(outcome)
    rows, cols = pictures.box
    slider, first = _slider_panels(pictures)
    return {
        "rows": rows,
        "cols": cols,
        "is_coarse": max(rows.stop - rows.start, cols.stop - cols.start) < COARSE_PX,
        "smoothing_px": pictures.smoothing_px,
        "light": pictures.light,
        "slider": slider,
        "first": first,
        "input": _input_panels(pictures),
        "planes": _plane_panels(pictures),
        "depth": _depth_panels(pictures),
    }


def _slider_panels(pictures: Pictures) -> tuple[list[Panel], int]:
    """Sections through the depth range, all at one exposure, and which is at the first plane of the analysis.

    They are evenly spaced in total disparity, and their captions are depths.
    """
    outcome, grid = pictures.outcome, pictures.outcome.dataset.grid
    z_mm, (near, far) = outcome.sections.z_mm, outcome.z_range_mm
    near, far = min(near, z_mm.min()), max(far, z_mm.max())
    span_px = float(total_disparity_px(grid, near) - total_disparity_px(grid, far))
    planes = FocalPlanes.at_depths(grid, z_mm[:1])  # one camera has one section for all depths
    if span_px > 0:
        step_px = max(span_px / (MAX_SLIDER_PLANES - 1), MIN_SLIDER_STEP_PX)
        planes = FocalPlanes.between(grid, near, far, step_px).take(slice(None, None, -1))
    stacks = (
        reconstruct(outcome.dataset.counts_or_views, planes.take(slice(first, first + SECTIONS_AT_ONCE)))
        for first in range(0, len(planes), SECTIONS_AT_ONCE)
    )
    images = each_in_threads(photo_uri, pictures.of_sections(stacks, pictures.smoothing_px))
    captions = (f"{z:.4g} mm" for z in planes.z_mm)
    panels = [*map(_panel, images, captions)]
    off_px = planes.total_disparity_px - outcome.sections.planes.total_disparity_px[0]
    return panels, int(np.abs(off_px).argmin())


def _input_panels(pictures: Pictures) -> list[Panel]:
    """The view in the middle: its photons, and at full light."""
    dataset, step_px = pictures.outcome.dataset, pictures.step_px
    k, l = dataset.grid.middle_camera
    panels: list[Panel] = []
    if dataset.has_counts:
        view = dataset.counts.view(k, l)
        image = photon_picture(view[pictures.box], step_px)
        panels.append(_panel(drawing_uri(image), f"view ({k}, {l}): {view.sum()} photons"))
    if dataset.views is not None:
        sums, samples = colours_and_samples(dataset.views.view(k, l), dataset.views.cfa)
        light = sums[pictures.box], samples[pictures.box]
        panels.append(_panel(photo_uri(exposed([light], step_px)[0]), f"view ({k}, {l}) at full light"))
    return panels


def _plane_panels(pictures: Pictures) -> list[tuple[str, list[Panel], list[Panel]]]:
    """For each plane its depth, sections with their truth, and each method's removal with its comparison."""
    outcome, middles, truth = pictures.outcome, pictures.middles, pictures.outcome.dataset.truth
    true, what = None, "objects"
    if truth is not None:
        true = TrueFocus(outcome.sections.planes, truth).masks(truth.mask_kind)  # (Z, H, W)
        what = "objects" if truth.are_objects_known else "what is in focus"
    images = pictures.of_sections([outcome.sections], pictures.smoothing_px)
    lights = {pictures.light: images}
    if outcome.dataset.has_counts and outcome.full_light is not None:
        lights["full light (Eq. 2)"] = pictures.of_sections([outcome.full_light], 0.0)
    planes: list[tuple[str, list[Panel], list[Panel]]] = []
    for plane, z in enumerate(outcome.sections.z_mm):
        at = f"{z:g} mm"
        sections = [_panel(photo_uri(light[plane]), f"section at {at}, {of}") for of, light in lights.items()]
        if true is not None:
            image = mask_image(middles(true[plane]))
            sections.append(_panel(drawing_uri(image), f"truth: {what} at {at}"))
        masks: list[Panel] = []
        for focus in outcome.focus:
            claim = middles(focus.in_focus[plane])
            masks.append(_panel(photo_uri(images[plane] * claim[..., None]), f"{focus.method}, {at}"))
            if true is not None:
                image = agreement_image(claim, middles(true[plane]))
                masks.append(_panel(drawing_uri(image), f"{focus.method}, {at}, compared with the truth"))
        planes.append((at, sections, masks))
    return planes


def _depth_panels(pictures: Pictures) -> list[Panel]:
    """The depth map, the truth and the error if there is a truth, and the confidence."""
    truth, depth = pictures.outcome.dataset.truth, pictures.outcome.depth
    z_mm, confidence = pictures.middles(depth.z_mm), pictures.middles(depth.confidence)
    scale = DEPTH_COLOURS, pictures.outcome.z_range_mm, "mm"
    panels = [_map("estimated depth, paler where less sure", z_mm, *scale, confidence)]
    if truth is not None:
        true_mm = pictures.middles(truth.object_z_mm)
        caption = "true depth of the objects" if truth.has_objects else "true depth"
        panels.append(_map(caption, true_mm, *scale))
        is_known = np.isfinite(z_mm) & np.isfinite(true_mm)
        error = np.subtract(z_mm, true_mm, out=np.full(z_mm.shape, np.nan), where=is_known)
        limit = float(np.quantile(np.abs(error[is_known]), UNSATURATED_SHARE)) if is_known.any() else 1.0
        limit = float(f"{max(limit, 1e-3):.1e}")
        limits, label = (-limit, limit), "mm, too far above 0"
        panels.append(_map("estimated less true depth", error, ERROR_COLOURS, limits, label))
    confidence = np.where(np.isfinite(z_mm), confidence, np.nan)
    label = "probability of an error below 1 px of total disparity"
    return [*panels, _map("confidence", confidence, SHARE_COLOURS, (0.0, 1.0), label)]


def _panel(uri: str, caption: str) -> Panel:
    return {"image": uri, "caption": caption}


def _map(
    caption: str,
    values: np.ndarray,
    colours: str,
    limits: tuple[float, float],
    label: str,
    confidence: np.ndarray | None = None,
) -> Panel:
    image = map_image(values, colours, limits, confidence)
    return _panel(drawing_uri(image), caption) | {"bar": colour_bar_uri(colours, limits, label)}
