"""Progress of long work, compilation included: bars on a terminal, plain lines in a log."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from typing import TYPE_CHECKING

from pcii.base.plain_text import visible

if TYPE_CHECKING:
    from rich.progress import Progress, Task

Report = Callable[[str, int, int], None]
"""Type of a progress callback: report(stage, done, total)."""
LOG_EVERY_S = 10.0
PACE_OF_S = 60.0
"""The time left follows from the pace of so many seconds: what an earlier run has finished passes at once."""
COMPILING = "compiling (once per machine)"


def silent(stage: str, done: int, total: int) -> None:
    """Report nothing: the default where progress is optional."""


class Stages(AbstractContextManager["Stages"]):
    """Progress of named stages: bars with time left on a terminal, else a line every ten seconds.

    Call it as stages(name, done, total); a stage ends when done reaches total. Work that goes on after that
    is a stage of its own, which is called with 0 when it begins.
    """

    def __init__(self) -> None:
        self.has_bars = False
        self._progress: Progress | None = None
        self._tasks: dict[str, Task] = {}
        self._logged: dict[str, float] = {}
        self._shown = ExitStack()

    def __enter__(self) -> "Stages":
        self._shown.enter_context(shown_by(self))
        self.has_bars = sys.stderr.isatty() and not is_quiet()
        return self

    def __exit__(self, *fault: object) -> None:
        self._shown.close()
        if self._progress is not None:
            self._progress.stop()

    def __call__(self, stage: str, done: int, total: int | None) -> None:
        if is_quiet():
            return
        stage, now = visible(stage), time.monotonic()
        goes_on = bool(self._tasks) and all(task.finished for task in self._tasks.values())
        is_new = stage not in self._tasks
        task, logged = self._updated(stage, done, total), self._logged.setdefault(stage, now)
        if self.has_bars:
            return
        if done == total or now - logged >= LOG_EVERY_S or (is_new and goes_on):
            self._logged[stage] = now
            seconds_left = None if task.finished else task.time_remaining
            left = "" if seconds_left is None else f", {seconds_left:.0f} s left"
            line = f"{stage}: {done}/{total}, {task.elapsed or 0:.1f} s{left}"
            print(line, file=sys.stderr, flush=True)

    def _updated(self, stage: str, done: int, total: int | None) -> "Task":
        """The task of Rich for a stage, brought up to date; bars are shown from the first one on."""
        if self._progress is None:
            from rich import progress as rich
            from rich.console import Console
            from rich.table import Column

            self._progress = rich.Progress(
                rich.TextColumn("{task.description}", markup=False, table_column=Column()),  # which wraps
                rich.BarColumn(),
                rich.MofNCompleteColumn(),
                rich.TimeElapsedColumn(),
                rich.TextColumn("left"),
                rich.TimeRemainingColumn(),
                console=Console(stderr=True),
                disable=not self.has_bars,
                speed_estimate_period=PACE_OF_S,
                get_time=lambda: time.monotonic(),
            )
            self._progress.start()
        if stage not in self._tasks:
            number = self._progress.add_task(stage, total=total)
            self._tasks[stage] = next(task for task in self._progress.tasks if task.id == number)
        task = self._tasks[stage]
        self._progress.update(task.id, completed=done, total=total)
        return task


_showing: list[Stages] = []
"""Active progress displays; compilation is reported to the last. Empty where `pcii` is used as a library."""
_has_announced = False
"""Whether this process has announced, without bars, that loops are compiled."""
_quiet: list[None] = []
"""Not empty within a command that was told to be quiet."""


@contextmanager
def shown_by(stages: Stages) -> Iterator[None]:
    """Let `stages` report compilation within the block."""
    _showing.append(stages)
    try:
        yield
    finally:
        _showing.remove(stages)


def report_compiling(loops: int, *, running: bool, own: bool) -> None:
    """Report that loop number `loops` is being compiled (`running`), or has been.

    It is a stage where a command shows bars. Else one line on standard error says so, once; where `pcii` is
    used as a library only if the loop is its `own`.
    """
    global _has_announced
    from multiprocessing import parent_process

    if _showing and _showing[-1].has_bars:
        _showing[-1](COMPILING, loops - running, None if running else loops)
    elif (_showing or own) and not _has_announced and not is_quiet():
        _has_announced = True
        if parent_process() is None:  # else each of many workers would say so
            print(f"{COMPILING}, which takes up to a minute", file=sys.stderr, flush=True)


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
