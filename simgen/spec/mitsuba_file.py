"""A Mitsuba scene that a scene.toml refers to: where it stands, and which files it names.

Mitsuba loads and runs any library that a plugin's type or a `<path>` names, so one pass of an XML parser
looks at the file first: all that it names has to be inside the scene's folder.
"""

import os
import re
from collections.abc import Mapping
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Annotated, Self
from xml.parsers import expat

from pydantic import BeforeValidator, Field, model_validator

from pcii.base import InputError
from simgen.base import AssetName, Length, Position, Strict, asset, shown_value

MAX_DEPTH = 100
"""Elements within elements at most, of included files too. Mitsuba goes a call deeper for each, and crashes
where the stack ends; files that include each other would have no end."""
ASCII_AND_MORE = re.compile(r"latin-?1|iso-8859-\d+|windows-125\d", re.IGNORECASE)
"""Encodings that are read if all characters are ASCII, which are the same in UTF-8."""
OF_RECIPES = {
    "sensor": "Sensor",
    "film": "Film",
    "sampler": "Sampler",
    "rfilter": "ReconstructionFilter",
    "integrator": "Integrator",
}
"""Elements that recipes have instead, and the names of their kinds in Mitsuba: of a sensor its place and its
medium are used."""


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


class MitsubaXml:
    """What one pass over a Mitsuba scene `name` in a folder, and over what it includes, finds there.

    `files` are the files that it reads, itself left out, relative to the folder; `unused` is what recipes
    have instead, with its parameters. Raises `InputError` that names file and line: for what is not XML or
    too deep, for entities, for a plugin that is no plain name, for files that are missing or outside the
    folder.
    """

    def __init__(self, folder: Path, name: str) -> None:
        self._folder = folder
        self._defaults: dict[str, str] = {}
        self._of_recipes: list[tuple[str, list[str]]] = []
        self.files = tuple(dict.fromkeys(self._read(name)))
        parts = [f"{what} ({', '.join(values)})" if values else what for what, values in self._of_recipes]
        self.unused = tuple(dict.fromkeys(parts))

    def _read(self, name: str, folders: tuple[PurePosixPath, ...] = (), depth: int = 0) -> list[str]:
        """Names of the files that a file names; `folders` are those of the files that include it, from the
        last one to the first, and `depth` is the number of elements around it."""
        path = asset(self._folder, name, "mitsuba")
        names, data, parents = list[str](), path.read_bytes(), list[list[str] | None]()
        own_folder = PurePosixPath(name).parent
        folders = folders or (own_folder,)
        if not _is_utf8(data):
            raise InputError(f"{path}: the XML of a scene is text in UTF-8; save it as that")
        parser = expat.ParserCreate("UTF-8")  # as Mitsuba has it, whatever encoding the first line states

        def refuse(what: str) -> None:
            raise InputError(f"{path}: line {parser.CurrentLineNumber}: {what}")

        def declare(_: str, encoding: str | None, __: int) -> None:
            stated = encoding or "UTF-8"
            is_utf8 = stated.upper() in ("UTF-8", "US-ASCII")
            if not (is_utf8 or (data.isascii() and ASCII_AND_MORE.fullmatch(stated))):
                refuse(f"the encoding {shown_value(stated)} is not read; save the file as UTF-8")

        def start(tag: str, attributes: dict[str, str]) -> None:
            if depth + len(parents) >= MAX_DEPTH:
                refuse(f"elements are more than {MAX_DEPTH} deep, or files include each other in a circle")
            values = {key: self._completed(value) for key, value in attributes.items()}
            if fault := _fault_of(tag, values):
                refuse(fault)
            if tag == "default":
                self._defaults.setdefault(values.get("name", ""), values.get("value", ""))
            parent = parents[-1] if parents else None
            if parent is not None and "name" in values and "value" in values:
                parent.append(f"{values['name']} = {values['value']}")
            parents.append([] if tag in OF_RECIPES else None)
            if (parameters := parents[-1]) is not None:
                self._of_recipes.append((f"{tag} {values.get('type', '')}", parameters))
            is_name = tag == "string" and values.get("name") == "filename"
            file = values.get("filename", values.get("value") if is_name else None)
            if file is None:
                return
            if not file:
                refuse("a file name is empty")
            # Where Mitsuba looks for it: the first folder that has one.
            searched = {"string": folders[-1:], "include": (own_folder, *folders)}.get(tag, folders)
            paths = [str(folder / file) for folder in searched]
            file = next((each for each in paths if os.access(self._folder / each, os.F_OK)), paths[-1])
            asset(self._folder, file, f"{path}: line {parser.CurrentLineNumber}")
            names.append(file)
            if tag == "include":
                names.extend(self._read(file, searched, depth + len(parents)))

        parser.StartElementHandler, parser.EndElementHandler = start, lambda _: parents.pop()
        parser.StartDoctypeDeclHandler = lambda *_: refuse("a scene has no DOCTYPE and no entities")
        parser.XmlDeclHandler = declare
        try:
            parser.Parse(data, True)
        except expat.ExpatError as fault:
            why = expat.ErrorString(fault.code)
            raise InputError(f"{path}: line {fault.lineno}: not valid XML: {why}") from None
        return names

    def _completed(self, value: str) -> str:
        """An attribute with the values of `<default>` in the place of their `$names`, as Mitsuba has it."""
        for name in sorted(self._defaults, key=len, reverse=True):
            value = value.replace(f"${name}", self._defaults[name])
        return value


def _fault_of(tag: str, values: Mapping[str, str]) -> str:
    """Why an element with these attributes is refused, or ""."""
    if tag == "path":
        return "<path> is not followed; files are those of the scene's folder"
    for value in values.values():
        kinds = PurePosixPath(value), PureWindowsPath(value)
        if any(kind.is_absolute() or ".." in kind.parts for kind in kinds):
            return f"{shown_value(value)} leads outside the scene's folder"
    if not re.fullmatch(r"\w*", values.get("type", ""), re.ASCII):
        return f"{shown_value(values['type'])} is no name of a plugin"
    return ""


def _is_utf8(data: bytes) -> bool:
    try:
        return "\0" not in data.decode()  # which UTF-16 and UTF-32 have
    except UnicodeDecodeError:
        return False
