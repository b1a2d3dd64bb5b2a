"""Compilation of loops with Numba, which needs no system library.

Modules of loops are imported where a loop is about to run and not with the package: importing Numba takes
longer than the rest of the package. Compiled code is cached beside these files, or in the user's cache where
that is not writable, so each loop is compiled once per machine. All loops together take more than a minute,
so commands report it (`progress`).
"""

import os

# OpenMP threads that spin while they wait slow down every other program on the machine; threads that sleep
# cost some microseconds per loop. The variable is read at Numba's import; a value set by the user stays.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")

import numba as nb
from numba.core import event

from pcii.base.progress import report_compiling

compiled = nb.njit(parallel=True, nogil=True, cache=True)
"""Decorator of a loop that is run by several threads."""
helper = nb.njit(nogil=True, cache=True)
"""Decorator of a function that compiled loops call within one thread."""


class _CompilingListener(event.Listener):
    """Reports each loop that Numba compiles; loops read from the cache are not reported."""

    def __init__(self) -> None:
        self.loops, self.nested = 0, 0

    def on_start(self, event: event.Event) -> None:
        self.nested += 1
        if self.nested == 1:  # a nested compilation is part of the outer one
            self.loops += 1
            report_compiling(self.loops, running=True)

    def on_end(self, event: event.Event) -> None:
        self.nested -= 1
        if self.nested == 0:
            report_compiling(self.loops, running=False)


event.register("numba:compile", _CompilingListener())


def use_threads(count: int) -> None:
    """Run compiled loops of this process on so many threads, at most as many as Numba has."""
    nb.set_num_threads(min(count, nb.config.NUMBA_NUM_THREADS))  # type: ignore[attr-defined]


def threads() -> int:
    """Number of threads that run a compiled loop."""
    return nb.get_num_threads()
