"""Plugins of Mitsuba as they are written, and what they are once references among them are followed."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from pcii.base.errors import InputError
from simgen.base.strict_models import shown_value
from simgen.mitsuba_xml.mitsuba_files import DEEPEST, MOST_ELEMENTS
from simgen.mitsuba_xml.mitsuba_scene import Value


@dataclass(frozen=True)
class Reference:
    """The place of a plugin that is defined elsewhere."""

    id: str
    place: str


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
    def place(self) -> str:
        """File and line, as messages begin."""
        return f"{self.file}: line {self.line}"

    @property
    def called(self) -> str:
        """What it is, as messages name it."""
        return "the scene" if self.category == "scene" else f"{self.category} {shown_value(self.type)}"

    @property
    def nested(self) -> "Iterator[tuple[str, Draft]]":
        """Nested plugins by name, but for references."""
        return ((name, value) for name, value in self.values.items() if isinstance(value, Draft))


def follow(root: Draft, known: Mapping[str, Draft]) -> None:
    """Puts plugins that are known by their ids in the place of all references in a scene.

    `InputError` for a reference to nothing or in a circle, and for a scene that with its references followed
    is too large or too deep for those who walk it.
    """
    _Following(known).extent(root, [])


class _Following:
    def __init__(self, known: Mapping[str, Draft]) -> None:
        self._known = known
        self._extents: dict[Draft, tuple[int, int]] = {}

    def extent(self, draft: Draft, outer: list[Draft]) -> tuple[int, int]:
        """How many plugins there are in one, itself included, and how deep they are nested.

        One that several refer to counts for each of them.
        """
        if draft in outer:
            raise InputError(f"{draft.place}: {draft.category} {shown_value(draft.id)} refers to itself")
        if draft not in self._extents:
            outer.append(draft)
            number, height = 1, 0
            for name, value in draft.values.items():
                inner = self._target(value) if isinstance(value, Reference) else value
                draft.values[name] = inner
                if isinstance(inner, Draft):
                    # Deeper than this is an error below, and needs no look.
                    more, deep = self.extent(inner, outer) if len(outer) <= DEEPEST else (1, 1)
                    number, height = number + more, max(height, deep)
            outer.pop()
            self._extents[draft] = number, height + 1
        number, height = self._extents[draft]
        if len(outer) + height > DEEPEST:
            raise InputError(
                f"{draft.place}: plugins may be nested {DEEPEST} deep, and these are deeper with references "
                "followed"
            )
        if number > MOST_ELEMENTS:
            raise InputError(
                f"{draft.place}: with references followed there are more than {MOST_ELEMENTS} plugins in it"
            )
        return number, height

    def _target(self, reference: Reference) -> Draft:
        if reference.id not in self._known:
            raise InputError(f"{reference.place}: nothing has the id {shown_value(reference.id)}")
        return self._known[reference.id]
