"""Mitsuba scene files as plugins that refer to each other: includes, defaults and old names.

Mitsuba 3, "Scene XML file format", and what its src/core/parser.cpp does with files of older versions.
"""

import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pcii.base.errors import InputError
from simgen.base.strict_models import shown_value
from simgen.mitsuba_xml.mitsuba_files import LARGEST_XML_BYTES, Element, SceneFiles
from simgen.mitsuba_xml.mitsuba_references import Draft, Reference, follow
from simgen.mitsuba_xml.mitsuba_scene import SpectrumValues, Value
from simgen.mitsuba_xml.mitsuba_values import STEPS, check_attributes, spectrum_of_file, value_of

DEEPEST_INCLUDE = 15
LONGEST_NAME = 100
LARGEST_SPECTRUM_BYTES = 1 << 17
_PLUGINS = {
    *("scene", "shape", "bsdf", "emitter", "texture", "sensor", "integrator", "film", "sampler", "rfilter"),
    *("medium", "phase", "volume"),
}
_VALUES = {"float", "integer", "boolean", "string", "vector", "point", "rgb", "spectrum", "transform"}
_OTHERS = {"ref", "include", "default", "alias"}


def read_drafts(path: Path, files: SceneFiles) -> Draft:
    """The scene in a file, every reference in it followed.

    `InputError` with file and line for the first thing that is not written as Mitsuba reads it, for a file
    outside the scene's folder, and for what goes round in a circle or grows beyond the limits.
    """
    reading = _Reading(files)
    root = reading.file(path, (), 0)
    if root.category != "scene":
        raise InputError(f"{root.place}: the root is <{root.category}>, and that of a scene file is <scene>")
    follow(root, reading.known)
    return root


class _Reading:
    """What has been said so far: ids and defaults, which a scene and the files that it includes share."""

    def __init__(self, files: SceneFiles) -> None:
        self.known: dict[str, Draft] = {}
        self.defaults: dict[str, str] = {}
        self.files = files
        self._filled_in = 0
        self._spectra: dict[Path, SpectrumValues] = {}

    def file(self, path: Path, outer: tuple[Path, ...], depth: int) -> Draft:
        """The root of a file that the `outer` files include, inside so many elements."""
        element = self.files.read_xml(path, depth)
        place = f"{path}: line {element.line}"
        if element.tag not in _PLUGINS:
            raise InputError(
                f"{place}: the root is <{element.tag[:40]}>, and that of a scene file is <scene>"
            )
        version = element.attributes.get("version", "")
        if not re.fullmatch(r"[0-9]{1,4}(\.[0-9]{1,4}){0,2}", version):
            raise InputError(
                f'{place}: <{element.tag}> needs the version of Mitsuba, such as version="3.0.0"'
            )
        reader = _FileReader(self, path, (*outer, path.resolve()), int(version.split(".")[0]) < 2)
        return reader.plugin(reader.filled(element), depth, ("version", "type?", "id?", "name?"))

    def name(self, name: str, draft: Draft, place: str) -> None:
        """Makes a plugin known by a name."""
        if self.known.setdefault(name, draft) is not draft:
            raise InputError(f"{place}: the id {shown_value(name)} is there twice")

    def filled(self, text: str, place: str) -> str:
        """A text with defaults in the place of `$name`."""
        first, *others = re.split(r"(?<!\\)\$", text)
        parts = [first]
        for other in others:
            # The longest name that fits, as in Mitsuba.
            ends = range(min(len(other), LONGEST_NAME), 0, -1)
            name = next((other[:end] for end in ends if other[:end] in self.defaults), None)
            if name is None:
                word = re.match(r"\w*", other)
                name = shown_value(word[0] if word else "")
                raise InputError(f"{place}: {name} has no value; give one by a <default> before this line")
            parts += [self.defaults[name], other[len(name) :]]
            # Defaults that are made of defaults could grow without bound.
            self._filled_in += len(self.defaults[name])
            if self._filled_in > LARGEST_XML_BYTES:
                raise InputError(f"{place}: with its defaults filled in the scene is too large")
        return "".join(parts).replace("\\$", "$")

    def spectrum(self, path: Path) -> SpectrumValues:
        """The spectrum in a file, which is read once; `ValueError` if it has none."""
        if path not in self._spectra:
            with path.open("rb") as file:
                data = file.read(LARGEST_SPECTRUM_BYTES + 1)
            try:
                if len(data) > LARGEST_SPECTRUM_BYTES:
                    raise ValueError(f"a spectrum may have {LARGEST_SPECTRUM_BYTES} bytes, and this has more")
                self._spectra[path] = spectrum_of_file(data)
            except ValueError as fault:
                raise ValueError(f"{path.name!r}: {fault}") from None
        return self._spectra[path]


