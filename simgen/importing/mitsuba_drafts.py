"""Elements of Mitsuba scene files as nested plugins: includes, defaults and references followed.

Mitsuba 3, "Scene XML file format", and what its src/core/parser.cpp does with files of older versions.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from pcii.base.errors import InputError
from simgen.base.strict_models import shown_value
from simgen.importing.mitsuba_files import DEEPEST, LARGEST_XML_BYTES, MOST_ELEMENTS, Element, SceneFiles
from simgen.importing.mitsuba_scene import SpectrumValues, Value
from simgen.importing.mitsuba_values import check_attributes, spectrum_file, value_of

DEEPEST_INCLUDE = 15
LARGEST_SPECTRUM_BYTES = 1 << 17
_PLUGINS = {
    *("scene", "shape", "bsdf", "emitter", "texture", "sensor", "integrator", "film", "sampler", "rfilter"),
    *("medium", "phase", "volume"),
}
_VALUES = {"float", "integer", "boolean", "string", "vector", "point", "rgb", "spectrum", "transform"}
_STEPS = {"translate", "scale", "rotate", "lookat", "matrix"}


@dataclass(eq=False)
class Draft:
    """A plugin as it is written, of whatever type."""

    category: str
    type: str
    id: str
    file: Path
    line: int
    values: "dict[str, Value | Draft | Reference]" = field(default_factory=dict)
    """Parameters and nested plugins by name, in order; those without a name by one that none can have."""

    @property
    def nested(self) -> "Iterator[tuple[str, Draft]]":
        """Nested plugins, once references are followed."""
        return ((name, value) for name, value in self.values.items() if isinstance(value, Draft))


@dataclass(frozen=True)
class Reference:
    """The place of a plugin that is defined elsewhere."""

    id: str
    file: Path
    line: int


def read_drafts(path: Path, files: SceneFiles) -> Draft:
    """The scene in a file, every reference in it followed.

    `InputError` with file and line for the first thing that is not written as Mitsuba reads it, for a file
    outside the scene's folder, and for what goes round in a circle or grows beyond the limits.
    """
    reading = _Reading(files)
    root = reading.file(path, ())
    if root.category != "scene":
        raise InputError(f"{path}: line {root.line}: the root is <{root.category}>, and a scene file has <scene>")
    _Following(reading.known).extent(root, [])
    return root


class _Reading:
    """What has been said so far: defaults and names, which are common to a scene and what it includes."""

    def __init__(self, files: SceneFiles) -> None:
        self.known: dict[str, Draft] = {}
        self._files = files
        self._defaults: dict[str, str] = {}
        self._longest_default = 0
        self._filled_in = 0
        self._spectra: dict[Path, SpectrumValues] = {}

    def file(self, path: Path, outer: tuple[Path, ...]) -> Draft:
        """The plugin that is the root of a file, which the `outer` files include."""
        element = self._files.read_xml(path)
        if element.tag not in _PLUGINS:
            raise InputError(
                f"{path}: line {element.line}: the root is <{element.tag}>, and a scene file has <scene>"
            )
        element = self._filled(path, element, old=False)
        version = element.attributes.get("version", "")
        if not re.fullmatch(r"[0-9]{1,4}(\.[0-9]{1,4}){0,2}", version):
            raise InputError(
                f"{path}: line {element.line}: <{element.tag}> needs the version of Mitsuba that it is for, such "
                'as version="3.0.0"'
            )
        reader = _FileReader(self, self._files, path, (*outer, path), int(version.split(".")[0]) < 2)
        return reader.plugin(element, ("version", "type?", "id?", "name?"))

    def name(self, draft: Draft) -> None:
        """Makes a plugin known by its id."""
        if draft.id and self.known.setdefault(draft.id, draft) is not draft:
            raise InputError(f"{draft.file}: line {draft.line}: the id {shown_value(draft.id)} is there twice")

    def set_default(self, name: str, value: str) -> None:
        """The first default of a name holds."""
        self._defaults.setdefault(name, value)
        self._longest_default = max(self._longest_default, len(name))

    def _filled(self, file: Path, element: Element, old: bool) -> Element:
        """An element with defaults in the place of `$name`."""
        tag = "lookat" if old and element.tag == "lookAt" else element.tag
        if tag == element.tag and not any("$" in text for text in element.attributes.values()):
            return element
        place = f"{file}: line {element.line}"
        given = {name: self._text(text, place) for name, text in element.attributes.items()}
        return replace(element, tag=tag, attributes=given)

    def _text(self, text: str, place: str) -> str:
        first, *others = re.split(r"(?<!\\)\$", text)
        parts = [first]
        for other in others:
            # The longest name that fits, as in Mitsuba.
            ends = range(min(len(other), self._longest_default), 0, -1)
            name = next((other[:end] for end in ends if other[:end] in self._defaults), None)
            if name is None:
                word = re.match(r"\w*", other)
                raise InputError(f"{place}: there is no <default> of {shown_value(word[0] if word else '')}")
            parts += [self._defaults[name], other[len(name) :]]
            # Defaults of defaults of defaults could grow without bound.
            self._filled_in += len(self._defaults[name])
            if self._filled_in > LARGEST_XML_BYTES:
                raise InputError(f"{place}: with its defaults filled in the scene is too large")
        return "".join(parts).replace("\\$", "$")

    def spectrum(self, path: Path) -> SpectrumValues:
        """The spectrum in a file, read once; `ValueError` if it has none."""
        if path not in self._spectra:
            with path.open("rb") as file:
                data = file.read(LARGEST_SPECTRUM_BYTES + 1)
            if len(data) > LARGEST_SPECTRUM_BYTES:
                raise ValueError(f"a spectrum may have {LARGEST_SPECTRUM_BYTES} bytes, and {path.name!r} has more")
            try:
                self._spectra[path] = spectrum_file(data.decode())
            except ValueError as fault:  # of UTF-8 too
                raise ValueError(f"{path.name!r}: {fault}") from None
        return self._spectra[path]


@dataclass(frozen=True)
class _FileReader:
    """Reads the elements of one file."""

    reading: _Reading
    files: SceneFiles
    path: Path
    chain: tuple[Path, ...]
    """The file and those that include it, the scene first."""
    old: bool
    """Whether its names are those of Mitsuba 0.x."""

    def plugin(self, element: Element, attributes: tuple[str, ...] = ("type", "id?", "name?")) -> Draft:
        self._check(element, attributes)
        given = element.attributes
        draft = Draft(
            "spectrum" if element.tag == "spectrum" else element.tag,
            given.get("type", "scene"),
            given.get("id", ""),
            self.path,
            element.line,
        )
        self.reading.name(draft)
        for child in element.children:
            self._add(draft, self.reading._filled(self.path, child, self.old))
        if self.old:
            _upgrade(draft)
        return draft

    def _add(self, draft: Draft, element: Element) -> None:
        """What one element says about the plugin that it is in."""
        tag, given = element.tag, element.attributes
        if tag in _PLUGINS or (tag == "spectrum" and "type" in given):
            self._set(draft, element, self.plugin(element))
            return
        if tag in _VALUES:
            self._set(draft, element, self._value(element))
            return
        if tag in ("path", *_STEPS) or tag not in ("ref", "include", "default", "alias"):
            raise self._fault(element, _why_not(tag))
        self._check(element)
        if element.children:
            raise self._fault(element, f"<{tag}> holds no other elements")
        if tag == "ref":
            self._set(draft, element, Reference(given["id"], self.path, element.line))
        elif tag == "include":
            self._include(draft, element)
        elif tag == "default":
            self.reading.set_default(given["name"], given["value"])
        else:
            source = self.reading.known.get(given["id"])
            if source is None:
                raise self._fault(element, f"nothing before has the id {shown_value(given['id'])}")
            if self.reading.known.setdefault(given["as"], source) is not source:
                raise self._fault(element, f"the id {shown_value(given['as'])} is there twice")

    def _value(self, element: Element) -> Value:
        if element.tag != "transform" and element.children:
            raise self._fault(element, f"<{element.tag}> holds no other elements")
        if element.tag == "transform":
            steps = [self.reading._filled(self.path, step, self.old) for step in element.children]
            element = replace(element, children=steps)
        try:
            if element.tag == "spectrum" and "filename" in element.attributes:
                check_attributes(element, ("name", "filename"))
                found = self.files.find(element.attributes["filename"], self._place(element), self.path)
                return self.reading.spectrum(found)
            return value_of(element)
        except InputError:
            raise
        except ValueError as fault:
            name = element.attributes.get("name", "")
            raise self._fault(element, f"{shown_value(name)}: {fault}" if name else str(fault)) from None

    def _include(self, draft: Draft, element: Element) -> None:
        """The contents of a scene take the element's place, or another plugin does."""
        name = element.attributes["filename"]
        found = self.files.find(name, self._place(element), self.path)
        if found in [path.resolve() for path in self.chain]:
            raise self._fault(element, f"{shown_value(name)} includes itself")
        if len(self.chain) > DEEPEST_INCLUDE:
            raise self._fault(element, f"files may include each other {DEEPEST_INCLUDE} deep, and these are deeper")
        inner = self.reading.file(found, self.chain)
        if inner.category != "scene":
            self._set(draft, element, inner)
        for key, value in inner.values.items() if inner.category == "scene" else ():
            named = replace(element, attributes={} if key.startswith("<") else {"name": key})
            self._set(draft, named, value)

    def _set(self, draft: Draft, element: Element, value: "Value | Draft | Reference") -> None:
        name = element.attributes.get("name") or f"<{len(draft.values)}>"
        if name in draft.values:
            what = f"<{draft.category}>" if draft.category == "scene" else f"{draft.category} {draft.type!r}"
            raise self._fault(element, f"{shown_value(name)} is there twice in {what}")
        draft.values[name] = value

    def _check(self, element: Element, attributes: tuple[str, ...] | None = None) -> None:
        try:
            check_attributes(element, attributes)
        except ValueError as fault:
            raise self._fault(element, str(fault)) from None

    def _place(self, element: Element) -> str:
        return f"{self.path}: line {element.line}"

    def _fault(self, element: Element, what: str) -> InputError:
        return InputError(f"{self._place(element)}: {what}")


