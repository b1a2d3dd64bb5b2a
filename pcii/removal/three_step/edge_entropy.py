"""Step 3 of the three-step removal: the entropy of the edges of each region (Muniraj et al. 2017, Eq. 9).

The paper does not say of which quantity h in Eq. 9 is the histogram. Here h is the share of the region's edge
energy |G|^2 (step 2) in each pixel. In focus the energy is concentrated in few strong edges, so the entropy
is low; out of focus the same edges are weak and wide, and photon noise remains, which is uniform.
docs/experiments/three_step.md compares this with grey levels and with the photons' places.
"""

import numpy as np

from pcii.removal.three_step.watershed_pieces import cheapest_planes

BORDER_BITS = 0.1
"""Least gain in entropy, in bits per window of border, for which neighbouring regions get different
planes."""


def edge_entropies(edges: np.ndarray, regions: np.ndarray, margin_px: int) -> np.ndarray:
    """Entropy in bits of every region (number, from 1) at every plane, (N + 1, P) float64; row 0 is 0.

    `edges` (P, H, W) is the Roberts magnitude at each plane and `regions` (H, W) the numbers. A region is
    dilated by a square of half-width `margin_px`, so that it has the blurred object at all planes, too. A
    region without edges at a plane has the largest possible entropy, log2 of its number of pixels.

    >>> sharp, blurred, none = [[1.0, 0.0], [0.0, 0.0]], [[1.0, 1.0], [1.0, 1.0]], [[0.0, 0.0], [0.0, 0.0]]
    >>> edges = np.array([sharp, blurred, none])
    >>> edge_entropies(edges, np.ones((2, 2), dtype=int), margin_px=0)[1].tolist()
    [0.0, 2.0, 2.0]
    """
    from scipy.ndimage import find_objects, maximum_filter
    from scipy.special import xlogy

    energy = edges.astype(np.float64) ** 2
    information = xlogy(energy, energy)
    entropies = np.zeros((int(regions.max()) + 1, len(edges)))
    for number, box in enumerate(find_objects(regions), start=1):
        if box is None:  # a square tile without light has no region
            continue
        rows, cols = (slice(max(s.start - margin_px, 0), s.stop + margin_px) for s in box)
        grown = np.asarray(maximum_filter(regions[rows, cols] == number, 2 * margin_px + 1), dtype=bool)
        total = energy[:, rows, cols].sum(axis=(1, 2), where=grown)
        weighted = information[:, rows, cols].sum(axis=(1, 2), where=grown)
        nats = np.log(np.maximum(total, 1e-300)) - weighted / np.maximum(total, 1e-300)
        entropies[number] = np.where(total > 0, nats, np.log(grown.sum())) / np.log(2)
    return entropies


def planes_of_least_entropy(
    entropies: np.ndarray, regions: np.ndarray, ridges: np.ndarray | None, window_px: int
) -> np.ndarray:
    """Index of the plane at which each region is in focus, (N + 1,) int64; -1 for number 0.

    Minimises the sum over regions of entropy times independent windows of `window_px`, plus `BORDER_BITS` for
    each window of border, along the `ridges` (H, W), between regions of different planes. Without `ridges`
    each region has the plane of its least entropy.
    """
    if ridges is None:
        planes = np.argmin(entropies, axis=1)
        planes[0] = -1
        return planes
    windows = np.bincount(regions.ravel(), minlength=len(entropies)) / window_px**2
    return cheapest_planes(regions, ridges, windows[:, None] * entropies, BORDER_BITS / window_px)
