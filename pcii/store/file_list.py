"""Lists of the files of a folder with size and SHA-256, and comparison of the files with such a list."""

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from pcii.base.errors import InputError
from pcii.store.hashes import hash_file


def list_files(root: Path, parts: Iterable[str]) -> dict[str, dict[str, Any]]:
    """Size and SHA-256 of every file of the named parts (files or folders), by path relative to `root`."""
    entries: dict[str, dict[str, Any]] = {}
    for part in parts:
        top = root / part
        files = [top] if top.is_file() else sorted(p for p in top.rglob("*") if p.is_file())
        for file in files:
            name = file.relative_to(root).as_posix()
            entries[name] = {"bytes": file.stat().st_size, "sha256": hash_file(file)}
    return entries


def lists_part(files: Iterable[str], part: str) -> bool:
    """Whether any of the listed files is `part`, or lies in the folder of this name."""
    return any(name == part or name.startswith(f"{part}/") for name in files)


def check_file(root: Path, name: str, entry: Mapping[str, Any], remedy: str, *, content: bool) -> None:
    """Raise `InputError` if a listed file is missing, has another size, or (`content`) another hash."""
    path = root / name
    try:
        if not path.is_file():
            raise InputError(f"{path}: listed in the manifest but missing; {remedy}")
        size = path.stat().st_size
        if size != entry["bytes"]:
            raise InputError(
                f"{path}: truncated or changed, {size} bytes where the manifest says {entry['bytes']}; "
                f"{remedy}"
            )
        if content and hash_file(path) != entry["sha256"]:
            raise InputError(f"{path}: its content does not match the manifest's SHA-256; {remedy}")
    except OSError as fault:
        raise InputError(f"{path}: cannot be read ({fault.strerror}); {remedy}") from None


def check_files(root: Path, files: Mapping[str, Mapping[str, Any]], remedy: str, *, content: bool) -> None:
    """Raise `InputError` for the first listed file that is not as `check_file` wants it."""
    for name, entry in files.items():
        check_file(root, name, entry, remedy, content=content)


def strays(root: Path, listed: Iterable[str]) -> list[str]:
    """Files and folders in `root` that are not listed and have no listed files in them, as relative paths."""
    files = set(listed)
    folders = {parent.as_posix() for name in files for parent in Path(name).parents}
    found: list[str] = []
    for top, inner, names in os.walk(root):
        folder_path = Path(top).relative_to(root)
        found += [name for name in ((folder_path / n).as_posix() for n in names) if name not in files]
        for folder in list(inner):
            name = (folder_path / folder).as_posix()
            if name not in folders or (root / name).is_symlink():
                inner.remove(folder)
                found.append(f"{name}/")
    return sorted(found)
