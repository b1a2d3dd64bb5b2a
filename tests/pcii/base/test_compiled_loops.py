"""Loops that threads share: every index once, errors raised, and processes that were forked."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from pcii.base import compiled, threads, use_threads
from pcii.base.compiled_loops import in_threads


@compiled
def _add_one(first: int, last: int, counts: np.ndarray) -> int:
    for place in range(first, last):
        counts[place] += 1
    return last - first


@pytest.fixture(params=[1, 2, 5])
def several_threads(request, monkeypatch):
    monkeypatch.setattr("numba.config.NUMBA_NUM_THREADS", 5)
    before = threads()
    use_threads(request.param)
    yield request.param
    use_threads(before)


@pytest.mark.parametrize("count", [0, 1, 2, 7, 1000])
def test_every_index_is_visited_once_and_results_come_in_order(several_threads, count):
    visits = np.zeros(count, np.int64)
    sizes = in_threads(_add_one, count, visits)
    np.testing.assert_array_equal(visits, 1)
    assert sum(sizes) == count
    starts = in_threads(lambda first, last: first, count)
    assert starts == sorted(starts)
    assert starts[0] == 0


def test_an_error_in_any_range_is_raised(several_threads):
    def fail_at_the_end(first, last):
        if last == 100:
            raise ZeroDivisionError("at the end")

    with pytest.raises(ZeroDivisionError, match="at the end"):
        in_threads(fail_at_the_end, 100)


@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_loops_run_in_a_process_that_was_forked(several_threads):
    visits = np.zeros(64, np.int64)
    in_threads(_add_one, 64, visits)  # the parent has its threads
    child = os.fork()
    if child == 0:
        in_threads(_add_one, 64, visits)
        os._exit(int((visits != 2).any()))
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0


def test_the_cache_of_compiled_code_is_not_where_the_working_directory_says(tmp_path: Path):
    pytest.importorskip("yaml")  # with which Numba reads that file
    (tmp_path / ".numba_config.yaml").write_text("cache_dir: planted")
    script = "import pcii.base, numba; pcii.base.threads(); assert numba.config.CACHE_DIR == ''"
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    environment["PYTHONPATH"] = os.pathsep.join(sys.path)
    subprocess.run([sys.executable, "-P", "-c", script], cwd=tmp_path, env=environment, check=True)
