"""Without the renderer one sentence says what to install."""

import importlib.util
from collections.abc import Callable

import pytest

from pcii.base import command_line
from simgen.app import commands as simgen_cli


@pytest.fixture
def _without_mitsuba(monkeypatch: pytest.MonkeyPatch) -> None:
    found: Callable[..., object] = importlib.util.find_spec
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None if name == "mitsuba" else found(name))


@pytest.mark.usefixtures("_without_mitsuba")
@pytest.mark.parametrize(
    "command", ["doctor", "check blank", "generate small -o out", "preview blank -o x.png"]
)
def test_what_is_missing_is_told_in_a_sentence(
    command: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: object
) -> None:
    monkeypatch.chdir(str(tmp_path))
    assert command_line.run(simgen_cli.app, command.split()) == 2
    said = capsys.readouterr().err
    assert said.startswith(
        "error: mitsuba: not installed, and needed for rendering; type in the source tree:  pip install"
    )
    assert "pip install '.[render]'" in said
    assert said.count("\n") == 1
