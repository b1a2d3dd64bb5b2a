"""Scores of masks, depth and entropies against the truth."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from pcii.base import InputError
from pcii.metrics.bounds import object_bounds
from pcii.metrics.depth_accuracy import depth_errors
from pcii.metrics.true_masks import KINDS, TrueFocus, mask_agreement, photon_agreement
from pcii.sections import entropy_bits, pooled_estimate, region_entropy_bits, section_window_px
from pcii.types import CameraGrid, DepthMap, Score, Sections, Segmented, Truth, blur_half_extent_px


def score(
    focus: Segmented | Sequence[Segmented] | None,
    depth: DepthMap | None,
    truth: Truth | None,
    *,
    grid: CameraGrid | None = None,
    full_light: Sections | None = None,
    dataset: str | None = None,
) -> Score:
    """Compare in-focus masks and a depth map with the truth.

    `planes` has a row for each method, plane and kind of truth. "object": the objects that belong to this
    plane (`TrueFocus.plane_of`). "pixel": the points whose blur half-extent,
    `|disparity(z) - disparity(z0)| (N - 1) / 2`, is at most 1 px. `mask_agreement` says how masks are
    compared, with outlines of a tolerance of 2 px, located within pixels if the truth has `coverage`;
    `entropy_before` and `entropy_after` are Eq. 9 of the section as a whole, before and after removal, in
    bits; `claimed_share` is the share of the section that the mask keeps. `objects` is Table 1: the entropy
    at each plane of the region of each object that is scored, which includes its blur at the other planes.
    `depth` is `depth_errors`. `bounds` holds `depth_sigma_px` for each object, the least standard deviation
    of its depth, from its texture in `full_light`, the sections of the radiance (Eq. 2). `readout` has the
    frames of the counts.

    A depth map without masks needs `grid`, the cameras. Scores without their truth are None. Raises
    `InputError` if shapes differ or the grid is missing.

    >>> import pcii
    >>> grid = pcii.CameraGrid(
    ...     rows=2, cols=2, pitch_mm=(5.0, 5.0), focal_mm=50.0, pixel_mm=0.25, height=8, width=12
    ... )
    >>> counts = pcii.PhotonCounts.from_dense(np.ones(grid.shape_KLHW, dtype=int), grid)
    >>> z_mm, object_id = np.full((8, 12), np.inf), np.zeros((8, 12), dtype=int)
    >>> z_mm[2:6, 2:6], object_id[2:6, 2:6] = 500.0, 1
    >>> in_focus = np.zeros((1, 8, 12), dtype=bool)
    >>> in_focus[0, 2:6, 2:10] = True
    >>> focus = pcii.Segmented(in_focus, "by hand", pcii.reconstruct(counts, z_mm=500))
    >>> row = score(focus, None, pcii.Truth(z_mm, object_id, {1: "card"})).planes[0]
    >>> row["object"], row["iou"], row["precision"], row["recall"]
    ('card', 0.5, 0.5, 1.0)
    """
    methods = [focus] if isinstance(focus, Segmented) else list(focus or ())
    if methods:
        grid = methods[0].sections.grid
    if truth is not None:
        maps = [*(each.in_focus[0] for each in methods), *([] if depth is None else [depth.z_mm])]
        for estimate in maps:
            if estimate.shape != truth.z_mm.shape:
                raise InputError(f"truth: its maps are {truth.z_mm.shape}, the estimates {estimate.shape}")
        if depth is not None and grid is None:
            raise InputError("grid: a depth map without masks is scored with the CameraGrid of its dataset")
    rows: list[dict[str, Any]] = []
    objects: list[dict[str, Any]] = []
    # Methods usually share their sections: what follows from these and the truth alone is computed once.
    for sections in {id(each.sections): each.sections for each in methods}.values():
        pooled = pooled_estimate(sections, section_window_px(sections))
        true = None if truth is None else TrueFocus(sections.planes, truth)
        if truth is not None and sections is methods[0].sections:
            objects = _object_rows(sections, pooled, truth)
        for each in methods:
            if each.sections is sections:
                rows += _plane_rows(each, pooled, true)
    object_rows: list[dict[str, Any]] = []
    if truth is not None:
        object_rows = object_bounds(truth, full_light, methods[0].sections if methods else None)
    bounds = {"objects": object_rows}
    readout = asdict(methods[0].sections.readout) if methods else None
    return Score(tuple(rows), tuple(objects), depth_errors(grid, depth, truth), dataset, bounds, readout)


def _plane_rows(focus: Segmented, pooled: np.ndarray, true: TrueFocus | None) -> list[dict[str, Any]]:
    before, after = _section_entropies(focus, pooled)
    rows: list[dict[str, Any]] = []
    for plane, depth in enumerate(focus.z_mm):
        photons = photon_agreement(focus, true, plane)
        for kind in KINDS:
            names = [] if true is None or kind == "pixel" else true.names_at(plane)
            mask = share = is_free = None
            if true is not None and (kind == "pixel" or true.truth.are_objects_known):
                mask, coverage, ids = true.masks(kind)[plane], true.truth.coverage, true.truth.object_id
                share = None if coverage is None else object_share(mask, ids, coverage)
                is_free = true.is_free(kind, ids, true.blur_px[plane])
            rows.append(
                {
                    "z_mm": float(depth),
                    "method": focus.method,
                    "object": ", ".join(names) or None,
                    "truth": kind,
                    **mask_agreement(focus.in_focus[plane], mask, share, is_free),
                    **photons[kind],
                    "entropy_before": before[plane],
                    "entropy_after": after[plane],
                    "claimed_share": float(focus.in_focus[plane].mean()),
                }
            )
    return rows


def object_share(mask: np.ndarray, object_id: np.ndarray, coverage: np.ndarray) -> np.ndarray:
    """Share of the area of each pixel that a mask (H, W) of objects covers, float64 (H, W).

    `coverage` is the share of each pixel that belongs to the object of its own `object_id`. The rest
    belongs to its neighbours (of eight) of other objects, to each of them equally.
    """
    other_count = np.zeros(mask.shape)
    masked_count = np.zeros(mask.shape)
    ids, inside = np.pad(object_id, 1, mode="edge"), np.pad(mask, 1, mode="edge")
    H, W = mask.shape
    for i, j in np.ndindex(3, 3):
        is_other = ids[i : i + H, j : j + W] != object_id
        other_count += is_other
        masked_count += is_other & inside[i : i + H, j : j + W]
    return coverage * mask + (1 - coverage) * masked_count / np.maximum(other_count, 1)


def _section_entropies(focus: Segmented, pooled: np.ndarray) -> tuple[list[float], list[float]]:
    """Entropy of each section before and after removal, mean over the colours, in bits."""
    maxima = pooled.max(axis=1).max(axis=1)  # ten times faster than max over both axes at once
    before: list[float] = []
    after: list[float] = []
    for plane, mask, maximum in zip(pooled, focus.in_focus, maxima, strict=True):
        colours = range(plane.shape[-1])
        before.append(float(np.mean([entropy_bits(plane[..., c], maximum[c]) for c in colours])))
        after.append(float(np.mean([entropy_bits(plane[..., c] * mask, maximum[c]) for c in colours])))
    return before, after


def _object_rows(sections: Sections, pooled: np.ndarray, truth: Truth) -> list[dict[str, Any]]:
    maxima = pooled.max(axis=1).max(axis=(0, 1))
    rows: list[dict[str, Any]] = []
    for number in sorted(set(truth.names) - truth.unscored):
        region = entropy_region(sections.grid, truth, number, sections.z_mm)
        entropy: dict[str, float | None] = {f"{z:g}": None for z in sections.z_mm}
        if region.any():
            for z, plane in zip(sections.z_mm, pooled, strict=True):
                entropy[f"{z:g}"] = region_entropy_bits(plane, region, maxima)
        rows.append({"name": truth.names[number], "entropy": entropy})
    return rows


def entropy_region(grid: CameraGrid, truth: Truth, number: int, z_mm: np.ndarray) -> np.ndarray:
    """Region (H, W) bool of an object for Table 1: where it is seen, and its blur at any of the planes."""
    from scipy.ndimage import distance_transform_cdt

    mask = truth.object_id == number
    if not mask.any():
        return mask
    blur = max(float(blur_half_extent_px(grid, truth.z_mm[mask], z).mean()) for z in z_mm)
    # What as many dilations by the four neighbours would reach, in one pass.
    distance_px = np.asarray(distance_transform_cdt(~mask, metric="taxicab"))
    return distance_px <= max(1, round(2 * blur))
