"""Pictures of a report: a view, and for each plane its section, masks and truth; depth, error, confidence.

All show the same part of the frame, the `Crop`, so that a place in one is the same place in all others.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pcii.app.pipeline import Outcome
from pcii.figures.exposure import (
    block_px,
    encoded,
    exposed,
    filled_means,
    image_block_sums,
    photon_picture,
    smoothed,
    smoothing_for,
)
from pcii.figures.panels import colour_bar_uri
from pcii.figures.pictures import (
    DEPTH_COLOURS,
    ERROR_COLOURS,
    SHARE_COLOURS,
    agreement_image,
    drawing_uri,
    map_image,
    mask_image,
    photo_uri,
)
from pcii.imaging.bright_regions import box_around
from pcii.metrics.true_masks import TrueFocus
from pcii.types.bayer import colours_and_samples
from pcii.types.section_stack import Sections

LONGEST_PX = 640
"""Longer sides of pictures are shown at one of 2 x 2 pixels, or of more."""
UNSATURATED_SHARE = 0.95
"""Share of the errors of depth that lie within the scale of their colours."""

Panel = dict[str, str]
"""An `image` as a data URI and its `caption`; of maps also the colour `bar`."""
Estimate = tuple[np.ndarray, np.ndarray]
"""Means of the blocks of a section and their numbers of samples, (h, w, C) each."""


@dataclass(frozen=True)
class Crop:
    """Part of the frame that a report shows: `rows` and `cols`, at one of `step_px` x `step_px` pixels."""

    rows: slice
    cols: slice
    step_px: int = 1

    @property
    def height_px(self) -> int:
        """Height of the part in pixels of the frame."""
        return self.rows.stop - self.rows.start

    @property
    def width_px(self) -> int:
        """Width of the part in pixels of the frame."""
        return self.cols.stop - self.cols.start

    def middles(self, image: np.ndarray) -> np.ndarray:
        """The pixel in the middle of each block of an image (H, W, ...): ids and depths have no mean."""
        part, step = image[self.rows, self.cols], self.step_px
        rows, cols = (
            np.minimum(np.arange(0, size, step) + step // 2, size - 1)
            for size in (self.height_px, self.width_px)
        )
        return part[rows][:, cols]

    def sums(self, image: np.ndarray) -> np.ndarray:
        """Sums over the blocks of an image (H, W, C)."""
        return image_block_sums(image[self.rows, self.cols], self.step_px)


@dataclass(frozen=True, eq=False)
class Pictures:
    """What a report shows: results, a part of the frame, and how photons are smoothed.

    `smoothing_px` is the standard deviation in pixels of the Gaussian with which photons of sections are
    shown, 0 for none.
    """

    outcome: Outcome
    crop: Crop
    smoothing_px: float

    @classmethod
    def of(cls, outcome: Outcome) -> "Pictures":
        """The true objects with a margin, or without any what the methods claim, else the whole frame."""
        truth, smoothing_px = outcome.dataset.truth, 0.0
        if truth is not None and truth.has_objects:
            region = truth.object_id > 0
        else:
            region = np.zeros(outcome.dataset.grid.shape_HW, dtype=bool)
            region |= np.any([focus.in_focus.any(axis=0) for focus in outcome.focus], axis=0)
        box = box_around(region)
        if outcome.dataset.has_counts:
            smoothing_px = smoothing_for([counts[box] for counts in outcome.sections.counts])
        step_px = block_px([side.stop - side.start for side in box], LONGEST_PX)
        return cls(outcome, Crop(*box, step_px), smoothing_px)

    @cached_property
    def true_masks(self) -> np.ndarray | None:
        """The objects that belong to each plane of the analysis, (Z, H, W) bool."""
        truth = self.outcome.dataset.truth
        return None if truth is None else TrueFocus(self.outcome.sections.planes, truth).by_object


def smoothing_words(smoothing_px: float) -> str:
    """What a caption says of the smoothing of the photons that it is of."""
    return f", smoothed by {smoothing_px:g} px" if smoothing_px else ""


def block_estimate(sections: Sections, plane: int, crop: Crop, smoothing_px: float = 0.0) -> Estimate:
    """Estimate of the blocks of one section: the sums of its counts over its samples.

    Both are smoothed by a Gaussian with a standard deviation of `smoothing_px` pixels of the frame. At some
    depths no view has a sample of a colour at every second voxel, as in a Bayer mosaic. There the estimate is
    that of the blocks around.
    """
    sums, samples = crop.sums(sections.counts[plane]), crop.sums(sections.coverage[plane])
    if smoothing_px:
        sums, samples = smoothed(sums, samples, smoothing_px / crop.step_px)
    return filled_means(sums, samples), samples


def _section_images(sections: Sections, crop: Crop, smoothing_px: float = 0.0) -> list[np.ndarray]:
    """Pictures of sections, all at the same exposure."""
    planes = range(len(sections.z_mm))
    return encoded([block_estimate(sections, plane, crop, smoothing_px) for plane in planes])


def input_panels(pictures: Pictures) -> list[Panel]:
    """The view in the middle: its photons, and at full light."""
    dataset, crop = pictures.outcome.dataset, pictures.crop
    k, l = dataset.grid.middle_camera
    panels: list[Panel] = []
    if dataset.has_counts:
        view = dataset.counts.view(k, l)
        image = photon_picture(view[crop.rows, crop.cols], crop.step_px)
        panels.append(_drawing(image, f"view ({k}, {l}): {view.sum()} photons"))
    if dataset.views is not None:
        light = colours_and_samples(dataset.views.view(k, l), dataset.views.cfa)
        (image,) = exposed([(light[0][crop.rows, crop.cols], light[1][crop.rows, crop.cols])], crop.step_px)
        panels.append(_photo(image, f"view ({k}, {l}) at full light"))
    return panels


def plane_panels(pictures: Pictures) -> list[tuple[str, list[Panel], list[Panel]]]:
    """For each plane its depth, sections with their truth, and each method's removal with its comparison."""
    outcome, crop, true = pictures.outcome, pictures.crop, pictures.true_masks
    words = smoothing_words(pictures.smoothing_px)
    lights: dict[str, list[np.ndarray]] = {}
    if outcome.dataset.has_counts:
        photons = _section_images(outcome.sections, crop, pictures.smoothing_px)
        lights[f"photon counts (Eq. 3){words}"] = photons
    if outcome.full_light is not None:
        lights["full light (Eq. 2)"] = _section_images(outcome.full_light, crop)
    planes: list[tuple[str, list[Panel], list[Panel]]] = []
    for plane, z in enumerate(outcome.sections.z_mm):
        sections = [
            _photo(images[plane], f"section at {z:g} mm, {light}") for light, images in lights.items()
        ]
        if true is not None:
            sections.append(_drawing(mask_image(crop.middles(true[plane])), f"truth: objects at {z:g} mm"))
        masks: list[Panel] = []
        first, *_ = lights.values()
        for focus in outcome.focus:
            claim = crop.middles(focus.in_focus[plane])
            masks.append(_photo(first[plane] * claim[..., None], f"{focus.method}, {z:g} mm{words}"))
            if true is not None:
                image = agreement_image(claim, crop.middles(true[plane]))
                masks.append(_drawing(image, f"{focus.method}, {z:g} mm, compared with the truth"))
        planes.append((f"{z:g} mm", sections, masks))
    return planes


