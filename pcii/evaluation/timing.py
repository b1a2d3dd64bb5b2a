"""Wall time of a method alone: no call counts in which code was compiled or loaded."""

import sys
import time
from collections.abc import Callable
from typing import TypeVar

Found = TypeVar("Found")
MOST_CALLS = 4
"""One may import, the next come to loops that the first did not, one is timed, and one is to spare; code
that loads something in every call is timed with it."""


def timed(work: Callable[[], Found]) -> tuple[float, Found]:
    """Seconds that `work()` takes, and what it returns.

    A call during which Numba compiled a loop or read a compiled one from its cache, or a module was
    imported, is made again and the later one told. Which loops a method needs depends on the data, so it is
    not enough to warm it up on other data.
    """
    from numba.core import event

    left = MOST_CALLS
    while True:
        left -= 1
        known = len(sys.modules)
        # The lock of the compiler is taken for both; the event of compilation tells nothing of the cache.
        with event.install_recorder("numba:compiler_lock") as locked:
            start = time.perf_counter()
            found = work()
            seconds = time.perf_counter() - start
        if not left or (not locked.buffer and len(sys.modules) == known):
            return seconds, found
