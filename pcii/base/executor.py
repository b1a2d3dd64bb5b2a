"""Who does a job: this process, several of this machine, or a Dask cluster."""

import time
from collections.abc import Generator, Sequence
from dataclasses import dataclass

from pcii.base.errors import InputError
from pcii.base.jobs import AGAIN_S, Done, Job, attempt
from pcii.base.progress import Report, silent

MOST_WORKERS = 1024
"""More are rejected as a typing error: no machine has so many cores."""


@dataclass(frozen=True)
class Executor:
    """Who does a job; raises `InputError` for a number of workers that makes no sense, and for both kinds."""

    workers: int = 1
    """Processes of this machine that share the work. The results are the same for any number of them."""
    scheduler: str | None = None
    """Address of a Dask scheduler whose cluster does the work, such as `tcp://10.0.0.1:8786`. All its workers
    must reach all folders under the same paths."""
    resource: str | None = None
    """Of a cluster, use only workers that were started with this resource, such as GPU."""

    def __post_init__(self) -> None:
        if not 1 <= self.workers <= MOST_WORKERS:
            raise InputError(f"workers: expected a whole number from 1 to {MOST_WORKERS}, got {self.workers}")
        if self.workers > 1 and self.scheduler is not None:
            raise InputError("workers: a cluster has workers of its own; leave out workers or scheduler")
        if self.resource is not None and self.scheduler is None:
            raise InputError("resource: workers of a cluster have such; give its scheduler too")

    def run(self, job: Job, pieces: Sequence[int], report: Report = silent) -> Generator[Done]:
        """Do these pieces and yield each when it is done; `report` is called while a cluster has no workers.

        Raises what is no fault of a single piece, such as a full disk, `InputError` if there is no such
        cluster, and ConnectionError if its scheduler ends meanwhile.
        """
        if self.scheduler is not None:
            from pcii.base.dask_cluster import run_on_cluster

            yield from run_on_cluster(job, pieces, self.scheduler, self.resource, report)
        elif self.workers > 1:
            from pcii.base.worker_processes import run_in_processes

            yield from run_in_processes(job, pieces, self.workers)
        else:
            yield from _run_here(job, pieces)


ALONE = Executor()
"""This process."""


def _run_here(job: Job, pieces: Sequence[int]) -> Generator[Done]:
    """Do these pieces one after the other; what others are at comes last, and is done if they died."""
    waiting = list(pieces)
    while waiting:
        busy = []
        for piece in waiting:
            done = attempt(job, piece)
            if done is None:
                busy.append(piece)
            else:
                yield done
        if len(busy) == len(waiting):
            time.sleep(AGAIN_S)
        waiting = busy
