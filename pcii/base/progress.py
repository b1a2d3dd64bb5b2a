"""Progress of long work: bars on a terminal, plain lines in a log."""

import sys
import threading
import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING

from pcii.base.plain_text import visible

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

Report = Callable[[str, int, int], None]
"""Type of a progress callback: report(stage, done, total)."""
LOG_EVERY_S = 10.0


def silent(stage: str, done: int, total: int) -> None:
    """Report nothing: the default where progress is optional."""


class Stages(AbstractContextManager["Stages"]):
    """Progress of named stages: bars on a terminal, else a line every ten seconds, with the time left.

    Call it as stages(name, done, total); a stage ends when done reaches total, and begins anew when less is
    done than before.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()  # steps of one analysis report from two threads
        self._bars: Progress | None = None
        self._tasks: dict[str, TaskID] = {}
        self._begun: dict[str, float] = {}
        self._done: dict[str, int] = {}
        self._logged: dict[str, float] = {}

    def __enter__(self) -> "Stages":
        if sys.stderr.isatty():
            from rich import progress as rich
            from rich.console import Console

            self._bars = rich.Progress(
                rich.TextColumn("{task.description}", markup=False),
                rich.BarColumn(),
                rich.MofNCompleteColumn(),
                rich.TimeElapsedColumn(),
                rich.TextColumn("left"),
                rich.TimeRemainingColumn(),
                console=Console(stderr=True),
            )
            self._bars.start()
        return self

    def __exit__(self, *fault: object) -> None:
        if self._bars is not None:
            self._bars.stop()

    def __call__(self, stage: str, done: int, total: int) -> None:
        with self._lock:
            self._show(visible(stage), done, total)

    def _show(self, stage: str, done: int, total: int) -> None:
        is_anew, self._done[stage] = done < self._done.get(stage, 0), done
        if is_anew:
            self._begun.pop(stage, None)
            self._logged.pop(stage, None)
            if self._bars is not None:
                self._bars.reset(self._tasks[stage])
        if self._bars is not None:
            if stage not in self._tasks:
                self._tasks[stage] = self._bars.add_task(stage, total=total)
            self._bars.update(self._tasks[stage], completed=done, total=total)
            return
        now = time.monotonic()
        begun = self._begun.setdefault(stage, now)
        if done == total or now - self._logged.get(stage, begun) >= LOG_EVERY_S:
            self._logged[stage] = now
            left_s = (total - done) * (now - begun) / max(done, 1)
            left = f", {left_s:.0f} s left" if 0 < done < total else ""
            print(f"{stage}: {done}/{total}, {now - begun:.1f} s{left}", file=sys.stderr, flush=True)
