"""Wall time of a piece of work, side by side with others in one run."""

import time
from collections.abc import Callable
from statistics import median
from typing import TypeVar

Result = TypeVar("Result")
REPEATS = 5


def timed(work: Callable[[int], Result], repeats: int = REPEATS) -> tuple[float, Result]:
    """Median seconds of some runs, numbered from 1, after one that warms up; and the last result."""
    result, seconds = work(0), []
    for repeat in range(1, repeats + 1):
        del result  # else its memory is asked for anew each time, which may cost more than the work
        start = time.perf_counter()
        result = work(repeat)
        seconds.append(time.perf_counter() - start)
    return median(seconds), result
