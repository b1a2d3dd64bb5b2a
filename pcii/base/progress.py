"""Progress of long work, compilation included: bars on a terminal, plain lines in a log."""

import sys
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from types import TracebackType
from typing import TYPE_CHECKING

from pcii.base.plain_text import visible

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

LOG_EVERY_S = 10.0
RECENT_LINES = 6
"""The time left follows from the pace since so many lines of a log ago."""


class Stages(AbstractContextManager["Stages"]):
    """Progress of named stages: bars with time left on a terminal, else a line every ten seconds.

    Call it as stages(name, done, total); a stage ends when done reaches total.
    """

    def __init__(self) -> None:
        self._rich: Progress | None = None
        self._tasks: dict[str, TaskID] = {}
        self._started: dict[str, float] = {}
        self._logged: dict[str, float] = {}
        self._recent: dict[str, deque[tuple[float, int]]] = {}
        self._shown = ExitStack()

    def __enter__(self) -> "Stages":
        self._shown.enter_context(shown_by(self))
        if sys.stderr.isatty() and not is_quiet():
            from rich.console import Console
            from rich.progress import (
                BarColumn,
                MofNCompleteColumn,
                Progress,
                TextColumn,
                TimeElapsedColumn,
                TimeRemainingColumn,
            )
            from rich.table import Column

            self._rich = Progress(
                TextColumn("{task.description}", markup=False, table_column=Column()),  # which wraps
                BarColumn(),
                MofNCompleteColumn(),
                TimeElapsedColumn(),
                TextColumn("left"),
                TimeRemainingColumn(),
                console=Console(stderr=True),
            )
            self._rich.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._shown.close()
        if self._rich is not None:
            self._rich.stop()

    def __call__(self, stage: str, done: int, total: int) -> None:
        if is_quiet():
            return
        stage = visible(stage)
        if self._rich is not None:
            if stage not in self._tasks:
                self._tasks[stage] = self._rich.add_task(stage, total=total)
            self._rich.update(self._tasks[stage], completed=done, total=total)
            return
        now = time.monotonic()
        start = self._started.setdefault(stage, now)
        recent = self._recent.setdefault(stage, deque([(now, done)], RECENT_LINES))
        if done == total or now - self._logged.get(stage, start) >= LOG_EVERY_S:
            self._logged[stage] = now
            # By the pace of the last minute: what an earlier run has finished passes in an instant.
            before, done_before = recent[0]
            new = done - done_before
            left = f", {(now - before) / new * (total - done):.0f} s left" if new > 0 and done < total else ""
            recent.append((now, done))
            print(f"{stage}: {done}/{total}, {now - start:.1f} s{left}", file=sys.stderr, flush=True)

    def compiling(self, loops: int, running: bool) -> None:
        """Report how many loops were compiled, the last of which may be `running`; the total is unknown."""
        if is_quiet():
            return
        if self._rich is not None:
            if COMPILING not in self._tasks:
                self._tasks[COMPILING] = self._rich.add_task(COMPILING, total=None)
            done, total = (loops - 1, None) if running else (loops, loops)
            self._rich.update(self._tasks[COMPILING], completed=done, total=total)
            return
        now = time.monotonic()
        if COMPILING not in self._logged:
            print(COMPILING, file=sys.stderr, flush=True)
        elif not running and now - self._logged[COMPILING] >= LOG_EVERY_S:
            print(f"{COMPILING}: {loops} so far", file=sys.stderr, flush=True)
        else:
            return
        self._logged[COMPILING] = now


COMPILING = "compiling (once per machine)"
_showing: list[Stages] = []
"""Active progress displays; compilation is reported to the last. Empty where `pcii` is used as a library."""
_announced: list[None] = []
"""Not empty once this process, without a display, has announced that loops are compiled."""


@contextmanager
def shown_by(stages: Stages) -> Iterator[None]:
    """Let `stages` report compilation within the block."""
    _showing.append(stages)
    try:
        yield
    finally:
        _showing.remove(stages)


def report_compiling(loops: int, *, running: bool, own: bool) -> None:
    """Report to a running command that loop number `loops` is being compiled (`running`), or has been.

    Where `pcii` is used as a library one line on standard error says so, once, if the loop is its `own`.
    """
    if _showing:
        _showing[-1].compiling(loops, running)
    elif own and not _announced:
        from multiprocessing import parent_process

        _announced.append(None)
        if parent_process() is None:  # else each of many workers would say so
            print(f"pcii: {COMPILING}, which takes up to a minute", file=sys.stderr, flush=True)


_quiet: list[None] = []
"""Not empty within a command that was told to be quiet."""


def is_quiet() -> bool:
    """Whether the command that runs was told to be quiet; false where `pcii` is used as a library."""
    return bool(_quiet)


@contextmanager
def quiet() -> Iterator[None]:
    """Show no progress within the block."""
    _quiet.append(None)
    try:
        yield
    finally:
        _quiet.pop()


def silent(stage: str, done: int, total: int) -> None:
    """Report nothing: the default where progress is optional."""


Report = Callable[[str, int, int], None]
"""Type of a progress callback: report(stage, done, total)."""
