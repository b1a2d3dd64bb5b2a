"""A job's pieces as tasks of a Dask cluster, all of whose workers see the same file system.

A task is the number of a piece and returns a small result. The job is installed on every worker, those that
replace dead ones too, and what it keeps between pieces stays there.
"""

import errno
import logging
import threading
import time
from collections import deque
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from queue import Empty, SimpleQueue
from typing import Any
from uuid import uuid4

from pcii.base.errors import InputError
from pcii.base.jobs import AGAIN_S, MOST_DEATHS, Done, Job, attempt
from pcii.base.progress import Report

MOST_TASKS = 2000
"""Tasks that the scheduler knows of at a time: each takes it some kB and a millisecond."""
ANSWER_S = 5.0
"""So long a scheduler may take to answer."""
LOOK_S = 1.0
"""After so long without a finished piece look whether there are workers at all."""

_one_at_a_time = threading.Lock()


def run_on_cluster(
    job: Job, pieces: Sequence[int], address: str, resource: str | None, report: Report
) -> Generator[Done]:
    """Do these pieces of a job on a cluster and yield each when it is done; without workers wait for one.

    `address` is that of the scheduler; tasks run on workers that have one of `resource`, if it is given.
    Raises `InputError` if no scheduler answers or the extra `cluster` is not installed, ConnectionError if
    the scheduler ends meanwhile, and what is no fault of a single piece.
    """
    try:
        from distributed import Client
    except ImportError:
        install = "pip install '.[cluster]'"
        raise InputError(f"scheduler: Dask is not installed; type in the source tree: {install}") from None
    with _without_messages_of_dask():
        try:
            client: Any = Client(address, timeout=ANSWER_S)
        except (OSError, ValueError) as fault:
            raise InputError(f"scheduler: none answers at {address} ({fault})") from None
        installed = f"{type(job).__name__}-{uuid4().hex}"
        with client, _loss_reported(client, address), _on_all_workers(client, job, installed):
            wanted = None if resource is None else {resource: 1}
            command = f"dask worker {address} --nthreads 1{f' --resources {resource}=1' if resource else ''}"
            ahead, running, ended = deque(pieces), dict[Any, int](), SimpleQueue[Any]()

            def submit() -> None:
                piece = ahead.popleft()
                settings = {"pure": False, "retries": MOST_DEATHS - 1, "resources": wanted}
                future = client.submit(_task, installed, piece, **settings)
                running[future] = piece
                future.add_done_callback(ended.put)

            waited = False

            def tell(*, waiting: bool) -> None:
                nonlocal waited
                if waiting or waited:
                    report(f"waiting for a worker, as this starts one: {command}", int(not waiting), 1)
                waited = waiting

            for _ in range(min(MOST_TASKS, len(ahead))):
                submit()
            while running:
                try:
                    future = ended.get(timeout=LOOK_S)
                except Empty:
                    tell(waiting=not _has_workers(client, resource))
                    continue
                piece = running.pop(future)
                fault = future.exception() if future.status == "error" else None
                done = None if fault is not None else future.result()
                tell(waiting=False)
                if done is not None:
                    yield done
                elif fault is None:
                    ahead.append(piece)
                elif type(fault).__name__ == "KilledWorker":
                    yield Done(piece, None, f"{job.name(piece)}: workers died of it again and again")
                else:
                    raise fault
                future.release()
                if ahead:
                    submit()


@contextmanager
def _without_messages_of_dask() -> Iterator[None]:
    """Keep Dask from printing what happens to connections, tracebacks included, within the block."""
    loggers = [logging.getLogger(f"distributed.{part}") for part in ("client", "batched")]
    before = [logger.disabled for logger in loggers]
    for logger in loggers:
        logger.disabled = True
    try:
        yield
    finally:
        for logger, disabled in zip(loggers, before, strict=True):
            logger.disabled = disabled


@contextmanager
def _loss_reported(client: Any, address: str) -> Iterator[None]:
    """Raise one ConnectionResetError for the various exceptions that Dask raises when its scheduler ends."""
    from distributed import CancelledError
    from distributed.comm.core import CommClosedError

    try:
        yield
    except Exception as fault:
        # Dask cancels what it has submitted when it loses its scheduler, and then tries to find it again.
        if client.status == "running" and not isinstance(fault, CancelledError | CommClosedError):
            raise
        lost = (
            "the Dask scheduler has ended or is out of reach; what is finished stays, and the same command "
            "goes on from there"
        )
        raise ConnectionResetError(errno.ECONNRESET, lost, address) from fault


def _has_workers(client: Any, resource: str | None) -> bool:
    """Whether the cluster has workers, with this resource if it is given."""
    # Not client.scheduler_info(), which lists only a few of the workers in some versions.
    workers = client.sync(client.scheduler.identity)["workers"].values()
    return any(resource is None or resource in worker["resources"] for worker in workers)


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
        if client.status == "running":  # and not lost
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
