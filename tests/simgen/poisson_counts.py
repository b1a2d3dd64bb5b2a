"""Whether counts are those of a Poisson process of known rate."""

import numpy as np


def has_mean(counts: np.ndarray, rate: float) -> bool:
    """Whether it is that of as many Poisson numbers, within 4 standard errors."""
    return bool(abs(counts.mean() - rate) < 4 * np.sqrt(rate / counts.size))


def is_poisson(counts: np.ndarray, rate: float) -> bool:
    """Whether mean and variance are those of as many Poisson numbers, within 4 standard errors."""
    spread = np.sqrt((rate + 2 * rate**2) / counts.size)
    return has_mean(counts, rate) and bool(abs(counts.var(ddof=1) - rate) < 4 * spread)
