"""True in-focus masks of sections, by object and by pixel, and how well masks and photons agree with them."""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from pcii.base.errors import InputError
from pcii.imaging.mask_outlines import boundary_f
from pcii.types.estimates import Segmented
from pcii.types.focal_planes import FocalPlanes
from pcii.types.geometry import blur_half_extent_px
from pcii.types.truth import PhotonTruth, Truth

FOCUS_TOLERANCE_PX = 1.0
"""A point is in focus where its blur half-extent is at most this."""

Kind = Literal["object", "pixel"]
KINDS: tuple[Kind, ...] = ("object", "pixel")
Row = dict[str, float | None]


@dataclass(frozen=True, eq=False)
class TrueFocus:
    """What is in focus in sections at `planes`; each map is made once, when it is first read."""

    planes: FocalPlanes
    truth: Truth

    @cached_property
    def plane_of(self) -> dict[int, int]:
        """Index of the plane to which each visible object belongs, by object id.

        It is the plane at which the object's visible surface has the least mean blur.
        """
        plane_of: dict[int, int] = {}
        for number in self.truth.names:
            surface = self.truth.z_mm[self.truth.object_id == number]
            if surface.size:
                blur = [blur_half_extent_px(self.planes.grid, surface, z).mean() for z in self.planes.z_mm]
                plane_of[number] = int(np.argmin(blur))
        return plane_of

    def names_at(self, plane: int) -> list[str]:
        """Names of the objects that belong to a plane."""
        return [self.truth.names[number] for number, own in self.plane_of.items() if own == plane]

    @cached_property
    def by_object(self) -> np.ndarray:
        """Truth by object: (Z, H, W) bool, the pixels of the objects that belong to each plane."""
        masks = np.zeros((len(self.planes), *self.truth.z_mm.shape), dtype=bool)
        for number, plane in self.plane_of.items():
            masks[plane] |= self.truth.object_id == number
        return masks

    @cached_property
    def by_pixel(self) -> np.ndarray:
        """Truth by pixel: (Z, H, W) bool, points whose blur half-extent is at most the tolerance."""
        return self._blur_px <= FOCUS_TOLERANCE_PX

    def masks(self, kind: Kind) -> np.ndarray:
        """The truth of this kind, (Z, H, W) bool."""
        return self.by_object if kind == "object" else self.by_pixel

    def oracle(self, kind: Kind) -> np.ndarray:
        """Masks (Z, H, W) of a method that knows each pixel's true depth and nothing else.

        A pixel belongs to the plane that is nearest in disparity. For the truth by "pixel" it is claimed
        there if it is in focus; for the truth by "object", which has no tolerance, if it shows an object.
        """
        nearest = self._blur_px.argmin(axis=0) == np.arange(len(self.planes))[:, None, None]
        return nearest & (self.truth.object_id > 0 if kind == "object" else self.by_pixel)

    @cached_property
    def _blur_px(self) -> np.ndarray:
        """Blur half-extent (Z, H, W) of every point at every plane."""
        grid = self.planes.grid
        return np.stack([blur_half_extent_px(grid, self.truth.z_mm, z) for z in self.planes.z_mm])


def mask_agreement(claimed: np.ndarray, true: np.ndarray | None, true_share: np.ndarray | None = None) -> Row:
    """IoU, precision, recall, F1 and boundary F of two masks (H, W).

    `true_share` (H, W) is the true share of each pixel's area, where that is known. Two empty masks have an
    IoU of 1. Precision is None if nothing is claimed, recall if nothing is true, all are None without truth.

    >>> agreement = mask_agreement(np.array([[True, True, False]]), np.array([[True, False, False]]))
    >>> agreement["iou"], agreement["precision"], agreement["recall"]
    (0.5, 0.5, 1.0)
    """
    if true is None:
        return dict.fromkeys(("iou", "precision", "recall", "f1", "boundary_f"))
    both, positives, truths = (int(np.count_nonzero(mask)) for mask in (claimed & true, claimed, true))
    any_of_them = positives + truths
    return {
        "iou": intersection_over_union(claimed, true),
        "precision": both / positives if positives else None,
        "recall": both / truths if truths else None,
        "f1": 2 * both / any_of_them if any_of_them else 1.0,
        "boundary_f": boundary_f(claimed, true, true_share) if any_of_them else 1.0,
    }


def intersection_over_union(one: np.ndarray, other: np.ndarray) -> float:
    """IoU of two masks (H, W), 1 if both are empty."""
    either = int(np.count_nonzero(one | other))
    return int(np.count_nonzero(one & other)) / either if either else 1.0


def photon_agreement(focus: Segmented, true: TrueFocus | None, plane: int) -> dict[Kind, Row]:
    """Precision and recall of the photons that a method keeps, by the origin of each, by kind of truth.

    A photon is kept if `photon_in_focus` has its event or, without that, if the voxel of the section that it
    is projected to is in the mask. It is rightly kept if its object belongs to the plane ("object"), or if
    its first hit is in focus there ("pixel"). Photons projected outside the section do not count. Raises
    `InputError` if `photon_in_focus` has another number of events than the truth.
    """
    unknown: Row = {"photon_precision": None, "photon_recall": None}
    if true is None or true.truth.photons is None:
        return {"object": unknown, "pixel": unknown}
    photons = true.truth.photons
    row, col, inside = focus.sections.planes.project(photons, plane)
    if focus.photon_in_focus is None:
        claimed = focus.in_focus[plane][row[inside], col[inside]]
    else:
        claimed = _by_photon(focus.photon_in_focus[plane], photons)[inside]
    objects = [number for number, own in true.plane_of.items() if own == plane]
    blur_px = blur_half_extent_px(true.planes.grid, photons.z_mm[inside], focus.z_mm[plane])
    return {
        "object": _shares(claimed, np.isin(photons.object_id[inside], objects)),
        "pixel": _shares(claimed, blur_px <= FOCUS_TOLERANCE_PX),
    }


def _shares(claimed: np.ndarray, right: np.ndarray) -> Row:
    both = int(np.count_nonzero(claimed & right))
    return {
        "photon_precision": both / int(claimed.sum()) if claimed.any() else None,
        "photon_recall": both / int(right.sum()) if right.any() else None,
    }


def _by_photon(by_event: np.ndarray, photons: PhotonTruth) -> np.ndarray:
    """Values of events (N,) repeated for each of their photons, which are consecutive in the truth."""
    places = np.stack([photons.k, photons.l, photons.i, photons.j])
    event = np.cumsum(np.any(np.diff(places, axis=1, prepend=-1), axis=0)) - 1
    events = int(event[-1]) + 1 if event.size else 0
    if by_event.size != events:
        raise InputError(
            f"photon_in_focus: has {by_event.size} events, and the truth's photons belong to {events}; "
            "for other counts give dataclasses.replace(truth, photons=None)"
        )
    return by_event[event]
