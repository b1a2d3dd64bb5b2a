"""Pictures of a report: the panels of the paper's Figures 6 and 7, and the depth map with its error.

All show the same part of the frame, the `Crop`, so that a place in one is the same place in all others.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pcii.app.pipeline import Outcome
from pcii.figures import pictures as picture
from pcii.figures.exposure import (
    encoded,
    filled_means,
    image_block_sums,
    photon_picture,
    smoothed,
    smoothing_for,
)
from pcii.imaging.bright_regions import box_around
from pcii.metrics.true_masks import TrueFocus
from pcii.sections.demosaicing import demosaic
from pcii.types.camera_grid import CameraGrid
from pcii.types.estimates import Segmented
from pcii.types.section_stack import Sections
from pcii.types.truth import Truth

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
        return image_block_sums(image[self.rows, self.cols], self.step_px)


@dataclass(frozen=True, eq=False)
class Shown:
    """What a report shows: results, a part of the frame, how photons are smoothed; pictures are made once.

    `smoothing_px` is the standard deviation in pixels of the Gaussian with which photons of sections are
    shown, 0 for none.
    """

    outcome: Outcome
    crop: Crop
    smoothing_px: float

    @classmethod
    def of(cls, outcome: Outcome, smoothing_px: float | None = None) -> "Shown":
        """The objects with a margin, or what was found in focus, else the whole frame.

        Without `smoothing_px` it follows from the photons.
        """
        dataset = outcome.dataset
        box = box_around(_interesting_part(dataset.grid, dataset.truth, outcome.focus))
        longest = max(side.stop - side.start for side in box)
        if not dataset.has_counts:
            smoothing_px = 0.0
        elif smoothing_px is None:
            smoothing_px = smoothing_for([counts[box] for counts in outcome.sections.counts])
        return cls(outcome, Crop(*box, -(-longest // LONGEST_PX)), smoothing_px)

    @cached_property
    def true(self) -> TrueFocus | None:
        """What is truly in focus at the planes of the analysis."""
        dataset = self.outcome.dataset
        if dataset.truth is None:
            return None
        return TrueFocus(self.outcome.sections.planes, dataset.truth)

    @cached_property
    def sections(self) -> list[np.ndarray]:
        """Pictures of the sections of the analysis."""
        return section_images(self.outcome.sections, self.crop, self.smoothing_px)

    @cached_property
    def true_depth(self) -> Panel | None:
        """The true depth of the objects."""
        truth = self.outcome.dataset.truth
        if truth is None:
            return None
        words = "true depth of the objects" if truth.has_objects else "true depth"
        return _drawing(self.depth_image(truth.object_z_mm), words)

    def depth_image(self, z_mm: np.ndarray, confidence: np.ndarray | None = None) -> np.ndarray:
        """Depth (H, W) in the colours of the range that was searched."""
        sure = None if confidence is None else self.crop.middles(confidence)
        return picture.depth_image(self.crop.middles(z_mm), *self.outcome.z_range_mm, sure)

    @cached_property
    def error_mm(self) -> tuple[np.ndarray, float]:
        """Estimated less true depth of the objects (h, w) in mm, NaN without either; where colours saturate.

        Most errors, `SATURATED` of them, are within that limit, which is rounded to two digits.
        """
        truth = self.outcome.dataset.truth
        assert truth is not None
        found, true = self.crop.middles(self.outcome.depth.z_mm), self.crop.middles(truth.object_z_mm)
        both = np.isfinite(found) & np.isfinite(true)
        error = np.full(found.shape, np.nan)
        error[both] = found[both] - true[both]
        limit = float(np.quantile(np.abs(error[both]), SATURATED)) if both.any() else 1.0
        return error, float(f"{max(limit, 1e-3):.1e}")


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


def section_images(sections: Sections, crop: Crop, smoothing_px: float = 0.0) -> list[np.ndarray]:
    """Pictures of sections, all at the same exposure."""
    planes = range(len(sections.z_mm))
    return encoded([block_estimate(sections, plane, crop, smoothing_px) for plane in planes])


def figure6(shown: Shown) -> list[Panel]:
    """Panels of Figure 6: central view raw and demosaiced, sections, photons of one view, truth."""
    panels = _view_panels(shown)
    outcome = shown.outcome
    if outcome.full_light is not None:
        images = section_images(outcome.full_light, shown.crop)
        panels += _section_panels(outcome.full_light, images, "full light", "")
    if outcome.dataset.has_counts:
        per_view = outcome.dataset.counts.total / outcome.dataset.grid.view_count
        light, words = f"{per_view:.0f} photons per view", smoothing_words(shown.smoothing_px)
        panels += _section_panels(outcome.sections, shown.sections, light, words)
        panels.append(_photon_panel(shown))
    if shown.true_depth is not None:
        words = f"{shown.true_depth['caption']} (colour scale under Depth)"
        panels.append(shown.true_depth | {"caption": words})
    letters = [*"abcdefghijklmnopqrstuvwxyz"] + [f"{n}" for n in range(27, 1000)]
    return [
        panel | {"caption": f"({letter}) {panel['caption']}"}
        for letter, panel in zip(letters, panels, strict=False)
    ]


def _view_panels(shown: Shown) -> list[Panel]:
    """The central view at full light, and demosaiced if it is a mosaic."""
    views = shown.outcome.dataset.views
    if views is None:
        return []
    k, l = views.grid.middle_camera
    name = f"view ({k}, {l}) at full light"
    view = views.view(k, l).astype(np.float64)
    if views.cfa is None:
        view = _reduced(view, shown.crop)
        return [_photo(picture.to_srgb8(view, picture.white_level(view)), name)]
    colour = _reduced(demosaic(view[..., 0], cfa=views.cfa), shown.crop)
    white = picture.white_level(colour)
    return [
        _photo(picture.to_srgb8(_reduced(view, shown.crop), white), f"{name}, raw"),
        _photo(picture.to_srgb8(colour, white), "the same, demosaiced (Eqs. 4–6)"),
    ]


def _section_panels(sections: Sections, images: Sequence[np.ndarray], light: str, words: str) -> list[Panel]:
    equation = "Eq. 2" if sections.counts.dtype.kind == "f" else "Eq. 3"
    return [
        _photo(image, f"section at {z:g} mm, {light} ({equation}){words}")
        for z, image in zip(sections.z_mm, images, strict=True)
    ]


def _photon_panel(shown: Shown) -> Panel:
    """The photons of the central view."""
    counts = shown.outcome.dataset.counts
    k, l = counts.grid.middle_camera
    view = counts.view(k, l)
    image = photon_picture(view[shown.crop.rows, shown.crop.cols], shown.crop.step_px)
    return _drawing(image, f"view ({k}, {l}) at the photon budget: {view.sum()} photons")


def figure7(shown: Shown) -> list[list[Panel]]:
    """Panels of Figure 7 for each method and plane: section after removal, truth, comparison.

    Without truth all are in one row.
    """
    crop, true = shown.crop, shown.true
    rows: list[list[Panel]] = []
    for focus in shown.outcome.focus:
        for plane, z in enumerate(focus.z_mm):
            kept = crop.middles(focus.in_focus[plane])
            image = shown.sections[plane] * kept[..., None]
            empty = "" if focus.in_focus[plane].any() else ", nothing is kept"
            words = f"after removal{empty or smoothing_words(shown.smoothing_px)}"
            panels = [_photo(image, f"{focus.method}, {z:g} mm: {words}")]
            if true is not None:
                mask = crop.middles(true.by_object[plane])
                image = picture.mask_image(mask)
                image[mask & ~crop.middles(true.by_pixel[plane])] = 130
                panels.append(_drawing(image, f"truth at {z:g} mm"))
                panels.append(_drawing(picture.agreement_image(kept, mask), f"comparison at {z:g} mm"))
            rows.append(panels)
    return rows if true else [[panel for row in rows for panel in row]]


def depth_panels(shown: Shown) -> list[Panel]:
    """The depth map, and beside it the truth and the error if there is a truth; the confidence."""
    truth, depth, crop = shown.outcome.dataset.truth, shown.outcome.depth, shown.crop
    image = shown.depth_image(depth.z_mm, depth.confidence)
    panels = [_drawing(image, "estimated depth, greyer where less sure, black where unknown")]
    if truth is not None and shown.true_depth is not None:
        error, limit = shown.error_mm
        image = picture.error_image(error, limit)
        image[np.isfinite(crop.middles(truth.object_z_mm)) & np.isnan(error)] = 110
        panels += [shown.true_depth, _drawing(image, "estimated less true depth")]
    sure = picture.to_srgb8(crop.middles(depth.confidence) ** 2.2, 1.0)
    return [*panels, _drawing(sure, "confidence, from 0 (black) to 1 (white)")]


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
        return np.ones(grid.shape_HW, dtype=bool)
    return np.logical_or.reduce([segmented.in_focus.any(axis=0) for segmented in focus])
