"""Bsdfs of Mitsuba as the colour and finish of our materials.

Mitsuba 3.9, "BSDFs", and the constructors of src/bsdfs.
"""

from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np

from pcii.base.errors import InputError
from simgen.base.strict_models import suggestion
from simgen.importing.mitsuba_pictures import SurfacePictures
from simgen.mitsuba_xml.mitsuba_plugins import ALLOWED
from simgen.mitsuba_xml.mitsuba_scene import Plugin
from simgen.mitsuba_xml.mitsuba_substances import METALS, REFRACTIVE_INDEX
from simgen.mitsuba_xml.mitsuba_textures import Given, light_of, reflected
from simgen.spec.materials import LEAST_INDEX, MOST_INDEX, Metal

LEAST_ALPHA = 0.001
PLASTIC_INDEX = 1.49
NEARLY = 0.005
OUR_METALS = get_args(Metal.model_fields["name"].annotation)
NOT_IN_PRINCIPLED = "anisotropic", "spec_tint", "sheen", "sheen_tint", "flatness"


@dataclass(frozen=True)
class Finished:
    """The colour and finish of a material, and what they ask of the shape."""

    material: dict[str, Any]
    body: Literal["any", "pane", "solid"] = "any"
    """A "pane" is clear and as thin as a card; what is "solid" must not become one."""
    turned: bool = False
    """Whether the outside of the shape must be its inside."""


def finished(bsdf: Plugin | None, pictures: SurfacePictures, *, shines: bool) -> Finished:
    """Of a bsdf that is not around another one; shapes without any are grey, or black if they shine.

    Raises `InputError` for a substance that is not known.
    """
    if bsdf is None:
        return Finished(pictures.colour(0.0 if shines else 0.5, "colour"))
    making = _Finishing(bsdf, pictures)
    match bsdf.type:
        case "diffuse":
            return Finished(pictures.colour(bsdf.parameters["reflectance"], "colour"))
        case "plastic" | "roughplastic":
            return making.plastic()
        case "conductor" | "roughconductor":
            return making.metal()
        case "principled":
            return making.principled()
        case _:
            return making.clear()


