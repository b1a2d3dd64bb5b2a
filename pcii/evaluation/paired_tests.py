"""Means over seeds with confidence intervals, and paired tests of two methods on the same datasets."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pcii.base.errors import InputError

CONFIDENCE = 0.95
EXACT_UP_TO = 14
"""Up to so many pairs all assignments of signs are computed: 2^14 sums take milliseconds."""
FLIPS = 10_000
"""Random assignments of signs for more pairs."""
ROUNDING = 1e-12
"""Relative difference below which sums are equal but for rounding."""


@dataclass(frozen=True)
class Mean:
    """Mean of `n` values and the 95 % interval of the mean; no interval for fewer than two."""

    n: int
    mean: float
    low: float | None
    high: float | None

    def figures(self) -> dict[str, Any]:
        """As in evaluation.json."""
        interval = None if self.low is None else [self.low, self.high]
        return {"n": self.n, "mean": self.mean, "interval": interval}


@dataclass(frozen=True)
class Difference:
    """Mean difference of paired values, and the p-value of a sign-flip test; `exact` if over all signs."""

    difference: Mean
    p: float
    exact: bool

    @property
    def least_p(self) -> float:
        """The smallest `p` that so many pairs can give, whatever their values."""
        return 2 / 2**self.difference.n if self.exact else 1 / (1 + FLIPS)

    def figures(self) -> dict[str, Any]:
        """As in evaluation.json."""
        tested = {"p": self.p, "least_p": self.least_p, "exact": self.exact}
        return {"difference": self.difference.figures(), **tested}


def mean_interval(values: Sequence[float], bounds: tuple[float, float] = (-np.inf, np.inf)) -> Mean:
    """Mean of values and its 95 % interval by Student's t, clipped to `bounds`.

    Assumes independent, approximately normal values, as means of shares far from 0 and 1 are. One value has
    no interval. Raises `InputError` for none.

    >>> mean = mean_interval([0.8, 0.9, 1.0], bounds=(0.0, 1.0))
    >>> round(mean.low, 3), round(mean.mean, 3), round(mean.high, 3)
    (0.652, 0.9, 1.0)
    """
    mean, half = _mean_and_half(values)
    if half is None:
        return Mean(1, mean, None, None)
    return Mean(len(values), mean, max(mean - half, bounds[0]), min(mean + half, bounds[1]))


def positive_mean_interval(values: Sequence[float]) -> Mean:
    """Mean of values that are never negative, such as times and errors, and its 95 % interval.

    It is Student's interval of the logarithm of the mean, whose standard error is about s / (mean sqrt(n)):
    from mean / r to mean r, r = exp(t s / (mean sqrt(n))). So it never reaches 0, approaches that of
    `mean_interval` for values close together, and is longer above than below if a few large values dominate.
    Values that are all 0 have an interval of width 0. Raises `InputError` for no values, or one below 0.
    """
    if any(value < 0 for value in values):
        raise InputError("values: expected numbers of at least 0")
    mean, half = _mean_and_half(values)
    if half is None:
        return Mean(1, mean, None, None)
    ratio = float(np.exp(half / mean)) if half > 0 else 1.0
    return Mean(len(values), mean, mean / ratio, mean * ratio)


def _mean_and_half(values: Sequence[float]) -> tuple[float, float | None]:
    """Mean and half the length of Student's interval, None for one value."""
    from scipy.special import stdtrit  # scipy.stats takes half a second to import

    x = np.asarray(values, dtype=np.float64)
    if x.ndim != 1 or x.size == 0 or not np.isfinite(x).all():
        raise InputError("values: expected a list of at least one finite number")
    if x.size == 1:
        return float(x[0]), None
    half = stdtrit(x.size - 1, (1 + CONFIDENCE) / 2) * x.std(ddof=1) / np.sqrt(x.size)
    return float(x.mean()), float(half)


def paired_difference(first: Sequence[float], second: Sequence[float], seed: int = 0) -> Difference:
    """`first` minus `second`, value by value on the same datasets, and a sign-flip permutation test.

    Under the null hypothesis both signs of each difference are equally likely. `p` is the share of
    assignments of signs whose mean is at least as far from 0 as the observed one (two-sided): of all 2^n for
    n up to `EXACT_UP_TO`, else of `FLIPS` random ones, drawn from `seed`, and the observed one. So n pairs
    give at least `least_p`. Raises `InputError` for lists of different lengths, or without values.
    """
    if len(first) != len(second):
        raise InputError("first, second: expected values of the same datasets, in the same order")
    x = np.asarray(first, dtype=np.float64) - np.asarray(second, dtype=np.float64)
    observed = mean_interval(x.tolist())
    exact = x.size <= EXACT_UP_TO
    if exact:
        signs = 1 - 2.0 * ((np.arange(1 << x.size)[:, None] >> np.arange(x.size)) & 1)
    else:
        signs = np.random.default_rng(seed).choice((-1.0, 1.0), size=(FLIPS, x.size))
    as_far = np.abs(signs @ x) >= abs(x.sum()) - ROUNDING * np.abs(x).sum()
    p = as_far.mean() if exact else (1 + as_far.sum()) / (1 + FLIPS)
    return Difference(observed, float(p), exact)
