"""Command lines: help, what commands print, error messages of one sentence, exit codes, --quiet, and Ctrl-C.

Exit codes: 0 done, 1 failure, 2 bad input, 130 interrupted, 141 standard output closed by its reader.
With PCII_TRACEBACK=1 in the environment tracebacks are shown.
"""

import os
import shlex
import shutil
import signal
import sys
import warnings
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from importlib.metadata import version
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Annotated, Any

from pcii.base.errors import InputError, WorkerLostError
from pcii.base.plain_text import in_json, in_terminal
from pcii.base.progress import Stages, is_quiet, quiet, shown_by

if TYPE_CHECKING:
    from cyclopts import App, Token

MOST_COMPLAINTS = 5
"""Largest number of faults that the last lines of a command, or one message, name."""
STOP_AGAIN_S = 1.0
"""An interruption is raised again after this time, in case the first exception was lost."""


# What commands print


def say(text: str) -> None:
    """Print one line on what was done on standard output; nothing with --quiet."""
    if not is_quiet():
        answer(text)


def answer(text: str) -> None:
    """Print what a command was asked for on standard output, with --quiet too."""
    print(in_terminal(text), flush=True)


def answer_json(value: Any) -> None:
    """Print a result for scripts: indented JSON on standard output, without NaN and infinities."""
    answer(in_json(value, indent=2))


def complain(text: str) -> None:
    """Print what went wrong on standard error, with --quiet too."""
    print(in_terminal(text), file=sys.stderr, flush=True)


def complain_of(faults: Sequence[str], prefix: str = "") -> None:
    """Print the first few of many faults on standard error, and how many more there are."""
    for fault in faults[:MOST_COMPLAINTS]:
        complain(f"{prefix}{fault}")
    if len(faults) > MOST_COMPLAINTS:
        complain(f"and {len(faults) - MOST_COMPLAINTS} more")


def say_next(*words: object) -> None:
    """Print the command to type next, for whoever sits at a terminal: not in a pipe or with --quiet."""
    if not is_quiet() and sys.stdout.isatty():
        program, *arguments = map(str, words)
        beside = Path(sys.argv[0]).parent / program  # where the shell may not look
        if shutil.which(program) is None and beside.is_file():
            program = str(beside)
        answer(f"next:  {shlex.join([program, *arguments])}")


def say_next_page(path: Path) -> None:
    """Print the command that shows a page in a browser, for whoever sits at a terminal."""
    say_next("python3", "-m", "webbrowser", path)


def results_folder(folder: Path) -> Path:
    """Folder that is suggested for the results of a dataset or collection."""
    return folder.parent / f"{folder.name}-results"


# Commands


def command_app(name: str, sentence: str) -> "App":
    """A command whose subcommands are added by its module; all have --quiet, and shells complete its words.

    Options have no negative form (`--no-json`, `--empty-z-mm`), which would mean what leaving them out means.
    """
    from cyclopts import App, Group, Parameter

    def shown_default(value: Any) -> Any:
        return None if value in ((), False) else value

    app = App(
        name=name,
        help=sentence,
        version=lambda: version("photon-integral-imaging"),
        default_parameter=Parameter(converter=_converted, negative=(), show_default=shown_default),
    )
    for each in (app, app.meta):
        each.suppress_keyboard_interrupt = False  # by default cyclopts exits without a message
    app.register_install_completion_command(
        help="Let the shell complete commands and options: bash, zsh or fish.", show=True
    )

    @app.meta.default
    def with_common_options(
        *tokens: Annotated[str, Parameter(show=False, allow_leading_hyphen=True)],
        quiet_: Annotated[
            bool, Parameter(name=("--quiet", "-q"), negative=(), show_default=False, group=Group("Common"))
        ] = False,
    ) -> Any:
        """Run a command.

        Parameters
        ----------
        quiet_
            Print only what was asked for, warnings and errors: no progress, nothing on what was done.
        """
        with quiet() if quiet_ else nullcontext():
            return _call(app, tokens)

    return app


def _call(app: "App", tokens: Sequence[str]) -> Any:
    return app(tokens, exit_on_error=False, print_error=False, result_action="return_value")


def _converted(kind: Any, tokens: Sequence["Token"]) -> Any:
    """What is given for a parameter; raises ValueError for 2.5 workers, which cyclopts makes 2."""
    from cyclopts import convert

    if kind is int:
        try:
            return int(tokens[-1].value)
        except ValueError:
            raise ValueError(f"expected a whole number, got {tokens[-1].value!r}") from None
    return convert(kind, tokens)


def run(app: "App", arguments: Sequence[str] | None = None, *, resuming: Collection[str] = ()) -> int:
    """Run a command line of `command_app` and return its exit code; here alone errors become messages.

    A whole number that a command returns is the exit code. `resuming` names the commands that continue an
    interrupted run when they are repeated; the message after Ctrl-C says so.
    """
    tokens = list(sys.argv[1:] if arguments is None else arguments)
    with _interruptions() as stops, shown_by(Stages()), _plain_warnings():
        try:
            code = _call(app.meta, tokens)
        except (Exception, KeyboardInterrupt) as fault:
            if stops:  # the remaining cleaning up is not interrupted again
                signal.setitimer(signal.ITIMER_REAL, 0)
                signal.signal(signal.SIGINT, signal.SIG_IGN)
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
    if isinstance(fault, MemoryError):
        return 1, f"not enough memory: {fault}"
    if isinstance(fault, OSError) and fault.filename is not None:
        return 1, f"{fault.filename}: {fault.strerror}"
    return 1, f"{type(fault).__name__}: {sentence}"


@contextmanager
def _plain_warnings() -> Iterator[None]:
    """Within the block warnings for users are one sentence on standard error, without lines of code."""
    shown = warnings.showwarning

    def show(message: Warning | str, category: type[Warning], *place: Any) -> None:
        if category is UserWarning:
            complain(f"warning: {message}")
        else:
            shown(message, category, *place)

    warnings.showwarning = show
    try:
        yield
    finally:
        warnings.showwarning = shown


@contextmanager
def _interruptions() -> Iterator[list[int]]:
    """The Ctrl-C signals received within the block, in which KeyboardInterrupt is repeated.

    A KeyboardInterrupt that is raised during an import or in another library can become another exception,
    and in a callback or a finaliser it is dropped. So it is raised again every second until the block ends.
    """
    stops: list[int] = []

    def stop(number: int, frame: FrameType | None) -> None:
        stops.append(number)
        sys.unraisablehook = lambda _: None  # no tracebacks from finalisers of half-built objects
        signal.setitimer(signal.ITIMER_REAL, STOP_AGAIN_S)
        raise KeyboardInterrupt

    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler:  # the calling program handles it
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