def _why_not(tag: str) -> str:
    if tag == "path":
        return "<path> names other folders, and files here come from the scene's own; remove it"
    if tag in _STEPS:
        return f"<{tag}> stands only in a <transform>"
    return f"there is no <{tag[:40]}> in scenes of Mitsuba 3"


class _Following:
    """Puts plugins in the place of references, and measures what comes of it."""

    def __init__(self, known: dict[str, Draft]) -> None:
        self._known = known
        self._extents: dict[Draft, tuple[int, int]] = {}

    def extent(self, draft: Draft, outer: list[Draft]) -> tuple[int, int]:
        """How many plugins are in one, itself included, and how deep they are nested in each other.

        One that several refer to counts for each, so that whoever walks the tree is done in finite time.
        """
        place = f"{draft.file}: line {draft.line}"
        if draft in outer:
            raise InputError(f"{place}: {draft.category} {shown_value(draft.id)} refers to itself")
        if draft not in self._extents:
            outer.append(draft)
            number, height = 1, 0
            for name, value in draft.values.items():
                if isinstance(value, Reference):
                    value = draft.values[name] = self._target(value)
                if isinstance(value, Draft):
                    more, deep = self.extent(value, outer) if len(outer) < DEEPEST else (0, DEEPEST)
                    number, height = number + more, max(height, deep)
            outer.pop()
            self._extents[draft] = number, height + 1
        number, height = self._extents[draft]
        if len(outer) + height > DEEPEST:
            raise InputError(f"{place}: with its references followed plugins are nested more than {DEEPEST} deep")
        if number > MOST_ELEMENTS:
            raise InputError(f"{place}: with its references followed it has more than {MOST_ELEMENTS} plugins")
        return number, height

    def _target(self, reference: Reference) -> Draft:
        if reference.id not in self._known:
            raise InputError(
                f"{reference.file}: line {reference.line}: nothing has the id {shown_value(reference.id)}"
            )
        return self._known[reference.id]


def _upgrade(draft: Draft) -> None:
    """Names as they are since version 2: with underscores, and `to_uv` for the four numbers of a texture."""
    values = {_underscored(name): value for name, value in draft.values.items()}
    if draft.type == "diffuse" and "diffuse_reflectance" in values:
        values["reflectance"] = values.pop("diffuse_reflectance")
    numbers = {key: values.pop(key) for key in ("uoffset", "voffset", "uscale", "vscale") if key in values}
    if numbers and all(isinstance(value, float) for value in numbers.values()):
        to_uv = np.diag([numbers.get("uscale", 1.0), numbers.get("vscale", 1.0), 1.0, 1.0])
        to_uv[:2, 3] = to_uv[0, 0] * numbers.get("uoffset", 0.0), to_uv[1, 1] * numbers.get("voffset", 0.0)
        to_uv.flags.writeable = False
        values["to_uv"] = to_uv
    draft.values = values


def _underscored(name: str) -> str:
    """`to_world` from `toWorld`.

    >>> _underscored("intIOR")
    'int_ior'
    """
    return re.sub(r"(?<=[a-z])[A-Z]+", lambda found: f"_{found[0].lower()}", name)
