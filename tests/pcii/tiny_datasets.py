"""Datasets of 8 x 12 pixels by hand, whose photons tell two made-up methods what to claim."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from twins import unit_grid

from pcii.store import COUNTS, TRUTH, list_files, nested_name, write_arrays_safely, write_manifest
from pcii.types import COUNTS_LABELS, TRUTH_LABELS, PhotonCounts, Sections, Segmented

GRID = unit_grid(2, 2, 8, 12, pitch_mm=(10.0, 10.0))
Z_MM = (1.0, 2.0)  # 10 and 5 px of disparity: 2.5 px of blur at the other's depth
NEAR, FAR = np.s_[1:3, 1:6], np.s_[5:7, 1:6]  # ten pixels each
OWN, NESTED = 50.0, 20.0


def write_dataset(root: Path, seed: int, hits: Mapping[float, int], title: str = "by hand") -> Path:
    """A dataset in whose first view, at each budget, so many of the near object's ten pixels have a photon.

    The largest budget is its own, the others are nested. All pixels of the far object have two. In the last
    view all pixels have one.
    """
    root.mkdir(parents=True)
    own = max(hits)
    for budget, near in hits.items():
        dense = np.zeros(GRID.shape_KLHW, dtype=np.int64)
        dense[1, 1] = 1
        dense[0, 0][FAR] = 2
        first = np.zeros(10, dtype=np.int64)
        first[:near] = 1
        dense[0, 0][NEAR] = first.reshape(2, 5)
        k, l, i, j = np.nonzero(dense)
        part = nested_name(COUNTS, None if budget == own else budget)
        events = {"k": k, "l": l, "i": i, "j": j, "n": dense[k, l, i, j]}
        write_arrays_safely(root / part, events, COUNTS_LABELS)
    z_mm, ids = np.full((8, 12), np.inf), np.zeros((8, 12), dtype=np.int16)
    z_mm[NEAR], ids[NEAR] = 1.0, 1
    z_mm[FAR], ids[FAR] = 2.0, 2
    write_arrays_safely(root / TRUTH, {"z_mm": z_mm, "object_id": ids}, TRUTH_LABELS)
    keys = ("rows", "cols", "pitch_mm", "focal_mm", "pixel_mm", "height", "width")
    nested = [budget for budget in hits if budget != own]
    parts = [TRUTH, *(nested_name(COUNTS, None if budget == own else budget) for budget in hits)]
    manifest = {
        "identity": f"{title}, seed {seed}",
        "title": title,
        "grid": {name: getattr(GRID, name) for name in keys},
        "cfa": None,
        "objects": {"1": "near", "2": "far"},
        "analysis": {"z_mm": list(Z_MM), "z_range_mm": [0.8, 2.5]},
        "recipe": {
            "scene": title,
            "seed": seed,
            "photons": {"scope": "view", "budget": own, "nested": nested},
        },
        "scene": {},
        "files": list_files(root, parts),
    }
    write_manifest(root, manifest)
    return root


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
