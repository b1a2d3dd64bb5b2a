"""Names of files that a scene brings along, and where these files are: only inside its folder."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Self

from pydantic import BaseModel, GetCoreSchemaHandler
from pydantic_core import CoreSchema, core_schema

from pcii.base.errors import InputError

LONGEST_NAME = 200
LARGEST_FILE_BYTES = 1 << 28


class AssetName(str):
    """Name of a file inside the scene's folder; a subclass says what the file holds.

    A field is `Annotated[str, ImageName]`, so that type checkers allow any string; it holds an `ImageName`.
    """

    __slots__ = ()

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        text = core_schema.str_schema(strict=True, min_length=1, max_length=LONGEST_NAME)
        return core_schema.no_info_after_validator_function(cls._checked, text)

    @classmethod
    def _checked(cls, text: str) -> Self:
        if not text.isprintable():
            raise ValueError("a file's name must not contain control characters")
        return cls(text)


class ImageName(AssetName):
    """A texture: PNG, JPEG or TIFF."""

    __slots__ = ()


class EnvironmentName(AssetName):
    """Light from all around: OpenEXR."""

    __slots__ = ()


class MeshName(AssetName):
    """A mesh: PLY or OBJ."""

    __slots__ = ()


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
    elif isinstance(value, dict):
        for key, item in value.items():
            yield from named_files(item, f"{where}.{key}")


def asset(folder: Path, name: str, where: str) -> Path:
    """The path of a scene's file; `InputError`, beginning with `where`, unless it is a plain file inside
    the scene's folder, links followed, of a size that can be read."""
    root = folder.resolve()
    try:
        path = (root / name).resolve()
        inside = path.is_relative_to(root) and not Path(name).is_absolute()
        plain = inside and path.is_file()  # not a folder, nor a pipe or device that would never end
        size = path.stat().st_size if plain else 0
    except (OSError, RuntimeError, ValueError):  # links in a circle, a name too long, a NUL byte
        path, inside, plain, size = root, True, False, 0
    if not inside:
        raise InputError(f"{where}: {name!r} lies outside the scene's folder")
    if not plain:
        raise InputError(f"{where}: there is no file {name!r} in {folder}")
    if size > LARGEST_FILE_BYTES:
        raise InputError(
            f"{where}: {name!r} has {size} bytes, more than a scene's file may have ({LARGEST_FILE_BYTES})"
        )
    return path
