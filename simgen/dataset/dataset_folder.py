"""Whose folder it is: what identifies a dataset, finished ones, and unfinished ones that one run works on."""

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from pcii.base import InputError, locked
from pcii.store import DATASET_FOLDER, MARKER, PACKAGE, DatasetManifest, check_size, provenance, read_listed

DECISIVE = (PACKAGE, "mitsuba")
"""Packages whose versions are part of what identifies a dataset."""


def versions() -> dict[str, str]:
    """Versions of the packages that make datasets."""
    return provenance.versions(*DECISIVE, "drjit", "numpy", "zarr")


def decisive_versions() -> dict[str, str]:
    """Versions that identify a dataset, with its recipe and scene."""
    return provenance.versions(*DECISIVE)


def other_versions(recorded: Mapping[str, str]) -> str:
    """How the decisive versions recorded differ from those here, in words; empty if they are the same."""
    known = {name: number for name, number in recorded.items() if name in DECISIVE}
    return provenance.differences(known, decisive_versions())


def find_finished(out: Path, identity: str, *, content: bool = True) -> DatasetManifest | None:
    """The manifest if `out` is this very dataset, finished and whole; None if it is still to do.

    Files are compared by their hashes, without `content` by their sizes. `InputError` for a file, or for a
    folder that holds anything else.
    """
    # In this order, since another run may finish it meanwhile: the manifest is there before the mark is gone.
    if DATASET_FOLDER.guard(out) <= {MARKER} or (out / MARKER).is_file():
        return None
    return read_whole(out, identity, content=content)


def read_whole(out: Path, identity: str, *, content: bool) -> DatasetManifest:
    """The manifest of a finished dataset; `InputError` if it is another one or a file is damaged."""
    manifest = DATASET_FOLDER.read(out)
    if manifest.identity != identity:
        raise other_dataset(out, "dataset", manifest.versions)
    check = read_listed if content else check_size
    for name, entry in manifest.files.items():
        check(out, name, entry)
    return manifest


@contextmanager
def claim(out: Path, identity: str, engine: dict[str, Any]) -> Iterator[Path]:
    """Mark the folder as this recipe's unfinished dataset, and keep other runs out of it; the mark.

    If nothing was put into the folder before the block raises, the mark is removed, and what folders were
    made for it. Raises `InputError` at once if another process is making the dataset.
    """
    new = [folder for folder in (out, *out.parents) if not folder.exists()]
    marker = out / MARKER
    with locked(marker, out) as file:
        text = file.read()
        if text:
            _check_mark(marker, text, identity, engine)
        else:
            mark = {"identity": identity, "versions": versions(), "backend": engine}
            file.write(json.dumps(mark).encode())
            file.flush()
            os.fsync(file.fileno())
        try:
            yield marker
        except BaseException:
            with suppress(OSError):
                if [entry.name for entry in out.iterdir()] == [MARKER]:
                    marker.unlink()
                    for folder in new:
                        folder.rmdir()
            raise


def _check_mark(marker: Path, text: bytes, identity: str, engine: dict[str, Any]) -> None:
    """Raise `InputError` unless the mark is of the same recipe on the same backend."""
    decisive = ("variant", "mitsuba", "drjit")
    out = marker.parent
    try:
        mark = json.loads(text)
        known, before = mark["identity"], {key: mark["backend"][key] for key in decisive}
        recorded = {name: mark["versions"][name] for name in DECISIVE}
    except (ValueError, KeyError, TypeError):
        raise InputError(f"{marker}: damaged; delete the folder {out} to start again") from None
    if known != identity:
        raise other_dataset(out, "unfinished dataset", recorded)
    if before != {key: engine[key] for key in decisive}:
        raise InputError(
            f"{out}: was begun with {before['variant']}, and this machine now runs {engine['variant']}, "
            f"whose pixels differ; delete the folder {out} to start again, or set SIMGEN_BACKEND"
        )


def other_dataset(out: Path, what: str, recorded: Mapping[str, str]) -> InputError:
    """That a folder holds something of other software or, if its versions agree, of another recipe."""
    differences = other_versions(recorded)
    if not differences:
        text = f"{out}: holds the {what} of another recipe or scene, or of other files that they name"
        return InputError(f"{text}; name a new or empty folder")
    return InputError(
        f"{out}: holds the {what} of other software, whose photons may differ ({differences}); name a new or "
        "empty folder, or install that software"
    )
