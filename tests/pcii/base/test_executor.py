"""Jobs in several processes: deaths, full disks, pieces of others, Ctrl-C, killed commands, clusters."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from pcii.base.errors import BusyError, InputError
from pcii.base.executor import Executor
from pcii.base.jobs import Done


class Numbers:
    """Answers each piece by its number; some pieces kill their process, find the disk full, or are busy."""

    def __init__(self, folder: Path, **pieces: Any) -> None:
        self.folder, self.pieces, self.threads = folder, pieces, 0

    def __call__(self, piece: int) -> tuple[int, int]:
        with (self.folder / "begun").open("a") as begun:
            begun.write(f"{piece} {os.getpid()}\n")
        if piece in self.pieces.get("deadly", ()) or self._first_time("deadly_once", piece):
            os.kill(os.getpid(), signal.SIGSEGV if piece % 2 else signal.SIGKILL)
        if piece in self.pieces.get("full", ()):
            raise OSError(28, "No space left on device", f"file {piece}")
        if piece in self.pieces.get("wrong", ()):
            raise InputError(f"piece {piece} is wrong")
        if self._first_time("busy_once", piece):
            raise BusyError
        time.sleep(self.pieces.get("seconds", 0.02))
        return piece, self.threads

    def _first_time(self, what: str, piece: int) -> bool:
        mark = self.folder / f"{what}_{piece}"
        if piece not in self.pieces.get(what, ()) or mark.exists():
            return False
        mark.touch()
        return True

    def name(self, piece: int) -> str:
        return f"number {piece}"

    def use_threads(self, count: int) -> None:
        self.threads = count

    def begun(self) -> list[tuple[int, int]]:
        """Pieces and the processes that began them, in order."""
        lines = (self.folder / "begun").read_text().split("\n")[:-1]
        return [(int(piece), int(process)) for piece, process in (line.split() for line in lines)]


def done_by(executor: Executor, job: Numbers, count: int) -> dict[int, Done]:
    done = list(executor.run(job, range(count)))
    assert len(done) == count
    return {one.piece: one for one in done}


def test_neighbours_are_done_by_one_process(tmp_path: Path) -> None:
    job, threads = Numbers(tmp_path), max(1, (os.cpu_count() or 1) // 2)
    assert done_by(Executor(2), job, 20) == {piece: Done(piece, (piece, threads)) for piece in range(20)}
    by_process: dict[int, list[int]] = {}
    for piece, process in job.begun():
        by_process.setdefault(process, []).append(piece)
    assert len(by_process) == 2
    following = sum(after == before + 1 for own in by_process.values() for before, after in pairwise(own))
    assert following > 10
    assert Counter(piece for piece, _ in job.begun()) == dict.fromkeys(range(20), 1)


def test_a_piece_that_kills_is_tried_once_more_and_harms_no_other(tmp_path: Path) -> None:
    job = Numbers(tmp_path, deadly={2, 3}, deadly_once={1}, wrong={4})
    done = done_by(Executor(2), job, 6)
    how = "2 processes died of it, the last with exit code"
    assert {piece: one.fault for piece, one in done.items() if one.fault} == {
        2: f"number 2: {how} {-signal.SIGKILL}",
        3: f"number 3: {how} {-signal.SIGSEGV}",
        4: "piece 4 is wrong",
    }
    assert all(done[piece].result for piece in (0, 1, 5))
    assert Counter(piece for piece, _ in job.begun()) == {0: 1, 1: 2, 2: 2, 3: 2, 4: 1, 5: 1}


def test_a_full_disk_is_raised_and_ends_the_work(tmp_path: Path) -> None:
    job = Numbers(tmp_path, full={0, 5})
    with pytest.raises(OSError, match="No space left on device") as fault:
        done_by(Executor(2), job, 100)
    assert fault.value.filename in ("file 0", "file 5")
    assert len(job.begun()) < 100


@pytest.mark.parametrize("workers", [1, 2])
def test_what_others_are_at_is_looked_at_again(tmp_path: Path, workers: int) -> None:
    job = Numbers(tmp_path, busy_once={0, 1})
    assert set(done_by(Executor(workers), job, 3)) == {0, 1, 2}
    assert Counter(piece for piece, _ in job.begun()) == {0: 2, 1: 2, 2: 1}


COMMAND = """
import sys
from pathlib import Path
from pcii.base import command_line, progress
from pcii.base.executor import Executor
from test_executor import Numbers

progress.LOG_EVERY_S = 0
app = command_line.command_app("numbers", "Numbers.")

@app.command
def work(folder: Path, scheduler: str | None = None):
    job, executor = Numbers(folder, seconds=float(sys.argv[-1])), Executor(1 if scheduler else 2, scheduler)
    with progress.Stages() as report:
        for count, _ in enumerate(executor.run(job, range(1000), report), start=1):
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
        pipes: Any = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True}
        command = [sys.executable, *arguments]
        processes.append(subprocess.Popen(command, env=environment, start_new_session=True, **pipes))
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
    found = next((line for line in process.stderr if text in line), "")
    end.cancel()
    return found


