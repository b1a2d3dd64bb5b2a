"""How loops are compiled: with Numba, which needs no system library.

Modules of loops are imported where a loop is about to run and not with the package: loading the compiler
takes longer than all else. Compiled code is kept beside these files, or in the user's cache where that is
not writable, so each loop is compiled once per machine. That takes a minute and more for all, so commands
report it (`progress`).
"""

import os

# Threads that spin while they wait slow everything down where other programs use the machine; asleep they
# cost some microseconds a loop. It is read when the compiler is loaded; who has set it is heard.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")

import numba as nb
from numba.core import event

from pcii.base.progress import report_compiling

compiled = nb.njit(parallel=True, nogil=True, cache=True)
helper = nb.njit(nogil=True, cache=True)
"""For what compiled loops call: one thread's part."""


class _CompilingListener(event.Listener):
    """Numba calls it for each loop that it compiles, not for those that it finds compiled."""

    def __init__(self) -> None:
        self.loops, self.nested = 0, 0

    def on_start(self, event: event.Event) -> None:
        self.nested += 1
        if self.nested == 1:  # else it is part of another
            self.loops += 1
            report_compiling(self.loops, running=True)

    def on_end(self, event: event.Event) -> None:
        self.nested -= 1
        if self.nested == 0:
            report_compiling(self.loops, running=False)


event.register("numba:compile", _CompilingListener())


def threads() -> int:
    """How many a loop is shared among."""
    return nb.get_num_threads()