class _Finishing:
    """One bsdf as a finish is made of it."""

    def __init__(self, bsdf: Plugin, pictures: SurfacePictures) -> None:
        self.bsdf, self.pictures, self.scene = bsdf, pictures, pictures.scene
        self.rough = bsdf.type.startswith("rough")

    def plastic(self) -> Finished:
        self._say_if_smooth()
        self._lose("nonlinear", "specular_reflectance")
        if abs(self._index() - PLASTIC_INDEX) > NEARLY:
            self.scene.lose(f"refractive indices of plastic other than {PLASTIC_INDEX}")
        finish = {"type": "plastic", "roughness": self._alpha()}
        return Finished(self._colour("diffuse_reflectance") | {"finish": finish})

    def metal(self) -> Finished:
        self._say_if_smooth()
        name, tint = (
            self.bsdf.parameters.get("material", "none"),
            self.bsdf.parameters["specular_reflectance"],
        )
        is_ours = name in OUR_METALS and not isinstance(tint, Plugin) and (reflected(tint) == 1).all()
        if is_ours and not self._has_picture_of_alpha():
            return Finished({"finish": {"type": "metal", "name": name, "roughness": self._alpha()}})
        if name != "none" or {"eta", "k"} & self.bsdf.parameters.keys():
            self.scene.lose("metals but for six: how they reflect at an angle is Schlick's estimate")
        finish = {"type": "principled", "metallic": 1.0, "roughness": self._roughness()}
        return Finished(self.pictures.colour(tint, "colour", self._straight(str(name))) | {"finish": finish})

    def clear(self) -> Finished:
        self._lose("specular_reflectance")
        index = self._index()
        turned, index = index < 1, max(index, 1 / index)
        if not LEAST_INDEX <= index <= MOST_INDEX:
            self.scene.lose(f"refractive indices that are not from {LEAST_INDEX} to {MOST_INDEX}")
        index = self._index_of_ours(index)
        through = self.pictures.flat(self.bsdf.parameters["specular_transmittance"], "specular_transmittance")
        glass = {"finish": {"type": "glass", "refractive_index": index}}
        if self.bsdf.type == "thindielectric":
            self._lose("specular_transmittance")
            return Finished(glass, "pane")
        if not self.rough and (through == 1).all():
            return Finished(glass, "solid", turned)
        # That plugin takes the root of its colour each time that light goes through.
        colour = self.pictures.colour(1.0, "colour", through**2)
        roughness = self._roughness() if self.rough else 0.0
        finish = {
            "type": "principled",
            "transmission": 1.0,
            "roughness": roughness,
            "refractive_index": index,
        }
        return Finished(colour | {"finish": finish}, "solid", turned)

    def principled(self) -> Finished:
        given = self.bsdf.parameters
        self._lose(*NOT_IN_PRINCIPLED)
        specular = float(np.clip(self.bsdf.number("specular") if "specular" in given else 0.5, 0, 1))
        index = self.bsdf.number("eta") if "eta" in given else 2 / (1 - np.sqrt(0.08 * specular)) - 1
        if not LEAST_INDEX <= index <= MOST_INDEX:
            self.scene.lose(f"refractive indices that are not from {LEAST_INDEX} to {MOST_INDEX}")
        colour = self._colour("base_color")
        shares = {
            field: self.pictures.share(given[name], field)
            for field, name in (
                ("metallic", "metallic"),
                ("roughness", "roughness"),
                ("transmission", "spec_trans"),
                ("clearcoat", "clearcoat"),
            )
        }
        gloss = self.pictures.flat(given["clearcoat_gloss"], "clearcoat_gloss")
        finish = {
            "type": "principled",
            **shares,
            "refractive_index": self._index_of_ours(index),
            "clearcoat_gloss": round(float(gloss.mean()), 6),
        }
        return Finished(colour | {"finish": finish}, "solid" if shares["transmission"] else "any")

    def _colour(self, name: str) -> dict[str, Any]:
        return self.pictures.colour(self.bsdf.parameters[name], "colour")

    def _lose(self, *names: str) -> None:
        """Say of parameters, which we have not, that they are lost where they do something."""
        for name in names:
            value = self.bsdf.parameters[name]
            default = ALLOWED["bsdf", self.bsdf.type].parameters[name].default
            assert default is not None
            if isinstance(value, Plugin) or (reflected(value) != reflected(default)).any():
                self.scene.lose(f"{name} of {self.bsdf.type} surfaces")

    def _say_if_smooth(self) -> None:
        if not self.rough:
            self.scene.lose(
                f"perfectly smooth plastic and metal: its highlights have a width of {LEAST_ALPHA}"
            )

    def _has_picture_of_alpha(self) -> bool:
        return any(
            isinstance(self.bsdf.parameters.get(name), Plugin) for name in ("alpha", "alpha_u", "alpha_v")
        )

    def _alpha_given(self) -> Given:
        """Of highlights that are wider in one direction the mean."""
        given = self.bsdf.parameters
        if given.get("distribution") == "beckmann":
            self.scene.lose("Beckmann's microfacets: their highlights have the width of GGX's")
        if "alpha_u" not in given and "alpha_v" not in given:
            return given.get("alpha", 0.1)
        u, v = (given.get(name, 0.1) for name in ("alpha_u", "alpha_v"))
        if u is v or u == v:
            return u
        self.scene.lose("highlights that are wider in one direction (alpha_u, alpha_v): their mean is taken")
        both = [self.pictures.flat(one, "alpha") for one in (u, v)]
        return float(np.sqrt(both[0] * both[1]).mean())

    def _alpha(self) -> float:
        """Of highlights, as plastic and metals take it."""
        alpha = self.pictures.flat(self._alpha_given(), "alpha").mean() if self.rough else 0.0
        return round(float(np.clip(alpha, LEAST_ALPHA, 1)), 6)

    def _roughness(self) -> float | str:
        """Whose square alpha is, as the principled finish takes it."""
        return self.pictures.share(self._alpha_given(), "roughness", np.sqrt) if self.rough else 0.0

    def _index(self) -> float:
        """Inside over outside."""
        inside, outside = (self._index_named(name) for name in ("int_ior", "ext_ior"))
        return inside / outside

    def _index_named(self, name: str) -> float:
        value = self.bsdf.parameters[name]
        if isinstance(value, str):
            return _known(REFRACTIVE_INDEX, value.lower(), f"{self.bsdf.place}: '{name}'", "substance")
        number = self.bsdf.number(name)
        if not number > 0:
            raise InputError(f"{self.bsdf.place}: '{name}' must be above 0, and is {number:g}")
        return number

    def _index_of_ours(self, index: float) -> float:
        return round(float(np.clip(index, LEAST_INDEX, MOST_INDEX)), 6)

    def _straight(self, name: str) -> np.ndarray:
        """What a metal reflects of light that falls on it straight, linear sRGB (3,)."""
        given = self.bsdf.parameters
        if name != "none":
            return np.array(_known(METALS, name, f"{self.bsdf.place}: 'material'", "metal"))
        eta, k = (
            self.pictures.flat(given.get(key, default), key, light_of)
            for key, default in (("eta", 0.0), ("k", 1.0))
        )
        return ((eta - 1) ** 2 + k**2) / ((eta + 1) ** 2 + k**2)


def _known(table: Any, name: str, where: str, what: str) -> Any:
    """What a table has under a name, else `InputError`."""
    if name not in table:
        raise InputError(f"{where}: there is no {what} {name[:40]!r}{suggestion(name, table)}")
    return table[name]
