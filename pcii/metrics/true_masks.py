"""True in-focus masks of sections, by object and by pixel; how masks, outlines, photons agree with them."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np

from pcii.base import InputError
from pcii.types import FocalPlanes, PhotonTruth, Segmented, Truth, blur_half_extent_px

FOCUS_TOLERANCE_PX = 1.0
"""A point is in focus where its blur half-extent is at most this."""
OBJECT_REACH_PX, OBJECT_SHARE = 4.0, 0.9
"""Share of an object's visible surface that is within a blur half-extent of the plane that it belongs to.

With a shorter reach bulky things are not scored, with a longer one floors are. Of the 114 objects in the
scenes of the benchmark 96 belong to a plane; reaches of 3 and 6 px change none and 3 of them, shares of 0.95
and 0.8 none and 1."""
OUTLINE_TOLERANCE_PX = 2.0
"""Outlines agree where they are at most this far apart."""

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

        Of the planes it is that at which the object's visible surface has the least mean blur, if
        `OBJECT_SHARE` of the surface has a blur half-extent of at most `OBJECT_REACH_PX` there. Objects that
        lean through the depths, or are far from all planes, belong to none, and neither do those that count
        in no score.
        """
        plane_of: dict[int, int] = {}
        for number in sorted(set(self.truth.names) - self.truth.unscored):
            blur = self.blur_px[:, self.truth.object_id == number]
            if blur.size:
                nearest = int(blur.mean(axis=1).argmin())
                if (blur[nearest] <= OBJECT_REACH_PX).mean() >= OBJECT_SHARE:
                    plane_of[number] = nearest
        return plane_of

    def names_at(self, plane: int) -> list[str]:
        """Names of the objects that belong to a plane."""
        return [self.truth.names[number] for number, nearest in self.plane_of.items() if nearest == plane]

    @cached_property
    def by_object(self) -> np.ndarray:
        """Truth by object: (Z, H, W) bool, the pixels of the objects that belong to each plane."""
        masks = np.zeros(self.blur_px.shape, dtype=bool)
        for number, plane in self.plane_of.items():
            masks[plane] |= self.truth.object_id == number
        return masks

    @cached_property
    def by_pixel(self) -> np.ndarray:
        """Truth by pixel: (Z, H, W) bool, points whose blur half-extent is at most the tolerance."""
        return (self.blur_px <= FOCUS_TOLERANCE_PX) & ~self.truth.is_unscored

    def masks(self, kind: Kind) -> np.ndarray:
        """The truth of this kind, (Z, H, W) bool."""
        return self.by_object if kind == "object" else self.by_pixel

    def is_free(self, kind: Kind, object_id: np.ndarray, blur_px: np.ndarray) -> np.ndarray:
        """Which points may be claimed and need not be, bool; of their objects and their blur at a plane.

        Those of objects that count in no score; by object also points of objects that belong to no plane,
        where their blur half-extent is at most `OBJECT_REACH_PX`.
        """
        is_unscored = np.isin(object_id, [*self.truth.unscored])
        if kind == "pixel":
            return is_unscored
        is_planeless = ~np.isin(object_id, [0, *self.plane_of])
        return is_unscored | (is_planeless & (blur_px <= OBJECT_REACH_PX))

    @cached_property
    def blur_px(self) -> np.ndarray:
        """Blur half-extent (Z, H, W) of every point at every plane."""
        grid = self.planes.grid
        return np.stack([blur_half_extent_px(grid, self.truth.z_mm, z) for z in self.planes.z_mm])


def mask_agreement(
    claimed: np.ndarray,
    true: np.ndarray | None,
    true_share: np.ndarray | None = None,
    is_free: np.ndarray | None = None,
) -> dict[str, Any]:
    """IoU, precision, recall, F1 and boundary F of two masks (H, W) bool, and what is claimed falsely.

    `true_share` (H, W) is the true share of each pixel's area, where that is known. Pixels `is_free` (H, W)
    count as if they were not claimed. `false_share` is the share of the film that is claimed and not true,
    and `everything` the IoU and the false share of whoever claims the whole film. Where nothing is true there
    is neither IoU, recall, F1 nor boundary F, and where nothing is claimed no precision; all are None without
    truth.

    >>> agreement = mask_agreement(np.array([[True, True, False]]), np.array([[True, False, False]]))
    >>> agreement["iou"], agreement["precision"], agreement["recall"]
    (0.5, 0.5, 1.0)
    """
    if true is None:
        unknown = dict.fromkeys(("iou", "precision", "recall", "f1", "boundary_f", "false_share"))
        return {**unknown, "everything": {"iou": None, "false_share": None}}
    counted = np.ones(true.shape, dtype=bool) if is_free is None else ~is_free
    claimed = claimed & counted
    both, positives, truths = (int(np.count_nonzero(mask)) for mask in (claimed & true, claimed, true))
    either, counts = positives + truths - both, int(np.count_nonzero(counted))
    return {
        "iou": both / either if truths else None,
        "precision": both / positives if positives else None,
        "recall": both / truths if truths else None,
        "f1": 2 * both / (positives + truths) if truths else None,
        "boundary_f": boundary_f(claimed, true, true_share) if truths else None,
        "false_share": (positives - both) / true.size,
        "everything": {
            "iou": truths / counts if truths else None,
            "false_share": (counts - truths) / true.size,
        },
    }


