"""Wall time of pieces of work, side by side in one run."""

import time
from collections.abc import Callable, Mapping, Sequence
from statistics import median
from typing import TypeVar

from benchmarks.results import Value

Name = TypeVar("Name", str, int)
REPEATS = 6
"""Least and largest of six are an interval of their median at 97 %."""


def side_by_side(
    works: Mapping[Name, Callable[[int], object]], repeats: int = REPEATS
) -> dict[Name, list[float]]:
    """Seconds of each work, which take turns: what else the machine does slows all of them alike.

    Each is called with the number of its round; round 0 warms up and is not counted.
    """
    seconds: dict[Name, list[float]] = {name: [] for name in works}
    for number in range(repeats + 1):
        for name, work in works.items():
            start = time.perf_counter()
            work(number)
            if number:
                seconds[name].append(time.perf_counter() - start)
    return seconds


def median_of(samples: Sequence[float], scale: float = 1.0) -> Value:
    """Median of samples times `scale`, and the shortest 95 % interval of it that two of the samples bound.

    It assumes nothing but independence; of fewer than six samples no two bound such an interval.

    >>> median_of([3.0, 1.0, 2.0, 4.0, 6.0, 5.0])
    Value(value=3.5, low=1.0, high=6.0)
    """
    from scipy.stats import binom

    ordered = sorted(scale * sample for sample in samples)
    # The interval misses the median if at most `outside` samples lie on one side of it.
    outside = int(binom.ppf(0.025, len(ordered), 0.5)) - 1
    if outside < 0:
        return Value(median(ordered))
    return Value(median(ordered), ordered[outside], ordered[-1 - outside])


def ratio_of(slower: Sequence[float], faster: Sequence[float], scale: float = 1.0) -> Value:
    """How many times longer the first takes than the second, by rounds of `side_by_side`.

    `scale` is how many times the first would have to be done for one of the second.
    """
    return median_of([scale * a / b for a, b in zip(slower, faster, strict=True)])
