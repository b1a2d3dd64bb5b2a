"""Results of methods, and their scores: in-focus masks, depth maps, measures of accuracy."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pcii.base import InputError, ShortForm, listed, span, times
from pcii.types.arrays import Plottable, freeze_array
from pcii.types.focal_planes import FocalPlanes, Sections


@dataclass(frozen=True, eq=False, repr=False)
class Segmented(Plottable):
    """Which points of each of the `sections` are in focus: `in_focus` (Z, H, W) bool.

    `steps` holds the named intermediate maps (Z, H, W) of the method, for display. A method that classifies
    single photons says in `photon_in_focus` (Z, N) bool which of the N events of the counts
    (`PhotonCounts.events`, in their order) come from points in focus in each plane; else that is None.
    `hot_pixels` is as of a `DepthMap`. Raises `InputError` for an array of another shape or dtype.
    """

    in_focus: np.ndarray
    method: str
    sections: Sections
    steps: Mapping[str, np.ndarray] = field(default_factory=dict)
    photon_in_focus: np.ndarray | None = None
    hot_pixels: int = 0

    def __post_init__(self) -> None:
        if not isinstance(self.sections, Sections):
            raise InputError(f"sections: expected Sections, got {type(self.sections).__name__}")
        shape = self.sections.counts.shape[:3]
        freeze_array(self, "in_focus", "bool", shape)
        if self.photon_in_focus is not None:
            freeze_array(self, "photon_in_focus", "bool", (shape[0], "events"))

    def _facts(self) -> dict[str, object]:
        shares = listed([f"{share:.2%}" for share in self.in_focus.mean(axis=(1, 2))])
        z_mm, shape = listed(self.z_mm.tolist()), times(self.in_focus.shape)
        return {"method": self.method, "z_mm": z_mm, "shape": shape, "in_focus": shares}

    @property
    def z_mm(self) -> np.ndarray:
        """Depths of the sections (Z,) float64."""
        return self.sections.z_mm


@dataclass(frozen=True, eq=False, repr=False)
class DepthMap(Plottable):
    """Depth per pixel of the virtual centre camera: `z_mm` (H, W), NaN where the method gives none.

    `confidence` (H, W), in [0, 1], is the probability that the depth is within 1 px of total disparity of the
    true one, as the method states it: 0 where no depth is given. `hot_pixels` is the number of pixels of a
    film that the method took for faults of the sensor and replaced. Raises `InputError` if the shapes differ,
    or for what is no array of real numbers.
    """

    z_mm: np.ndarray
    confidence: np.ndarray
    hot_pixels: int = 0

    def __post_init__(self) -> None:
        freeze_array(self, "z_mm", "real numbers", ("H", "W"))
        freeze_array(self, "confidence", "real numbers", self.z_mm.shape)

    def _facts(self) -> dict[str, object]:
        answered = self.z_mm[np.isfinite(self.z_mm)]
        share = f"{answered.size / max(1, self.z_mm.size):.2%}"
        return {"shape": times(self.z_mm.shape), "answered": share, "z_mm": span(answered)}


@dataclass(frozen=True, eq=False, repr=False)
class DepthPosterior(ShortForm):
    """What is known of the depth of blocks of `block_px` x `block_px` pixels of the virtual centre camera.

    `probability` (Z, h, w) float32 is that of a surface at each of the `planes`, `no_surface` (h, w) that
    there is none between the first and the last; their sum is 1. Planes are in order and evenly spaced in
    total disparity. h x w are enough blocks for all pixels. `in_focus` (R, h, w) float32 is the probability
    that the surface belongs to an object in focus at each of R requested planes. `is_detected` (h, w) bool is
    where depth maps and masks have an answer, and `is_supported` where the photons around tell the depth of
    the block. `hot_pixels` is as of a `DepthMap`. Raises `InputError` for other shapes.
    """

    planes: FocalPlanes
    probability: np.ndarray
    no_surface: np.ndarray
    block_px: int
    in_focus: np.ndarray
    is_detected: np.ndarray
    is_supported: np.ndarray
    hot_pixels: int = 0

    def __post_init__(self) -> None:
        h, w = (-(-size // self.block_px) for size in self.planes.grid.shape_HW)
        freeze_array(self, "probability", "real numbers", (len(self.planes), h, w))
        freeze_array(self, "no_surface", "real numbers", (h, w))
        freeze_array(self, "in_focus", "real numbers", ("requested planes", h, w))
        freeze_array(self, "is_detected", "bool", (h, w))
        freeze_array(self, "is_supported", "bool", (h, w))

    def _facts(self) -> dict[str, object]:
        return {"z_mm": listed(self.planes.z_mm.tolist()), "shape": times(self.probability.shape)}

    def most_probable(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The plane (h, w) int64 most probable with its neighbours, their probability, and a finer estimate.

        The last, in px of total disparity, is the mean over the plane and two on either side.
        """
        padded = [0.0, *self.probability, 0.0]
        confidence, plane = np.full_like(self.no_surface, -1), np.zeros(self.no_surface.shape, int)
        for z, (before, here, after) in enumerate(zip(padded, padded[1:], padded[2:], strict=False)):
            near = here + before + after
            plane[near > confidence] = z
            np.maximum(confidence, near, out=confidence)
        confidence = np.minimum(confidence, 1.0)
        at = plane + np.arange(-2, 3)[:, None, None]
        inside = (at >= 0) & (at < len(self.planes))
        at = np.clip(at, 0, len(self.planes) - 1)
        weight = np.where(inside, np.take_along_axis(self.probability, at, axis=0), 0).astype(np.float64)
        weight[2] += np.finfo(np.float32).tiny  # where all are 0 the plane itself is the mean
        total_px = (weight * self.planes.total_disparity_px[at]).sum(axis=0) / weight.sum(axis=0)
        return plane, confidence, total_px


@dataclass(frozen=True, repr=False)
class Score(ShortForm):
    """Content of `score.json`: rows per plane, entropies per object, errors of depth, bounds, frames."""

    planes: tuple[Mapping[str, Any], ...]
    objects: tuple[Mapping[str, Any], ...]
    depth: Mapping[str, Any]
    dataset: str | None = None
    bounds: Mapping[str, Any] = field(default_factory=dict)
    readout: Mapping[str, Any] | None = None

    def _facts(self) -> dict[str, object]:
        return {
            "dataset": self.dataset,
            "methods": listed(list(dict.fromkeys(row["method"] for row in self.planes))),
            "planes": len(self.planes),
            "objects": len(self.objects),
            "depth median_mm": self.depth.get("median_mm"),
        }

    def to_dict(self) -> dict[str, Any]:
        """The score as plain Python values, in the spelling of `score.json`."""
        rows = {name: [dict(row) for row in getattr(self, name)] for name in ("planes", "objects")}
        others = {"depth": dict(self.depth), "bounds": dict(self.bounds), "readout": self.readout}
        return {"dataset": self.dataset, **rows, **others}
