"""Means over seeds with their uncertainty, and whether two methods differ on the same datasets."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pcii.base.errors import InputError

CONFIDENCE = 0.95
EXACT_UP_TO = 14
"""With so many differences all their signs are tried: 2^14 sums take milliseconds."""
FLIPS = 10_000
ROUNDING = 1e-12
"""Sums that differ by less than this share of the greatest are equal but for rounding."""


@dataclass(frozen=True)
class Mean:
    """Mean of `n` values and the 95 % interval of the mean; no interval for fewer than two."""

    n: int
    mean: float
    low: float | None
    high: float | None


@dataclass(frozen=True)
class Difference:
    """Mean difference of paired values, and how likely one as large is if signs are chance."""

    difference: Mean
    p: float
    exact: bool


def mean_interval(values: Sequence[float], bounds: tuple[float, float] = (-np.inf, np.inf)) -> Mean:
    """Mean of values and its 95 % interval by Student's t, clipped to `bounds`.

    The values are taken as independent and about normal, which means of shares far from 0 and 1 are.
    One value has no interval. Raises `InputError` for none.
    """
    mean, half = _mean_and_half(values)
    if half is None:
        return Mean(1, mean, None, None)
    return Mean(len(values), mean, max(mean - half, bounds[0]), min(mean + half, bounds[1]))


def positive_mean_interval(values: Sequence[float]) -> Mean:
    """Mean of values that are never negative, such as times and errors, and its 95 % interval.

    It is Student's interval of the logarithm of the mean, whose standard error is about s / (mean sqrt(n)):
    from mean / r to mean r, r = exp(t s / (mean sqrt(n))). So it never reaches 0, is that of
    `mean_interval` where the values lie close together, and is longer above than below where few large ones
    make the mean. Values that are all 0 have an interval without width. Raises `InputError` for none, or
    one below 0.
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
    from scipy.stats import t

    x = np.asarray(values, dtype=np.float64)
    if x.ndim != 1 or x.size == 0 or not np.isfinite(x).all():
        raise InputError("values: expected a list of at least one finite number")
    if x.size == 1:
        return float(x[0]), None
    return float(x.mean()), float(t.ppf((1 + CONFIDENCE) / 2, x.size - 1) * x.std(ddof=1) / np.sqrt(x.size))


def paired_difference(first: Sequence[float], second: Sequence[float], seed: int = 0) -> Difference:
    """`first` minus `second`, value by value on the same datasets, and a sign-flip permutation test.

    If neither method is better each difference is as likely with the other sign. `p` is the share of all
    assignments of signs whose mean is as far from 0 as the one found (two-sided): of all 2^n for n of at
    most `EXACT_UP_TO`, else of `FLIPS` random ones and the one found. So n pairs cannot give less
    than 2 / 2^n. Raises `InputError` for lists of different lengths, or without values.
    """
    if len(first) != len(second):
        raise InputError("first, second: expected values of the same datasets, in the same order")
    x = np.asarray(first, dtype=np.float64) - np.asarray(second, dtype=np.float64)
    found = mean_interval(x.tolist())
    exact = x.size <= EXACT_UP_TO
    if exact:
        signs = 1 - 2.0 * ((np.arange(1 << x.size)[:, None] >> np.arange(x.size)) & 1)
    else:
        signs = np.random.default_rng(seed).choice((-1.0, 1.0), size=(FLIPS, x.size))
    as_far = np.abs(signs @ x) >= abs(x.sum()) - ROUNDING * np.abs(x).sum()
    p = as_far.mean() if exact else (1 + as_far.sum()) / (1 + FLIPS)
    return Difference(found, float(p), exact)
