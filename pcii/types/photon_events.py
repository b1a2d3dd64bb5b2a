"""Photon counts as lists of the pixels that have photons, and single counts with their frames."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pcii.base.errors import InputError
from pcii.base.short_form import ShortForm
from pcii.types.arrays import read_only, whole_counts
from pcii.types.camera_grid import CameraGrid
from pcii.types.readout import Readout


@dataclass(frozen=True, repr=False)
class PhotonEvents(ShortForm):
    """Pixels with photons: camera (k, l), pixel (i, j), `n` photons; five arrays (N,) of integers."""

    k: np.ndarray
    l: np.ndarray
    i: np.ndarray
    j: np.ndarray
    n: np.ndarray

    def _facts(self) -> dict[str, object]:
        return {"events": self.n.size, "photons": int(self.n.sum())}


@dataclass(frozen=True, repr=False)
class FrameEvents:
    """Single counts: camera (k, l), pixel (i, j) and `frame`, from 0; five arrays (N,) of integers."""

    k: np.ndarray
    l: np.ndarray
    i: np.ndarray
    j: np.ndarray
    frame: np.ndarray


def checked_pixels(columns: Mapping[str, np.ndarray], grid: CameraGrid) -> tuple[np.ndarray, ...]:
    """Lists k, l, i, j of cameras and pixels as int32; `InputError` for an index outside the grid."""
    pixels = []
    for (name, values), limit in zip(columns.items(), grid.shape_KLHW, strict=True):
        column = whole_counts(name, np.atleast_1d(values))
        if column.ndim != 1:
            raise InputError(f"{name}: expected a one-dimensional list")
        if column.size and column.max() >= limit:
            raise InputError(f"{name}: index {column.max()} is outside 0 .. {limit - 1}")
        pixels.append(column.astype(np.int32))
    return tuple(pixels)


def events_of(pixels: tuple[np.ndarray, ...], n: np.ndarray) -> PhotonEvents:
    """Events of pixels (k, l, i, j) that are sorted, one event each."""
    k, l, i, j = (read_only(index.astype(np.int32, copy=False)) for index in pixels)
    return PhotonEvents(k, l, i, j, read_only(n))


def sorted_events(pixels: tuple[np.ndarray, ...], n: np.ndarray, grid: CameraGrid) -> PhotonEvents:
    """Events sorted by (k, l, i, j), one per pixel, without zeros: equal counts have equal events."""
    flat = np.ravel_multi_index(pixels, grid.shape_KLHW)
    if n.all() and (np.diff(flat) > 0).all():  # as files and parts of other counts have them
        return events_of(pixels, n)
    occupied, inverse = np.unique(flat, return_inverse=True)
    photons = np.zeros(occupied.size, dtype=np.int64)
    np.add.at(photons, inverse, n)
    occupied, photons = occupied[photons > 0], photons[photons > 0]
    return events_of(np.unravel_index(occupied, grid.shape_KLHW), photons)


def sorted_frames(
    pixels: tuple[np.ndarray, ...], n: np.ndarray, frame: np.ndarray, grid: CameraGrid, readout: Readout
) -> np.ndarray:
    """Frame of each count of pixels that have `n`, in the order of their `sorted_events`, (sum n,) int32.

    Frames of a pixel are in their order. Raises `InputError` for a list of another length, a frame outside
    the exposure, and more counts in one than it holds.
    """
    if frame.shape != (int(n.sum()),):
        raise InputError(f"frame: expected one for each of {int(n.sum())} counts, got {frame.shape}")
    if frame.size and frame.max() >= readout.frames:
        raise InputError(f"frame: {frame.max()} is outside 0 .. {readout.frames - 1}")
    flat = np.ravel_multi_index(pixels, grid.shape_KLHW).repeat(n)
    frame = frame.astype(np.int32)
    step = np.diff(flat)
    if not ((step > 0) | (step == 0) & (np.diff(frame) >= 0)).all():
        order = np.lexsort((frame, flat))
        flat, frame = flat[order], frame[order]
    most = readout.most_per_frame
    if most is not None and most < frame.size:
        again = (flat[most:] == flat[:-most]) & (frame[most:] == frame[:-most])
        if again.any():
            raise InputError(f"frame: a pixel has more counts in frame {frame[most:][again][0]} than {most}")
    return read_only(frame)
