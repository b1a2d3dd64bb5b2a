"""Choosing a renderer: what is refused, what is tried, and what is remembered."""

import json
from pathlib import Path

import pytest

from pcii.base.errors import InputError
from simgen.renderer import backend


@pytest.fixture
def no_machine(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A machine without CUDA and with only the libraries put into the returned folder."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv("SIMGEN_BACKEND", raising=False)
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    monkeypatch.setattr(backend.ctypes.util, "find_library", lambda name: None)
    libraries = tmp_path / "lib"
    libraries.mkdir()
    monkeypatch.setattr(
        backend,
        "_llvm_libraries",
        lambda: sorted(libraries.glob("libLLVM*"), key=lambda p: -(backend._major_version(p) or 0)),
    )
    return libraries


def answers(monkeypatch: pytest.MonkeyPatch, works: dict[str, bool]) -> list[str]:
    """Replace the trial process by a table; returns the list of what was tried."""
    tried: list[str] = []

    def probe(kind: str, library: str) -> tuple[bool, str]:
        tried.append(library)
        return (True, "works") if works[Path(library).name] else (False, "ended with signal 6")

    monkeypatch.setattr(backend, "_probe", probe)
    return tried


def test_without_any_library_it_is_scalar(no_machine: Path) -> None:
    chosen = backend.choose()
    assert chosen.kind == "scalar"
    assert "libllvm19" in (backend.advice() or "")


def test_llvm_14_and_15_are_refused_without_being_tried(
    no_machine: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("libLLVM-14.so.1", "libLLVM-15.so"):
        (no_machine / name).touch()
    tried = answers(monkeypatch, {})
    chosen = backend.choose()
    assert chosen.kind == "scalar"
    assert tried == []
    assert "LLVM 15 is too old" in chosen.reason


def test_the_newest_that_works_is_taken_and_an_abort_survived(
    no_machine: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("libLLVM-15.so", "libLLVM.so.19.1", "libLLVM.so.20.1"):
        (no_machine / name).touch()
    answers(monkeypatch, {"libLLVM.so.19.1": True, "libLLVM.so.20.1": False})
    chosen = backend.choose()
    assert chosen.kind == "llvm"
    assert (chosen.library or "").endswith("libLLVM.so.19.1")
    assert "signal 6" in chosen.reason
    assert backend.advice() is None


def test_answers_are_cached_until_the_library_changes(
    no_machine: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    library = no_machine / "libLLVM.so.19.1"
    library.write_bytes(b"one")
    tried = answers(monkeypatch, {library.name: True})
    backend.choose()
    backend.choose()
    assert len(tried) == 1
    library.write_bytes(b"another")
    backend.choose()
    assert len(tried) == 2


def test_a_damaged_cache_is_ignored(
    no_machine: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (no_machine / "libLLVM.so.19.1").touch()
    tried = answers(monkeypatch, {"libLLVM.so.19.1": True})
    backend.choose()
    (stored,) = (tmp_path / "cache" / "simgen").glob("*.json")
    assert json.loads(stored.read_text())["works"] is True
    stored.write_text("{")
    assert backend.choose().kind == "llvm"
    assert len(tried) == 2


def test_what_is_asked_for_is_given_or_refused(no_machine: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SIMGEN_BACKEND", "scalar")
    assert backend.choose().variant == "scalar_rgb"
    monkeypatch.setenv("SIMGEN_BACKEND", "llvm")
    with pytest.raises(InputError, match="llvm does not work here"):
        backend.choose()
    monkeypatch.setenv("SIMGEN_BACKEND", "opencl")
    with pytest.raises(InputError, match="use one of cuda, llvm, scalar"):
        backend.choose()


def test_a_library_that_kills_its_process_does_not_kill_ours(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(backend, "_PROBE", "import os; os.abort()")
    assert backend._probe("llvm", "/nowhere/libLLVM.so") == (False, "ended the trial process with signal 6")
    monkeypatch.setattr(backend, "_PROBE", "raise ImportError('no such library')")
    works, detail = backend._probe("llvm", "/nowhere/libLLVM.so")
    assert not works
    assert "no such library" in detail
