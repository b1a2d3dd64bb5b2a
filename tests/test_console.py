"""What commands print at a terminal, in a log and for scripts, after Ctrl-C, and while loops compile."""

import contextlib
import json
import os
import pty
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from hostile_names import NAMES
from property_settings import mostly_slow

from pcii.app import commands as pcii_cli
from pcii.app.command_options import depths_mm
from pcii.base import command_line
from pcii.base.command_line import answer, answer_json, command_app, say, say_next
from pcii.base.plain_text import UNSEEN
from pcii.base.progress import Stages, is_quiet
from pcii.store.dataset import SAMPLE
from pcii.store.dataset_layout import MARKER
from simgen.app import commands as simgen_cli


def at_a_terminal(command: list[str], **settings: str) -> tuple["subprocess.Popen[bytes]", int]:
    """A process whose input and output are a terminal, and the other end of that."""
    controller, terminal = pty.openpty()
    process = subprocess.Popen(
        command,
        stdin=terminal,
        stdout=terminal,
        stderr=terminal,
        start_new_session=True,
        env=os.environ | settings,
    )
    os.close(terminal)
    return process, controller


def all_text(controller: int) -> str:
    said = b""
    with contextlib.suppress(OSError):  # the end of a terminal
        while part := os.read(controller, 1 << 16):
            said += part
    os.close(controller)
    return said.decode()


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


went_on: list[str] = []


def as_of_an_import() -> None:
    """Ctrl-C while an extension module is loaded."""
    try:
        os.kill(os.getpid(), signal.SIGINT)
    except KeyboardInterrupt:
        raise SystemError("returned a result with an exception set") from None


def as_of_a_callback() -> None:
    """Ctrl-C where an exception is dropped."""
    with contextlib.suppress(KeyboardInterrupt):
        os.kill(os.getpid(), signal.SIGINT)
    time.sleep(20)
    went_on.append("after 20 s")


@pytest.mark.parametrize("stop", [as_of_an_import, as_of_a_callback])
@pytest.mark.parametrize(("resuming", "words"), [(("work",), ON), ((), "stopped")])
def test_a_stop_is_told_whatever_becomes_of_it(
    stop: Callable[[], None],
    resuming: tuple[str, ...],
    words: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(sys, "unraisablehook", sys.unraisablehook)  # for it to be put back
    monkeypatch.setattr(command_line, "STOP_AGAIN_S", 0.1)
    went_on.clear()
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    app = command_app("works", "Works.")
    app.command(stop, name="work")
    try:
        assert command_line.run(app, ["work"], resuming=resuming) == 130
        assert not went_on
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
        assert signal.getitimer(signal.ITIMER_REAL)[0] == 0
    finally:
        signal.signal(signal.SIGINT, before)
    assert capsys.readouterr().err == f"{words}\n"


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


LOOPS = """
from pcii.base.compiled_loops import compiled

@compiled
def double(number):
    return 2 * number
"""
WORKS = """
import sys
from pcii.base import command_line, progress

app = command_line.command_app("works", "Works.")

@app.command
def work() -> None:
    import loops
    with progress.Stages():
        print(loops.double(4))
    command_line.say_next("work", "a file", "-o", "out")

sys.exit(command_line.run(app))
"""


@pytest.fixture
def works(tmp_path: Path) -> list[str]:
    """A program with a compiled loop of its own."""
    for name, text in (("loops.py", LOOPS), ("works.py", WORKS)):
        (tmp_path / name).write_text(text)
    return [sys.executable, str(tmp_path / "works.py")]


def errors_of_two_runs(command: list[str], tmp_path: Path, output: str) -> list[str]:
    """Standard error of two runs of a command with a cache of loops, empty at first; both print `output`."""
    errors = []
    for _ in range(2):
        settings = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
        process = subprocess.run(command, env=settings, capture_output=True, text=True, check=True)
        assert process.stdout == output
        errors.append(process.stderr)
    return errors


COMPILING = "compiling (once per machine)"


def test_compiling_is_told_once_per_machine_and_the_next_command_to_people_alone(
    works: list[str], tmp_path: Path
) -> None:
    errors = errors_of_two_runs([*works, "work"], tmp_path, output="8\n")
    assert errors == [f"{COMPILING}, which takes up to a minute\n", ""]
    process, controller = at_a_terminal([*works, "work"], NUMBA_CACHE_DIR=str(tmp_path / "other"))
    words = all_text(controller)
    assert process.wait() == 0
    assert COMPILING in words
    assert "1/1" in words
    assert words.splitlines()[-1].endswith("next:  work 'a file' -o out")
    process, controller = at_a_terminal([*works, "work", "-q"], NUMBA_CACHE_DIR=str(tmp_path / "cache"))
    assert all_text(controller).split() == ["8"]
    assert process.wait() == 0


AS_LIBRARY = """
import sys
import pcii
from loops import double

double(4)  # a loop of the user's own is no concern of the package
print("now the package", file=sys.stderr)
grid = pcii.CameraGrid(rows=2, cols=2, pitch_mm=(5, 5), focal_mm=50, pixel_mm=0.05, height=8, width=8)
counts = pcii.PhotonCounts.from_events([0], [0], [1], [1], [1], grid)
pcii.reconstruct(counts, z_mm=[500.0])
pcii.demosaic([[1.0, 2.0], [3.0, 4.0]], cfa="GRBG")
"""


def test_a_program_that_imports_the_package_is_told_once_that_loops_are_compiled(
    works: list[str], tmp_path: Path
) -> None:
    (tmp_path / "program.py").write_text(AS_LIBRARY)
    errors = errors_of_two_runs([sys.executable, str(tmp_path / "program.py")], tmp_path, output="")
    line = f"{COMPILING}, which takes up to a minute\n"
    assert errors == [f"now the package\n{line}", "now the package\n"]


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
                text = capsys.readouterr().out
                for noise in ("--no-", "--empty-", "[default: ()]", "[default: False]", "\x1b"):
                    assert noise not in text, (command, noise)
                assert "--quiet" in text


def test_completion_is_installed_where_the_shell_looks(tmp_path: Path) -> None:
    script = "import sys; from pcii.app.commands import main; sys.exit(main())"
    command = [sys.executable, "-c", script, "--install-completion", "--shell", "bash"]
    subprocess.run(command, env=os.environ | {"HOME": str(tmp_path)}, capture_output=True, check=True)
    files = [file.read_text() for file in tmp_path.rglob("*") if file.is_file()]
    assert any("verify" in text and "pcii" in text for text in files)


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
        printed = capsys.readouterr()
        assert not UNSEEN.search((printed.out + printed.err).replace("\n", ""))
        assert json.JSONDecoder().raw_decode(printed.out)[0] == {name: 1}
