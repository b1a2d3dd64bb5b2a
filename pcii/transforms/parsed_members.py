"""Members of JSON objects of strangers, checked one by one."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any

from pcii.base.errors import InputError
from pcii.base.plain_text import visible

MOST = 1e9
"""Largest number of pixels and radians, far above any; their products are finite."""


@dataclass(frozen=True)
class Members:
    """An object of a JSON file; `place` in it, such as "frames.3.", begins the names in messages."""

    file: Path
    place: str
    values: Mapping[str, Any]

    def fault(self, name: str, sentence: str) -> InputError:
        """The error of a member, which names file and member."""
        return InputError(f"{self.file}: {self.place}{name}: {sentence}")

    def has(self, name: str) -> bool:
        """Whether there is such a member, which is not null."""
        return self.values.get(name) is not None

    def number(self, name: str, most: float = MOST) -> float:
        """A number of at most `most` in size; raises `InputError` for anything else, and if it is missing."""
        if not self.has(name):
            raise self.fault(name, "missing")
        found = finite(self.values[name])
        if found is None or abs(found) > most:
            raise self.fault(name, f"expected a number up to {most:g}, got {_shown(self.values[name])}")
        return found

    def above_zero(self, name: str, most: float = MOST) -> float:
        """A number above 0: from 1 / `most` to that."""
        found = self.number(name, most)
        if found < 1 / most:
            raise self.fault(name, f"expected a number above 0, got {found:g}")
        return found

    def whole(self, name: str, most: int) -> int:
        """A whole number from 1 to `most`."""
        found = self.number(name)
        if found != int(found) or not 1 <= found <= most:
            raise self.fault(name, f"expected a whole number from 1 to {most}, got {found:g}")
        return int(found)

    def inner_path(self, name: str) -> str:
        """A path inside the file's folder, without "./"; raises `InputError` for one that leads out of it."""
        text = self.values.get(name)
        if not isinstance(text, str) or not text:
            raise self.fault(name, f"expected the path of a file, got {_shown(text)}")
        path = PurePosixPath(text)
        strange = "\\" in text or PureWindowsPath(text).drive or visible(text) != text
        if strange or path.is_absolute() or ".." in path.parts:
            raise self.fault(
                name, f"expected a path inside the folder such as images/00_00.png, got {_shown(text)}"
            )
        folder = self.file.parent.resolve()
        try:
            inside = (folder / path).resolve().is_relative_to(folder)
        except (OSError, RuntimeError):
            inside = False
        if not inside or not path.parts:
            raise self.fault(name, f"{_shown(text)} leads out of the folder")
        return str(path)


def finite(value: object) -> float | None:
    """A finite number as float; None for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def _shown(value: object) -> str:
    """A value in a message: short, on one line."""
    if value is None:
        return "nothing"
    if isinstance(value, list | dict):
        return "a list" if isinstance(value, list) else "an object"
    text = visible(repr(value) if isinstance(value, str) else str(value))
    return text if len(text) <= 100 else f"{text[:97]}..."
