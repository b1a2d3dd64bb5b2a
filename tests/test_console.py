"""What commands print in a log and for scripts, and after Ctrl-C."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from hostile_names import NAMES
from property_settings import mostly_slow

from pcii.app import commands as pcii_cli
from pcii.app.command_options import depths_mm
from pcii.base import command_line
from pcii.base.command_line import answer_json, command_app, say, say_next
from pcii.base.plain_text import UNSEEN
from pcii.base.progress import Stages
from pcii.store.dataset import SAMPLE
from pcii.store.dataset_layout import MARKER
from simgen.app import commands as simgen_cli


def generating(out: Path, samples: int) -> list[str]:
    """A command line for a process that heeds Ctrl-C, whoever started this one."""
    script = "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler); "
    script += "from simgen.app.commands import main; sys.exit(main())"
    return [
        *(sys.executable, "-c", script, "generate", "small", "-o", str(out)),
        *("--set", f"render.samples_per_pixel={samples}", "--set", "grid.rows=2"),
    ]


def wait_for(path: Path) -> None:
    for _ in range(600):
        if path.exists():
            return
        time.sleep(0.05)
    raise AssertionError(f"{path} did not come to be")


ON = "stopped; the same command goes on from here"


@pytest.mark.renders
@pytest.mark.parametrize(
    "begun", mostly_slow([MARKER, "radiance/view_00_01.exr"], quick=["radiance/view_00_01.exr"])
)
def test_a_stopped_generate_says_so_and_goes_on(begun: str, tmp_path: Path) -> None:
    out = tmp_path / "small"
    process = subprocess.Popen(generating(out, 4), stderr=subprocess.PIPE, text=True)
    wait_for(out / begun)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert (process.returncode, errors.splitlines()[-1]) == (130, ON)
    assert "Traceback" not in errors
    # The folder stays if anything was written to it.
    assert (out / MARKER).exists() or begun == MARKER
    assert subprocess.run(generating(out, 4), capture_output=True, check=False).returncode == 0
    assert command_line.run(simgen_cli.app, ["verify", str(out)]) == 0


UNFINISHED = "unfinished; the same `simgen generate` command goes on from here"


@pytest.mark.parametrize("verb", ["run", "reconstruct", "score", "evaluate", "verify", "sheet"])
def test_of_an_unfinished_dataset_the_way_on_is_told(
    verb: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    begun, out = tmp_path / "sets" / "begun", str(tmp_path / "out.png")
    begun.mkdir(parents=True)
    (begun / MARKER).write_text("{}")
    app = simgen_cli.app if verb in ("verify", "sheet") else pcii_cli.app
    named = begun.parent if verb == "evaluate" else begun
    more = {"verify": [], "score": [out]}.get(verb, ["-o", out])
    assert command_line.run(app, [verb, str(named), *more]) == 2
    assert capsys.readouterr().err == f"error: {begun}: {UNFINISHED}\n"
    assert not Path(out).exists()


APPS = (simgen_cli.app, pcii_cli.app)


def json_of(app: object, words: list[str], capsys: pytest.CaptureFixture[str], code: int = 0) -> object:
    capsys.readouterr()
    assert command_line.run(app, [*words, "--json"]) == code  # type: ignore[arg-type]
    return json.loads(capsys.readouterr().out)


def test_a_verification_for_scripts_tells_the_fault(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for app in APPS:
        good = json_of(app, ["verify", str(SAMPLE)], capsys)
        assert isinstance(good, dict)
        assert good["files"] > 50
        assert good["fault"] is None
        bad = json_of(app, ["verify", str(tmp_path)], capsys, code=2)
        assert isinstance(bad, dict)
        assert bad["files"] is None
        assert str(tmp_path) in bad["fault"]


def test_depths_as_they_are_typed() -> None:
    assert depths_mm("540") == [540.0]
    assert depths_mm("500:700:20") == [float(z) for z in range(500, 701, 20)]
    assert depths_mm("500:699:20")[-1] == 680.0
    assert depths_mm("500:500:1") == [500.0]
    assert len(depths_mm("500:501:0.1")) == 11  # 0.1 is not exact in binary
    for wrong in ("500:700", "700:500:20", "500:700:0", "500:700:-20", "a:b:c", "1:inf:1", "1:2:1e-9", ""):
        with pytest.raises(ValueError, match=r"start:stop:step|larger step"):
            depths_mm(wrong)


def test_help_has_no_negative_options_no_empty_defaults_and_no_colours_in_a_pipe(
    capsys: pytest.CaptureFixture[str],
) -> None:
    for app in APPS:
        for command in app:
            if not command.startswith("-"):
                assert command_line.run(app, [command, "--help"]) == 0
                text = capsys.readouterr().out
                for noise in ("--no-", "--empty-", "[default: ()]", "[default: False]", "\x1b"):
                    assert noise not in text, (command, noise)


def test_control_characters_in_names_do_not_reach_the_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    app = command_app("works", "Works.")

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
        assert not UNSEEN.search((printed.out + printed.err).replace("\n", ""))
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
