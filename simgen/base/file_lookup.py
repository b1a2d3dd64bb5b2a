"""What is on this machine: scenes and recipes by name, what a scene brings along in its folder, values that
are cached between processes, packages that rendering needs."""

import contextlib
import hashlib
import importlib.util
import json
import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, GetCoreSchemaHandler
from pydantic_core import CoreSchema, core_schema

from pcii.base import InputError, write_json_safely

LONGEST_NAME = 200
LARGEST_FILE_BYTES = 1 << 28
_PACKAGE = Path(__file__).resolve().parents[1]
Value = TypeVar("Value")
RENDERING_MODULES = {"mitsuba": "mitsuba", "drjit": "drjit", "colour": "colour-science", "plyfile": "plyfile"}
"""The modules of the extra `render`, and the packages that they are of."""


def find(name: str) -> Path | None:
    """The first file of that name, such as "scenes/desk/scene.toml", under any of the roots."""
    return next((root / name for root in _roots() if (root / name).is_file()), None)


def find_all(pattern: str) -> list[Path]:
    """All files of that pattern, such as "data_recipes/*.toml", under all roots."""
    return [file for root in _roots() for file in sorted(root.glob(pattern))]


def _roots() -> list[Path]:
    """Where scenes and recipes may be: in the working directory, the source tree, the installed package."""
    return list(dict.fromkeys((Path.cwd(), _PACKAGE.parent, _PACKAGE / "_shipped")))


class AssetName(str):
    """Name of a file inside the scene's folder; a subclass says what the file holds.

    A field is `Annotated[str, ImageName]`, so that type checkers allow any string; it holds an `ImageName`.
    """

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        text = core_schema.str_schema(strict=True, min_length=1, max_length=LONGEST_NAME)
        return core_schema.no_info_after_validator_function(cls, text)


class ImageName(AssetName):
    """A texture: PNG, JPEG or TIFF."""


class EnvironmentName(AssetName):
    """Light from all around: OpenEXR."""


class MeshName(AssetName):
    """A mesh: PLY or OBJ."""


def named_files(value: Any, where: str = "") -> Iterator[tuple[str, AssetName]]:
    """Every file that a model names, as (dotted field, name)."""
    if isinstance(value, AssetName):
        yield where, value
    elif isinstance(value, BaseModel):
        for field in type(value).model_fields:
            yield from named_files(getattr(value, field), f"{where}.{field}" if where else field)
    elif isinstance(value, tuple):
        for number, item in enumerate(value):
            yield from named_files(item, f"{where}[{number}]")


def asset(folder: Path, name: str, where: str) -> Path:
    """The path of a file that a scene or recipe in `folder` names; `InputError`, beginning with `where`,
    unless it is a plain file inside that folder, links followed, of a size that can be read."""
    root = folder.resolve()
    try:
        path = (root / name).resolve()
        is_plain = path.is_file()  # no folder, nor a pipe or device that would never end
    except (OSError, RuntimeError, ValueError):  # links in a circle, a name too long, a NUL byte
        path, is_plain = root, False
    if not path.is_relative_to(root):
        raise InputError(f"{where}: {name!r} lies outside the folder {folder}")
    if not is_plain:
        raise InputError(f"{where}: there is no file {name!r} in {folder}")
    if path.stat().st_size > LARGEST_FILE_BYTES:
        raise InputError(f"{where}: {name!r} is larger than the {LARGEST_FILE_BYTES} bytes that are allowed")
    return path


def cache_folder() -> Path:
    """This user's folder for files that can be made anew; it need not exist."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "simgen"


def cached(
    name: str, depends_on: Sequence[str], make: Callable[[], Any], read: Callable[[Any], Value]
) -> Value:
    """What `read` makes of the plain values (JSON) that `make` returned, here or in an earlier process.

    They are made anew where a text of `depends_on` has changed, and where `read` raises KeyError, TypeError
    or ValueError of what is cached; without a cache that can be written, in each process.
    """
    key = hashlib.sha256("\n".join(depends_on).encode()).hexdigest()[:32]
    path = cache_folder() / f"{name}-{key}.json"
    with contextlib.suppress(OSError, KeyError, TypeError, ValueError):
        return read(json.loads(path.read_text()))
    values = make()
    with contextlib.suppress(OSError):
        write_json_safely(path, values)
    return read(values)


def check_installed() -> None:
    """Raise `InputError` unless all packages that rendering needs are installed."""
    missing = [name for module, name in RENDERING_MODULES.items() if importlib.util.find_spec(module) is None]
    if missing:
        raise not_installed(missing)


def not_installed(names: Sequence[str]) -> InputError:
    """That packages are missing, and what to type."""
    return InputError(
        f"{' and '.join(names)}: not installed, and needed for rendering; type in the source tree:  "
        "pip install '.[render]'"
    )
