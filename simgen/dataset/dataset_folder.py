"""Whose folder it is: what identifies a dataset, finished ones, and unfinished ones that one run works on."""

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from pcii.base.errors import BusyError, InputError
from pcii.base.safe_files import is_locked, locked
from pcii.io.dataset_layout import MARKER
from pcii.io.dataset_writer import held_dataset


def finished(out: Path, identity: str, *, content: bool = True) -> dict[str, Any] | None:
    """The manifest if `out` is this very dataset, finished and whole; None if it is still to do.

    Files are compared by their hashes, without `content` by their sizes. `InputError` for a file, or for a
    folder that holds anything else.
    """
    return None if (out / MARKER).is_file() else held_dataset(out, identity, content=content)


def check_free(out: Path) -> None:
    """Raise `BusyError` if another process is making the dataset."""
    if is_locked(out / MARKER):
        raise _busy(out)


@contextmanager
def claimed(out: Path, identity: str, engine: dict[str, Any]) -> Iterator[Path]:
    """Mark the folder as this recipe's unfinished dataset, and keep other runs out of it; the mark."""
    out.mkdir(parents=True, exist_ok=True)
    try:
        with locked(out / MARKER, wait=False) as file:
            text = file.read()
            if text:
                _check_begun(out / MARKER, text, identity, engine)
            else:
                file.write(json.dumps({"identity": identity, "backend": engine}).encode())
                file.flush()
                os.fsync(file.fileno())
            yield out / MARKER
    except BlockingIOError:
        raise _busy(out) from None


def _busy(out: Path) -> BusyError:
    return BusyError(f"{out}: another run is writing this dataset")


def _check_begun(marker: Path, text: bytes, identity: str, engine: dict[str, Any]) -> None:
    """Raise `InputError` unless the dataset was begun for the same recipe on the same backend."""
    decisive = ("variant", "mitsuba", "drjit")
    try:
        begun = json.loads(text)
        known, before = begun["identity"], {key: begun["backend"][key] for key in decisive}
    except (ValueError, KeyError, TypeError):
        raise InputError(f"{marker}: damaged; delete the folder {marker.parent} to start again") from None
    if known != identity:
        raise InputError(
            f"{marker.parent}: holds the unfinished dataset of another recipe or scene; "
            "name a new or empty folder"
        )
    if before != {key: engine[key] for key in decisive}:
        raise InputError(
            f"{marker.parent}: was begun with {before['variant']}, and this machine now runs "
            f"{engine['variant']}, whose pixels differ; delete the folder {marker.parent} to start again, "
            "or set SIMGEN_BACKEND"
        )
