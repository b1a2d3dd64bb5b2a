"""What a command prints: what it did, what was asked for, and the next command to type."""

import shlex
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pcii.base.plain_text import in_json, in_terminal
from pcii.base.progress import is_quiet


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


MOST_COMPLAINTS = 5
"""Largest number of faults that the last lines of a command, or one message, name."""


def complain_of(faults: Sequence[str], prefix: str = "", rest: str = "") -> None:
    """Print the first few of many faults on standard error, and how many more there are."""
    for fault in faults[:MOST_COMPLAINTS]:
        complain(f"{prefix}{fault}")
    if len(faults) > MOST_COMPLAINTS:
        complain(f"and {len(faults) - MOST_COMPLAINTS} more{rest}")


def say_next(*words: object) -> None:
    """Print the command to type next, for whoever sits at a terminal: not in a pipe or with --quiet."""
    if not is_quiet() and sys.stdout.isatty():
        program, *arguments = map(str, words)
        answer(f"next:  {shlex.join([_typed(program), *arguments])}")


def say_next_page(path: Path) -> None:
    """Print the command that shows a page in a browser, for whoever sits at a terminal."""
    say_next("python3", "-m", "webbrowser", path)


def results_folder(folder: Path) -> Path:
    """Folder that is suggested for the results of a dataset or collection."""
    return folder.parent / f"{folder.name}-results"


def _typed(program: str) -> str:
    """A program of this package as it must be typed here: with its folder if the shell does not find it."""
    beside = Path(sys.argv[0]).parent / program
    return str(beside) if shutil.which(program) is None and beside.is_file() else program
