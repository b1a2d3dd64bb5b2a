"""Kinds of folders: what says that a folder is of one, and the sealed document in it."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pcii.base.errors import InputError
from pcii.store.sealed_json import LARGEST_DOCUMENT_BYTES, read_sealed, write_sealed


@dataclass(frozen=True)
class FolderKind:
    """A kind of folder, such as that of a dataset, and the document that makes a folder a finished one.

    The document is JSON, sealed by its checksum, and begins with its format and the version of that. What
    errors say of it ends in `remedy`; of a folder without it they say `absent`.
    """

    what: str
    document: str
    version: int
    absent: str
    remedy: str
    marks: frozenset[str]
    """Files of which every such folder has one, finished or not."""
    passing: frozenset[str] = frozenset()
    """Files that may be in a folder before it is one of this kind, as for a lock."""
    largest_bytes: int = LARGEST_DOCUMENT_BYTES

    @property
    def format(self) -> str:
        """Name of the document's format."""
        return f"photon-integral-imaging {self.what}"

    def guard(self, folder: Path) -> set[str]:
        """Names of what is in a folder to be written to: none in a new one, else those of one of this kind.

        Raises `InputError` for a file, and for a folder that holds something else.
        """
        names = entries(folder, self.what) - self.passing
        names = {name for name in names if not name.startswith(f".{self.document}.")}  # left by a kill
        if names and not names & self.marks:
            raise _something_else(folder)
        return names

    def write(self, folder: Path, content: Mapping[str, Any]) -> None:
        """Write the document, atomically."""
        head = {"format": self.format, "format_version": self.version}
        write_sealed(folder / self.document, {**head, **content})

    def read(self, folder: Path) -> dict[str, Any]:
        """The document; `InputError` if it is missing, was changed, or is of another format or release."""
        path = folder / self.document
        if not folder.is_dir():
            raise InputError(f"{folder}: there is no such {self.what} folder")
        if not path.is_file():
            raise InputError(f"{folder}: {self.absent}")
        content = read_sealed(path, self.remedy, largest_bytes=self.largest_bytes)
        if content.get("format") != self.format:
            raise InputError(f"{path}: not of a {self.format}; {self.remedy}")
        if content.get("format_version") != self.version:
            raise InputError(
                f"{path}: format version {content.get('format_version')!r} is not supported; this release "
                f"reads version {self.version}; {self.remedy}"
            )
        return content


def entries(folder: Path, what: str) -> set[str]:
    """Names in a folder for `what`, none if there is no folder; raises `InputError` for a file."""
    try:
        return {entry.name for entry in folder.iterdir()}
    except FileNotFoundError:
        return set()
    except NotADirectoryError:
        raise InputError(f"{folder}: this is a file; name a folder for the {what}") from None


def check_free(folder: Path, what: str) -> None:
    """Raise `InputError` unless a folder for `what` is new or empty."""
    if entries(folder, what):
        raise _something_else(folder)


def _something_else(folder: Path) -> InputError:
    return InputError(f"{folder}: holds something else; name a new or empty folder")
