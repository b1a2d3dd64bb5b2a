"""Jobs of many pieces.

The pieces of a job can be done in any order, by anybody, and again: what is done already is found to be so.
"""

from dataclasses import dataclass
from typing import Any, Protocol

from pcii.base.errors import BusyError, InputError

MOST_DEATHS = 2
"""After so many processes have died of a piece it is given up: one death may have another cause."""
AGAIN_S = 0.25
"""How often to look whether other processes have finished what they were at."""


class Job(Protocol):
    """Work in numbered pieces, which can be sent to other processes; it may keep things between pieces."""

    def __call__(self, piece: int) -> Any:
        """Do a piece; its result, which can be sent between processes.

        Raises `BusyError` if another process is at it, `InputError` for what concerns this piece alone.
        """
        ...

    def name(self, piece: int) -> str:
        """What messages call a piece."""
        ...

    def use_threads(self, count: int) -> None:
        """Let this process work on so many threads."""
        ...


@dataclass(frozen=True)
class Done:
    """A piece of a job: its result, or None and what is wrong with it."""

    piece: int
    result: Any
    fault: str = ""


def attempt(job: Job, piece: int) -> Done | None:
    """Do a piece; with what is wrong with it if that concerns it alone, None if another process is at it."""
    try:
        return Done(piece, job(piece))
    except BusyError:
        return None
    except InputError as fault:
        return Done(piece, None, str(fault))
