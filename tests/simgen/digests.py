"""Hashes of all files of a dataset."""

import hashlib
from pathlib import Path

from pcii.store import MANIFEST


def digest(folder: Path) -> dict[str, str]:
    """Hash of every file but the manifest, which holds the times that things took."""
    return {
        file.relative_to(folder).as_posix(): hashlib.sha256(file.read_bytes()).hexdigest()
        for file in sorted(folder.rglob("*"))
        if file.is_file() and file.name != MANIFEST
    }
