"""Files of views by names: a pattern with {row} and {col}, or with {index}, and the files that fit it."""

import glob
import math
import re
from collections.abc import Iterable
from pathlib import Path, PurePosixPath

import numpy as np

from pcii.base.errors import InputError
from pcii.base.plain_text import visible

EXAMPLES = '"{col}_{row}.png" or "view{index:03d}.png"'
FIELD = re.compile(r"\{([^{}]*)\}")
MOST_VIEWS = 100_000
MOST_NAMED = 3
"""Most missing files that an error names."""
Found = dict[tuple[int, ...], Path]


def files_by_camera(folder: Path, pattern: str, shape: tuple[int, int] | None) -> np.ndarray:
    """Paths (A, B), object, of the files in `folder` that fit the pattern, in the order of their numbers.

    Axes are {row} and {col}; the numbers of {index} count along the rows of a grid of `shape`, which is
    square if it is not given. Numbers may start anywhere. Raises `InputError` for a pattern that is none, for
    files that are missing and for two of one view.
    """
    fields = _fields(pattern)
    if not folder.is_dir():
        raise InputError(f"{folder}: there is no such folder of pictures")
    found = _matching(folder, pattern, fields)
    if fields == ["index"]:
        return _by_index(folder, pattern, found, shape)
    rows, cols = ({camera[axis] for camera in found} for axis in (0, 1))
    first, size = (min(rows), min(cols)), (_span(rows), _span(cols))
    if shape is not None and shape != size:
        raise InputError(
            f"{folder}: {pattern} gives {size[0]} rows and {size[1]} columns, not {shape[0]} x {shape[1]} "
            "as --grid"
        )
    _check_number(folder, size)
    cameras = [(first[0] + k, first[1] + l) for k, l in np.ndindex(*size)]
    return _table(folder, pattern, found, cameras, size)


def _fields(pattern: str) -> list[str]:
    """Names of the numbers in a pattern: row and col, in the order of their places, or index."""
    if not isinstance(pattern, str):
        raise InputError(f"pattern: expected text, got {type(pattern).__name__}")
    steps = PurePosixPath(pattern).parts
    if not steps or pattern.startswith("/") or ".." in steps or "\0" in pattern:
        raise InputError(f"pattern: expected names of files such as {EXAMPLES}, got {pattern!r}")
    inner = FIELD.findall(pattern)
    names = [field.split(":")[0] for field in inner]
    formats = [field.partition(":")[2] for field in inner]
    if any(brace in FIELD.sub("", pattern) for brace in "{}") or sorted(names) not in (
        ["index"],
        ["col", "row"],
    ):
        raise InputError(
            f"pattern: expected {{row}} and {{col}}, or {{index}}, as in {EXAMPLES}; got {pattern!r}"
        )
    if not all(re.fullmatch(r"(0[1-9])?d?", form) for form in formats):
        raise InputError(f"pattern: a number is written as {{index}} or {{index:03d}}; got {pattern!r}")
    return names


def _matching(folder: Path, pattern: str, fields: list[str]) -> Found:
    """Files that fit, by (row, col) or by (index,)."""
    expression = "".join(
        "([0-9]+)" if part % 2 else re.escape(text) for part, text in enumerate(FIELD.split(pattern))
    )
    wild = "".join("*" if part % 2 else glob.escape(text) for part, text in enumerate(FIELD.split(pattern)))
    found: Found = {}
    for path in sorted(folder.glob(wild)):
        match = re.fullmatch(expression, path.relative_to(folder).as_posix())
        if match is None or not path.is_file():
            continue
        numbers = dict(zip(fields, map(int, match.groups()), strict=True))
        camera = (numbers["index"],) if fields == ["index"] else (numbers["row"], numbers["col"])
        if camera in found:
            raise InputError(f"{path}: is of the same view as {found[camera].name}")
        found[camera] = path
    if not found:
        raise InputError(f"{folder}: no file fits the pattern {visible(pattern)}{_hint(folder)}")
    if len(found) > MOST_VIEWS:
        raise InputError(f"{folder}: {len(found)} files fit the pattern, and at most {MOST_VIEWS} are taken")
    return found


def _hint(folder: Path) -> str:
    names = sorted(path.name for path in folder.iterdir())
    return f"; its files are named like {visible(names[0])}" if names else "; it is empty"


def _by_index(folder: Path, pattern: str, found: Found, shape: tuple[int, int] | None) -> np.ndarray:
    numbers = {camera[0] for camera in found}
    first, count = min(numbers), _span(numbers)
    if shape is None:
        shape = square_of(folder, count)
    elif shape[0] * shape[1] < count:
        raise InputError(f"{folder}: {count} files fit the pattern, more than in {shape[0]} x {shape[1]}")
    _check_number(folder, shape)
    cameras = [(first + number,) for number in range(shape[0] * shape[1])]
    return _table(folder, pattern, found, cameras, shape)


def square_of(source: Path, count: int) -> tuple[int, int]:
    """Rows and columns of a square grid of `count` views; `InputError` if there is none."""
    side = math.isqrt(count)
    if side * side != count:
        raise InputError(
            f"{source}: {count} views are no square grid; say how many rows and columns with --grid"
        )
    return side, side


def _span(numbers: set[int]) -> int:
    return max(numbers) - min(numbers) + 1


def _check_number(folder: Path, size: tuple[int, int]) -> None:
    """Raise `InputError` for a grid of more views than anybody has, before anything is made of that size."""
    if not 1 <= math.prod(size) <= MOST_VIEWS:
        raise InputError(f"{folder}: the numbers in the files' names are of {size[0]} x {size[1]} views")


def _table(
    folder: Path, pattern: str, found: Found, cameras: Iterable[tuple[int, ...]], size: tuple[int, int]
) -> np.ndarray:
    """Paths by camera; `InputError` if some are missing, naming the first."""
    cameras = list(cameras)
    missing = [camera for camera in cameras if camera not in found]
    if missing:
        names = ", ".join(_named(pattern, camera) for camera in missing[:MOST_NAMED])
        more = f" and {len(missing) - MOST_NAMED} more" if len(missing) > MOST_NAMED else ""
        are = "is" if len(missing) == 1 else "are"
        raise InputError(
            f"{folder}: of {size[0]} x {size[1]} views {len(missing)} {are} missing: {visible(names)}{more}"
        )
    table = np.empty(len(cameras), dtype=object)
    table[:] = [found[camera] for camera in cameras]
    return table.reshape(size)


def _named(pattern: str, camera: tuple[int, ...]) -> str:
    names = ("index",) if len(camera) == 1 else ("row", "col")
    return pattern.format(**dict(zip(names, camera, strict=True)))
