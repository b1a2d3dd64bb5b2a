"""The command line of `pcii` within the tests: its exit code, and refusals in one sentence."""

import re
from collections.abc import Sequence
from pathlib import Path

import pytest

from pcii.app.commands import app
from pcii.base import command_line


def run(*arguments: object) -> int:
    return command_line.run(app, [str(argument) for argument in arguments])


def check_refused(
    source: Path, out: Path, options: Sequence[object], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """An import ends with exit code 2 and one sentence that has these words, and leaves nothing."""
    capsys.readouterr()
    assert run("import", source, "-o", out, *options) == 2
    *_, said = capsys.readouterr().err.strip().split("\n")
    assert said.startswith("error: ")
    assert re.search(words, said), said
    assert not out.exists()
