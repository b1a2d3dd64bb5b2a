"""A job's pieces as tasks of a Dask cluster, all of whose workers see the same file system.

A task is the number of a piece and returns a small result. The job is installed on every worker, those that
replace dead ones too, and what it keeps between pieces stays there.
"""

import threading
import time
from collections import deque
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from typing import Any
from uuid import uuid4

from pcii.base.errors import InputError
from pcii.base.jobs import AGAIN_S, MOST_DEATHS, Done, Job, attempt

MOST_TASKS = 2000
"""Tasks that the scheduler knows of at a time: each takes it some kB and a millisecond."""
ANSWER_S = 5.0
"""So long a scheduler may take to answer."""

_one_at_a_time = threading.Lock()


def run_on_cluster(job: Job, pieces: Sequence[int], address: str, resource: str | None) -> Generator[Done]:
    """Do these pieces of a job on a cluster and yield each when it is done.

    `address` is that of the scheduler; tasks run on workers that have one of `resource`, if it is given.
    Raises `InputError` if no scheduler answers or the extra `cluster` is not installed, and what is no
    fault of a single piece.
    """
    try:
        from distributed import Client, Future, as_completed
    except ImportError:
        install = "pip install '.[cluster]'"
        raise InputError(f"scheduler: Dask is not installed; type in the source tree: {install}") from None
    try:
        client = Client(address, timeout=ANSWER_S)
    except (OSError, ValueError) as fault:
        raise InputError(f"scheduler: none answers at {address} ({fault})") from None
    installed = f"{type(job).__name__}-{uuid4().hex}"
    with client, _on_all_workers(client, job, installed):
        wanted = None if resource is None else {resource: 1}
        ahead, running = deque(pieces), dict[Any, int]()

        def submit() -> Future:
            piece = ahead.popleft()
            settings = {"pure": False, "retries": MOST_DEATHS - 1, "resources": wanted}
            future = client.submit(_task, installed, piece, **settings)
            running[future] = piece
            return future

        tasks = as_completed([submit() for _ in range(min(MOST_TASKS, len(ahead)))])
        for future in tasks:
            piece = running.pop(future)
            fault = future.exception() if future.status == "error" else None
            if fault is None and (done := future.result()) is not None:
                yield done
            elif fault is None:
                ahead.append(piece)
            elif type(fault).__name__ == "KilledWorker":
                yield Done(piece, None, f"{job.name(piece)}: workers died of it again and again")
            else:
                raise fault
            future.release()
            if ahead:
                tasks.add(submit())


@contextmanager
def _on_all_workers(client: Any, job: Job, name: str) -> Iterator[None]:
    """Have the job on all workers, also on those that start within the block, under this name."""
    from distributed import WorkerPlugin

    class Installed(WorkerPlugin):
        def __init__(self) -> None:
            self.job = job

    client.register_plugin(Installed(), name=name)
    try:
        yield
    finally:
        client.unregister_worker_plugin(name)


def _task(installed: str, piece: int) -> Done | None:
    """Do a piece; None if a process that is not of this cluster is at it."""
    from distributed import get_worker

    plugin: Any = get_worker().plugins[installed]
    job: Job = plugin.job
    with _one_at_a_time:  # threads of a worker would share one renderer
        done = attempt(job, piece)
        if done is None:
            time.sleep(AGAIN_S)
        return done
