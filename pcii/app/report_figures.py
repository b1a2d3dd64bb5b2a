"""Pictures of a report: the panels of the paper's Figures 6 and 7, and the depth map with its error.

All show the same part of the frame, the `Crop`, so that a place in one is the same place in all others.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pcii.app.pipeline import Outcome
from pcii.core.camera_grid import CameraGrid
from pcii.core.estimates import Segmented
from pcii.core.section_stack import Sections
from pcii.core.truth import Truth
from pcii.figures import pictures as picture
from pcii.figures.exposure import block_sums, encoded, filled_means, smoothed, smoothing_for
from pcii.imaging.bright_regions import box_around
from pcii.io.suggested_depths import depth_range_of
from pcii.metrics.true_masks import object_masks, pixel_masks
from pcii.sections.demosaicing import demosaic

LONGEST_PX = 640
"""Longer sides of pictures are shown at one of 2 x 2 pixels, or of more."""
SATURATED = 0.95
"""Share of the errors of depth that the colours of their picture do not saturate."""

Panel = dict[str, str]
"""An `image` as a data URI and its `caption`."""


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
        return block_sums(image[self.rows, self.cols], self.step_px)


def crop_of(outcome: Outcome) -> Crop:
    """The objects with a margin, or what was found in focus; else the whole frame."""
    dataset = outcome.dataset
    box = box_around(_interesting_part(dataset.grid, dataset.truth, outcome.focus))
    longest = max(side.stop - side.start for side in box)
    return Crop(*box, -(-longest // LONGEST_PX))


def smoothing_of(outcome: Outcome, crop: Crop, asked_px: float | None) -> float:
    """Standard deviation in pixels of the Gaussian with which photons of sections are shown, 0 for none.

    If nothing is asked for it follows from the photons.
    """
    if not outcome.dataset.has_counts:
        return 0.0
    if asked_px is not None:
        return asked_px
    return smoothing_for([counts[crop.rows, crop.cols] for counts in outcome.sections.counts])


def smoothing_words(smoothing_px: float) -> str:
    """What a caption says of the smoothing of the photons that it is of."""
    return f", smoothed by {smoothing_px:g} px" if smoothing_px else ""


def block_estimate(
    sections: Sections, plane: int, crop: Crop, smoothing_px: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Estimate and samples (h, w, C) of the blocks of one section: the sums of its counts over its samples.

    Both are smoothed by a Gaussian with a standard deviation of `smoothing_px` pixels of the frame. At some
    depths no view has a sample of a colour at every second voxel, as in a Bayer mosaic. There the estimate is
    that of the blocks around.
    """
    sums, samples = crop.sums(sections.counts[plane]), crop.sums(sections.coverage[plane])
    if smoothing_px:
        sums, samples = smoothed(sums, samples, smoothing_px / crop.step_px)
    return filled_means(sums, samples), samples


def figure6(outcome: Outcome, crop: Crop, smoothing_px: float) -> list[Panel]:
    """Panels of Figure 6: central view raw and demosaiced, sections, photons of one view, truth."""
    dataset = outcome.dataset
    k, l = dataset.grid.rows // 2, dataset.grid.cols // 2
    letters = iter([*"abcdefghijklmnopqrstuvwxyz"] + [f"{n}" for n in range(27, 1000)])
    panels: list[Panel] = []
    if dataset.views is not None:
        view = dataset.views.view(k, l).astype(np.float64)
        is_mosaic = dataset.views.cfa is not None
        colour = demosaic(view[..., 0], cfa=dataset.cfa) if is_mosaic else view
        raw, colour = (_reduced(image, crop) for image in (view, colour))
        white = picture.white_level(colour)
        name = f"view ({k}, {l}) at full light"
        panels.append(_photo(picture.to_srgb8(raw, white), f"({next(letters)}) {name}{', raw' * is_mosaic}"))
        if is_mosaic:
            image = picture.to_srgb8(colour, white)
            panels.append(_photo(image, f"({next(letters)}) the same, demosaiced (Eqs. 4–6)"))
    if outcome.full_light is not None:
        panels += _section_panels(outcome.full_light, crop, "full light", letters, 0.0)
    if dataset.has_counts:
        per_view = dataset.counts.total / dataset.grid.view_count
        light = f"{per_view:.0f} photons per view"
        panels += _section_panels(outcome.sections, crop, light, letters, smoothing_px)
        counts = dataset.counts.view(k, l)
        shown = crop.sums(counts[..., None])
        image = picture.to_srgb8(shown, max(1.0, picture.white_level(shown)))
        caption = f"({next(letters)}) view ({k}, {l}) at the photon budget: {counts.sum()} photons"
        panels.append(_drawing(image, caption))
    if dataset.truth is not None:
        near, far = depth_range_of(dataset, outcome.sections.z_mm.tolist())
        image = picture.depth_image(crop.middles(dataset.truth.object_z_mm), near, far)
        panels.append(
            _drawing(
                image, f"({next(letters)}) {_true_depth_words(dataset.truth)} (colour scale under Depth)"
            )
        )
    return panels


