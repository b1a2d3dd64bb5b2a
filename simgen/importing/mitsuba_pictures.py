"""What one surface of a Mitsuba scene takes from its textures: pictures in one layout, or their means."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base.srgb import LUMINANCE
from simgen.base.srgb import srgb_of
from simgen.importing.foreign_scene import ForeignScene
from simgen.mitsuba_xml.mitsuba_scene import Plugin
from simgen.mitsuba_xml.mitsuba_textures import (
    Given,
    MitsubaTextures,
    reflectance_of,
    reflected,
)

WHITE = np.ones(3)


class SurfacePictures:
    """The textures of one surface; pictures, and what is lost, go into the scene."""

    def __init__(self, textures: MitsubaTextures, scene: ForeignScene) -> None:
        self.textures, self.scene = textures, scene
        self._first: Plugin | None = None

    @property
    def any(self) -> bool:
        """Whether there are pictures, which ask for texture coordinates."""
        return self._first is not None

    @property
    def to_uv(self) -> np.ndarray:
        """(3, 3), which moves Mitsuba's texture coordinates for all of them."""
        return np.eye(3) if self._first is None else _to_uv(self._first)

    @property
    def repeat(self) -> bool:
        """Whether they are repeated beyond their borders."""
        return self._first is not None and _repeats(self._first)

    def fit(self, texture: Plugin, what: str) -> bool:
        """Whether a texture can be a picture here: the first says how all are laid out."""
        if texture.parameters.get("filter_type") == "nearest":
            self.scene.lose("sharp borders of pixels (filter_type nearest): pictures are smooth between them")
        if texture.parameters.get("wrap_mode") == "mirror":
            self.scene.lose("every other repetition of a picture mirrored: pictures are repeated as they are")
        self._first = self._first or texture
        if not np.array_equal(_to_uv(texture), self.to_uv):
            self.scene.lose(f"pictures of {what} that are laid out unlike the others of their surface")
            return False
        if _repeats(texture) != self.repeat:
            self.scene.lose(
                "how pictures go on beyond their borders, where those of one surface differ in it"
            )
        return True

    def colour(self, value: Given, what: str, factor: np.ndarray = WHITE) -> dict[str, Any]:
        """A colour times a linear factor (3,) as the "reflectance" or "texture" of a material."""
        if isinstance(value, Plugin) and self.fit(value, what):
            painted = self.textures.painted(value, factor)
            if isinstance(painted, np.ndarray):
                return {"texture": self.scene.keep(stem_of(value), painted)}
            return {"texture": painted}
        if isinstance(value, Plugin) or (factor != 1).any():
            return {"reflectance": srgb_of(self.textures.flat(value) * factor)}
        return {"reflectance": reflectance_of(value)}

    def share(
        self, value: Given, what: str, of: Callable[[np.ndarray], np.ndarray] = lambda numbers: numbers
    ) -> float | str:
        """`of` a number, cut to 0 to 1; or the file of a grey picture of such."""
        if isinstance(value, Plugin) and self.fit(value, what):
            shares = np.clip(of(np.clip(self.textures.numbers(value), 0, 1)), 0, 1)
            if np.ptp(shares) > 0:
                stored = np.round(shares * 65535).astype(np.uint16)
                return self.scene.keep(f"{stem_of(value)}-{what.replace(' ', '-')}", stored)
            return round(float(shares.flat[0]), 6)
        return round(float(np.clip(of(self.textures.flat(value) @ LUMINANCE), 0, 1)), 6)

    def flat(self, value: Given, what: str, of: Callable[[Given], np.ndarray] = reflected) -> np.ndarray:
        """A colour (3,), as `of` makes it, where there can be no picture."""
        if isinstance(value, Plugin):
            self.scene.lose(f"pictures of {what}: their mean is taken")
        return self.textures.flat(value, of)


def stem_of(texture: Plugin) -> str:
    """What a picture that is made of a texture is called."""
    return Path(str(texture.parameters.get("filename", "squares"))).stem


def _to_uv(texture: Plugin) -> np.ndarray:
    return texture.matrix("to_uv")[np.ix_((0, 1, 3), (0, 1, 3))]


def _repeats(texture: Plugin) -> bool:
    return texture.parameters.get("wrap_mode", "repeat") != "clamp"