def depth_panels(pictures: Pictures) -> list[Panel]:
    """The depth map, and beside it the truth and the error if there is a truth; the confidence."""
    truth, depth, crop = pictures.outcome.dataset.truth, pictures.outcome.depth, pictures.crop
    z_mm, confidence = crop.middles(depth.z_mm), crop.middles(depth.confidence)
    scale = DEPTH_COLOURS, pictures.outcome.z_range_mm, "mm"
    panels = [_map("estimated depth, paler where less sure", z_mm, *scale, confidence)]
    if truth is not None:
        true_mm = crop.middles(truth.object_z_mm)
        words = "true depth of the objects" if truth.has_objects else "true depth"
        panels.append(_map(words, true_mm, *scale))
        error, limit = depth_errors(z_mm, true_mm)
        label, words = "mm, too far above 0", "estimated less true depth"
        panels.append(_map(words, error, ERROR_COLOURS, (-limit, limit), label))
    confidence = np.where(np.isfinite(z_mm), confidence, np.nan)
    label, words = "probability of an error below 1 px of total disparity", "confidence"
    return [*panels, _map(words, confidence, SHARE_COLOURS, (0.0, 1.0), label)]


def depth_errors(z_mm: np.ndarray, true_mm: np.ndarray) -> tuple[np.ndarray, float]:
    """Estimated less true depth (H, W) in mm, NaN without either, and a limit that most errors are within.

    These are `UNSATURATED_SHARE` of them; the limit is rounded to two digits.
    """
    both = np.isfinite(z_mm) & np.isfinite(true_mm)
    error = np.full(z_mm.shape, np.nan)
    error[both] = z_mm[both] - true_mm[both]
    limit = float(np.quantile(np.abs(error[both]), UNSATURATED_SHARE)) if both.any() else 1.0
    return error, float(f"{max(limit, 1e-3):.1e}")


def _photo(image: np.ndarray, caption: str) -> Panel:
    return {"image": photo_uri(image), "caption": caption}


def _drawing(image: np.ndarray, caption: str) -> Panel:
    return {"image": drawing_uri(image), "caption": caption}


def _map(
    caption: str,
    values: np.ndarray,
    colours: str,
    limits: tuple[float, float],
    label: str,
    confidence: np.ndarray | None = None,
) -> Panel:
    image = map_image(values, colours, limits, confidence)
    return _drawing(image, caption) | {"bar": colour_bar_uri(colours, limits, label)}
