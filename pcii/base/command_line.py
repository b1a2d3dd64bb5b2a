"""Command lines: help, what commands print, progress, error messages of one sentence, and exit codes.

Exit codes: 0 done, 1 failure, 2 bad input, 130 interrupted, 141 standard output closed by its reader.
With PCII_TRACEBACK=1 in the environment tracebacks are shown.
"""

import json
import os
import shlex
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Collection, Sequence
from contextlib import AbstractContextManager
from importlib.metadata import version
from pathlib import Path
from types import FrameType
from typing import IO, TYPE_CHECKING, Any

from pcii.base.plain_text import InputError, WorkerLostError, visible

if TYPE_CHECKING:
    from cyclopts import App, Token
    from rich.progress import Progress, TaskID

Report = Callable[[str, int, int], None]
"""Type of a progress callback: report(stage, done, total)."""
LOG_EVERY_S = 10.0


# What commands print


def say(text: str) -> None:
    """Print a line of what a command was asked for, or of what it did, on standard output."""
    _print(text, sys.stdout)


def answer_json(value: Any) -> None:
    """Print a result for scripts: indented JSON on standard output, without NaN and infinities."""
    # All that is not ASCII is escaped, and so is what a terminal would obey.
    print(json.dumps(value, indent=2, allow_nan=False).replace("\x7f", "\\u007f"), flush=True)


def complain(text: str) -> None:
    """Print a line of what went wrong on standard error."""
    _print(text, sys.stderr)


def _print(text: str, stream: IO[str]) -> None:
    """Print the lines of a text, with what a terminal would obey and not show as escape sequences."""
    print("\n".join(map(visible, text.split("\n"))), file=stream, flush=True)


def complain_of(faults: Sequence[str], prefix: str = "") -> None:
    """Print the first five of many faults on standard error, and how many more there are."""
    for fault in faults[:5]:
        complain(f"{prefix}{fault}")
    if len(faults) > 5:
        complain(f"and {len(faults) - 5} more")


def say_next(*words: object) -> None:
    """Print the command to type next, for whoever sits at a terminal: not in a pipe."""
    if sys.stdout.isatty():
        say(f"next:  {shlex.join(map(str, words))}")


def say_next_page(path: Path) -> None:
    """Print the command that shows a page in a browser, for whoever sits at a terminal."""
    say_next("python3", "-m", "webbrowser", path)


def results_folder(folder: Path) -> Path:
    """Folder that is suggested for the results of a dataset or collection."""
    return folder.parent / f"{folder.name}-results"


# Progress: bars on a terminal, plain lines in a log


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
        self._stages: dict[str, tuple[int, float, float]] = {}
        """What of each stage is done, when it began, and when a line on it was last written."""

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
        now = time.monotonic()
        last_done, begun, logged = self._stages.get(stage, (0, now, now))
        if is_anew := done < last_done:
            begun = logged = now
        if self._bars is not None:
            if stage not in self._tasks:
                self._tasks[stage] = self._bars.add_task(stage, total=total)
            if is_anew:
                self._bars.reset(self._tasks[stage])
            self._bars.update(self._tasks[stage], completed=done, total=total)
        elif done == total or now - logged >= LOG_EVERY_S:
            logged = now
            left_s = (total - done) * (now - begun) / max(done, 1)
            left = f", {left_s:.0f} s left" if 0 < done < total else ""
            print(f"{stage}: {done}/{total}, {now - begun:.1f} s{left}", file=sys.stderr, flush=True)
        self._stages[stage] = done, begun, logged


# Commands


def command_app(name: str, sentence: str) -> "App":
    """A command whose subcommands are added by its module.

    Options have no negative form (`--no-json`, `--empty-z-mm`), which would mean what leaving them out means.
    """
    from cyclopts import App, Parameter

    app = App(
        name=name,
        help=sentence,
        version=lambda: version("photon-integral-imaging"),
        default_parameter=Parameter(
            converter=_converted,
            negative=(),
            show_default=lambda value: None if value in ((), False) else value,
        ),
    )
    app.suppress_keyboard_interrupt = False  # by default cyclopts exits without a message
    return app


def _converted(kind: Any, tokens: Sequence["Token"]) -> Any:
    """The value of an option; raises ValueError for 2.5 workers, which cyclopts rounds to 2."""
    from cyclopts import convert

    text = tokens[-1].value if tokens else ""
    if kind is int and not text.removeprefix("-").isdecimal():
        raise ValueError(f"expected a whole number, got {text!r}")
    return convert(kind, tokens)


def run(app: "App", arguments: Sequence[str] | None = None, *, resuming: Collection[str] = ()) -> int:
    """Run a command line of `command_app` and return its exit code; here alone errors become messages.

    A whole number that a command returns is the exit code. `resuming` names the commands that continue an
    interrupted run when they are repeated; the message after Ctrl-C says so.
    """
    tokens = list(sys.argv[1:] if arguments is None else arguments)
    stops: list[int] = []  # a KeyboardInterrupt that is raised within Dr.Jit becomes another exception

    def stop(number: int, frame: FrameType | None) -> None:
        stops.append(number)
        raise KeyboardInterrupt

    is_default = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if is_default:  # else the calling program handles it
        signal.signal(signal.SIGINT, stop)
    with warnings.catch_warnings():
        warnings.showwarning = lambda message, *place: complain(f"warning: {message}")
        try:
            code = app(tokens, exit_on_error=False, print_error=False, result_action="return_value")
        except (Exception, KeyboardInterrupt) as fault:
            if os.environ.get("PCII_TRACEBACK"):
                raise
            if stops or isinstance(fault, KeyboardInterrupt):
                goes_on = "; the same command goes on from here" if {*tokens[:1]} & {*resuming} else ""
                complain(f"stopped{goes_on}")
                return 130
            if isinstance(fault, BrokenPipeError):  # the reader closed the pipe, as `| head` does
                os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
                return 141
            code, sentence = _failure(fault, app, tokens)
            complain(f"error: {sentence}")
        finally:
            if is_default:
                signal.signal(signal.SIGINT, signal.default_int_handler)
        return code if isinstance(code, int) else 0


def _failure(fault: Exception, app: "App", tokens: Sequence[str]) -> tuple[int, str]:
    """The exit code and the sentence of an exception."""
    from cyclopts import CycloptsError

    sentence = " ".join(str(fault).split())
    if isinstance(fault, CycloptsError):
        see = " ".join([app.name[0], *(word for word in tokens[:1] if word in app), "--help"])
        return 2, f"{sentence}{'' if sentence.endswith('.') else '.'} See: {see}"
    if isinstance(fault, InputError):
        return 2, "\n".join([str(fault), *getattr(fault, "__notes__", ())])
    if isinstance(fault, WorkerLostError):
        return 1, sentence
    if isinstance(fault, OSError) and fault.filename is not None:
        return 1, f"{fault.filename}: {fault.strerror}"
    return 1, f"{type(fault).__name__}: {sentence}"
