"""Datasets of 8 x 12 pixels by hand, whose photons tell two made-up methods what to claim."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from stored_datasets import rewrite_manifest
from twins import unit_grid

from pcii.store import COUNTS, TRUTH, list_files, nested_name, save_dataset, write_counts
from pcii.types import PhotonCounts, Sections, Segmented, Truth

GRID = unit_grid(2, 2, 8, 12, pitch_mm=(10.0, 10.0))
Z_MM = (1.0, 2.0)  # 10 and 5 px of disparity: 2.5 px of blur at the other's depth
NEAR, FAR = np.s_[1:3, 1:6], np.s_[5:7, 1:6]  # ten pixels each
OWN, NESTED = 50.0, 20.0


def write_dataset(root: Path, seed: int, hits: Mapping[float, int], title: str = "by hand") -> Path:
    """A dataset in whose first view, at each budget, so many of the near object's ten pixels have a photon.

    The largest budget is its own, the others are nested. All pixels of the far object have two. In the last
    view all pixels have one.
    """
    own, *nested = sorted(hits, reverse=True)
    z_mm, ids = np.full((8, 12), np.inf), np.zeros((8, 12), dtype=np.int16)
    z_mm[NEAR], ids[NEAR] = 1.0, 1
    z_mm[FAR], ids[FAR] = 2.0, 2
    truth = Truth(z_mm, ids, {1: "near", 2: "far"})
    save_dataset(root, counts_of(hits[own]), truth, title=title, z_mm=Z_MM, z_range_mm=(0.8, 2.5))
    for budget in nested:
        write_counts(root / nested_name(COUNTS, budget), counts_of(hits[budget]))
    photons = {"scope": "view", "budget": own, "nested": nested}
    files = list_files(root, [TRUTH, COUNTS, *(nested_name(COUNTS, budget) for budget in nested)])
    recipe = {"scene": title, "seed": seed, "photons": photons}
    rewrite_manifest(root, identity=f"{title}, seed {seed}", recipe=recipe, scene={}, files=files)
    return root


def counts_of(near: int) -> PhotonCounts:
    """Photons of the two views, of which so many are of the near object."""
    dense = np.zeros(GRID.shape_KLHW, dtype=np.int64)
    dense[1, 1] = 1
    dense[0, 0][FAR] = 2
    dense[0, 0][NEAR] = (np.arange(10) < near).reshape(2, 5)
    k, l, i, j = np.nonzero(dense)
    return PhotonCounts.from_events(k, l, i, j, dense[k, l, i, j], GRID)


def by_count(counts: PhotonCounts, sections: Sections) -> Segmented:
    """Claims at the plane p the pixels of the first view that have p + 1 photons."""
    first = counts.view(0, 0)
    masks = np.stack([first == plane + 1 for plane in range(len(sections.planes))])
    return Segmented(masks, "by count", sections)


def two_rows(_: PhotonCounts, sections: Sections) -> Segmented:
    """Claims at both planes the near object's two rows from edge to edge: 24 pixels."""
    masks = np.zeros((len(sections.planes), 8, 12), dtype=bool)
    masks[:, 1:3] = True
    return Segmented(masks, "two rows", sections)