def alive(processes: set[int]) -> set[int]:
    stats = {process: Path(f"/proc/{process}/stat") for process in processes}
    return {process for process, stat in stats.items() if stat.exists() and ") Z" not in stat.read_text()}


@pytest.mark.parametrize("ending", [signal.SIGINT, signal.SIGKILL])
def test_ctrl_c_and_a_kill_end_all_processes_in_the_midst_of_pieces(
    started: Callable[..., subprocess.Popen[str]], tmp_path: Path, ending: signal.Signals
) -> None:
    process, job = started(str(tmp_path / "command.py"), "work", str(tmp_path), "1000"), Numbers(tmp_path)
    until = time.monotonic() + 120
    while not (tmp_path / "begun").exists() or len(job.begun()) < 2:
        assert process.poll() is None
        assert time.monotonic() < until
        time.sleep(0.05)
    workers = {process for _, process in job.begun()}
    assert len(alive(workers)) == 2
    if ending == signal.SIGINT:
        os.killpg(process.pid, ending)  # as a terminal does
    else:
        process.send_signal(ending)
    _, told = process.communicate(timeout=60)
    if ending == signal.SIGINT:
        assert process.returncode == 130
        assert told == "stopped; the same command goes on from here\n"
    until = time.monotonic() + 30
    while alive(workers):
        assert time.monotonic() < until
        time.sleep(0.05)


def test_ctrl_c_that_another_thread_receives_ends_the_work(tmp_path: Path) -> None:
    job, ended, ignored = Numbers(tmp_path, seconds=1000), threading.Event(), threading.Event()

    def stop() -> None:
        while not (tmp_path / "begun").exists() or len(job.begun()) < 2:
            time.sleep(0.05)
        signal.pthread_kill(threading.get_ident(), signal.SIGINT)
        if not ended.wait(30):
            ignored.set()
            signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)

    threading.Thread(target=stop, daemon=True).start()
    with pytest.raises(KeyboardInterrupt):
        done_by(Executor(2), job, 2)
    ended.set()
    assert not ignored.is_set()


def test_a_cluster_without_workers_is_waited_for_and_the_end_of_its_scheduler_told_in_one_line(
    started: Callable[..., subprocess.Popen[str]], tmp_path: Path
) -> None:
    pytest.importorskip("distributed")
    settings = ["--host", "127.0.0.1", "--port", "0", "--no-dashboard"]
    scheduler = started("-m", "distributed.cli.dask_scheduler", *settings)
    address = line_with("Scheduler at:", scheduler).split()[-1]
    command = started(str(tmp_path / "command.py"), "work", str(tmp_path), "--scheduler", address, "0.01")
    assert f"dask worker {address} --nthreads 1: 0/1" in line_with("waiting for a worker", command)
    started("-m", "distributed.cli.dask_worker", address, "--no-nanny", "--nthreads", "1")
    assert line_with("numbers: 1/1000", command)
    scheduler.kill()
    _, told = command.communicate(timeout=120)
    lines = [line for line in told.splitlines() if not line.startswith(("numbers", "waiting for a worker"))]
    assert len(lines) == 1, told
    assert lines[0].startswith(f"error: {address}: the Dask scheduler has ended")
    assert "the same command goes on" in lines[0]
    assert command.returncode == 1


def test_a_cluster_does_a_piece_again_whose_worker_died(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    options: Any = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
    with distributed.LocalCluster(resources={"renderer": 1}, **options) as cluster:
        executor = Executor(scheduler=cluster.scheduler_address, resource="renderer")
        job = Numbers(tmp_path, deadly_once={3}, wrong={4}, busy_once={5})
        done = done_by(executor, job, 8)
        assert {piece: one.fault for piece, one in done.items() if one.fault} == {4: "piece 4 is wrong"}
        assert len({process for _, process in job.begun()}) > 1
        with pytest.raises(OSError, match="No space left on device"):
            done_by(executor, Numbers(tmp_path, full={1}), 3)


def test_a_scheduler_that_does_not_answer_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr("pcii.base.dask_cluster.ANSWER_S", 0.5)
    with pytest.raises(InputError, match=r"scheduler: none answers at tcp://127\.0\.0\.1:9"):
        list(Executor(scheduler="tcp://127.0.0.1:9").run(Numbers(tmp_path), range(2)))


def test_without_dask_processes_work_and_a_scheduler_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert set(done_by(Executor(2), Numbers(tmp_path), 2)) == {0, 1}
    with pytest.raises(InputError, match=r"scheduler: Dask is not installed; .* pip install '\.\[cluster\]'"):
        done_by(Executor(scheduler="tcp://127.0.0.1:9"), Numbers(tmp_path), 2)


def test_executors_that_make_no_sense_are_refused() -> None:
    for workers, scheduler, resource in ((0, None, None), (2, "tcp://here", None), (1, None, "GPU")):
        with pytest.raises(InputError):
            Executor(workers, scheduler, resource)
