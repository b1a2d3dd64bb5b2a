"""What commands say at a terminal and in a log: stopped, given unfinished data, and while loops compile."""

import contextlib
import os
import pty
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from cyclopts import App
from property_settings import mostly_slow

from pcii.app import commands as pcii_cli
from pcii.base import command_line
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


def all_said(controller: int) -> str:
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
    _, said = process.communicate(timeout=60)
    assert (process.returncode, said.splitlines()[-1]) == (130, ON)
    assert "Traceback" not in said
    # The folder stays if anything was written to it.
    assert (out / MARKER).exists() or begun == MARKER
    assert subprocess.run(generating(out, 4), capture_output=True, check=False).returncode == 0
    assert command_line.run(simgen_cli.app, ["verify", str(out)]) == 0


@pytest.mark.renders
def test_a_generate_stopped_at_a_terminal_says_so_below_its_bars(tmp_path: Path) -> None:
    out = tmp_path / "small"
    process, controller = at_a_terminal(generating(out, 64))
    wait_for(out / "radiance" / "view_00_02.exr")  # told of the first two
    process.send_signal(signal.SIGINT)
    said = all_said(controller)
    assert process.wait(timeout=60) == 130
    assert "views" in said
    assert said.splitlines()[-1].endswith(ON)


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
    app = App()
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


@pytest.mark.parametrize("inside", [False, True])
@pytest.mark.parametrize(
    "verb", ["run", "depth", "segment", "reconstruct", "score", "evaluate", "verify", "sheet"]
)
def test_of_an_unfinished_dataset_the_way_on_is_told(
    verb: str, inside: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    begun, out = tmp_path / "sets" / "begun", str(tmp_path / "out.png")
    begun.mkdir(parents=True)
    (begun / MARKER).write_text("{}")
    app = simgen_cli.app if verb in ("verify", "sheet") else pcii_cli.app
    named = begun.parent if inside and verb == "evaluate" else begun
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
from cyclopts import App
from pcii.base import command_line, progress

app = App()

@app.command
def work(*, bars: bool) -> None:
    import loops
    with progress.Stages() if bars else __import__("contextlib").nullcontext():
        print(loops.double(4))

sys.exit(command_line.run(app))
"""


@pytest.fixture
def works(tmp_path: Path) -> list[str]:
    """A program with a compiled loop of its own."""
    for name, text in (("loops.py", LOOPS), ("works.py", WORKS)):
        (tmp_path / name).write_text(text)
    return [sys.executable, str(tmp_path / "works.py")]


def said_twice(command: list[str], tmp_path: Path, output: str) -> list[str]:
    """Standard error of two runs of a command with a cache of loops, empty at first; both print `output`."""
    said = []
    for _ in range(2):
        process = subprocess.run(
            command,
            env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")},
            capture_output=True,
            text=True,
            check=True,
        )
        assert process.stdout == output
        said.append(process.stderr)
    return said


@pytest.mark.parametrize("bars", ["--bars", "--no-bars"])
def test_compiling_is_told_once_per_machine(works: list[str], bars: str, tmp_path: Path) -> None:
    said = said_twice([*works, "work", bars], tmp_path, output="8\n")
    assert said == ["compiling (once per machine)\n", ""]


def test_compiling_is_a_stage_at_a_terminal(works: list[str], tmp_path: Path) -> None:
    process, controller = at_a_terminal([*works, "work", "--bars"], NUMBA_CACHE_DIR=str(tmp_path / "cache"))
    said = all_said(controller)
    assert process.wait() == 0
    assert "compiling (once per machine)" in said
    assert "1/1" in said


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
    said = said_twice([sys.executable, str(tmp_path / "program.py")], tmp_path, output="")
    line = "pcii: compiling (once per machine), which takes up to a minute\n"
    assert said == [f"now the package\n{line}", "now the package\n"]
