"""Evenly spaced numbers among measured ones, a few of which may be wrong."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Lattice:
    """Numbers `origin` + `step` i for i from 0 to `count` - 1; the step of a single one is 0."""

    origin: float
    step: float
    count: int

    def places(self, values: np.ndarray) -> np.ndarray:
        """The number i, (N,) int, whose place is nearest to each value."""
        if self.count == 1:
            return np.zeros(len(values), np.int64)
        return np.clip(np.rint((values - self.origin) / self.step), 0, self.count - 1).astype(np.int64)

    def off(self, values: np.ndarray) -> np.ndarray:
        """How far each value is from the nearest place."""
        return values - (self.origin + self.step * self.places(values))


def lattice_of(values: np.ndarray, apart: float) -> Lattice:
    """The lattice of values (N,), of which those that are closer than `apart` are of one place.

    Places with less than half as many values as the fullest one are left out of the fit, so that few values
    that are wrong move no other.
    """
    centres = _centres(values, apart)
    gaps = np.diff(centres)
    if not gaps.size:
        return Lattice(float(centres[0]), 0.0, 1)
    usual = np.quantile(gaps, 0.5, method="lower")
    number = np.concatenate([[0.0], np.cumsum(np.maximum(np.rint(gaps / usual), 1))])
    origin, step = line_through(number, centres)
    return Lattice(origin, step, int(number[-1]) + 1)


def line_through(x: np.ndarray, y: np.ndarray) -> tuple[float, float]:
    """Value at x = 0 and slope of a line: medians over all pairs of points (Theil 1950, Sen 1968).

    It stays as it is if less than 29 % of the points are wrong. The x, at least two, all differ.

    >>> line_through(np.arange(5.0), np.array([1.0, 3.0, 5.0, 70.0, 9.0]))
    (1.0, 2.0)
    """
    first, second = np.triu_indices(len(x), 1)
    slope = float(np.median((y[second] - y[first]) / (x[second] - x[first])))
    return float(np.median(y - slope * x)), slope


def _centres(values: np.ndarray, apart: float) -> np.ndarray:
    """Medians of the groups of values, in their order, without those that have few members."""
    ordered = np.sort(values)
    groups = np.split(ordered, np.flatnonzero(np.diff(ordered) > apart) + 1)
    fullest = max(map(len, groups))
    return np.array([np.median(group) for group in groups if 2 * len(group) >= fullest])
