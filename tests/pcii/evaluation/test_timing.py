"""Nothing but the work is timed: calls that compile, read compiled code or import do not count."""

import importlib.util
import sys
from collections.abc import Callable
from itertools import count
from pathlib import Path
from types import ModuleType

import numba as nb
import pytest
from slow_clock import SlowClock

from pcii.evaluation.measurement import timed

NAMES = count()
LOOP = """
import numba as nb

@nb.njit(cache=True)
def loop(n):
    total = 0
    for i in range(n):
        total += i
    return total
"""


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> SlowClock:
    return SlowClock(monkeypatch)


def counted(clock: SlowClock, work: Callable[[int], object]) -> tuple[Callable[[], object], list[float]]:
    """The work, given the number of its call, and the seconds that each call took: 100, 101 and so on."""
    calls: list[float] = []

    def again() -> object:
        answer = work(len(calls))
        calls.append(100.0 + len(calls))
        clock.go_on(calls[-1])
        return answer

    return again, calls


def loaded(file: Path) -> ModuleType:
    """The file as a module that no one has loaded, which is not put where imported ones are."""
    spec = importlib.util.spec_from_file_location(f"loop_{next(NAMES)}", file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_work_that_compiles_nothing_is_called_once(clock: SlowClock) -> None:
    work, calls = counted(clock, lambda _: 7)
    assert timed(work) == (100.0, 7)
    assert len(calls) == 1


def test_a_call_that_compiles_is_made_again(clock: SlowClock) -> None:
    loop = nb.njit(lambda n: n + 1)
    loop(1)  # other data needs the loop for other numbers
    work, calls = counted(clock, lambda _: loop(1.5))
    assert timed(work) == (101.0, 2.5)
    assert len(calls) == 2


def test_a_call_that_reads_compiled_code_is_made_again(tmp_path: Path, clock: SlowClock) -> None:
    (tmp_path / "loop.py").write_text(LOOP)
    loaded(tmp_path / "loop.py").loop(3)
    again = loaded(tmp_path / "loop.py")
    work, calls = counted(clock, lambda _: again.loop(3))
    assert timed(work) == (101.0, 3)
    assert len(calls) == 2
    assert sum(again.loop.stats.cache_hits.values()) == 1
    assert sum(again.loop.stats.cache_misses.values()) == 0


def test_a_call_that_imports_is_made_again(
    tmp_path: Path, clock: SlowClock, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "not_imported_yet.py").write_text("")
    monkeypatch.syspath_prepend(str(tmp_path))

    def work(_: int) -> None:
        import not_imported_yet  # type: ignore[import-not-found]  # noqa: F401

    again, calls = counted(clock, work)
    assert timed(again)[0] == 101.0
    del sys.modules["not_imported_yet"]
    assert len(calls) == 2


def test_code_that_compiles_in_every_call_is_timed_in_the_end(clock: SlowClock) -> None:
    # One call may import, the next compile, one is timed, and one is to spare.
    work, calls = counted(clock, lambda number: nb.njit(lambda n: n + number)(1))
    assert timed(work) == (103.0, 4)
    assert len(calls) == 4