@dataclass(frozen=True)
class _FileReader:
    """Reads the elements of one file."""

    reading: _Reading
    path: Path
    chain: tuple[Path, ...]
    """The file and those that include it, the scene first."""
    old: bool
    """Whether it is of Mitsuba 0.x or 1, whose names have capitals."""

    def filled(self, element: Element) -> Element:
        """An element with defaults in the place of `$name`."""
        tag = "lookat" if self.old and element.tag == "lookAt" else element.tag
        if tag == element.tag and not any("$" in text for text in element.attributes.values()):
            return element
        place = self._place(element)
        given = {name: self.reading.filled(text, place) for name, text in element.attributes.items()}
        return replace(element, tag=tag, attributes=given)

    def plugin(self, element: Element, depth: int, attributes: tuple[str, ...]) -> Draft:
        """The plugin that an element is, inside so many elements."""
        self._check(element, attributes)
        given = element.attributes
        type_ = "scene" if element.tag == "scene" else given.get("type", "")
        draft = Draft(element.tag, type_, given.get("id", ""), self.path, element.line)
        if draft.id:
            self.reading.name(draft.id, draft, draft.place)
        for child in element.children:
            self._add(draft, self.filled(child), depth + 1)
        if self.old:
            _upgrade(draft)
        return draft

    def _add(self, draft: Draft, element: Element, depth: int) -> None:
        """What one element says about the plugin that it is in."""
        tag, given = element.tag, element.attributes
        if tag in _PLUGINS or (tag == "spectrum" and "type" in given):
            self._set(draft, element, self.plugin(element, depth, ("type", "id?", "name?")))
            return
        if tag in _VALUES:
            self._set(draft, element, self._value(element))
            return
        if tag not in _OTHERS:
            raise self._fault(element, _why_not(tag))
        self._check(element)
        if element.children:
            raise self._fault(element, f"<{tag}> holds no other elements")
        match tag:
            case "ref":
                self._set(draft, element, Reference(given["id"], self._place(element)))
            case "include":
                self._include(draft, element, depth)
            case "default":
                if len(given["name"]) > LONGEST_NAME:
                    raise self._fault(element, f"the name of a <default> may have {LONGEST_NAME} characters")
                # The first of a name holds.
                self.reading.defaults.setdefault(given["name"], given["value"])
            case _:
                source = self.reading.known.get(given["id"])
                if source is None:
                    raise self._fault(element, f"nothing before has the id {shown_value(given['id'])}")
                self.reading.name(given["as"], source, self._place(element))

    def _value(self, element: Element) -> Value:
        if element.children and element.tag != "transform":
            raise self._fault(element, f"<{element.tag}> holds no other elements")
        element = replace(element, children=[self.filled(step) for step in element.children])
        try:
            if element.tag == "spectrum" and "filename" in element.attributes:
                check_attributes(element, ("name", "filename"))
                name = element.attributes["filename"]
                return self.reading.spectrum(self.reading.files.find(name, self._place(element), self.path))
            return value_of(element)
        except InputError:
            raise
        except ValueError as fault:
            name = element.attributes.get("name")
            raise self._fault(element, f"{shown_value(name)}: {fault}" if name else str(fault)) from None

    def _include(self, draft: Draft, element: Element, depth: int) -> None:
        """What is in a scene takes the place of the element; any other plugin stands there itself."""
        name = element.attributes["filename"]
        found = self.reading.files.find(name, self._place(element), self.path)
        if found in self.chain:
            raise self._fault(element, f"{shown_value(name)} includes itself")
        if len(self.chain) > DEEPEST_INCLUDE:
            raise self._fault(
                element, f"files may include each other {DEEPEST_INCLUDE} deep; these are deeper"
            )
        inner = self.reading.file(found, self.chain, depth)
        if inner.category != "scene":
            self._set(draft, element, inner)
            return
        for key, value in inner.values.items():
            self._set(draft, replace(element, attributes={} if key[:1] == "<" else {"name": key}), value)

    def _set(self, draft: Draft, element: Element, value: "Value | Draft | Reference") -> None:
        name = element.attributes.get("name") or f"<{len(draft.values)}>"
        if name in draft.values:
            raise self._fault(element, f"{shown_value(name)} is there twice in {draft.called}")
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
        return "<path> lets files come from other folders, and here they come from the scene's own; remove it"
    if tag in STEPS:
        return f"<{tag}> has its place in a <transform>"
    return f"there is no <{tag[:40]}> in scenes of Mitsuba 3"


def _upgrade(draft: Draft) -> None:
    """Names as they are since version 2: with underscores, and `to_uv` for four numbers of a texture."""
    values = {_underscored(name): value for name, value in draft.values.items()}
    if draft.type == "diffuse" and "diffuse_reflectance" in values:
        values["reflectance"] = values.pop("diffuse_reflectance")
    layout = {"uscale": 1.0, "vscale": 1.0, "uoffset": 0.0, "voffset": 0.0}
    numbers = {name: float(one) for name in layout if isinstance(one := values.get(name), int | float)}
    if numbers:
        values = {name: value for name, value in values.items() if name not in numbers}
        u, v, u_offset, v_offset = (layout | numbers).values()
        values["to_uv"] = np.diag([u, v, 1.0, 1.0])
        values["to_uv"][:2, 3] = u * u_offset, v * v_offset
        values["to_uv"].flags.writeable = False
    draft.values = values


def _underscored(name: str) -> str:
    """`to_world` from `toWorld`, `int_ior` from `intIOR`."""
    return re.sub(r"(?<=[a-z])[A-Z]+", lambda found: f"_{found[0].lower()}", name)
