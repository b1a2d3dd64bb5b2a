"""Photon events, camera grid and truth in one NumPy archive."""

from dataclasses import asdict
from pathlib import Path

import numpy as np

from pcii.core.truth import OPTIONAL_MAPS, Truth
from pcii.io.dataset import Dataset

ARCHIVE = "events.npz"


def write_events(dataset: Dataset, folder: Path) -> None:
    """Write `events.npz`, whose arrays need no pickle.

    `k`, `l`, `i`, `j`, `n` (events,); `frames`, `bits` and `frame` (photons,) of a camera that has frames, if
    they are known; each field of the `CameraGrid` by its name; `cfa`, "" for monochrome.
    Where known, `analysis_z_mm` (planes,), `analysis_z_range_mm` (near, far) and `photon_budget`; and
    `truth_...` (H, W) maps of the virtual centre with `object_keys` and `object_names`, and
    `photon_object_id`, `photon_z_mm` (photons,), photon by photon in the events' order.
    """
    events = dataset.counts.events
    arrays = {name: getattr(events, name) for name in "klijn"}
    arrays |= {name: np.asarray(value) for name, value in asdict(dataset.grid).items()}
    arrays["cfa"] = np.asarray(dataset.cfa or "")
    counted = dataset.counts.readout
    if not counted.is_plain:
        arrays |= {name: np.asarray(value) for name, value in asdict(counted).items() if value is not None}
    if dataset.counts.frame is not None:
        arrays["frame"] = dataset.counts.frame
    told = {f"analysis_{name}": dataset.analysis.get(name) for name in ("z_mm", "z_range_mm")}
    told["photon_budget"] = dataset.photon_budget
    arrays |= {name: np.asarray(value) for name, value in told.items() if value}
    if dataset.truth is not None:
        arrays |= _truth_arrays(dataset.truth)
    np.savez_compressed(folder / ARCHIVE, **arrays)


def _truth_arrays(truth: Truth) -> dict[str, np.ndarray]:
    maps = {name: getattr(truth, name) for name in ("z_mm", "object_id", *OPTIONAL_MAPS)}
    arrays = {f"truth_{name}": values for name, values in maps.items() if values is not None}
    arrays["object_keys"] = np.array(list(truth.names), dtype=np.int64)
    arrays["object_names"] = np.array(list(truth.names.values()), dtype=np.str_)
    if truth.photons is not None:
        arrays["photon_object_id"] = truth.photons.object_id
        arrays["photon_z_mm"] = truth.photons.z_mm
    return arrays
