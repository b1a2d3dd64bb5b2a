"""A Mitsuba scene that a scene.toml refers to: where it stands, and which files it names.

Mitsuba loads and runs any library that a plugin's type or a `<path>` names, so one pass of an XML parser
looks at the file first: all that it names has to be inside the scene's folder.
"""

import re
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Annotated, Self
from xml.parsers import expat

from pydantic import BeforeValidator, Field, model_validator

from pcii.base.errors import InputError
from simgen.base.file_lookup import AssetName, asset
from simgen.base.strict_models import Length, Position, Strict, shown_value

LARGEST_BYTES, MOST_ELEMENTS, DEEPEST = 1 << 24, 100_000, 100
"""Limits of all files together that make up a scene; Mitsuba's own parser has none."""


class MitsubaName(AssetName):
    """A Mitsuba scene: XML."""


class MitsubaFile(Strict):
    """A Mitsuba scene by reference: all that it has stands in the world, at the place that is stated here.

    One of its sensors becomes the virtual centre, or the middle of its bounding box comes to `place_at_mm`,
    its +Y up and its +Z towards the cameras.
    """

    file: Annotated[str, MitsubaName]
    """The XML file inside the scene's folder."""
    unit_mm: Length = 1000.0
    """Millimetres of the file's unit of length."""
    camera: Annotated[str, Field(max_length=200)] | None = None
    """Id of the sensor that becomes the virtual centre; may be left out if the file has only one."""
    place_at_mm: Position | None = None
    """Where the middle of the bounding box of its shapes stands, whatever sensors it has."""
    fit_mm: Length | None = None
    """Length of the longest side of that box, instead of `unit_mm`."""
    unscored: Annotated[tuple[str, ...], Field(exclude_if=lambda names: not names)] = ()
    """Names of its objects that count in no score."""

    @model_validator(mode="after")
    def _stands_in_one_place(self) -> Self:
        if self.camera is not None and self.place_at_mm is not None:
            raise ValueError("give camera or place_at_mm, not both")
        return self


MitsubaScene = Annotated[
    MitsubaFile,
    BeforeValidator(
        lambda value: {"file": value} if isinstance(value, str) else value,
        json_schema_input_type=str | MitsubaFile,
    ),
]
"""The same by the name of its file alone."""


def files_named_by(folder: Path, name: str) -> list[str]:
    """Names, relative to the folder, of the files that a Mitsuba scene `name` in it reads, itself left out.

    Raises `InputError` that names file and line: for what is not XML or too large, for entities, for a
    plugin that is no plain name, for files that are missing or outside the folder.
    """
    return list(dict.fromkeys(_XmlPass(folder).read(name)))


class _XmlPass:
    """One pass over a scene file and what it includes; counts elements, knows `<default>` values."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.elements, self.bytes = folder, 0, 0
        self.defaults: dict[str, str] = {}

    def read(self, name: str, depth: int = 0) -> list[str]:
        path = asset(self.folder, name, "mitsuba")
        self.bytes += path.stat().st_size
        if self.bytes > LARGEST_BYTES:
            raise InputError(f"{path}: the XML of a scene may have {LARGEST_BYTES} bytes")
        names: list[str] = []
        parser = expat.ParserCreate()

        def refuse(what: str) -> None:
            raise InputError(f"{path}: line {parser.CurrentLineNumber}: {what}")

        def start(tag: str, attributes: dict[str, str]) -> None:
            nonlocal depth
            depth, self.elements = depth + 1, self.elements + 1
            if self.elements > MOST_ELEMENTS or depth > DEEPEST:
                refuse(f"a scene may have {MOST_ELEMENTS} elements, {DEEPEST} deep")
            if tag == "path":
                refuse("<path> is not followed; files are those of the scene's folder")
            values = {key: self._completed(value) for key, value in attributes.items()}
            for value in values.values():
                kinds = PurePosixPath(value), PureWindowsPath(value)
                if any(kind.is_absolute() or ".." in kind.parts for kind in kinds):
                    refuse(f"{shown_value(value)} leads outside the scene's folder")
            if not re.fullmatch(r"\w*", values.get("type", ""), re.ASCII):
                refuse(f"{shown_value(values['type'])} is no name of a plugin")
            if tag == "default":
                self.defaults.setdefault(values.get("name", ""), values.get("value", ""))
            is_name = tag == "string" and values.get("name") == "filename"
            file = values.get("filename") or (values.get("value") if is_name else None)
            if file is None:
                return
            asset(self.folder, file, f"{path}: line {parser.CurrentLineNumber}")
            names.append(file)
            if tag == "include":
                names.extend(self.read(file, depth))

        def end(_: str) -> None:
            nonlocal depth
            depth -= 1

        parser.StartElementHandler, parser.EndElementHandler = start, end
        parser.StartDoctypeDeclHandler = lambda *_: refuse("a scene has no DOCTYPE and no entities")
        try:
            parser.Parse(path.read_bytes(), True)
        except expat.ExpatError as fault:
            why = expat.ErrorString(fault.code)
            raise InputError(f"{path}: line {fault.lineno}: not valid XML: {why}") from None
        return names

    def _completed(self, value: str) -> str:
        """An attribute with the values of `<default>` in the place of their `$names`, as Mitsuba has it."""
        for name in sorted(self.defaults, key=len, reverse=True):
            value = value.replace(f"${name}", self.defaults[name])
        return value
