"""Small photon cubes: random bits of cameras in a grid, and the dataset that has them."""

from pathlib import Path
from typing import Any

import numpy as np

import pcii
from pcii.types import CameraGrid

FRAMES = 9


def bits_of(grid: CameraGrid, frames: int = FRAMES, share: float = 0.1) -> np.ndarray:
    """Random bits (K, L, T, H, W), bool."""
    K, L, H, W = grid.shape_KLHW
    return np.random.default_rng(1).random((K, L, frames, H, W)) < share


def counts_of(bits: np.ndarray, grid: CameraGrid, cfa: str | None = None) -> pcii.PhotonCounts:
    """Photon counts with the frame of each."""
    k, l, frame, i, j = np.nonzero(bits)
    ones = np.ones(k.size, int)
    told: dict[str, Any] = {"frames": bits.shape[2], "bits": 1, "frame": frame}
    return pcii.PhotonCounts.from_events(k, l, i, j, ones, grid, cfa=cfa, **told)


def write_cubes(root: Path, bits: np.ndarray, grid: CameraGrid, cfa: str | None = None) -> Path:
    """The export of a dataset of these bits."""
    data = pcii.save_dataset(root / "data", counts_of(bits, grid, cfa), photon_budget=90)
    return pcii.export_dataset(data, "photoncube", root / "cubes")


def packed(bits: np.ndarray) -> np.ndarray:
    """Eight pixels of a row in a byte, the first in the highest bit, written out."""
    padded = np.concatenate([bits, np.zeros((*bits.shape[:-1], -bits.shape[-1] % 8), bool)], axis=-1)
    eights = padded.reshape(*bits.shape[:-1], -1, 8)
    return (eights * [128, 64, 32, 16, 8, 4, 2, 1]).sum(axis=-1).astype(np.uint8)
