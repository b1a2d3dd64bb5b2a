"""Where the pieces of work are done: in this process, in local worker processes, or on a Dask cluster."""

import logging
import os
import pickle
import signal
import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import islice
from queue import Empty, SimpleQueue
from typing import Any
from uuid import uuid4

from pcii.base.errors import InputError, WorkerLostError
from pcii.base.progress import Report, silent

GOES_ON = "what is finished stays, and the same command goes on from there"
PIECES_PER_WORKER = 4
"""Pieces that a local pool knows of at a time, so that no worker waits for this process."""
MAX_CLUSTER_TASKS = 2000
"""Pieces that a scheduler knows of at a time: each takes it some kB and a millisecond."""
CONNECTION_TIMEOUT_S = 5.0
LOOK_S = 1.0
"""After so long without a finished piece signals and the workers of a cluster are looked at."""

Work = Callable[[int], Any]


@dataclass(frozen=True)
class Executor:
    """Where work is done; raises `InputError` for less than one worker, and for workers of both kinds."""

    workers: int = 1
    """Processes of this machine that share the work. The results are the same for any number of them."""
    scheduler: str | None = None
    """Address of a Dask scheduler whose cluster does the work, such as `tcp://10.0.0.1:8786`. All its workers
    must reach all folders under the same paths."""
    resource: str | None = None
    """Of a cluster, use only workers that were started with this resource, such as GPU."""

    def __post_init__(self) -> None:
        if self.workers < 1:
            raise InputError(f"workers: expected a whole number from 1 on, got {self.workers}")
        if self.workers > 1 and self.scheduler is not None:
            raise InputError("workers: a cluster has workers of its own; leave out workers or scheduler")
        if self.resource is not None and self.scheduler is None:
            raise InputError("resource: workers of a cluster have such; give its scheduler too")

    def run(self, work: Work, pieces: Sequence[int], report: Report = silent) -> Generator[tuple[int, Any]]:
        """Yield (piece, `work(piece)`) of each of these pieces as soon as it is done.

        Each process has one copy of `work`, which can be pickled and may keep things between pieces. An
        exception of a piece is raised here and ends the work, as the end of this generator does.
        `report` is called while a cluster has no workers. Raises `WorkerLostError` if a process dies or the
        cluster is out of reach, and `InputError` if there is no such cluster.
        """
        if self.scheduler is not None:
            yield from _run_on_cluster(work, pieces, self.scheduler, self.resource, report)
        elif self.workers > 1 and len(pieces) > 1:
            yield from _run_in_processes(work, pieces, min(self.workers, len(pieces)))
        else:
            for piece in pieces:
                yield piece, work(piece)


THIS_PROCESS = Executor()


def threads_of_worker() -> int | None:
    """Threads that this process may use if it is one of several local workers; None if it is not."""
    return _threads_of_worker


def _results(
    submit: Callable[[int], Any], pieces: Sequence[int], at_a_time: int, look: Callable[[], None]
) -> Iterator[tuple[int, Any]]:
    """Results of pieces as they are done; `look` is called after each `LOOK_S` in which none was.

    `submit` returns a future, of `concurrent` or of `distributed`.
    """
    running, finished = dict[Any, int](), SimpleQueue[Any]()

    def start(piece: int) -> None:
        future = submit(piece)
        running[future] = piece
        future.add_done_callback(finished.put)

    waiting = iter(pieces)
    for piece in islice(waiting, at_a_time):
        start(piece)
    while running:
        try:
            future = finished.get(timeout=LOOK_S)
        except Empty:
            look()
            continue
        yield running.pop(future), future.result()
        for piece in islice(waiting, 1):
            start(piece)


# Local worker processes


def _run_in_processes(work: Work, pieces: Sequence[int], count: int) -> Generator[tuple[int, Any]]:
    import multiprocessing
    from concurrent.futures.process import BrokenProcessPool, ProcessPoolExecutor

    pickled, threads = pickle.dumps(work), max(1, (os.cpu_count() or 1) // count)
    # Not forked: what other threads hold locked would be locked for ever in the copy.
    spawning = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(count, spawning, _begin_worker, (pickled, threads))

    def submit(piece: int) -> Any:
        # Workers inherit the mask: Ctrl-C reaches all processes, and this one ends the others.
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
        try:
            return pool.submit(_do_in_worker, piece)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)

    try:
        yield from _results(submit, pieces, PIECES_PER_WORKER * count, lambda: None)
    except BrokenProcessPool:
        raise WorkerLostError(f"a worker process died, perhaps for want of memory; {GOES_ON}") from None
    finally:
        for process in list(pool._processes.values()):  # from Python 3.14 on pool.terminate_workers()
            process.terminate()
        pool.shutdown(cancel_futures=True)


