"""How well two masks agree, and how many of the photons that a method keeps are rightly kept."""

import numpy as np

from pcii.base.errors import InputError
from pcii.core.estimates import Segmented
from pcii.core.geometry import blur_half_extent_px
from pcii.core.truth import PhotonTruth
from pcii.imaging.mask_outlines import boundary_f
from pcii.metrics.true_masks import FOCUS_TOLERANCE_PX, Kind, TrueFocus

Row = dict[str, float | None]


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
    either = positives + truths - both
    return {
        "iou": both / either if either else 1.0,
        "precision": both / positives if positives else None,
        "recall": both / truths if truths else None,
        "f1": 2 * both / (positives + truths) if either else 1.0,
        "boundary_f": boundary_f(claimed, true, true_share) if either else 1.0,
    }


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
        kept = focus.in_focus[plane][row[inside], col[inside]]
    else:
        kept = _by_photon(focus.photon_in_focus[plane], photons)[inside]
    objects = [number for number, own in true.plane_of.items() if own == plane]
    blur_px = blur_half_extent_px(true.grid, photons.z_mm[inside], focus.z_mm[plane])
    return {
        "object": _shares(kept, np.isin(photons.object_id[inside], objects)),
        "pixel": _shares(kept, blur_px <= FOCUS_TOLERANCE_PX),
    }


def _shares(kept: np.ndarray, right: np.ndarray) -> Row:
    both = int(np.count_nonzero(kept & right))
    return {
        "photon_precision": both / int(kept.sum()) if kept.any() else None,
        "photon_recall": both / int(right.sum()) if right.any() else None,
    }


def _by_photon(by_event: np.ndarray, photons: PhotonTruth) -> np.ndarray:
    """Values of events (N,) repeated for each of their photons, which are consecutive in the truth."""
    places = np.stack([photons.k, photons.l, photons.i, photons.j])
    event = np.cumsum(np.any(np.diff(places, axis=1, prepend=-1), axis=0)) - 1
    events = int(event[-1]) + 1 if event.size else 0
    if by_event.size != events:
        raise InputError(
            f"photon_in_focus: has {by_event.size} events, but the truth's photons belong to {events}, "
            "so these are other counts; for counts drawn anew give dataclasses.replace(truth, photons=None)"
        )
    return by_event[event]
