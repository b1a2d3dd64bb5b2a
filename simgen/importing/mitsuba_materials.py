"""Surfaces of a Mitsuba scene as our materials: finish, holes, tilts, and the light that they send out.

Mitsuba 3.9, "BSDFs" and "Emitters".
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from pcii.base.srgb import LUMINANCE
from simgen.importing.foreign_scene import ForeignScene, light_values
from simgen.importing.mitsuba_finishes import Finished, finished
from simgen.importing.mitsuba_pictures import SurfacePictures, stem_of
from simgen.mitsuba_xml.mitsuba_scene import MitsubaScene, Plugin
from simgen.mitsuba_xml.mitsuba_textures import MitsubaTextures, light_of, reflected

HALF, NEARLY = 0.5, 1e-3
AROUND = {"twosided", "mask", "normalmap", "bumpmap"}
"""Bsdfs that are around another one."""


@dataclass(frozen=True, eq=False)
class Surface:
    """What a shape looks like."""

    finished: Finished
    material: dict[str, Any]
    """As in a scene.toml, but for whether its pictures are tiled."""
    has_pictures: bool
    to_uv: np.ndarray
    """(3, 3), which moves Mitsuba's texture coordinates."""
    pictures_repeat: bool
    is_clear: bool
    """Whether light passes through it."""
    dark_behind: bool
    """Whether in the file it is black from behind."""


class MitsubaMaterials:
    """The surfaces of one scene, each made once; pictures, and what is lost, go into the other scene."""

    def __init__(self, source: MitsubaScene, scene: ForeignScene) -> None:
        self.textures, self.scene = MitsubaTextures(source), scene
        self._made: dict[tuple[Plugin | None, Plugin | None], Surface | None] = {}

    def surface(self, shape: Plugin) -> Surface | None:
        """That of a shape; None for one that is all clear."""
        bsdf, emitter = (
            next((part for part in shape.parts if part.category == category), None)
            for category in ("bsdf", "emitter")
        )
        if (bsdf, emitter) not in self._made:
            pictures = SurfacePictures(self.textures, self.scene)
            self._made[bsdf, emitter] = _Making(pictures).surface(bsdf, emitter)
        return self._made[bsdf, emitter]


class _Making:
    """One surface as it is made."""

    def __init__(self, pictures: SurfacePictures) -> None:
        self.pictures, self.scene = pictures, pictures.scene
        self.material: dict[str, Any] = {}

    def surface(self, bsdf: Plugin | None, emitter: Plugin | None) -> Surface | None:
        around: list[Plugin] = []
        while bsdf is not None and bsdf.type in AROUND:
            around.append(bsdf)
            inner = [part for part in bsdf.parts if part.category == "bsdf"]
            if len(inner) > 1:
                self.scene.lose("backs of surfaces that differ from their fronts")
            bsdf = inner[0]
        made = finished(bsdf, self.pictures, shines=emitter is not None)
        self.material |= made.material
        finish = made.material.get("finish", {})
        is_clear = finish.get("type") == "glass" or bool(finish.get("transmission"))
        for plugin in around:
            if plugin.type == "mask" and not self._mask(plugin, is_clear=is_clear):
                self.scene.lose("surfaces that are all clear")
                return None
            if plugin.type == "normalmap":
                self._normals(plugin, is_clear=is_clear)
            if plugin.type == "bumpmap":
                self.scene.lose("bumps (bumpmap): these surfaces are smooth")
        if emitter is not None:
            self._emission(emitter)
        # Lamps without any bsdf are black on both sides.
        dark_lamp = bsdf is None and emitter is not None
        pictures, two_sided = self.pictures, any(plugin.type == "twosided" for plugin in around)
        return Surface(
            finished=made,
            material=self.material,
            has_pictures=pictures.any,
            to_uv=pictures.to_uv,
            pictures_repeat=pictures.repeat,
            is_clear=is_clear,
            dark_behind=not (is_clear or two_sided or dark_lamp),
        )

    def _mask(self, mask: Plugin, *, is_clear: bool) -> bool:
        """Sets holes; returns whether there is any surface."""
        value, stem = mask.parameters["opacity"], ""
        if not isinstance(value, Plugin):
            opacity = np.array(reflected(value) @ LUMINANCE)
        elif is_clear or "opacity" in self.material:
            self.scene.lose("holes in surfaces that light passes through, or that have others")
            return True
        elif not self.pictures.fit(value, "opacity"):
            return True
        else:
            opacity, stem = self.pictures.textures.numbers(value), stem_of(value)
        if ((opacity > NEARLY) & (opacity < 1 - NEARLY)).any():
            self.scene.lose("surfaces that are partly clear: they are there from an opacity of a half")
        if opacity.max() < HALF:
            return False
        if opacity.min() < HALF:
            stored = np.round(np.clip(opacity, 0, 1) * 65535).astype(np.uint16)
            self.material["opacity"] = self.scene.keep(f"{stem}-opacity", stored)
        return True

    def _normals(self, tilted: Plugin, *, is_clear: bool) -> None:
        texture = tilted.parameters["normalmap"]
        assert isinstance(texture, Plugin)
        if texture.type != "bitmap" or is_clear or "normal_map" in self.material:
            self.scene.lose(
                "normal maps of surfaces that light passes through or that have two, or without file"
            )
        elif self.pictures.fit(texture, "normals"):
            (to_right, _), (turned, _) = np.linalg.inv(self.pictures.to_uv[:2, :2])
            if to_right <= 0 or turned:
                self.scene.lose("directions of tilts where pictures are turned or mirrored by to_uv")
            self.material["normal_map"] = self.scene.keep(
                stem_of(texture), self.pictures.textures.held(texture)
            )

    def _emission(self, emitter: Plugin) -> None:
        radiance = emitter.parameters["radiance"]
        if (
            isinstance(radiance, Plugin)
            and radiance.type == "bitmap"
            and self.pictures.fit(radiance, "light")
        ):
            painted = self.pictures.textures.painted(radiance, np.ones(3))
            assert isinstance(painted, np.ndarray)
            if painted.any():
                file = self.scene.keep(stem_of(radiance), painted)
                self.material["emission"] = {"luminance_cd_m2": 1.0, "texture": file}
            return
        rgb = self.pictures.flat(radiance, "light", light_of)
        if rgb.any():
            self.material["emission"] = light_values("luminance_cd_m2", rgb)
