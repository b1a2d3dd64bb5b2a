"""How commands behave: one sentence for bad input, and what Ctrl-C does.

Exit codes: 0 done, 1 failure, 2 bad input, 130 interrupted, 141 output
no longer read. Set PCII_TRACEBACK=1 to see tracebacks.
"""

import os
import signal
import sys
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from types import FrameType
from typing import TYPE_CHECKING

from pcii.base.errors import InputError
from pcii.base.progress import Stages, shown_by

if TYPE_CHECKING:
    from cyclopts import App, Token

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
    with _stops() as stops, shown_by(Stages()):
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
