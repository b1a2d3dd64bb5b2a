"""Where the pieces of work are done: in this process, in local worker processes, or on a Dask cluster."""

import contextlib
import logging
import os
import pickle
import queue
import signal
import threading
import warnings
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from pcii.base.plain_text import InputError, WorkerLostError

if TYPE_CHECKING:
    from concurrent.futures import Future

GOES_ON = "what is finished stays, and the same command goes on from there"
CONNECTION_TIMEOUT_S = 5.0

Work = Callable[[int], Any]


@dataclass(frozen=True)
class Executor:
    """Where work is done; raises `InputError` for less than one worker, and for workers of both kinds."""

    workers: int = 1
    """Processes of this machine that share the work. The results are the same for any number of them."""
    scheduler: str | None = None
    """Address of a Dask scheduler whose cluster does the work, such as `tcp://10.0.0.1:8786`. All its workers
    must reach all folders under the same paths."""

    def __post_init__(self) -> None:
        if self.workers < 1:
            raise InputError(f"workers: expected a whole number from 1 on, got {self.workers}")
        if self.workers > 1 and self.scheduler is not None:
            raise InputError("workers: a cluster has workers of its own; leave out workers or scheduler")

    def run(self, work: Work, pieces: Sequence[int]) -> Generator[tuple[int, Any]]:
        """Yield (piece, `work(piece)`) of each of these pieces as soon as it is done.

        Each process has one copy of `work`, which can be pickled and may keep things between pieces. An
        exception of a piece is raised here and ends the work, as the end of this generator does. Warns if a
        cluster has no worker yet. Raises `WorkerLostError` if a process dies or the cluster is out of reach,
        and `InputError` if there is no such cluster.
        """
        if self.scheduler is not None:
            yield from _run_on_cluster(work, pieces, self.scheduler)
        elif self.workers > 1 and len(pieces) > 1:
            yield from _run_in_processes(work, pieces, min(self.workers, len(pieces)))
        else:
            for piece in pieces:
                yield piece, work(piece)


THIS_PROCESS = Executor()


def threads_of_worker() -> int | None:
    """Threads that this process may use if it is one of several local workers; None if it is not."""
    return _threads_of_worker


_one_at_a_time = threading.Lock()
"""Held while a piece is done: threads of a Dask worker would share one renderer."""


_copy_of_work = lru_cache(maxsize=1)(pickle.loads)


def _do_elsewhere(piece: int, pickled: bytes | None = None) -> Any:
    """Do a piece in another process, whose copy of the work, by default that of `_begin_worker`, is kept."""
    with _one_at_a_time:
        return _copy_of_work(pickled or _work_of_worker)(piece)


# Local worker processes


SAFE_PATH = "PYTHONSAFEPATH"
WAKING_S = 0.25
"""So often is looked whether Ctrl-C was pressed, which a longer wait would notice later."""


def _run_in_processes(work: Work, pieces: Sequence[int], count: int) -> Generator[tuple[int, Any]]:
    import multiprocessing
    from concurrent.futures.process import BrokenProcessPool, ProcessPoolExecutor

    done: queue.SimpleQueue[Future[Any]] = queue.SimpleQueue()
    pickled, threads = pickle.dumps(work), max(1, (os.cpu_count() or 1) // count)
    # Not forked: what other threads hold locked would be locked for ever in the copy.
    spawning = multiprocessing.get_context("spawn")
    worker = threads, pickled, os.environ.get(SAFE_PATH)
    with _starting_processes():  # the pool has one that tidies up
        pool = ProcessPoolExecutor(count, spawning, _begin_worker, worker)
    try:
        with _starting_processes():
            futures = {pool.submit(_do_elsewhere, piece): piece for piece in pieces}
        for future in futures:
            future.add_done_callback(done.put)
        left = len(futures)
        while left:
            # A signal that another thread gets does not wake this one: it looks from time to time.
            try:
                future = done.get(timeout=WAKING_S)
            except queue.Empty:
                continue
            left -= 1
            yield futures[future], future.result()
    except BrokenProcessPool:
        raise WorkerLostError(f"a worker process died, perhaps for want of memory; {GOES_ON}") from None
    finally:
        for process in list(pool._processes.values()):  # from Python 3.14 on pool.terminate_workers()
            process.terminate()
        pool.shutdown(cancel_futures=True)


@contextlib.contextmanager
def _starting_processes() -> Iterator[None]:
    """How processes begin that are started in this block.

    Ctrl-C reaches all of them and is left to this one, which ends the others. They import nothing from the
    working directory, where a new Python looks for its own library first.
    """
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    safe_path = os.environ.get(SAFE_PATH)
    os.environ[SAFE_PATH] = "1"
    try:
        yield
    finally:
        _set_safe_path(safe_path)
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


def _set_safe_path(value: str | None) -> None:
    os.environ.pop(SAFE_PATH, None)
    if value is not None:
        os.environ[SAFE_PATH] = value


_threads_of_worker: int | None = None
_work_of_worker = b""


def _begin_worker(threads: int, pickled: bytes, safe_path: str | None) -> None:
    global _threads_of_worker, _work_of_worker
    _threads_of_worker, _work_of_worker = threads, pickled
    _set_safe_path(safe_path)  # of programs that the work starts
    threading.Thread(target=_end_with_starter, daemon=True).start()


def _end_with_starter() -> None:
    """End this process, in the midst of a piece too, when the one that started it was killed."""
    from multiprocessing import parent_process

    starter = parent_process()
    assert starter is not None
    starter.join()
    os._exit(1)


# Dask clusters


def _run_on_cluster(work: Work, pieces: Sequence[int], address: str) -> Generator[tuple[int, Any]]:
    try:
        from distributed import CancelledError, Client, KilledWorker, as_completed
        from distributed.comm.core import CommClosedError
        from distributed.protocol.pickle import dumps  # functions of notebooks too
    except ImportError:
        install = "pip install '.[cluster]'"
        raise InputError(f"scheduler: Dask is not installed; type in the source tree: {install}") from None

    for part in ("client", "batched"):  # which print tracebacks when a connection is lost
        logging.getLogger(f"distributed.{part}").setLevel(logging.CRITICAL)
    try:
        client: Any = Client(address, timeout=CONNECTION_TIMEOUT_S)
    except (OSError, ValueError) as fault:
        raise InputError(f"scheduler: none answers at {address} ({fault})") from None
    with client:
        try:
            if not client.scheduler_info()["workers"]:
                warnings.warn(f"{address} has no worker yet: dask worker {address}", stacklevel=2)
            # A task, whose result travels to each worker once; the bytes at its end, which pickle does not
            # read, make it another one than an equal job of an earlier run.
            pickled = client.submit(bytes, dumps(work) + os.urandom(16), pure=False)
            futures = client.map(_do_elsewhere, pieces, pickled=pickled, pure=False)
            by_future = dict(zip(futures, pieces, strict=True))
            del futures
            for future in as_completed(list(by_future)):
                yield by_future.pop(future), future.result()
        except Exception as fault:
            # Dask raises various exceptions when its scheduler ends, some before its client knows of it.
            dask_faults = CancelledError, CommClosedError, KilledWorker
            if client.status != "running" or isinstance(fault, dask_faults):
                lost = f"{address}: the Dask scheduler has ended or is out of reach, or its workers died"
                raise WorkerLostError(f"{lost}; {GOES_ON}") from fault
            raise
