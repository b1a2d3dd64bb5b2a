"""Worker processes of this machine that share a job's pieces; one that dies harms no other piece."""

import multiprocessing
import os
import signal
import threading
import time
from collections import Counter, deque
from collections.abc import Generator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess

from pcii.base.jobs import AGAIN_S, MOST_DEATHS, Done, Job, attempt


@dataclass
class _Worker:
    """A process, the pipe to it, the pieces that it will be given, and the one that it is at."""

    process: BaseProcess
    pipe: Connection
    ahead: deque[int]
    piece: int | None = None


def run_in_processes(job: Job, pieces: Sequence[int], count: int) -> Generator[Done]:
    """Do these pieces of a job in `count` processes and yield each when it is done.

    Each process begins with a part of its own, in order, since neighbours have much in common; who is done
    takes half of what another has ahead. Raises what is no fault of a single piece, such as a full disk.
    """
    ends = [len(pieces) * part // count for part in range(count + 1)]
    parts = [deque(pieces[start:end]) for start, end in pairwise(ends)]
    workers = [_start(job, part, count) for part in parts if part]
    missing, deaths = len(pieces), Counter[int]()
    try:
        while missing:
            for worker in workers:
                _hand_out(worker, workers)
            busy = [worker.pipe for worker in workers if worker.piece is not None]
            for pipe in wait(busy, AGAIN_S):  # Ctrl-C that interrupts no wait is seen after it
                worker = next(worker for worker in workers if worker.pipe is pipe)
                reply, piece = _reply(worker), worker.piece
                assert piece is not None
                worker.piece = None
                if isinstance(reply, Done):
                    missing -= 1
                    yield reply
                elif reply is None:
                    worker.ahead.append(piece)
                elif not isinstance(reply, _DiedError):
                    raise reply
                else:
                    worker.process.join()
                    workers[workers.index(worker)] = _start(job, worker.ahead, count)
                    deaths[piece] += 1
                    if deaths[piece] < MOST_DEATHS:
                        worker.ahead.appendleft(piece)
                    else:
                        missing -= 1
                        how = f"the last with exit code {worker.process.exitcode}"
                        yield Done(
                            piece, None, f"{job.name(piece)}: {MOST_DEATHS} processes died of it, {how}"
                        )
    finally:
        for worker in workers:
            worker.process.terminate()
        for worker in workers:
            worker.process.join()


def _start(job: Job, ahead: deque[int], count: int) -> _Worker:
    # Not forked: what other threads hold locked would be locked for ever in the copy.
    spawning = multiprocessing.get_context("spawn")
    ours, theirs = spawning.Pipe()
    threads = max(1, (os.cpu_count() or 1) // count)
    process = spawning.Process(target=_work, args=(theirs, job, threads), daemon=True)
    process.start()
    theirs.close()  # so that our end learns of the process's end
    return _Worker(process, ours, ahead)


def _hand_out(worker: _Worker, workers: Sequence[_Worker]) -> None:
    """Give a worker that waits its next piece, if need be of what another has ahead."""
    if worker.piece is not None:
        return
    if not worker.ahead:
        richest = max(workers, key=lambda other: len(other.ahead))
        for _ in range((len(richest.ahead) + 1) // 2):
            worker.ahead.appendleft(richest.ahead.pop())
    if worker.ahead:
        worker.piece = worker.ahead.popleft()
        with suppress(BrokenPipeError):  # it died, which its reply will say
            worker.pipe.send(worker.piece)


class _DiedError(Exception):
    """A worker's process has ended."""


def _reply(worker: _Worker) -> Done | Exception | None:
    """What a worker says of its piece: None if another process is at it, `_DiedError` if its own ended."""
    try:
        return worker.pipe.recv()
    except (EOFError, ConnectionResetError):
        return _DiedError()


def _work(pipe: Connection, job: Job, threads: int) -> None:
    """Do the pieces whose numbers come through the pipe, until it is closed at the other end."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches all; who started this process ends it
    threading.Thread(target=_end_with_starter, daemon=True).start()
    job.use_threads(threads)
    with suppress(EOFError, BrokenPipeError):  # who started this process was killed
        while True:
            piece = pipe.recv()
            try:
                reply = attempt(job, piece)
            except Exception as fault:
                reply = fault
            if reply is None:
                time.sleep(AGAIN_S)
            pipe.send(reply)


def _end_with_starter() -> None:
    """End this process, in the midst of a piece too, when the one that started it is gone."""
    starter = multiprocessing.parent_process()
    assert starter is not None
    starter.join()
    os._exit(1)