_threads_of_worker: int | None = None
_copy_of_work: bytes | Work = b""
"""In a worker: its copy of the work, pickled until the first piece, whose exceptions are passed on."""


def _begin_worker(pickled: bytes, threads: int) -> None:
    global _copy_of_work, _threads_of_worker
    _copy_of_work, _threads_of_worker = pickled, threads
    threading.Thread(target=_end_with_starter, daemon=True).start()


def _do_in_worker(piece: int) -> Any:
    global _copy_of_work
    if isinstance(_copy_of_work, bytes):
        _copy_of_work = pickle.loads(_copy_of_work)
    assert callable(_copy_of_work)
    return _copy_of_work(piece)


def _end_with_starter() -> None:
    """End this process, in the midst of a piece too, when the one that started it was killed."""
    from multiprocessing import parent_process

    starter = parent_process()
    assert starter is not None
    starter.join()
    os._exit(1)


# Dask clusters


_one_at_a_time = threading.Lock()
"""Held while a piece is done: threads of a Dask worker would share one renderer."""


def _do_on_cluster(name: str, piece: int) -> Any:
    from distributed import get_worker

    plugin: Any = get_worker().plugins[name]
    with _one_at_a_time:
        return plugin.work(piece)


def _run_on_cluster(
    work: Work, pieces: Sequence[int], address: str, resource: str | None, report: Report
) -> Generator[tuple[int, Any]]:
    try:
        from distributed import CancelledError, Client, WorkerPlugin
    except ImportError:
        install = "pip install '.[cluster]'"
        raise InputError(f"scheduler: Dask is not installed; type in the source tree: {install}") from None

    class CopyOfWork(WorkerPlugin):  # which workers that start later are given too
        def __init__(self) -> None:
            self.work = work

    for part in ("client", "batched"):  # which print tracebacks when a connection is lost
        logging.getLogger(f"distributed.{part}").setLevel(logging.CRITICAL)
    try:
        client: Any = Client(address, timeout=CONNECTION_TIMEOUT_S)
    except (OSError, ValueError) as fault:
        raise InputError(f"scheduler: none answers at {address} ({fault})") from None
    options = "--nthreads 1" + (f" --resources {resource}=1" if resource else "")
    had_workers = False

    def look() -> None:
        """Report that there are no workers yet; raise `WorkerLostError` if there are none any more."""
        nonlocal had_workers
        # Not client.scheduler_info(), which lists only a few of the workers in some versions.
        workers = client.sync(client.scheduler.identity)["workers"].values()
        if any(resource is None or resource in worker["resources"] for worker in workers):
            had_workers = True
        elif had_workers:
            raise WorkerLostError(f"{address}: all workers of the cluster are gone; {GOES_ON}")
        else:
            report(f"waiting for a worker, as this starts one: dask worker {address} {options}", 0, 1)

    name = uuid4().hex
    with client:
        try:
            client.register_plugin(CopyOfWork(), name=name)
            settings = {"pure": False, "resources": resource and {resource: 1}}
            submit = partial(client.submit, _do_on_cluster, name, **settings)
            yield from _results(submit, pieces, MAX_CLUSTER_TASKS, look)
        except Exception as fault:
            # Dask raises various exceptions when its scheduler ends.
            if client.status != "running" or isinstance(fault, CancelledError):
                lost = f"{address}: the Dask scheduler has ended or is out of reach; {GOES_ON}"
                raise WorkerLostError(lost) from fault
            if type(fault).__name__ == "KilledWorker":
                raise WorkerLostError(f"{address}: workers died of a piece; {GOES_ON}") from fault
            raise
        finally:
            if client.status == "running":
                client.unregister_worker_plugin(name)
