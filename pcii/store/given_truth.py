"""What a dataset that is written is given of truth and words: checked, and as it is stored."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from pcii.base.errors import InputError
from pcii.types.photon_counts import PhotonCounts
from pcii.types.truth import OPTIONAL_MAPS, PhotonTruth, Truth

LARGEST_ID = 10**9 - 1


def check_texts(texts: Mapping[str, object]) -> None:
    """Raise `InputError` for a value that is neither text nor None."""
    for name, text in texts.items():
        if text is not None and not isinstance(text, str):
            raise InputError(f"{name}: expected text, got {type(text).__name__}")


def check_truth(truth: object, images: Any) -> None:
    """Raise `InputError` unless the truth is of the images' size and can be stored."""
    if not isinstance(truth, Truth):
        raise InputError(f"truth: expected Truth, got {type(truth).__name__}")
    size = images.grid.height, images.grid.width
    if truth.z_mm.shape != size:
        raise InputError(f"truth: expected maps of {size}, as the images, got {truth.z_mm.shape}")
    if truth.z_mm.dtype.kind not in "fiu" or truth.object_id.dtype.kind not in "iu":
        raise InputError("truth: expected depths that are real and object ids that are whole numbers")
    for key, name in truth.names.items():
        whole = isinstance(key, int | np.integer) and not isinstance(key, bool) and abs(key) <= LARGEST_ID
        if not whole or not isinstance(name, str):
            raise InputError(f"truth: names: expected text by object id up to {LARGEST_ID}, got {key!r}")


def checked_depths(view_z_mm: object, images: Any) -> np.ndarray:
    """True depths of every view as float32; `InputError` unless they are of the images, and depths."""
    shape, maps = images.grid.shape_KLHW, np.asarray(view_z_mm)
    if maps.shape != shape or maps.dtype.kind not in "fiu":
        raise InputError(f"view_z_mm: expected real depths of {shape}, as the images, got {maps.shape}")
    if not (maps > 0).all():
        raise InputError("view_z_mm: true depths are above 0 mm and never NaN; a miss is +inf")
    return maps.astype(np.float32)


def stored_maps(truth: Truth) -> dict[str, np.ndarray]:
    """The maps of the virtual centre as they are stored."""
    maps = {"z_mm": as_stored(truth.z_mm), "object_id": truth.object_id.astype(np.int32)}
    for name in OPTIONAL_MAPS:
        if getattr(truth, name) is not None:
            maps[name] = getattr(truth, name)
    return maps


def as_stored(z_mm: np.ndarray) -> np.ndarray:
    """Depths as float32, if they are that already, else as float64."""
    return z_mm if z_mm.dtype == np.float32 else z_mm.astype(np.float64)


def check_origins(photons: PhotonTruth, counts: PhotonCounts | None) -> None:
    """Raise `InputError` unless the origins are those of the counts, photon by photon."""
    if counts is None:
        raise InputError("truth: photons: there are no photon counts that they belong to")
    events = counts.events
    for name in "klij":
        if not np.array_equal(getattr(photons, name), getattr(events, name).repeat(events.n)):
            raise InputError("truth: photons: not those of the counts, in the order of their events")
