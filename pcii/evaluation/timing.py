"""Wall time of a method without the time of compiling or importing code."""

import sys
import time
from collections.abc import Callable
from typing import TypeVar

Result = TypeVar("Result")
MOST_CALLS = 4
"""One call may import modules, one may compile further loops, one is timed and one is spare. A method that
imports or compiles in every call is timed with that."""


def timed(work: Callable[[], Result]) -> tuple[float, Result]:
    """Seconds of a call of `work()`, and its result.

    A call during which Numba compiled a loop or read one from its cache, or a module was imported, is
    repeated, and the last call counts. Which loops a method needs depends on the data, so a warm-up on other
    data does not suffice.
    """
    from numba.core import event

    left = MOST_CALLS
    while True:
        left -= 1
        known = len(sys.modules)
        # Numba locks its compiler both to compile and to read its cache.
        with event.install_recorder("numba:compiler_lock") as locked:
            start = time.perf_counter()
            result = work()
            seconds = time.perf_counter() - start
        if not left or (not locked.buffer and len(sys.modules) == known):
            return seconds, result
