"""Outlines of masks with subpixel accuracy, and their agreement."""

import numpy as np

TOLERANCE_PX = 2.0
"""Outlines agree where they are at most this far apart."""


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


def boundary_f(claimed: np.ndarray, true: np.ndarray, true_share: np.ndarray | None = None) -> float:
    """F-measure of the outlines of two masks (H, W): shares of each within `TOLERANCE_PX` of the other.

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
    precision = (KDTree(true_px).query(claimed_px)[0] <= TOLERANCE_PX).mean()
    recall = (KDTree(claimed_px).query(true_px)[0] <= TOLERANCE_PX).mean()
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
