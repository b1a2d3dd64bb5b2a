"""Groups of arrays packed into one archive, where many small files would be a burden.

    arrays.zip    counts.zarr/k/zarr.json, counts.zarr/k/c/0, ..., truth.zarr/...: what would be in the folder

A ZIP file as the zip stores of Zarr are: without compression, since chunks are compressed already. Members
are in order and without dates, so that the same arrays make the same bytes.
"""

import io
import shutil
import zipfile
from collections.abc import Iterable
from pathlib import Path

from pcii.base.errors import InputError
from pcii.base.safe_files import write_bytes_safely
from pcii.store.folders import REMEDY

ARRAYS = "arrays.zip"


def pack_arrays(root: Path, parts: Iterable[str]) -> list[str]:
    """Move the named folders of `root` into its archive; the paths of the files in it."""
    parts, content = list(parts), io.BytesIO()
    paths = [path for part in parts for path in sorted((root / part).rglob("*")) if path.is_file()]
    names = [path.relative_to(root).as_posix() for path in paths]
    with zipfile.ZipFile(content, "w") as archive:
        for name in names:
            archive.writestr(zipfile.ZipInfo(name), (root / name).read_bytes())
    write_bytes_safely(root / ARRAYS, content.getvalue())
    for part in parts:
        shutil.rmtree(root / part, ignore_errors=True)
    return names


def read_packed(root: Path, names: Iterable[str]) -> dict[str, bytes]:
    """Content of files in the archive; `InputError` for one that is missing or damaged."""
    try:
        with zipfile.ZipFile(root / ARRAYS) as archive:
            return {name: archive.read(name) for name in names}
    except (OSError, KeyError, zipfile.BadZipFile) as fault:
        raise InputError(f"{root / ARRAYS}: cannot be read ({fault}); {REMEDY}") from None
