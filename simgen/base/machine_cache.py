"""What takes long to find out and does not change on a machine, kept in the user's cache."""

import contextlib
import hashlib
import json
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

from pcii.store.safe_files import write_json_safely

Made = TypeVar("Made")


def kept(name: str, depends_on: Sequence[str], make: Callable[[], Any], read: Callable[[Any], Made]) -> Made:
    """What `read` makes of the plain values (JSON) that `make` found, here or in an earlier process.

    They are found anew where a text of `depends_on` has changed, and where `read` raises KeyError, TypeError
    or ValueError of what is kept; without a cache that can be written, in each process.
    """
    key = hashlib.sha256("\n".join(depends_on).encode()).hexdigest()[:32]
    root = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    path = root / "simgen" / f"{name}-{key}.json"
    with contextlib.suppress(OSError, KeyError, TypeError, ValueError):
        return read(json.loads(path.read_text()))
    found = make()
    with contextlib.suppress(OSError):
        write_json_safely(path, found)
    return read(found)