def figure7(outcome: Outcome, crop: Crop, smoothing_px: float) -> list[list[Panel]]:
    """Panels of Figure 7 for each method and plane: section after removal, truth, comparison.

    Without truth all are in one row.
    """
    truth, grid, z_mm = outcome.dataset.truth, outcome.dataset.grid, outcome.sections.z_mm
    by_object = object_masks(grid, truth, z_mm) if truth else None
    by_pixel = pixel_masks(grid, truth, z_mm) if truth else None
    sections = _section_images(outcome.sections, crop, smoothing_px)
    rows: list[list[Panel]] = []
    for focus in outcome.focus:
        for plane, z in enumerate(z_mm):
            kept = crop.middles(focus.in_focus[plane])
            image = sections[plane] * kept[..., None]
            empty = "" if focus.in_focus[plane].any() else ", nothing is kept"
            words = f"after removal{empty or smoothing_words(smoothing_px)}"
            panels = [_photo(image, f"{focus.method}, {z:g} mm: {words}")]
            if by_object is not None and by_pixel is not None:
                true = crop.middles(by_object[plane])
                image = picture.mask_image(true)
                image[true & ~crop.middles(by_pixel[plane])] = 130
                panels.append(_drawing(image, f"truth at {z:g} mm"))
                panels.append(_drawing(picture.agreement_image(kept, true), f"comparison at {z:g} mm"))
            rows.append(panels)
    return rows if truth else [[panel for row in rows for panel in row]]


def depth_panels(outcome: Outcome, crop: Crop) -> list[Panel]:
    """The depth map, and beside it the truth and the error if there is a truth; the confidence."""
    truth, depth = outcome.dataset.truth, outcome.depth
    near, far = depth_range_of(outcome.dataset, outcome.sections.z_mm.tolist())
    found, sure = crop.middles(depth.z_mm), crop.middles(depth.confidence)
    image = picture.depth_image(found, near, far, sure)
    panels = [_drawing(image, "estimated depth, greyer where less sure, black where unknown")]
    if truth is not None:
        true = crop.middles(truth.object_z_mm)
        panels.append(_drawing(picture.depth_image(true, near, far), _true_depth_words(truth)))
        error, limit = depth_error_mm(outcome, crop)
        image = picture.error_image(error, limit)
        image[np.isfinite(true) & np.isnan(error)] = 110
        panels.append(_drawing(image, "estimated less true depth"))
    panels.append(_drawing(picture.to_srgb8(sure**2.2, 1.0), "confidence, from 0 (black) to 1 (white)"))
    return panels


def depth_error_mm(outcome: Outcome, crop: Crop) -> tuple[np.ndarray, float]:
    """Estimated less true depth of the objects (h, w), NaN without either, and where colours saturate, in mm.

    Most errors, `SATURATED` of them, are within that limit, which is rounded to two digits.
    """
    truth = outcome.dataset.truth
    assert truth is not None
    found, true = crop.middles(outcome.depth.z_mm), crop.middles(truth.object_z_mm)
    both = np.isfinite(found) & np.isfinite(true)
    error = np.full(found.shape, np.nan)
    error[both] = found[both] - true[both]
    limit = float(np.quantile(np.abs(error[both]), SATURATED)) if both.any() else 1.0
    return error, float(f"{max(limit, 1e-3):.1e}")


def _true_depth_words(truth: Truth) -> str:
    """What a picture of `Truth.object_z_mm` shows."""
    return "true depth of the objects" if truth.has_objects else "true depth"


def _section_images(sections: Sections, crop: Crop, smoothing_px: float) -> list[np.ndarray]:
    planes = range(len(sections.z_mm))
    return encoded([block_estimate(sections, plane, crop, smoothing_px) for plane in planes])


def _section_panels(
    sections: Sections, crop: Crop, light: str, letters: Iterator[str], smoothing_px: float
) -> list[Panel]:
    equation = "Eq. 2" if sections.counts.dtype.kind == "f" else "Eq. 3"
    images, words = _section_images(sections, crop, smoothing_px), smoothing_words(smoothing_px)
    return [
        _photo(image, f"({next(letters)}) section at {z:g} mm, {light} ({equation}){words}")
        for z, image in zip(sections.z_mm, images, strict=True)
    ]


def _reduced(image: np.ndarray, crop: Crop) -> np.ndarray:
    return crop.sums(image) / crop.sums(np.ones_like(image))


def _photo(image: np.ndarray, caption: str) -> Panel:
    return {"image": picture.photo_uri(image), "caption": caption}


def _drawing(image: np.ndarray, caption: str) -> Panel:
    return {"image": picture.data_uri(image), "caption": caption}


def _interesting_part(grid: CameraGrid, truth: Truth | None, focus: Sequence[Segmented]) -> np.ndarray:
    """Mask (H, W) of the true objects; if there are none, of all points that a method found in focus.

    Without methods it is the whole image.
    """
    if truth is not None and truth.has_objects:
        return truth.object_id > 0
    if not focus:
        return np.ones((grid.height, grid.width), dtype=bool)
    return np.logical_or.reduce([segmented.in_focus.any(axis=0) for segmented in focus])
