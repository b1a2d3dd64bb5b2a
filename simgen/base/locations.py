"""Where scenes and recipes are found: the working directory, the source tree, the installed package."""

import contextlib
import hashlib
import json
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

from pcii.store.safe_files import write_json_safely

Made = TypeVar("Made")
_PACKAGE = Path(__file__).resolve().parents[1]


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


def _roots(name: str) -> list[Path]:
    candidates = (Path.cwd() / name, _PACKAGE.parent / name, _PACKAGE / "_shipped" / name)
    roots: list[Path] = []
    for root in candidates:
        if root.is_dir() and root.resolve() not in (known.resolve() for known in roots):
            roots.append(root)
    return roots


def scene_roots() -> list[Path]:
    """Folders that hold scene folders."""
    return _roots("scenes")


def recipe_roots() -> list[Path]:
    """Folders that hold recipe files."""
    return _roots("data_recipes")


def find(roots: Callable[[], list[Path]], name: str) -> Path | None:
    """The first file of that name under any of the roots."""
    return next((root / name for root in roots() if (root / name).is_file()), None)
