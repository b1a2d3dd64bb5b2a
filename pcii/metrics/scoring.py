"""Scores against the truth: how masks, their outlines and photons agree with it, entropies, and depth."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from pcii.base import InputError
from pcii.metrics.depth_accuracy import depth_errors, object_bounds
from pcii.metrics.true_masks import FOCUS_TOLERANCE_PX, KINDS, Kind, TrueFocus, entropy_region
from pcii.sections import (
    entropy_bits,
    pooled_estimate,
    pooled_samples,
    reconstruct,
    region_entropy_bits,
    section_window_px,
)
from pcii.types import (
    CameraGrid,
    DepthMap,
    PhotonCounts,
    PhotonTruth,
    Score,
    Sections,
    Segmented,
    Truth,
    blur_half_extent_px,
)

OUTLINE_TOLERANCE_PX = 2.0
"""Outlines agree where they are at most this far apart."""
JACKKNIFE_GROUPS = 10
"""Intervals of so few pseudo-values are 15 % longer than those of many, and take a fraction of the time."""
MAX_JACKKNIFE_EVENTS = 5_000_000
"""With more pixels that have photons, intervals are narrower than the digits that are shown."""

Row = dict[str, float | None]


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

    `planes` has a row for each method, plane and kind of truth, by object and by pixel (`TrueFocus`), of
    `mask_agreement`, photons, and Eq. 9 of the section before and after removal, in bits. `objects` is
    Table 1: the entropy at each plane of the region of each object that is scored, which includes its blur at
    the other planes. `depth` is `depth_errors`, `bounds` is `object_bounds`, by textures in `full_light`, the
    sections of the radiance (Eq. 2). docs/scores.md has every key.

    A depth map without masks needs `grid`, the cameras. Scores without their truth are None. Raises
    `InputError` if shapes differ or the grid is missing.
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
    first = methods[0].sections if methods else None
    bounds = {"objects": [] if truth is None else object_bounds(truth, full_light, first)}
    readout = None if first is None else asdict(first.readout)
    return Score(tuple(rows), tuple(objects), depth_errors(grid, depth, truth), dataset, bounds, readout)


def _plane_rows(focus: Segmented, pooled: np.ndarray, true: TrueFocus | None) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = []
    maxima = pooled.max(axis=1).max(axis=1)  # ten times faster than max over both axes at once
    for plane, depth in enumerate(focus.z_mm):
        removed = pooled[plane] * focus.in_focus[plane][..., None]
        before, after = (_mean_entropy_bits(each, maxima[plane]) for each in (pooled[plane], removed))
        photons = _photon_agreement(focus, true, plane)
        for kind in KINDS:
            names: list[str] = []
            if true is not None and kind == "object":
                names = [true.truth.names[number] for number, at in true.plane_of.items() if at == plane]
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
                    "entropy_before": before,
                    "entropy_after": after,
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


def _mean_entropy_bits(section_HWC: np.ndarray, maxima: np.ndarray) -> float:
    """Eq. 9, mean over the colours."""
    return float(np.mean([entropy_bits(section_HWC[..., c], top) for c, top in enumerate(maxima)]))


def _scored_regions(sections: Sections, truth: Truth) -> list[tuple[str, np.ndarray]]:
    """The name and the region (H, W) of each object that is scored, in which its entropies are."""
    numbers = sorted(set(truth.names) - truth.unscored)
    regions = (entropy_region(sections.grid, truth, number, sections.z_mm) for number in numbers)
    return [(truth.names[number], region) for number, region in zip(numbers, regions, strict=True)]


def _object_rows(sections: Sections, pooled: np.ndarray, truth: Truth) -> list[dict[str, Any]]:
    maxima = pooled.max(axis=1).max(axis=(0, 1))
    rows: list[dict[str, Any]] = []
    for name, region in _scored_regions(sections, truth):
        entropy: dict[str, float | None] = {f"{z:g}": None for z in sections.z_mm}
        if region.any():
            for z, plane in zip(sections.z_mm, pooled, strict=True):
                entropy[f"{z:g}"] = region_entropy_bits(plane, region, maxima)
        rows.append({"name": name, "entropy": entropy})
    return rows


def entropy_half_widths(counts: PhotonCounts, sections: Sections, truth: Truth) -> list[dict[str, float]]:
    """Half the 95 % interval of each entropy in `Score.objects`, in bits, by depth spelled as there.

    A jackknife over photons (Quenouille 1956; Tukey 1958): every photon is in one of G random groups. With H
    the entropy of all photons and H_g that of all but group g, the pseudo-values G H - (G - 1) H_g have about
    the mean H, and their interval by Student's t is that of H over draws of the photons. Its variance is
    rather too large than too small (Efron and Stein 1981). Objects that are not seen have none; more than
    `MAX_JACKKNIFE_EVENTS` events, or fewer than G photons, give an empty list. `sections` are of `counts`.
    """
    from scipy.stats import t

    G = JACKKNIFE_GROUPS
    if counts.total < G or counts.events.n.size > MAX_JACKKNIFE_EVENTS:
        return []
    regions = [region for _, region in _scored_regions(sections, truth)]
    window_px = section_window_px(sections)
    samples = pooled_samples(sections, window_px)

    def entropies(counts_ZHWC: np.ndarray) -> np.ndarray:
        """Entropies (objects, planes) of Eq. 9, as `score` computes them."""
        stack = Sections(sections.planes, counts_ZHWC, sections.coverage)
        pooled = pooled_estimate(stack, window_px, samples)
        tops = pooled.max(axis=(0, 1, 2))
        return np.array([[region_entropy_bits(plane, each, tops) for plane in pooled] for each in regions])

    groups = (reconstruct(group, sections.planes).counts for group in _photon_groups(counts))
    without_group = [entropies(sections.counts - group) for group in groups]
    pseudo_values = G * entropies(sections.counts) - (G - 1) * np.stack(without_group)
    half_widths = t.ppf(0.975, G - 1) * pseudo_values.std(axis=0, ddof=1) / np.sqrt(G)
    depths = [f"{z:g}" for z in sections.z_mm]
    return [
        dict(zip(depths, widths, strict=True)) if region.any() else {}
        for region, widths in zip(regions, half_widths.tolist(), strict=True)
    ]


def _photon_groups(counts: PhotonCounts) -> Iterator[PhotonCounts]:
    """The photons in `JACKKNIFE_GROUPS` groups, the same whenever this is called."""
    rng, events = np.random.default_rng(0), counts.events
    remaining = events.n.copy()
    for group in range(JACKKNIFE_GROUPS):
        n = rng.binomial(remaining, 1 / (JACKKNIFE_GROUPS - group))
        remaining -= n
        places = (axis[n > 0] for axis in (events.k, events.l, events.i, events.j, n))
        yield PhotonCounts.from_events(*places, grid=counts.grid, cfa=counts.cfa)


def mask_agreement(
    claimed: np.ndarray,
    true: np.ndarray | None,
    true_share: np.ndarray | None = None,
    is_free: np.ndarray | None = None,
) -> dict[str, Any]:
    """IoU, precision, recall, F1 and boundary F of two masks (H, W) bool, and what is claimed falsely.

    `true_share` (H, W) is the true share of each pixel's area, where that is known. Pixels `is_free` (H, W)
    count as if they were not claimed. `everything` is the IoU and the false share of whoever claims the whole
    film. What has nothing to be a share of is None, as all are without truth.

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


def _photon_agreement(focus: Segmented, true: TrueFocus | None, plane: int) -> dict[Kind, Row]:
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
