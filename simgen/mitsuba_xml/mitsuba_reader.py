"""A Mitsuba scene file as checked plugins; what cannot be imported is named.

Mitsuba itself would load and run whatever library a plugin's type or a `<path>` names, so it never sees the
file: the standard library reads the XML, and what is not in `mitsuba_plugins` is refused.
"""

from pathlib import Path

import numpy as np

from pcii.base.errors import InputError
from simgen.base.strict_models import faults_of, shown_value
from simgen.mitsuba_xml.mitsuba_drafts import read_drafts
from simgen.mitsuba_xml.mitsuba_files import SceneFiles
from simgen.mitsuba_xml.mitsuba_plugins import ALLOWED, IGNORED, Allowed, Kind, Parameter
from simgen.mitsuba_xml.mitsuba_references import Draft
from simgen.mitsuba_xml.mitsuba_scene import MitsubaScene, Plugin, Rgb, SpectrumValues, Value

_NEEDED: dict[Kind, str] = {
    "number": "a number",
    "flag": "a boolean",
    "text": "a string",
    "vector": "a vector or point",
    "transform": "a transform",
    "colour": "a number, an rgb, a spectrum or a texture",
    "texture": "a texture",
    "index": "a number or the name of a substance",
    "file": "a string, the name of a file",
}


def read_mitsuba(path: Path) -> MitsubaScene:
    """The plugins of a scene file of Mitsuba 3, or of an older version, with their parameters.

    Integrators, films, samplers and filters are left out. Files that the scene names are found inside its
    folder but not opened, except for what it includes and for spectra.

    Raises `InputError` that names the file and, where it can, the line: if it is not XML of a scene, is too
    large or nested too deeply, names files outside its folder or that are not there, or has plugins and
    parameters that cannot be imported, which are all named.

    Source: Mitsuba 3, "Scene XML file format", and src/core/parser.cpp.
    """
    files = SceneFiles(path)
    return _Checking(path, files).scene(read_drafts(path, files))


class _Checking:
    """Compares plugins with what is allowed, and collects what is not."""

    def __init__(self, path: Path, files: SceneFiles) -> None:
        self._path = path
        self._files = files
        self._done: dict[Draft, Plugin | None] = {}
        # Each once, in the order of the file.
        self._unknown_plugins: dict[str, None] = {}
        self._unknown_parameters: dict[str, None] = {}
        self._faults: list[str] = []

    def scene(self, root: Draft) -> MitsubaScene:
        scene = self._plugin(root)
        sentences = [
            f"{', '.join(names)}: not among {what} that can be imported"
            for names, what in (
                (self._unknown_plugins, "the plugins"),
                (self._unknown_parameters, "the parameters"),
            )
            if names
        ] + self._faults
        if scene is None or sentences:
            raise faults_of(str(self._path), sentences, len(sentences))
        return MitsubaScene(self._path, scene.parts)

    def _plugin(self, draft: Draft) -> Plugin | None:
        """None for what is left out or refused."""
        if draft not in self._done:
            self._done[draft] = None if draft.category in IGNORED else self._checked(draft)
        return self._done[draft]

    def _checked(self, draft: Draft) -> Plugin | None:
        nested = {name: self._plugin(inner) for name, inner in draft.nested}
        allowed = ALLOWED.get((draft.category, draft.type))
        if allowed is None:
            self._unknown_plugins[draft.called] = None
            return None
        parameters: dict[str, Value | Plugin] = {}
        parts: list[Plugin] = []
        counted: list[Draft] = []
        for name, value in draft.values.items():
            parameter = allowed.parameters.get(name)
            if parameter is not None:
                good = self._value(draft, name, parameter, value, nested.get(name))
                if good is not None:
                    parameters[name] = good
            elif isinstance(value, Draft):
                inner = nested[name]
                counted.append(value)
                if inner is not None:
                    parts.append(inner)
            else:
                self._unknown_parameters[f"{shown_value(name)} of {draft.called}"] = None
        self._count(draft, allowed, counted)
        for name, parameter in allowed.parameters.items():
            if name not in draft.values:
                if parameter.needed:
                    self._fault(draft, f"{draft.called} needs '{name}'")
                if parameter.default is not None:
                    parameters[name] = parameter.default
        for one, other in allowed.not_both:
            if one in draft.values and other in draft.values:
                self._fault(draft, f"{draft.called} takes either '{one}' or '{other}'")
        return Plugin(draft.category, draft.type, draft.id, parameters, tuple(parts), draft.place)

    def _count(self, draft: Draft, allowed: Allowed, nested: list[Draft]) -> None:
        """Faults of the number and kinds of nested plugins."""
        nested = [inner for inner in nested if inner.category not in IGNORED]
        categories = {part.category for part in allowed.parts}
        for inner in nested:
            if inner.category not in categories and (inner.category, inner.type) in ALLOWED:
                self._fault(inner, f"{inner.called} has no place in {draft.called}")
        for part in allowed.parts:
            of_it = [inner for inner in nested if inner.category == part.category]
            for inner in of_it:
                if part.type and inner.type != part.type and (inner.category, inner.type) in ALLOWED:
                    self._fault(inner, f"{draft.called} takes no {inner.called}")
            if len(of_it) < part.fewest:
                self._fault(draft, f"{draft.called} needs a {part.type or part.category} in it")
            if part.most is not None and len(of_it) > part.most:
                self._fault(
                    draft, f"{draft.called} takes {part.most} {part.category} in it, and has {len(of_it)}"
                )

    def _value(
        self, draft: Draft, name: str, parameter: Parameter, value: object, inner: Plugin | None
    ) -> "Value | Plugin | None":
        """A parameter as its kind is; None if it is not, which is noted."""
        match parameter.kind, value:
            case ("colour" | "texture", Draft(category="texture" | "spectrum")):
                return inner
            case ("number" | "colour" | "index", int() | float()) if not isinstance(value, bool):
                return float(value)
            case ("flag", bool()) | ("vector", tuple()) | ("transform", np.ndarray()) | ("index", str()):
                return value
            case ("colour", Rgb() | SpectrumValues()):
                return value
            case ("text", str()):
                text = value.lower() if parameter.choices else value
                if not parameter.choices or text in parameter.choices:
                    return text
                known = ", ".join(parameter.choices)
                self._fault(draft, f"'{name}' of {draft.called} is {shown_value(value)}; known are {known}")
            case ("file", str()):
                try:
                    self._files.find(value, f"'{name}' of {draft.called}")
                    return value
                except InputError as fault:
                    self._fault(draft, str(fault))
            case _:
                self._fault(draft, f"'{name}' of {draft.called} must be {_NEEDED[parameter.kind]}")
        return None

    def _fault(self, draft: Draft, what: str) -> None:
        file = "" if draft.file == self._path else f" of {draft.file.name}"
        self._faults.append(f"line {draft.line}{file}: {what}")
