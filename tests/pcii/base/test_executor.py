"""Work in several processes and threads: faults, deaths, Ctrl-C, killed commands, clusters, forks."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pcii.base import Executor, InputError, WorkerLostError, compiled, threads, threads_of_worker, use_threads
from pcii.base.compiled_loops import in_threads


class Numbers:
    """Answers each piece by its number and what it keeps; some pieces kill their process or are wrong."""

    def __init__(self, folder: Path, **pieces: Any) -> None:
        self.folder, self.pieces, self.count = folder, pieces, 0

    def __call__(self, piece: int) -> tuple[int, int, int | None]:
        with (self.folder / "begun").open("a") as begun:
            begun.write(f"{piece} {os.getpid()}\n")
        if piece == self.pieces.get("deadly"):
            os.kill(os.getpid(), signal.SIGKILL)
        if piece == self.pieces.get("wrong"):
            raise InputError(f"piece {piece} is wrong")
        time.sleep(self.pieces.get("seconds", 0.02))
        self.count += 1
        return piece, self.count, threads_of_worker()

    def begun(self) -> list[tuple[int, int]]:
        """Pieces and the processes that began them, in order."""
        (self.folder / "begun").touch()
        lines = (self.folder / "begun").read_text().split("\n")[:-1]
        return [(int(piece), int(process)) for piece, process in (line.split() for line in lines)]


def wait_for(condition: Callable[[], object], seconds: float = 120) -> None:
    until = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < until
        time.sleep(0.02)


def alive(processes: set[int]) -> set[int]:
    stats = {process: Path(f"/proc/{process}/stat") for process in processes}
    return {process for process, stat in stats.items() if stat.exists() and ") Z" not in stat.read_text()}


@pytest.mark.parametrize("workers", [1, 2])
def test_each_piece_is_done_once_and_each_process_keeps_its_copy(tmp_path: Path, workers: int) -> None:
    work = Numbers(tmp_path)
    results = dict(Executor(workers).run(work, range(20)))
    assert {piece: result[0] for piece, result in results.items()} == {piece: piece for piece in range(20)}
    assert sorted(piece for piece, _ in work.begun()) == list(range(20))
    by_process = [process for _, process in work.begun()]
    counts = [by_process.count(process) for process in set(by_process)]
    assert len(counts) <= workers
    assert sorted(count for _, count, _ in results.values()) == sorted(
        number + 1 for count in counts for number in range(count)
    )
    share = None if workers == 1 else max(1, (os.cpu_count() or 1) // workers)
    assert {threads for _, _, threads in results.values()} == {share}


@pytest.mark.parametrize(
    ("workers", "fault", "sentence"),
    [
        (1, "wrong", "piece 3 is wrong"),
        (2, "wrong", "piece 3 is wrong"),
        (2, "deadly", "a worker process died.*; what is finished stays"),
    ],
)
def test_a_fault_or_a_death_ends_the_work(tmp_path: Path, workers: int, fault: str, sentence: str) -> None:
    work = Numbers(tmp_path, **{fault: 3})
    with pytest.raises(InputError if fault == "wrong" else WorkerLostError, match=sentence):
        list(Executor(workers).run(work, range(100)))
    assert len(work.begun()) < 20
    assert not alive({process for _, process in work.begun()} - {os.getpid()})


COMMAND = """
import sys
from pathlib import Path
from pcii.base import Executor, command_line
from test_executor import Numbers

command_line.LOG_EVERY_S = 0
app = command_line.command_app("numbers", "Numbers.")

@app.command
def work(folder: Path, scheduler: str | None = None):
    work, executor = Numbers(folder, seconds=float(sys.argv[-1])), Executor(1 if scheduler else 2, scheduler)
    with command_line.Stages() as report:
        for count, _ in enumerate(executor.run(work, range(1000)), start=1):
            report("numbers", count, 1000)

if __name__ == "__main__":
    raise SystemExit(command_line.run(app, sys.argv[1:-1], resuming=["work"]))
