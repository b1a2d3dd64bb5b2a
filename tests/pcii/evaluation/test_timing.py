"""Nothing but the work is timed: calls that compile, read compiled code or import do not count."""

import importlib.util
import sys
import time
from collections.abc import Callable
from itertools import count
from pathlib import Path
from types import ModuleType

import numba as nb
import pytest

from pcii.evaluation.timing import MOST_CALLS, timed

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


def counted(work: Callable[[int], object]) -> tuple[Callable[[], object], list[float]]:
    """The work, given the number of its call, and the seconds that each call took."""
    calls: list[float] = []

    def again() -> object:
        start = time.perf_counter()
        answer = work(len(calls))
        calls.append(time.perf_counter() - start)
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


def test_what_compiles_nothing_is_called_once() -> None:
    work, calls = counted(lambda _: 7)
    seconds, answer = timed(work)
    assert (len(calls), answer) == (1, 7)
    assert seconds >= calls[0]


def test_a_call_that_compiles_is_made_again() -> None:
    loop = nb.njit(lambda n: n + 1)
    loop(1)  # other data needs the loop for other numbers
    work, calls = counted(lambda _: loop(1.5))
    seconds, answer = timed(work)
    assert (len(calls), answer) == (2, 2.5)
    assert seconds < calls[0] / 2


def test_a_call_that_reads_compiled_code_is_made_again(tmp_path: Path) -> None:
    (tmp_path / "loop.py").write_text(LOOP)
    loaded(tmp_path / "loop.py").loop(3)
    again = loaded(tmp_path / "loop.py")
    work, calls = counted(lambda _: again.loop(3))
    seconds, answer = timed(work)
    assert sum(again.loop.stats.cache_hits.values()) == 1
    assert sum(again.loop.stats.cache_misses.values()) == 0
    assert (len(calls), answer) == (2, 3)
    assert seconds < calls[0] / 2


def test_a_call_that_imports_is_made_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "slow_to_import.py").write_text("import time\ntime.sleep(0.05)\n")
    monkeypatch.syspath_prepend(str(tmp_path))

    def work(_: int) -> None:
        import slow_to_import  # type: ignore[import-not-found]  # noqa: F401

    again, calls = counted(work)
    seconds, _ = timed(again)
    del sys.modules["slow_to_import"]
    assert len(calls) == 2
    assert seconds < 0.05


def test_code_that_compiles_in_every_call_is_timed_in_the_end() -> None:
    work, calls = counted(lambda number: nb.njit(lambda n: n + number)(1))
    _, answer = timed(work)
    assert (len(calls), answer) == (MOST_CALLS, MOST_CALLS)
