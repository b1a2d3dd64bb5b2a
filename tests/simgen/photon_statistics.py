"""Counts of a photon table, and whether they are Poisson numbers."""

import numpy as np
from scipy import stats

from pcii.types import CameraGrid
from simgen.sensor import PhotonTable


def counted(photons: PhotonTable, grid: CameraGrid) -> np.ndarray:
    """Counts per pixel, (K, L, H, W)."""
    counts = np.zeros(grid.shape_KLHW, dtype=np.int64)
    np.add.at(counts, (photons.k, photons.l, photons.i, photons.j), photons.n)
    return counts


def has_mean(counts: np.ndarray, rate: float) -> bool:
    """Whether it is that of as many Poisson numbers, within 4 standard errors."""
    return bool(abs(counts.mean() - rate) < 4 * np.sqrt(rate / counts.size))


def is_poisson(counts: np.ndarray, rate: float) -> bool:
    """Whether mean and variance are those of as many Poisson numbers, within 4 standard errors."""
    spread = np.sqrt((rate + 2 * rate**2) / counts.size)
    return has_mean(counts, rate) and bool(abs(counts.var(ddof=1) - rate) < 4 * spread)


def p_value(counts: np.ndarray, expected: np.ndarray) -> float:
    """Of chi-square of Poisson numbers with these means."""
    return float(stats.chi2.sf(((counts - expected) ** 2 / expected).sum(), counts.size))