"""


@pytest.fixture
def started(tmp_path: Path) -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Starts Python with these arguments in a process group; what it says on standard error is to be read."""
    processes: list[subprocess.Popen[str]] = []
    (tmp_path / "command.py").write_text(COMMAND)
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), *sys.path])}

    def start(*arguments: str) -> subprocess.Popen[str]:
        # What a shell starts in the background ignores Ctrl-C, and so does all that this starts.
        listen = partial(signal.signal, signal.SIGINT, signal.default_int_handler)
        pipes: Any = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True}
        command = [sys.executable, *arguments]
        options = pipes | {"start_new_session": True, "preexec_fn": listen}
        processes.append(subprocess.Popen(command, env=environment, **options))
        return processes[-1]

    yield start
    for process in processes:
        process.kill()
        process.communicate()


def line_with(text: str, process: subprocess.Popen[str]) -> str:
    """The next line with this text, or "" if the process ends before; after two minutes it is ended."""
    assert process.stderr is not None
    end = threading.Timer(120, process.kill)
    end.start()
    next_line = next((line for line in process.stderr if text in line), "")
    end.cancel()
    return next_line


@pytest.mark.parametrize("ending", [signal.SIGINT, signal.SIGKILL])
def test_ctrl_c_and_a_kill_end_all_processes_in_the_midst_of_pieces(
    started: Callable[..., subprocess.Popen[str]], tmp_path: Path, ending: signal.Signals
) -> None:
    process, work = started(str(tmp_path / "command.py"), "work", str(tmp_path), "1000"), Numbers(tmp_path)
    wait_for(lambda: len(work.begun()) == 2)
    workers = {process for _, process in work.begun()}
    assert len(alive(workers)) == 2
    if ending == signal.SIGINT:
        os.killpg(process.pid, ending)  # as a terminal does
    else:
        process.send_signal(ending)
    _, errors = process.communicate(timeout=10)
    if ending == signal.SIGINT:
        assert process.returncode == 130
        assert errors == "stopped; the same command goes on from here\n"
    wait_for(lambda: not alive(workers), 10)


def test_a_cluster_without_workers_is_waited_for_and_the_end_of_its_scheduler_is_one_line(
    started: Callable[..., subprocess.Popen[str]], tmp_path: Path
) -> None:
    pytest.importorskip("distributed")
    settings = ["--host", "127.0.0.1", "--port", "0", "--no-dashboard"]
    scheduler = started("-m", "distributed.cli.dask_scheduler", *settings)
    address = line_with("Scheduler at:", scheduler).split()[-1]
    command = started(str(tmp_path / "command.py"), "work", str(tmp_path), "--scheduler", address, "0.01")
    assert f"dask worker {address}" in line_with("has no worker yet", command)
    started("-m", "distributed.cli.dask_worker", address, "--no-nanny", "--nthreads", "1")
    assert line_with("numbers: 1/1000", command)
    scheduler.kill()
    _, errors = command.communicate(timeout=120)
    lines = [line for line in errors.splitlines() if not line.startswith("numbers")]
    assert len(lines) == 1, errors
    assert lines[0].startswith(f"error: {address}: the Dask scheduler has ended")
    assert "the same command goes on" in lines[0]
    assert command.returncode == 1


def test_a_cluster_does_the_pieces_and_raises_their_faults(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    options: Any = {"n_workers": 1, "threads_per_worker": 2, "dashboard_address": None, "processes": False}
    with distributed.LocalCluster(**options) as cluster:
        executor = Executor(scheduler=cluster.scheduler_address)
        assert {piece for piece, _ in executor.run(Numbers(tmp_path), range(8))} == set(range(8))
        with pytest.raises(InputError, match="piece 1 is wrong"):
            list(executor.run(Numbers(tmp_path, wrong=1), range(3)))


def test_a_scheduler_that_does_not_answer_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr("pcii.base.executor.CONNECTION_TIMEOUT_S", 0.5)
    with pytest.raises(InputError, match=r"scheduler: none answers at tcp://127\.0\.0\.1:9"):
        list(Executor(scheduler="tcp://127.0.0.1:9").run(Numbers(tmp_path), range(2)))
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r"scheduler: Dask is not installed; .* pip install '\.\[cluster\]'"):
        list(Executor(scheduler="tcp://127.0.0.1:9").run(Numbers(tmp_path), range(2)))


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