def photon_agreement(focus: Segmented, true: TrueFocus | None, plane: int) -> dict[Kind, Row]:
    """Precision and recall of the photons that a method keeps, by the origin of each, by kind of truth.

    A photon is kept if `photon_in_focus` has its event or, without that, if the voxel of the section that it
    is projected to is in the mask. It is rightly kept if its object belongs to the plane ("object"), or if
    its first hit is in focus there ("pixel"). Photons projected outside the section do not count, and neither
    do those of objects whose pixels may be claimed (`TrueFocus.is_free`). Raises `InputError` if
    `photon_in_focus` has another number of events than the truth.
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
    object_id = photons.object_id[inside]
    blur_px = blur_half_extent_px(true.planes.grid, photons.z_mm[inside], focus.z_mm[plane])
    objects_at = [number for number, nearest in true.plane_of.items() if nearest == plane]
    right = {"object": np.isin(object_id, objects_at), "pixel": blur_px <= FOCUS_TOLERANCE_PX}
    rows: dict[Kind, Row] = {}
    for kind in KINDS:
        counted = ~true.is_free(kind, object_id, blur_px)
        claimed_here, to_keep = claimed & counted, right[kind] & counted
        both = int(np.count_nonzero(claimed_here & to_keep))
        rows[kind] = {
            "photon_precision": both / int(claimed_here.sum()) if claimed_here.any() else None,
            "photon_recall": both / int(to_keep.sum()) if to_keep.any() else None,
        }
    return rows


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


def boundary_f(claimed: np.ndarray, true: np.ndarray, true_share: np.ndarray | None = None) -> float:
    """F-measure of the outlines of two masks (H, W): shares of each within 2 px of the other.

    If `true_share` (H, W), the share of each pixel's area that is true, is given, both outlines are lines:
    the true one where the share is one half, linear between pixel centres, the claimed one midway between
    pixels. Else they are the outermost pixels of the masks. The frame's border is no outline. The result
    is 0 if a mask has no outline.

    >>> mask = np.pad(np.ones((4, 4), dtype=bool), 8)
    >>> boundary_f(mask, mask), boundary_f(mask, np.roll(mask, 6, axis=1))
    (1.0, 0.0)
    """
    from scipy.spatial import KDTree

    if true_share is None:
        claimed_px, true_px = _outermost_px(claimed), _outermost_px(true)
    else:
        claimed_px, true_px = _line_px(claimed), _line_px(true_share)
    if not (len(claimed_px) and len(true_px)):
        return 0.0
    precision = (KDTree(true_px).query(claimed_px)[0] <= OUTLINE_TOLERANCE_PX).mean()
    recall = (KDTree(claimed_px).query(true_px)[0] <= OUTLINE_TOLERANCE_PX).mean()
    total = precision + recall
    return float(2 * precision * recall / total) if total else 0.0


def _outermost_px(mask: np.ndarray) -> np.ndarray:
    """Row and column (N, 2) of the pixels of the mask with a neighbour (of four) outside it."""
    p = np.pad(mask, 1, mode="edge")
    return np.argwhere(mask & ~(p[:-2, 1:-1] & p[2:, 1:-1] & p[1:-1, :-2] & p[1:-1, 2:]))


def _line_px(share: np.ndarray) -> np.ndarray:
    """Points (N, 2), row and column, along the lines where shares are one half, at most 0.71 px apart."""
    from skimage.measure import find_contours

    # Contours run through squares of four pixel centres, so a picture one pixel wide is repeated.
    wide = np.pad(share.astype(np.float64), [(0, int(size < 2)) for size in share.shape], mode="edge")
    lines = [np.concatenate([line, (line[1:] + line[:-1]) / 2]) for line in find_contours(wide, 0.5)]
    return np.concatenate([np.zeros((0, 2)), *lines])
