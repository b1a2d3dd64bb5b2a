"""How far photon counts are from the distribution that they ought to have: Poisson with the true rates.

All three are 1 for exact counts. Notation: n counts of R repeats, r the rates that a long rendering gives,
v the variance of these rates, which is no fault of the counts and is taken into account.
"""

from dataclasses import dataclass

import numpy as np

from benchmarks.results import Value, mean_of

TILE_PX = 16
GROUPS = 16
"""Pixels are divided at random into so many groups, whose figures give the intervals."""


@dataclass(frozen=True)
class Rates:
    """Expected photons (V, H, W) of a budget of one photon per view, and their variance."""

    mean: np.ndarray
    variance: np.ndarray


def distances(counts: np.ndarray, rates: Rates, budget: float) -> dict[str, Value]:
    """Distances of counts (R, V, H, W) of at least two repeats from Poisson counts.

    `dispersion`: variance over mean of the repeats, pooled over pixels; noise in the rates makes it larger.
    `tile_chi_square`: of tiles of `TILE_PX`, by degree of freedom, the mean over repeats. `rmse_of_mean`: the
    root mean square error of the mean over repeats, relative to that of exact counts.
    """
    repeats = len(counts)
    expected, variance = budget * rates.mean, budget**2 * rates.variance
    group = np.random.default_rng(0).integers(0, GROUPS, expected.shape).ravel()

    def by_group(values: np.ndarray) -> np.ndarray:
        return np.bincount(group, weights=values.ravel(), minlength=GROUPS)

    light = by_group(counts.mean(axis=0))
    spread = by_group(counts.var(axis=0, ddof=1))
    squares = by_group((counts.mean(axis=0) - expected) ** 2)
    exact = by_group(expected / repeats + variance)
    lit = light > 0
    return {
        "dispersion": mean_of(list(spread[lit] / light[lit])),
        "tile_chi_square": mean_of([_chi_square(one, expected, variance) for one in counts]),
        "rmse_of_mean": mean_of(list(np.sqrt(squares / exact))),
    }


def _chi_square(counts: np.ndarray, expected: np.ndarray, variance: np.ndarray) -> float:
    seen, wanted, doubt = (tile_sums(one.astype(np.float64)) for one in (counts, expected, variance))
    lit = wanted > 0
    return float(((seen - wanted)[lit] ** 2 / (wanted + doubt)[lit]).mean())


def tile_sums(images: np.ndarray) -> np.ndarray:
    """Sums over whole tiles of (V, H, W); what is left over at the ends is not counted."""
    V, H, W = images.shape
    h, w = H // TILE_PX, W // TILE_PX
    whole = images[:, : h * TILE_PX, : w * TILE_PX]
    return whole.reshape(V, h, TILE_PX, w, TILE_PX).sum(axis=(2, 4))
