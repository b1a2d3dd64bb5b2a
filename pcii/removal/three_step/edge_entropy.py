"""Step 3 of the removal: the entropy (Muniraj et al. 2017, Eq. 9) of the edges of each region.

The paper does not say what the histogram h of a sub-image is of. We take the output of step 2: the share
of the region's edge energy |G|^2 that each pixel has. In focus it is gathered in few strong edges, so
the entropy is low; out of focus the same edges are weak and wide, and what remains is photon noise, which
is the same everywhere (docs/removal.md compares this with grey levels and with the photons themselves).
"""

import numpy as np

from pcii.imaging.watershed_pieces import cheapest_planes

BORDER_BITS = 0.1
"""What must be gained per window along a border between regions of different planes."""


def edge_entropies(edges: np.ndarray, regions: np.ndarray, margin_px: int) -> np.ndarray:
    """Entropy in bits of every region (number, from 1) at every plane, (N + 1, P) float64; row 0 is 0.

    `edges` (P, H, W) is the Roberts magnitude at each plane and `regions` (H, W) the numbers. A region is
    grown by `margin_px`, a square, so that all planes show the same object and the same light. Where a
    plane has no edges it is as disordered as can be: log2 of the number of pixels.
    """
    from scipy.ndimage import find_objects, maximum_filter
    from scipy.special import xlogy

    energy = edges.astype(np.float64) ** 2
    information = xlogy(energy, energy)
    entropies = np.zeros((int(regions.max()) + 1, len(edges)))
    for number, box in enumerate(find_objects(regions), start=1):
        if box is None:  # a tile without light has no region
            continue
        rows, cols = (slice(max(s.start - margin_px, 0), s.stop + margin_px) for s in box)
        grown = np.asarray(maximum_filter(regions[rows, cols] == number, 2 * margin_px + 1), dtype=bool)
        total = energy[:, rows, cols].sum(axis=(1, 2), where=grown)
        own = information[:, rows, cols].sum(axis=(1, 2), where=grown)
        nats = np.log(np.maximum(total, 1e-300)) - own / np.maximum(total, 1e-300)
        entropies[number] = np.where(total > 0, nats, np.log(grown.sum())) / np.log(2)
    return entropies


def planes_of_least_entropy(
    entropies: np.ndarray, regions: np.ndarray, ridges: np.ndarray | None, window_px: int
) -> np.ndarray:
    """The plane (index) in focus of each region, (N + 1,) int64; -1 for number 0.

    A region weighs as many times as it has independent windows of `window_px`. Neighbours across `ridges`
    (H, W) have different planes only if that gains `BORDER_BITS` for each window along their border; with
    None each region has the plane of its own least entropy.
    """
    if ridges is None:
        planes = np.argmin(entropies, axis=1)
        planes[0] = -1
        return planes
    windows = np.bincount(regions.ravel(), minlength=len(entropies)) / window_px**2
    return cheapest_planes(regions, ridges, windows[:, None] * entropies, BORDER_BITS / window_px)
