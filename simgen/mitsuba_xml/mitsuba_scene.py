"""What a Mitsuba scene file says: nested plugins with checked parameters."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np

Vector: TypeAlias = tuple[float, float, float]


@dataclass(frozen=True)
class Rgb:
    """A colour or light as linear sRGB; light may be above 1."""

    linear: Vector


@dataclass(frozen=True)
class SpectrumValues:
    """A value by wavelength, linear in between and 0 beyond the ends; or the same at all wavelengths."""

    wavelength_nm: tuple[float, ...]
    """Growing wavelengths, in nm: two at least, or none."""
    value: tuple[float, ...]
    """As many values; one if there are no wavelengths."""


Value: TypeAlias = float | int | bool | str | Vector | Rgb | SpectrumValues | np.ndarray
"""A transform is a read-only (4, 4) float64 array that acts on columns (x, y, z, 1)."""


@dataclass(frozen=True, eq=False)
class Plugin:
    """One object of a scene. What several references name is one and the same plugin."""

    category: str
    """"shape", "bsdf", "emitter", "texture" or "sensor"."""
    type: str
    """Which of its category, such as "sphere"; one of those in `mitsuba_plugins`."""
    id: str
    """The name that references use; "" if it has none."""
    parameters: "Mapping[str, Value | Plugin]"
    """By name, of the kinds in `mitsuba_plugins`. Those that the file leaves out have Mitsuba's defaults, and
    are missing where it has none. A texture may stand in the place of a number or colour."""
    parts: "tuple[Plugin, ...]"
    """Nested plugins whose names have no meaning: the bsdf and emitter of a shape, the shapes of a group."""
    place: str
    """File and line where it stands, for messages."""

    def number(self, name: str) -> float:
        """A parameter that is a number."""
        value = self.parameters[name]
        assert isinstance(value, int | float)
        return float(value)

    def vector(self, name: str) -> np.ndarray:
        """A parameter that is a vector or point, (3,)."""
        value = self.parameters[name]
        assert isinstance(value, tuple)
        return np.array(value)

    def matrix(self, name: str) -> np.ndarray:
        """A parameter that is a transform, (4, 4)."""
        value = self.parameters[name]
        assert isinstance(value, np.ndarray)
        return value

    def text(self, name: str) -> str:
        """A parameter that is a text or the name of a file."""
        value = self.parameters[name]
        assert isinstance(value, str)
        return value


@dataclass(frozen=True, eq=False)
class MitsubaScene:
    """A scene file: its plugins in the order of the file, without what only tells how to render."""

    path: Path
    """The file; names of files among the parameters are names in its folder."""
    plugins: tuple[Plugin, ...]
    """Those of the scene itself, with bsdfs and textures that are defined there to be referred to."""
