"""How right it was: masks, depth and entropies against the truth.

The one place where estimate and truth meet.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from pcii.boundary import boundary_f, object_share
from pcii.errors import InputError
from pcii.geometry import blur_half_extent_px, disparity_spread_px, landing
from pcii.statistics import entropy_bits, pooled_estimate, region_entropy_bits, section_window_px
from pcii.types import CameraGrid, DepthMap, PhotonTruth, Score, Segmented, Truth

FOCUS_TOLERANCE_PX = 1.0
"""A point is in focus where its blur half-extent is at most this."""


def score(
    focus: Segmented | Sequence[Segmented],
    depth: DepthMap | None,
    truth: Truth | None,
    *,
    dataset: str | None = None,
) -> Score:
    """Compare in-focus masks and a depth map with the truth.

    `planes` has a row per method and plane for each kind of truth. "object": the objects whose
    visible surface is closest to this plane. "pixel": the points whose blur half-extent
    |disparity(z) - disparity(z0)| (N - 1) / 2 is at most 1 px. `boundary_f` is the F-measure of the
    outlines with a tolerance of 2 px, located within pixels if the truth has `coverage`;
    `entropy_before` and `entropy_after` are Eq. 9 of the section as a whole, before and after removal,
    in bits. `objects` is Table 1: the entropy of each object, with the blur it has at the other planes,
    at each plane. `depth` is over the objects' pixels: errors in mm where answered; `bad_1px` and
    `bad_3px` the share whose error exceeds 1 or 3 px of total disparity spread, a missing answer
    counting as bad; `coverage` the share answered.

    What cannot be known is None. Raises `InputError` if shapes differ.
    """
    methods = [focus] if isinstance(focus, Segmented) else list(focus)
    if truth is not None:
        shapes = [one.in_focus.shape[1:] for one in methods]
        shapes += [] if depth is None else [depth.z_mm.shape]
        if any(shape != truth.z_mm.shape for shape in shapes):
            raise InputError(f"truth: its maps are {truth.z_mm.shape}, the estimates {shapes[0]}")
    pooled = [pooled_estimate(one.sections, section_window_px(one.sections)) for one in methods]
    rows = [
        row for one, section in zip(methods, pooled, strict=True) for row in _plane_rows(one, section, truth)
    ]
    objects = _object_rows(methods[0], pooled[0], truth) if methods and truth is not None else []
    grid = methods[0].sections.grid if methods else None
    errors = _depth_errors(grid, depth, truth)
    return Score(tuple(rows), tuple(objects), errors, dataset)


def objects_by_plane(grid: CameraGrid, truth: Truth, z_mm: np.ndarray) -> dict[int, int]:
    """Plane index (into `z_mm`) to which each visible object belongs, by object id.

    The closest plane is the one at which the object's visible surface has the least mean blur.
    """
    belongs: dict[int, int] = {}
    for number in truth.names:
        surface = truth.z_mm[truth.object_id == number]
        if surface.size:
            blur = [blur_half_extent_px(grid, surface, z).mean() for z in z_mm]
            belongs[number] = int(np.argmin(blur))
    return belongs


def object_masks(grid: CameraGrid, truth: Truth, z_mm: np.ndarray) -> np.ndarray:
    """Truth by object: (Z, H, W) bool, the pixels of the objects that belong to each plane."""
    belongs = objects_by_plane(grid, truth, z_mm)
    masks = np.zeros((len(z_mm), *truth.z_mm.shape), dtype=bool)
    for number, plane in belongs.items():
        masks[plane] |= truth.object_id == number
    return masks


def pixel_masks(grid: CameraGrid, truth: Truth, z_mm: np.ndarray) -> np.ndarray:
    """Truth by pixel: (Z, H, W) bool, points whose blur half-extent is at most the tolerance."""
    return np.stack([blur_half_extent_px(grid, truth.z_mm, z) <= FOCUS_TOLERANCE_PX for z in z_mm])


def _plane_rows(focus: Segmented, pooled: np.ndarray, truth: Truth | None) -> list[dict[str, Any]]:
    grid, z_mm = focus.sections.grid, focus.z_mm
    before, after = _section_entropies(focus, pooled)
    kinds: list[tuple[str, np.ndarray | None]] = [("object", None), ("pixel", None)]
    names: dict[int, list[str]] = {}
    if truth is not None:
        kinds = [("object", object_masks(grid, truth, z_mm)), ("pixel", pixel_masks(grid, truth, z_mm))]
        for number, plane in objects_by_plane(grid, truth, z_mm).items():
            names.setdefault(plane, []).append(truth.names[number])
    rows: list[dict[str, Any]] = []
    for plane, depth in enumerate(z_mm):
        for kind, masks in kinds:
            owner = ", ".join(names.get(plane, [])) if kind == "object" else ""
            rows.append(
                {
                    "z_mm": float(depth),
                    "method": focus.method,
                    "object": owner or None,
                    "truth": kind,
                    **_plane_agreement(focus.in_focus[plane], None if masks is None else masks[plane], truth),
                    **photon_agreement(focus, truth, plane, kind),
                    "entropy_before": before[plane],
                    "entropy_after": after[plane],
                }
            )
    return rows


def _plane_agreement(
    claimed: np.ndarray, true: np.ndarray | None, truth: Truth | None
) -> dict[str, float | None]:
    if true is None or truth is None or truth.coverage is None:
        return mask_agreement(claimed, true)
    return mask_agreement(claimed, true, object_share(true, truth.object_id, truth.coverage))


def mask_agreement(
    claimed: np.ndarray, true: np.ndarray | None, true_share: np.ndarray | None = None
) -> dict[str, float | None]:
    """IoU, precision, recall, F1 and boundary F of two masks (H, W).

    `true_share` (H, W) is how much of each pixel is true, if that is known more finely. Two empty masks
    agree fully. Precision is None if nothing is claimed, recall if nothing is true.
    """
    if true is None:
        return dict.fromkeys(("iou", "precision", "recall", "f1", "boundary_f"))
    both, claims, facts = (int(np.count_nonzero(m)) for m in (claimed & true, claimed, true))
    either = claims + facts - both
    return {
        "iou": both / either if either else 1.0,
        "precision": both / claims if claims else None,
        "recall": both / facts if facts else None,
        "f1": 2 * both / (claims + facts) if either else 1.0,
        "boundary_f": boundary_f(claimed, true, true_share) if either else 1.0,
    }


def photon_agreement(focus: Segmented, truth: Truth | None, plane: int, kind: str) -> dict[str, float | None]:
    """Precision and recall of the photons that a method keeps, against where each came from.

    A photon is kept if `photon_in_focus` says so of its event or, without one, if the voxel that it lands
    on in the section is claimed. It is rightly kept if its object belongs to the plane ("object"), or if
    its first hit is in focus there ("pixel"). Photons that land outside the section do not count.
    Raises `InputError` if `photon_in_focus` is of other events than the truth.
    """
    if truth is None or truth.photons is None:
        return {"photon_precision": None, "photon_recall": None}
    grid, photons, z0 = focus.sections.grid, truth.photons, focus.z_mm[plane]
    row, col, inside = landing(grid, photons, z0)
    if focus.photon_in_focus is None:
        kept = focus.in_focus[plane][row[inside], col[inside]]
    else:
        kept = _by_photon(focus.photon_in_focus[plane], photons)[inside]
    if kind == "object":
        own = [n for n, p in objects_by_plane(grid, truth, focus.z_mm).items() if p == plane]
        right = np.isin(photons.object_id[inside], own)
    else:
        right = blur_half_extent_px(grid, photons.z_mm[inside], z0) <= FOCUS_TOLERANCE_PX
    both = int(np.count_nonzero(kept & right))
    return {
        "photon_precision": both / int(kept.sum()) if kept.any() else None,
        "photon_recall": both / int(right.sum()) if right.any() else None,
    }


def _by_photon(by_event: np.ndarray, photons: PhotonTruth) -> np.ndarray:
    """What is said of each event (N,) for each of its photons: in the truth they are a run of one pixel."""
    where = np.stack([photons.k, photons.l, photons.i, photons.j])
    event = np.cumsum(np.any(np.diff(where, axis=1, prepend=-1), axis=0)) - 1
    events = int(event[-1]) + 1 if event.size else 0
    if by_event.size != events:
        raise InputError(
            f"photon_in_focus: tells of {by_event.size} events, and the truth's photons are of {events}"
        )
    return by_event[event]


def _section_entropies(focus: Segmented, pooled: np.ndarray) -> tuple[list[float], list[float]]:
    """Entropy of each section before and after removal, mean over the colours, in bits."""
    tops = pooled.max(axis=(1, 2))
    before: list[float] = []
    after: list[float] = []
    for plane, mask, top in zip(pooled, focus.in_focus, tops, strict=True):
        colours = range(plane.shape[-1])
        before.append(float(np.mean([entropy_bits(plane[..., c], top[c]) for c in colours])))
        after.append(float(np.mean([entropy_bits(plane[..., c] * mask, top[c]) for c in colours])))
    return before, after


def _object_rows(focus: Segmented, pooled: np.ndarray, truth: Truth) -> list[dict[str, Any]]:
    from scipy.ndimage import binary_dilation

    grid = focus.sections.grid
    tops = pooled.max(axis=(0, 1, 2))
    rows: list[dict[str, Any]] = []
    for number, name in sorted(truth.names.items()):
        mask = truth.object_id == number
        entropy: dict[str, float | None] = {f"{z:g}": None for z in focus.z_mm}
        if mask.any():
            surface = truth.z_mm[mask]
            blur = max(float(blur_half_extent_px(grid, surface, z).mean()) for z in focus.z_mm)
            region = binary_dilation(mask, iterations=max(1, round(2 * blur)))
            for z, plane in zip(focus.z_mm, pooled, strict=True):
                entropy[f"{z:g}"] = region_entropy_bits(plane, region, tops)
        rows.append({"name": name, "entropy": entropy})
    return rows


def _depth_errors(
    grid: CameraGrid | None, depth: DepthMap | None, truth: Truth | None
) -> dict[str, float | None]:
    keys = ("mae_mm", "median_mm", "bad_1px", "bad_3px", "coverage")
    if grid is None or depth is None or truth is None or not (truth.object_id > 0).any():
        return dict.fromkeys(keys)
    here = truth.object_id > 0
    estimate, true = depth.z_mm[here], truth.z_mm[here]
    answered = np.isfinite(estimate)
    error_mm = np.abs(estimate[answered] - true[answered])
    error_px = np.full(estimate.shape, np.inf)
    spread = disparity_spread_px(grid, estimate[answered]) - disparity_spread_px(grid, true[answered])
    error_px[answered] = np.abs(spread)
    return {
        "mae_mm": float(error_mm.mean()) if answered.any() else None,
        "median_mm": float(np.median(error_mm)) if answered.any() else None,
        "bad_1px": float((error_px > 1).mean()),
        "bad_3px": float((error_px > 3).mean()),
        "coverage": float(answered.mean()),
    }
