"""Atomic writing of files and folders: whatever has its final name is complete.

A file or folder is written beside its destination as `.NAME.*.tmp`, flushed to disk and renamed.
"""

import json
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from pcii.base.plain_text import InputError


def write_bytes_safely(path: Path, content: bytes) -> None:
    """Write a file so that it is complete or, if interrupted, keeps its former content."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=".tmp")
    try:
        with named_in_errors(path), os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        Path(temporary).chmod(0o644)
        Path(temporary).replace(path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
    _sync_folder(path.parent)


def json_bytes(value: Any) -> bytes:
    """`value` as indented JSON; infinities and NaN are refused, since JSON has none."""
    text = json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False)
    # Names of files may hold bytes that are not valid characters; JSON holds them as escape sequences.
    return (text + "\n").encode(errors="backslashreplace")


def write_json_safely(path: Path, value: Any) -> None:
    """Write indented JSON safely; raises ValueError for infinities and NaN."""
    write_bytes_safely(path, json_bytes(value))


@contextmanager
def new_folder_safely(folder: Path) -> Iterator[Path]:
    """An empty folder to fill, which replaces `folder` when the block ends without an exception.

    Where `folder` is a symbolic link, what it leads to is replaced. All is flushed to disk first; a former
    folder is renamed, and deleted last.
    """
    folder = folder.resolve() if folder.is_symlink() else folder
    with _temporary_folder(folder) as new:
        yield new
        new.chmod(0o755)
        for file in new.rglob("*"):
            if file.is_file():
                with named_in_errors(folder), file.open("rb") as opened:
                    os.fsync(opened.fileno())
        with _temporary_folder(folder) as old:
            replaces = folder.exists()
            if replaces:
                folder.replace(old)  # allowed since `old` is empty
            try:
                new.replace(folder)
            except OSError:
                if replaces:
                    old.replace(folder)
                raise
            _sync_folder(folder.parent)


@contextmanager
def _temporary_folder(folder: Path) -> Iterator[Path]:
    """An empty folder beside `folder`, removed at the end of the block unless it was renamed by then."""
    temporary = Path(tempfile.mkdtemp(dir=folder.parent, prefix=f".{folder.name}.", suffix=".tmp"))
    try:
        yield temporary
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _sync_folder(folder: Path) -> None:
    """Flush a folder's entries (new names, renames) to disk."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        with named_in_errors(folder):
            os.fsync(handle)
    finally:
        os.close(handle)


def temporaries_of(folder: Path, name: str) -> list[Path]:
    """Temporary files of this file that killed processes left in the folder."""
    return list(folder.glob(f".{name}.*.tmp"))


def sweep_temporaries(root: Path) -> None:
    """Remove temporary files and folders that an interrupted run left in `root` and its folders."""
    for path in [*root.glob(".*.tmp"), *root.glob("*/.*.tmp")]:
        if path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)


@contextmanager
def named_in_errors(path: Path) -> Iterator[None]:
    """Name `path` in errors of the operating system that name no file, such as of a full disk."""
    try:
        yield
    except OSError as fault:
        if fault.errno is None or fault.filename is not None:
            raise
        raise OSError(fault.errno, os.strerror(fault.errno), str(path)) from fault


@contextmanager
def locked(path: Path, folder: Path) -> Iterator[IO[bytes]]:
    """The file `path`, created if missing, open for reading and appending and locked against other processes.

    The holder of the lock may delete the file. Raises `InputError`, of the folder that is written to, if
    another process holds it.
    """
    import fcntl  # not available on every system, and needed by writers only

    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a+b") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            is_held = os.path.samestat(os.fstat(file.fileno()), path.stat())
        except (BlockingIOError, FileNotFoundError):  # or its holder has deleted it meanwhile
            is_held = False
        if not is_held:
            raise InputError(f"{folder}: another run writes here; wait for its end")
        file.seek(0)
        yield file
