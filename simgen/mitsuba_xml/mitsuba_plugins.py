"""The plugins of Mitsuba that can be imported, with their parameters and defaults.

Mitsuba 3.9, "Plugin reference" and the constructors of src/shapes, src/bsdfs, src/textures, src/emitters and
src/sensors.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from simgen.mitsuba_xml.mitsuba_scene import Value, Vector

IGNORED = {"integrator", "film", "sampler", "rfilter"}
"""Categories that only tell how to render: whatever is in them, it is left out."""

Kind = Literal["number", "flag", "text", "vector", "transform", "colour", "texture", "index", "file"]
"""A `colour` is a number, an Rgb, a spectrum or a texture; an `index` of refraction is a number or a name."""


@dataclass(frozen=True)
class Parameter:
    """One parameter of a plugin."""

    kind: Kind
    default: Value | None = None
    """What it is if the file does not say; None if it is missing then."""
    needed: bool = False
    choices: tuple[str, ...] = ()
    """The texts that it can be, if they are few."""


@dataclass(frozen=True)
class Part:
    """Nested plugins of one category."""

    category: str
    type: str | None = None
    """The only type that they may be of."""
    fewest: int = 0
    most: int | None = None


@dataclass(frozen=True)
class Allowed:
    """What a plugin may have."""

    parameters: dict[str, Parameter]
    parts: tuple[Part, ...] = ()
    not_both: tuple[tuple[str, str], ...] = ()
    """Parameters that exclude each other."""


def _number(default: float | None = None, needed: bool = False) -> Parameter:
    return Parameter("number", default, needed)


def _flag(default: bool) -> Parameter:
    return Parameter("flag", default)


def _text(default: str | None, *choices: str) -> Parameter:
    return Parameter("text", default, choices=choices)


def _colour(default: float | None = None) -> Parameter:
    return Parameter("colour", default)


def _vector(default: Vector | None = None) -> Parameter:
    return Parameter("vector", default)


def _index(default: str) -> Parameter:
    return Parameter("index", default)


def _identity() -> np.ndarray:
    matrix = np.eye(4)
    matrix.flags.writeable = False
    return matrix


_FILE = Parameter("file", needed=True)
_PLACED = {"to_world": Parameter("transform", _identity())}
_LAID_OUT = {"to_uv": Parameter("transform", _identity())}
_SHAPE = {**_PLACED, "flip_normals": _flag(False), "silhouette_sampling_weight": _number()}
_DRESS = (Part("bsdf", most=1), Part("emitter", "area", most=1))
_MESH = {"filename": _FILE, "face_normals": _flag(False), **_SHAPE}
_METAL = {
    "material": _text(None),
    "eta": _colour(),
    "k": _colour(),
    "specular_reflectance": _colour(1.0),
}
_MICROFACETS = {
    "distribution": _text("beckmann", "beckmann", "ggx"),
    "sample_visible": _flag(True),
}
_ALPHAS = {"alpha": _colour(), "alpha_u": _colour(), "alpha_v": _colour()}
_ONE_ALPHA = (("alpha", "alpha_u"), ("alpha", "alpha_v"))
_PLASTIC = {
    "diffuse_reflectance": _colour(0.5),
    "nonlinear": _flag(False),
    "int_ior": _index("polypropylene"),
    "ext_ior": _index("air"),
    "specular_reflectance": _colour(1.0),
}
_GLASS = {
    "int_ior": _index("bk7"),
    "ext_ior": _index("air"),
    "specular_reflectance": _colour(1.0),
    "specular_transmittance": _colour(1.0),
}
_TILTED = {"flip_invalid_normals": _flag(True), "use_shadowing_function": _flag(True)}
_ONE_BSDF = Part("bsdf", fewest=1, most=1)
_LAMP = {"sampling_weight": _number()}
_CAMERA = {
    **_PLACED,
    "fov": _number(),
    "focal_length": _text(None),
    "fov_axis": _text("x", "x", "y", "diagonal", "smaller", "larger"),
    "near_clip": _number(0.01),
    "far_clip": _number(10_000.0),
    "focus_distance": _number(),
    "shutter_open": _number(0.0),
    "shutter_close": _number(0.0),
    "srf": _colour(),
}
_ONE_VIEW = (("fov", "focal_length"),)

ALLOWED: dict[tuple[str, str], Allowed] = {
    ("scene", "scene"): Allowed(
        {}, (Part("shape"), Part("bsdf"), Part("texture"), Part("emitter"), Part("sensor"))
    ),
    ("shape", "sphere"): Allowed(
        {"center": _vector((0.0, 0.0, 0.0)), "radius": _number(1.0), **_SHAPE}, _DRESS
    ),
    ("shape", "rectangle"): Allowed(_SHAPE, _DRESS),
    ("shape", "cube"): Allowed(_SHAPE, _DRESS),
    ("shape", "disk"): Allowed(_SHAPE, _DRESS),
    ("shape", "cylinder"): Allowed(
        {"p0": _vector((0.0, 0.0, 0.0)), "p1": _vector((0.0, 0.0, 1.0)), "radius": _number(1.0), **_SHAPE},
        _DRESS,
    ),
    ("shape", "obj"): Allowed({**_MESH, "flip_tex_coords": _flag(True)}, _DRESS),
    ("shape", "ply"): Allowed({**_MESH, "flip_tex_coords": _flag(False)}, _DRESS),
    ("shape", "shapegroup"): Allowed({}, (Part("shape", fewest=1),)),
    ("shape", "instance"): Allowed(_PLACED, (Part("shape", "shapegroup", fewest=1, most=1),)),
    ("bsdf", "diffuse"): Allowed({"reflectance": _colour(0.5)}),
    ("bsdf", "conductor"): Allowed(_METAL),
    ("bsdf", "roughconductor"): Allowed({**_METAL, **_MICROFACETS, **_ALPHAS}, not_both=_ONE_ALPHA),
    ("bsdf", "plastic"): Allowed(_PLASTIC),
    ("bsdf", "roughplastic"): Allowed({**_PLASTIC, **_MICROFACETS, "alpha": _number(0.1)}),
    ("bsdf", "dielectric"): Allowed(_GLASS),
    ("bsdf", "thindielectric"): Allowed(_GLASS),
    ("bsdf", "roughdielectric"): Allowed({**_GLASS, **_MICROFACETS, **_ALPHAS}, not_both=_ONE_ALPHA),
    ("bsdf", "principled"): Allowed(
        {
            **{"base_color": _colour(0.5), "roughness": _colour(0.5), "anisotropic": _colour(0.0)},
            **{"metallic": _colour(0.0), "spec_trans": _colour(0.0), "eta": _number(), "specular": _number()},
            **{"spec_tint": _colour(0.0), "sheen": _colour(0.0), "sheen_tint": _colour(0.0)},
            **{"flatness": _colour(0.0), "clearcoat": _colour(0.0), "clearcoat_gloss": _colour(0.0)},
            **{"diffuse_reflectance_sampling_rate": _number(), "main_specular_sampling_rate": _number()},
            "clearcoat_sampling_rate": _number(),
        },
        not_both=(("eta", "specular"),),
    ),
    ("bsdf", "twosided"): Allowed({"allow_transmission": _flag(False)}, (Part("bsdf", fewest=1, most=2),)),
    ("bsdf", "mask"): Allowed({"opacity": _colour(0.5)}, (_ONE_BSDF,)),
    ("bsdf", "bumpmap"): Allowed(
        {"scale": _number(1.0), **_TILTED}, (_ONE_BSDF, Part("texture", fewest=1, most=1))
    ),
    ("bsdf", "normalmap"): Allowed({"normalmap": Parameter("texture", needed=True), **_TILTED}, (_ONE_BSDF,)),
    ("texture", "bitmap"): Allowed(
        {
            "filename": _FILE,
            "filter_type": _text("bilinear", "bilinear", "nearest"),
            "wrap_mode": _text("repeat", "repeat", "mirror", "clamp"),
            "format": _text("auto"),
            "raw": _flag(False),
            "accel": _flag(True),
            **_LAID_OUT,
        }
    ),
    ("texture", "checkerboard"): Allowed({"color0": _colour(0.4), "color1": _colour(0.2), **_LAID_OUT}),
    ("emitter", "area"): Allowed({"radiance": _colour(1.0), **_LAMP}),
    ("emitter", "point"): Allowed(
        {
            "intensity": _colour(1.0),
            "position": _vector(),
            "to_world": Parameter("transform"),
            **_LAMP,
        },
        not_both=(("position", "to_world"),),
    ),
    ("emitter", "spot"): Allowed(
        {
            "intensity": _colour(1.0),
            "cutoff_angle": _number(20.0),
            "beam_width": _number(),
            "texture": Parameter("texture"),
            **_PLACED,
            **_LAMP,
        }
    ),
    ("emitter", "directional"): Allowed(
        {
            "irradiance": _colour(1.0),
            "direction": _vector(),
            "to_world": Parameter("transform"),
            **_LAMP,
        },
        not_both=(("direction", "to_world"),),
    ),
    ("emitter", "constant"): Allowed({"radiance": _colour(1.0), **_PLACED, **_LAMP}),
    ("emitter", "envmap"): Allowed(
        {"filename": _FILE, "scale": _number(1.0), "mis_compensation": _flag(False), **_PLACED, **_LAMP}
    ),
    ("sensor", "perspective"): Allowed(
        {**_CAMERA, "principal_point_offset_x": _number(0.0), "principal_point_offset_y": _number(0.0)},
        not_both=_ONE_VIEW,
    ),
    ("sensor", "thinlens"): Allowed({**_CAMERA, "aperture_radius": _number(needed=True)}, not_both=_ONE_VIEW),
}
"""By category and type. A parameter that is missing and has no default here: `beam_width` is 3/4 of
`cutoff_angle`, `alpha` 0.1 unless there is `alpha_u`, `specular` 0.5 unless there is `eta`, `focal_length`
50 mm unless there is `fov`. A metal with neither `material` nor `eta` reflects all light; a light without
`position`, `direction` and `to_world` is at the origin or shines along +Z."""
