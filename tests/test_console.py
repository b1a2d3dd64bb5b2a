"""What commands print in a log and for scripts, and after Ctrl-C."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from hostile_names import NAMES

from pcii.app import commands as pcii_cli
from pcii.app.command_options import depths_mm
from pcii.base import Stages, answer_json, command_line, say, say_next, visible
from pcii.store import MARKER
from simgen.app import commands as simgen_cli

ON = "stopped; the same command goes on from here"


@pytest.mark.renders
def test_a_stopped_generate_says_so_and_goes_on(tmp_path: Path) -> None:
    out = tmp_path / "small"
    # A process that heeds Ctrl-C, whoever started this one.
    script = "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler); "
    script += "from simgen.app.commands import main; sys.exit(main())"
    settings = ["--set", "render.samples_per_pixel=4", "--set", "grid.rows=2", "--set", "grid.cols=3"]
    command = ["generate", "small", "-o", str(out), *settings]
    process = subprocess.Popen([sys.executable, "-c", script, *command], stderr=subprocess.PIPE, text=True)
    end = time.monotonic() + 120
    while not (out / "radiance" / "view_00_01.exr").exists():
        assert time.monotonic() < end
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert (process.returncode, errors.splitlines()[-1]) == (130, ON)
    assert "Traceback" not in errors
    assert command_line.run(simgen_cli.app, command) == 0
    assert command_line.run(simgen_cli.app, ["verify", str(out)]) == 0


@pytest.mark.parametrize(("resuming", "sentence"), [(["work"], ON), ([], "stopped")])
def test_a_stop_that_became_another_exception_is_a_stop(
    resuming: list[str], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    app = command_line.command_app("works", "Works.")

    @app.command
    def work() -> None:
        try:
            os.kill(os.getpid(), signal.SIGINT)
        except KeyboardInterrupt:
            raise RuntimeError("as Dr.Jit raises it") from None

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    assert command_line.run(app, ["work"], resuming=resuming) == 130
    assert signal.signal(signal.SIGINT, before) is signal.default_int_handler
    assert capsys.readouterr().err == f"{sentence}\n"


UNFINISHED = "unfinished; the same `simgen generate` command goes on from here"


@pytest.mark.parametrize("verb", ["run", "evaluate", "verify"])
def test_of_an_unfinished_dataset_the_way_on_is_told(
    verb: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    begun, out = tmp_path / "sets" / "begun", tmp_path / "out"
    begun.mkdir(parents=True)
    (begun / MARKER).write_text("{}")
    named = begun.parent if verb == "evaluate" else begun
    more = [] if verb == "verify" else ["-o", str(out)]
    assert command_line.run(pcii_cli.app, [verb, str(named), *more]) == 2
    assert capsys.readouterr().err == f"error: {begun}: {UNFINISHED}\n"
    assert not out.exists()


def test_depths_as_they_are_typed() -> None:
    assert len(depths_mm("500:501:0.1")) == 11  # 0.1 is not exact in binary
    for wrong in ("500:700", "700:500:20", "500:700:0", "a:b:c", "1:2:1e-9"):
        with pytest.raises(ValueError, match=r"start:stop:step|larger step"):
            depths_mm(wrong)


def test_control_characters_in_names_do_not_reach_the_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    app = command_line.command_app("works", "Works.")

    @app.command
    def fail(name: str) -> None:
        answer_json({name: 1})
        say(f"object {name}")
        with Stages() as report:
            report(name, 1, 1)
        raise RuntimeError(name)

    for name in NAMES:
        assert command_line.run(app, ["fail", "--", name]) == 1
        printed = capsys.readouterr()
        lines = (printed.out + printed.err).split("\n")
        assert [visible(line) for line in lines] == lines
        assert json.JSONDecoder().raw_decode(printed.out)[0] == {name: 1}


def test_a_terminal_has_bars_and_the_command_to_type_next(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for stream in ("stdout", "stderr"):
        monkeypatch.setattr(f"sys.{stream}.isatty", lambda: True)
    with Stages() as report:
        for done in (0, 2):
            report("[red] rows", done, 3)
    say_next("pcii", "run", "a file")
    printed = capsys.readouterr()
    assert "[red] rows" in printed.err
    assert "2/3" in printed.err
    assert printed.out == "next:  pcii run 'a file'\n"
