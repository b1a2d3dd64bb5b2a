"""Collections on a Dask cluster of processes: the same bytes, also when a worker dies."""

import os
import signal
import threading
import time
from collections.abc import Iterator
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
