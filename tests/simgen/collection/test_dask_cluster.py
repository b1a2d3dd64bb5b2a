"""Collections on a Dask cluster: the same bytes though a worker dies; no worker; a scheduler that dies."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from digests import digest
from tiny import GRID_2_X_2

from pcii.base.crew import Crew
from pcii.base.errors import InputError
from pcii.io.collection import open_collection
from simgen.collection.whole_collection import generate_collection
from simgen.spec.sweeps import load_sweep

distributed = pytest.importorskip("distributed")
pytestmark = pytest.mark.renders
TOML = f'scene = "plain_pair"\n{GRID_2_X_2}[photons]\nbudget = 100\n'


@pytest.fixture
def cluster() -> Iterator[object]:
    settings = {"processes": True, "threads_per_worker": 1, "dashboard_address": None}
    with distributed.LocalCluster(n_workers=2, resources={"renderer": 1}, **settings) as cluster:
        yield cluster


def test_a_cluster_makes_the_same_bytes_though_a_worker_dies(cluster, tmp_path: Path) -> None:
    path = tmp_path / "tiny.toml"
    path.write_text(TOML)
    sweep = load_sweep(str(path), seeds=6)
    assert generate_collection(sweep, tmp_path / "here") == []
    out = tmp_path / "cluster"
    killed = []

    def kill() -> None:
        while not list(out.glob("*/.unfinished.json")) and not list(out.glob("*/manifest.json")):
            time.sleep(0.005)
        process = next(iter(cluster.workers.values())).process.process
        killed.append(process.pid)
        os.kill(process.pid, signal.SIGKILL)

    killer = threading.Thread(target=kill, daemon=True)
    killer.start()
    crew = Crew(scheduler=cluster.scheduler_address, resource="renderer")
    assert generate_collection(sweep, out, crew) == []
    killer.join(timeout=10)
    assert killed
    for row in open_collection(tmp_path / "here").rows:
        assert digest(out / row["path"]) == digest(tmp_path / "here" / row["path"])
    assert len(open_collection(out)) == 6


def test_a_scheduler_that_does_not_answer_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pcii.base.dask_cluster.ANSWER_S", 0.5)
    path = tmp_path / "tiny.toml"
    path.write_text(TOML)
    with pytest.raises(InputError, match=r"scheduler: none answers at tcp://127\.0\.0\.1:9"):
        generate_collection(
            load_sweep(str(path), seeds=2), tmp_path / "out", Crew(scheduler="tcp://127.0.0.1:9")
        )


@pytest.fixture
def started() -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Starts Python with these arguments; what it says on standard error is to be read."""
    processes: list[subprocess.Popen[str]] = []

    def start(*arguments: str) -> subprocess.Popen[str]:
        command = [sys.executable, *arguments]
        processes.append(
            subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        )
        return processes[-1]

    yield start
    for process in processes:
        process.kill()
        process.communicate()


def test_workers_are_waited_for_and_a_scheduler_that_dies_is_told_of_in_one_line(
    started: Callable[..., subprocess.Popen[str]], tmp_path: Path
) -> None:
    path, out = tmp_path / "tiny.toml", tmp_path / "out"
    path.write_text(TOML)
    scheduler = started(
        "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard"
    )
    address = line_with("Scheduler at:", scheduler).split()[-1]
    often = "from pcii.base import progress; progress.LOG_EVERY_S = 0"
    run = f"{often}; from simgen.app.commands import main; raise SystemExit(main())"
    given = ["-o", str(out), "--seeds", "1000", "--scheduler", address]
    command = started("-c", run, "generate", str(path), *given)
    assert f"dask worker {address} --nthreads 1: 0/1" in line_with("waiting for a worker", command)
    started("-m", "distributed.cli.dask_worker", address, "--no-nanny", "--nthreads", "1")
    assert line_with("datasets: 1/1000", command)
    scheduler.kill()
    _, told = command.communicate(timeout=60)
    lines = [line for line in told.splitlines() if not line.startswith(("datasets", "waiting for a worker"))]
    assert len(lines) == 1, told
    assert lines[0].startswith(f"error: {address}: the Dask scheduler has ended")
    assert "the same command goes on" in lines[0]
    assert command.returncode == 1
    assert 1 <= len(open_collection(out)) < 1000


def line_with(text: str, process: subprocess.Popen[str]) -> str:
    """The next line with this text, or "" if the process ends before; after a minute it is ended."""
    assert process.stderr is not None
    end = threading.Timer(60, process.kill)
    end.start()
    found = next((line for line in process.stderr if text in line), "")
    end.cancel()
    return found
