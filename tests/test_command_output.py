"""What commands print: results for scripts, silence on request, the next command for people at a terminal."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import zarr
from hostile_names import NAMES
from test_console import all_said, at_a_terminal

from pcii.app import commands as pcii_cli
from pcii.app.command_options import depths_mm
from pcii.base import command_line
from pcii.base.command_line import command_app
from pcii.base.command_output import answer, answer_json, say, say_next
from pcii.base.plain_text import UNSEEN
from pcii.base.progress import Stages, is_quiet
from pcii.store.dataset import SAMPLE
from simgen.app import commands as simgen_cli

APPS = (simgen_cli.app, pcii_cli.app)
WORKS = """
import sys
from pcii.base import command_line
from pcii.base.command_output import say_next
app = command_line.command_app("works", "Works.")

@app.command
def work() -> None:
    say_next("work", "a file", "-o", "out")

sys.exit(command_line.run(app, sys.argv[1:]))
"""


def said_in_json(app: object, words: list[str], capsys: pytest.CaptureFixture[str], code: int = 0) -> object:
    capsys.readouterr()
    assert command_line.run(app, [*words, "--json"]) == code  # type: ignore[arg-type]
    return json.loads(capsys.readouterr().out)


def test_a_verification_for_scripts_tells_the_fault(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for app in APPS:
        good = said_in_json(app, ["verify", str(SAMPLE)], capsys)
        assert isinstance(good, dict)
        assert good["files"] > 50
        assert good["fault"] is None
        bad = said_in_json(app, ["verify", str(tmp_path)], capsys, code=2)
        assert isinstance(bad, dict)
        assert bad["files"] is None
        assert str(tmp_path) in bad["fault"]


def test_a_score_for_scripts_is_that_of_the_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = str(tmp_path / "out")
    command = ["segment", str(SAMPLE), "--z-mm", "540", "--method", "brightness", "-o", out]
    assert command_line.run(pcii_cli.app, command) == 0
    said = said_in_json(pcii_cli.app, ["score", str(SAMPLE), out], capsys)
    assert said == json.loads((tmp_path / "out" / "score.json").read_text())


@pytest.mark.renders
def test_the_renderer_is_told_to_scripts(capsys: pytest.CaptureFixture[str]) -> None:
    said = said_in_json(simgen_cli.app, ["doctor"], capsys)
    assert isinstance(said, dict)
    assert said["chosen"]["kind"] in {each["kind"] for each in said["candidates"] if each["works"]}


def test_depths_as_they_are_typed() -> None:
    assert depths_mm("540") == [540.0]
    assert depths_mm("500:700:20") == [float(z) for z in range(500, 701, 20)]
    assert depths_mm("500:699:20")[-1] == 680.0
    assert depths_mm("500:500:1") == [500.0]
    assert len(depths_mm("500:501:0.1")) == 11  # 0.1 is not exact in binary
    for wrong in ("500:700", "700:500:20", "500:700:0", "500:700:-20", "a:b:c", "1:inf:1", "1:2:1e-9", ""):
        with pytest.raises(ValueError, match=r"start:stop:step|larger step"):
            depths_mm(wrong)


def test_ranges_of_depths_and_single_ones_make_sections(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["reconstruct", str(SAMPLE), "--z-mm", "500:600:50", "--z-mm", "620", "-o", str(tmp_path)]
    assert command_line.run(pcii_cli.app, command) == 0
    group = zarr.open_group(tmp_path / "sections.zarr", mode="r")
    assert np.asarray(group["z_mm"]).tolist() == [500.0, 550.0, 600.0, 620.0]
    capsys.readouterr()
    assert command_line.run(pcii_cli.app, [*command[:3], "500:600", *command[4:]]) == 2
    said = capsys.readouterr().err
    assert "--z-mm: expected a depth in mm such as 540, or start:stop:step" in said
    assert said.count("\n") == 1


def test_a_quiet_command_prints_only_what_was_asked_for(capsys: pytest.CaptureFixture[str]) -> None:
    app = command_app("works", "Works.")

    @app.command
    def work() -> None:
        with Stages() as report:
            report("rows", 1, 1)
        say("done")
        answer("42")
        say_next("work", "more")

    assert command_line.run(app, ["work"]) == 0
    loud = capsys.readouterr()
    assert (loud.out, "rows: 1/1" in loud.err) == ("done\n42\n", True)
    for words in (["work", "--quiet"], ["-q", "work"]):
        assert command_line.run(app, words) == 0
        quiet = capsys.readouterr()
        assert (quiet.out, quiet.err) == ("42\n", "")
    assert not is_quiet()


def test_the_time_left_follows_from_the_pace_of_the_last_minute(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = 0.0
    monkeypatch.setattr("time.monotonic", lambda: clock)
    report = Stages()
    for done in range(1, 301):  # made by an earlier run
        report("datasets", done, 400)
    for done in range(301, 309):
        clock += 12.0
        report("datasets", done, 400)
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "datasets: 301/400, 12.0 s, 4 s left"
    assert lines[-1] == "datasets: 308/400, 96.0 s, 1104 s left"


def test_the_next_command_is_told_at_a_terminal_alone(tmp_path: Path) -> None:
    (tmp_path / "works.py").write_text(WORKS)
    command = [sys.executable, str(tmp_path / "works.py"), "work"]
    process, controller = at_a_terminal(command)
    assert all_said(controller).split() == ["next:", "work", "'a", "file'", "-o", "out"]
    assert process.wait() == 0
    process, controller = at_a_terminal([*command, "--quiet"])
    assert all_said(controller) == ""
    assert process.wait() == 0
    piped = subprocess.run(command, capture_output=True, text=True, check=True)
    assert (piped.stdout, piped.stderr) == ("", "")


def test_the_next_command_is_one_that_can_be_typed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("simgen", "pcii"):
        (tmp_path / name).touch(mode=0o755)
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    monkeypatch.setattr(sys, "argv", [str(tmp_path / "simgen")])
    monkeypatch.setenv("PATH", str(tmp_path))
    say_next("pcii", "run")
    monkeypatch.setenv("PATH", "/nowhere")
    say_next("pcii", "run")
    assert capsys.readouterr().out == f"next:  pcii run\nnext:  {tmp_path / 'pcii'} run\n"


def test_help_has_no_negative_options_no_empty_defaults_and_no_colours_in_a_pipe(
    capsys: pytest.CaptureFixture[str],
) -> None:
    for app in APPS:
        for command in app:
            if not command.startswith("-"):
                assert command_line.run(app, [command, "--help"]) == 0
                said = capsys.readouterr().out
                for noise in ("--no-", "--empty-", "[default: ()]", "[default: False]", "\x1b"):
                    assert noise not in said, (command, noise)
                assert "--quiet" in said


@pytest.mark.parametrize("name", ["simgen", "pcii"])
@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_is_installed_where_the_shell_looks(name: str, shell: str, tmp_path: Path) -> None:
    module = f"{name}.app.commands"
    script = f"import sys; from {module} import main; sys.exit(main())"
    command = [sys.executable, "-c", script, "--install-completion", "--shell", shell]
    done = subprocess.run(
        command, env=os.environ | {"HOME": str(tmp_path)}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    written = [file.read_text() for file in tmp_path.rglob("*") if file.is_file()]
    assert any("verify" in text and name in text for text in written)


def test_control_characters_in_names_do_not_reach_the_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    app = command_app("works", "Works.")

    @app.command
    def fail(name: str) -> None:
        answer_json({name: 1})
        answer(f"object {name}")
        with Stages() as report:
            report(name, 1, 1)
        raise RuntimeError(name)

    for name in NAMES:
        assert command_line.run(app, ["fail", "--", name]) == 1
        told = capsys.readouterr()
        assert not UNSEEN.search((told.out + told.err).replace("\n", ""))
        assert json.JSONDecoder().raw_decode(told.out)[0] == {name: 1}
