"""Jobs of many pieces.

The pieces of a job can be done in any order, by anybody, and again: what is done already is found to be so.
"""

from dataclasses import dataclass
from typing import Any, Protocol

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
