"""Choosing a renderer: what is tried, what is refused, and what is remembered."""

import importlib.util
import json
from collections.abc import Callable
from pathlib import Path

import pytest

from pcii.base import InputError, command_line
from simgen.app import commands as simgen_cli
from simgen.renderer import backend


@pytest.fixture
def libraries(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """The only folder with libraries, at first none, of a machine without CUDA."""
    folder = tmp_path / "lib"
    folder.mkdir()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    for name in ("SIMGEN_BACKEND", "DRJIT_LIBLLVM_PATH", "LD_LIBRARY_PATH"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(backend, "cuda_driver", lambda: None)
    monkeypatch.setattr(backend, "LIBRARY_FOLDERS", (str(folder.relative_to("/")),))
    return folder


@pytest.fixture
def trials(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the libraries that were tried: 19 works, others end the trial process."""
    names: list[str] = []

    def probe(kind: str, library: str) -> dict[str, bool | str]:
        names.append(Path(library).name)
        works = ".so.19" in library
        return {"works": works, "detail": "works" if works else "ended with signal 6"}

    monkeypatch.setattr(backend, "_probe", probe)
    return names


def test_the_newest_that_works_is_chosen_and_without_any_it_is_scalar(
    libraries: Path, trials: list[str]
) -> None:
    assert backend.choose().kind == "scalar"
    assert "libllvm19" in (backend.advice() or "")
    names = ("libLLVM-15.so.1", "libLLVM.so.20.1", "libLLVM.so.19.1", "libLLVM-9.so", "libLLVMCore.so.21")
    for name in names:
        (libraries / name).touch()
    (libraries / "libLLVM-20.so").symlink_to("libLLVM.so.20.1")
    choice = backend.choose()
    assert (choice.kind, choice.library) == ("llvm", str(libraries / "libLLVM.so.19.1"))
    assert trials == ["libLLVM.so.20.1", "libLLVM.so.19.1"]
    assert backend.advice() is None
    works = [(each.kind, each.works) for each in backend.survey()]
    assert works == [*(("llvm", number == 1) for number in range(4)), ("scalar", True)]
    assert backend.survey()[0].detail == "LLVM 20 ended with signal 6"


def test_answers_are_cached_until_the_library_changes(
    libraries: Path, trials: list[str], tmp_path: Path
) -> None:
    library = libraries / "libLLVM.so.19.1"
    library.write_bytes(b"one")
    backend.choose()
    backend.choose()
    assert len(trials) == 1
    (stored,) = (tmp_path / "cache" / "simgen").glob("*.json")
    assert json.loads(stored.read_text())["works"] is True
    stored.write_text("{")  # a damaged cache is ignored
    assert backend.choose().kind == "llvm"
    assert len(trials) == 2
    library.write_bytes(b"another")
    backend.choose()
    assert len(trials) == 3


def test_a_request_is_met_or_refused(libraries: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SIMGEN_BACKEND", "scalar")
    assert backend.choose().variant == "scalar_rgb"
    for request, sentence in (("llvm", "llvm does not work here"), ("opencl", "use one of cuda, llvm,")):
        monkeypatch.setenv("SIMGEN_BACKEND", request)
        with pytest.raises(InputError, match=sentence):
            backend.choose()


def test_a_library_that_kills_its_process_does_not_kill_ours(
    libraries: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (libraries / "libLLVM.so.19.1").touch()
    monkeypatch.setattr(backend, "_PROBE", "import os; os.abort()")
    assert backend.survey()[0].detail == "LLVM 19 ended the trial process with signal 6"
    (libraries / "libLLVM.so.20.1").touch()
    monkeypatch.setattr(backend, "_PROBE", "raise ImportError('no such library')")
    assert backend.survey()[0].detail == "LLVM 20 failed: ImportError: no such library"


@pytest.mark.renders
def test_nothing_is_loaded_from_the_working_directory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mi = backend.load()
    package = Path(mi.__file__).parent
    assert [Path(str(folder)) for folder in mi.file_resolver()] == [package]
    (tmp_path / "plugins").mkdir()
    for plugin in (package / "plugins").iterdir():
        (tmp_path / "plugins" / plugin.name).write_text("no library")
    (tmp_path / "numpy.py").write_text("raise ImportError")
    monkeypatch.chdir(tmp_path)
    assert backend._probe("scalar", "") == {"works": True, "detail": "works"}


@pytest.mark.parametrize("command", ["doctor", "generate small -o out"])
def test_without_mitsuba_one_sentence_says_what_to_install(
    command: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    find: Callable[..., object] = importlib.util.find_spec
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None if name == "mitsuba" else find(name))
    monkeypatch.chdir(tmp_path)
    assert command_line.run(simgen_cli.app, command.split()) == 2
    sentence = "error: mitsuba: not installed, and needed for rendering; type in the source tree:  "
    assert capsys.readouterr().err == sentence + "pip install '.[render]'\n"
