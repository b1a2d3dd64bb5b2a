"""Running of command lines: help, error messages of one sentence, exit codes, --quiet, and Ctrl-C.

Exit codes: 0 done, 1 failure, 2 bad input, 130 interrupted, 141 standard output closed by its reader.
With PCII_TRACEBACK=1 in the environment tracebacks are shown.
"""

import os
import signal
import sys
import warnings
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from importlib.metadata import version
from types import FrameType
from typing import TYPE_CHECKING, Annotated, Any

from pcii.base.command_output import complain
from pcii.base.errors import InputError, WorkerLostError
from pcii.base.progress import Stages, quiet, shown_by

if TYPE_CHECKING:
    from cyclopts import App, Token

STOP_AGAIN_S = 1.0
"""An interruption is raised again after this time, in case the first exception was lost."""


def command_app(name: str, sentence: str) -> "App":
    """A command whose subcommands are added by its module; it completes words in shells too.

    Options have no negative form (`--no-json`, `--empty-z-mm`), which would mean what leaving them out means.
    """
    from cyclopts import App, Parameter

    app = App(
        name=name,
        help=sentence,
        version=lambda: version("photon-integral-imaging"),
        default_parameter=Parameter(converter=converted, negative=(), show_default=_shown_default),
    )
    app.register_install_completion_command(
        help="Let the shell complete commands and options: bash, zsh or fish.", show=True
    )
    return app


def _shown_default(value: Any) -> Any:
    """A default as help shows it; None for those that say nothing, such as an empty list."""
    return None if value in ((), False) else value


def run(app: "App", arguments: Sequence[str] | None = None, *, resuming: Collection[str] = ()) -> int:
    """Run a command line and return its exit code; the only place where errors become messages.

    A whole number that a command returns is the exit code. `resuming` names the commands that continue an
    interrupted run when they are repeated; the message after Ctrl-C says so.
    """
    from cyclopts import CycloptsError

    _add_common_options(app)
    tokens = list(sys.argv[1:] if arguments is None else arguments)
    with _stops() as stops, shown_by(Stages()), _plain_warnings():
        try:
            code = _call(app.meta, tokens)
        except (Exception, KeyboardInterrupt) as fault:
            if stops:  # the remaining cleaning up is not interrupted again
                signal.setitimer(signal.ITIMER_REAL, 0)
                signal.signal(signal.SIGINT, signal.SIG_IGN)
            if stops or isinstance(fault, KeyboardInterrupt):
                hint = "; the same command goes on from here" if {*tokens[:1]} & {*resuming} else ""
                return _leave(130, f"stopped{hint}")
            if isinstance(fault, CycloptsError):
                command = tokens[:1] if tokens[:1] and tokens[0] in app else []
                see = " ".join([app.name[0], *command, "--help"])
                sentence = " ".join(str(fault).split())
                return _fail(2, f"{sentence}{'' if sentence.endswith('.') else '.'} See: {see}")
            return _failed(fault)
    return code if isinstance(code, int) else 0


def _call(app: "App", tokens: Sequence[str]) -> Any:
    app.suppress_keyboard_interrupt = False  # by default cyclopts exits without a message
    return app(tokens, exit_on_error=False, print_error=False, result_action="return_value")


def _add_common_options(app: "App") -> None:
    """Give all commands of `app` the options that are the same for each."""
    from cyclopts import Group, Parameter

    if app.meta.default_command is not None:
        return

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
def _stops() -> Iterator[list[int]]:
    """The list of Ctrl-C signals received within the block, in which KeyboardInterrupt is repeated.

    A KeyboardInterrupt that is raised during an import or in another library can become another exception,
    and in a callback or a finaliser it is dropped. So it is raised again every second until the block ends.
    """
    stops: list[int] = []

    def stop(number: int, frame: FrameType | None) -> None:
        stops.append(number)
        sys.unraisablehook = lambda _: None  # no tracebacks from finalisers of half-built objects
        signal.setitimer(signal.ITIMER_REAL, STOP_AGAIN_S)
        signal.default_int_handler(number, frame)

    if (
        signal.getsignal(signal.SIGINT) is not signal.default_int_handler
    ):  # the calling program handles or ignores Ctrl-C
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
    """Print a message for the exception and return the exit code."""
    if isinstance(fault, InputError):
        return _fail(2, "\n".join([str(fault), *getattr(fault, "__notes__", ())]))
    if isinstance(fault, WorkerLostError):
        return _fail(1, str(fault))
    if isinstance(fault, BrokenPipeError):  # the reader closed the pipe, as `| head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141
    if isinstance(fault, MemoryError):
        return _fail(1, f"not enough memory: {fault}")
    if isinstance(fault, OSError) and fault.filename is not None:
        return _fail(1, f"{fault.filename}: {fault.strerror}")
    return _fail(1, f"{type(fault).__name__}: {' '.join(str(fault).split())}")


def _fail(code: int, sentence: str) -> int:
    return _leave(code, f"error: {sentence}")


def _leave(code: int, sentence: str) -> int:
    """Print the sentence on standard error and return the code; for PCII_TRACEBACK raise the exception."""
    if os.environ.get("PCII_TRACEBACK"):
        raise
    complain(sentence)
    return code


def converted(kind: Any, tokens: Sequence["Token"]) -> Any:
    """Convert what is given for a parameter; raises ValueError for 2.5 workers, which cyclopts makes 2."""
    from cyclopts import convert

    if kind is not int:
        return convert(kind, tokens)
    text = tokens[-1].value
    try:
        return int(text)
    except ValueError:
        raise ValueError(f"expected a whole number, got {text!r}") from None
