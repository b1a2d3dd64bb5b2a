"""A disk that breaks while a command runs: after so many changes in a folder the next ones fail.

It breaks within a process, before Python opens, makes or renames a file (by audit events), and in `os.fsync`,
which fails as the system does, without the name of a file. What other languages write is not seen.
"""

import errno
import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

_fsync = os.fsync


@dataclass
class BrokenDisk:
    """A disk on which so many changes in the folder succeed; all later ones fail."""

    folder: str
    good: int
    heals: bool = False
    """Only the first of those fails."""
    done: int = 0

    def fails(self, path: Any) -> bool:
        """Count a change of a file; whether it must fail."""
        if not isinstance(path, str | Path) or not str(path).startswith(self.folder):
            return False
        self.done += 1
        return self.done == self.good + 1 or (self.done > self.good and not self.heals)


_disk: BrokenDisk | None = None


def break_disk(disk: BrokenDisk | None) -> None:
    """Break the disk of this process, or, with None, mend it."""
    global _disk
    if os.fsync is _fsync:
        sys.addaudithook(_audited)
        os.fsync = _failing_fsync
    _disk = disk


def _audited(event: str, given: tuple[Any, ...]) -> None:
    if _disk is None or event not in ("open", "os.mkdir", "os.rename", "os.truncate"):
        return
    writes = os.O_WRONLY | os.O_RDWR | os.O_CREAT
    if event == "open" and not (isinstance(given[2], int) and given[2] & writes):
        return
    if _disk.fails(given[0]):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS), given[0])


def _failing_fsync(handle: Any) -> None:
    number = handle if isinstance(handle, int) else handle.fileno()
    if _disk is not None and _disk.fails(Path(f"/proc/self/fd/{number}").readlink()):
        raise OSError(errno.EIO, os.strerror(errno.EIO))
    _fsync(handle)
