"""How the commands behave: one sentence for bad input, progress on a terminal, plain lines in a log.

Exit codes: 0 done, 1 failure, 2 bad input, 130 interrupted, 141 output
no longer read. Set PCII_TRACEBACK=1 to see tracebacks.
"""

import os
import signal
import sys
import time
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from types import FrameType, TracebackType
from typing import TYPE_CHECKING

from pcii.core.errors import InputError

if TYPE_CHECKING:
    from cyclopts import App, Token
    from rich.progress import Progress, TaskID

LOG_EVERY_S = 10.0
STOP_AGAIN_S = 1.0
"""Time enough to tidy up, after which a stop that nobody heeded is repeated."""


def run(app: "App", arguments: Sequence[str] | None = None, *, resuming: Collection[str] = ()) -> int:
    """Run a command line and return its exit code; the only place where errors become messages.

    A command that returns a number leaves with that exit code. `resuming` names the commands that go on where
    they were stopped when they are given again.
    """
    from cyclopts import CycloptsError

    tokens = list(sys.argv[1:] if arguments is None else arguments)
    app.suppress_keyboard_interrupt = False  # else it would end the process without a word
    with _stops() as stops, _shown_by(Stages()):
        try:
            code = app(tokens, exit_on_error=False, print_error=False, result_action="return_value")
        except (Exception, KeyboardInterrupt) as fault:
            if stops:  # what was stopped may take its time to end, and is not to be stopped in that
                signal.setitimer(signal.ITIMER_REAL, 0)
                signal.signal(signal.SIGINT, signal.SIG_IGN)
            if stops or isinstance(fault, KeyboardInterrupt):
                on = "; the same command goes on from here" if {*tokens[:1]} & {*resuming} else ""
                return _leave(130, f"stopped{on}")
            if isinstance(fault, CycloptsError):
                return _fail(2, " ".join(str(fault).split()) + f" See: {app.name[0]} --help")
            return _failed(fault)
    return code if isinstance(code, int) else 0


@contextmanager
def _stops() -> Iterator[list[int]]:
    """Signals of Ctrl-C as they come, of which a KeyboardInterrupt need not be left.

    Raised during an import or in a foreign library it can become another error, and in a callback or a
    finaliser it is dropped. So it is raised again until the block ends.
    """
    stops: list[int] = []

    def stop(number: int, frame: FrameType | None) -> None:
        stops.append(number)
        sys.unraisablehook = lambda _: None  # what is half made need not tell how it ends
        signal.setitimer(signal.ITIMER_REAL, STOP_AGAIN_S)
        signal.default_int_handler(number, frame)

    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler:  # another sees to it, or none shall
        yield stops
        return
    signal.signal(signal.SIGINT, stop)
    alarm = signal.signal(signal.SIGALRM, stop)
    try:
        yield stops
    finally:
        if stops:
            signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.signal(signal.SIGALRM, alarm)


def _failed(fault: Exception) -> int:
    """Tell what went wrong, and the exit code."""
    if isinstance(fault, InputError):
        return _fail(2, str(fault))
    if isinstance(fault, BrokenPipeError):  # whoever read the output has read enough, such as `| head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141
    if isinstance(fault, MemoryError):
        return _fail(1, f"not enough memory: {fault}")
    return _fail(1, f"{type(fault).__name__}: {' '.join(str(fault).split())}")


def _fail(code: int, sentence: str) -> int:
    return _leave(code, f"error: {sentence}")


def _leave(code: int, sentence: str) -> int:
    if os.environ.get("PCII_TRACEBACK"):
        raise
    print(sentence, file=sys.stderr, flush=True)
    return code


def whole(_: object, tokens: Sequence["Token"]) -> int:
    """Converter of a parameter to a whole number, and not to one that would have to be rounded."""
    text = tokens[0].value
    try:
        return int(text)
    except ValueError:
        raise ValueError(f"expected a whole number, got {text!r}") from None


def say(text: str) -> None:
    """One line of result or log on standard output."""
    print(text, flush=True)


class Stages(AbstractContextManager["Stages"]):
    """Progress of named stages: bars with time left on a terminal, else a line now and then.

    Call it as stages(name, done, total); a stage ends when done reaches total.
    """

    def __init__(self) -> None:
        self._rich: Progress | None = None
        self._tasks: dict[str, TaskID] = {}
        self._started: dict[str, float] = {}
        self._logged: dict[str, float] = {}
        self._shown = ExitStack()

    def __enter__(self) -> "Stages":
        self._shown.enter_context(_shown_by(self))
        if sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import (
                BarColumn,
                MofNCompleteColumn,
                Progress,
                TextColumn,
                TimeElapsedColumn,
                TimeRemainingColumn,
            )

            self._rich = Progress(
                TextColumn("{task.description}"),
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
        if self._rich is not None:
            if stage not in self._tasks:
                self._tasks[stage] = self._rich.add_task(stage, total=total)
            self._rich.update(self._tasks[stage], completed=done, total=total)
            return
        now = time.monotonic()
        start = self._started.setdefault(stage, now)
        last = self._logged.get(stage, start)
        if done == total or now - last >= LOG_EVERY_S:
            self._logged[stage] = now
            elapsed = now - start
            left = f", {elapsed / done * (total - done):.0f} s left" if 0 < done < total else ""
            print(f"{stage}: {done}/{total}, {elapsed:.1f} s{left}", file=sys.stderr, flush=True)

    def compiling(self, loops: int, running: bool) -> None:
        """Tell of loops compiled up to now, the last maybe still `running`; nobody knows how many follow."""
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
"""Those who show progress now, the last of them to be told; nobody where `pcii` is used as a library."""


@contextmanager
def _shown_by(stages: Stages) -> Iterator[None]:
    _showing.append(stages)
    try:
        yield
    finally:
        _showing.remove(stages)


def tell_of_compiling(loops: int, *, running: bool) -> None:
    """Tell whoever runs a command that a loop is being compiled, or has been; `loops` are those up to now."""
    for stages in _showing[-1:]:
        stages.compiling(loops, running)


def silent(stage: str, done: int, total: int) -> None:
    """The progress of whoever does not want any."""


Report = Callable[[str, int, int], None]
"""Called as report(stage, done, total) by whatever takes long."""
