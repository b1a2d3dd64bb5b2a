"""Emitters of Mitsuba that are no surfaces, as our lights.

Radiance is linear sRGB whose luminance is in cd/m^2, so that pictures of both have the same numbers. Mitsuba
3.9, "Emitters".
"""

from pathlib import Path

import numpy as np

from pcii.base.errors import InputError
from simgen.assets.asset_files import read_environment
from simgen.base.asset_names import asset
from simgen.importing.foreign_scene import (
    LARGEST_CONE_DEG,
    ForeignScene,
    Lamp,
    Surroundings,
    cone_values,
    light_values,
)
from simgen.mitsuba_xml.mitsuba_scene import Plugin
from simgen.mitsuba_xml.mitsuba_textures import light_of
from simgen.mitsuba_xml.mitsuba_values import any_across

BEAM = 0.75
"""Of the cutoff angle, without a beam width."""


def add_light(emitter: Plugin, scene: ForeignScene, folder: Path) -> None:
    """Put an emitter into a scene; `folder` is that of the file.

    Raises `InputError` for an image that cannot be read, and for a second light from all around.
    """
    given = emitter.parameters
    if emitter.type == "envmap":
        _check_alone(emitter, scene)
        scene.surroundings = _surroundings(emitter, folder)
        return
    field, of = {
        "point": ("intensity_cd", "intensity"),
        "spot": ("intensity_cd", "intensity"),
        "directional": ("illuminance_lux", "irradiance"),
        "constant": ("luminance_cd_m2", "radiance"),
    }[emitter.type]
    value = given[of]
    if isinstance(value, Plugin):
        raise InputError(f"{emitter.place}: '{of}' must be a number, an rgb or a spectrum, not a texture")
    rgb = light_of(value)
    if not rgb.any():
        return
    values = {"type": "uniform" if emitter.type == "constant" else emitter.type}
    # An intensity per square unit of the file, in cd.
    values |= light_values(field, rgb * (scene.mm / 1000) ** 2 if field == "intensity_cd" else rgb)
    match emitter.type:
        case "constant":
            _check_alone(emitter, scene)
            matrix = np.eye(4)
        case "point":
            matrix = np.eye(4)
            matrix[:3, 3] = emitter.vector("position") if "position" in given else _to_world(emitter)[:3, 3]
        case "spot":
            matrix = _to_world(emitter)
            values |= _cone(emitter, scene)
        case _:
            matrix = _along(emitter) if "direction" in given else _to_world(emitter)
    scene.lamps.append(Lamp(matrix, values))


def _to_world(emitter: Plugin) -> np.ndarray:
    matrix = emitter.parameters.get("to_world", np.eye(4))
    assert isinstance(matrix, np.ndarray)
    if not matrix[:3, 2].any():
        raise InputError(f"{emitter.place}: 'to_world' leaves this light no direction")
    return matrix


def _along(emitter: Plugin) -> np.ndarray:
    """A rotation (4, 4) that brings +Z to the direction of a light."""
    ahead, matrix = emitter.vector("direction"), np.eye(4)
    if not ahead.any():
        raise InputError(f"{emitter.place}: 'direction' must not be 0 0 0")
    ahead /= np.linalg.norm(ahead)
    left = any_across(*ahead)
    matrix[:3, :3] = np.stack([left, np.cross(ahead, left), ahead], axis=-1)
    return matrix


def _cone(spot: Plugin, scene: ForeignScene) -> dict[str, float]:
    if "texture" in spot.parameters:
        scene.lose("pictures that spots throw")
    given = spot.number("cutoff_angle")
    beam = spot.number("beam_width") if "beam_width" in spot.parameters else BEAM * given
    cone = cone_values(beam, given)
    if abs(cone["cutoff_deg"] - given) > 1e-6:
        scene.lose(f"spots wider than {LARGEST_CONE_DEG:g} degrees from their axis")
    return cone


def _check_alone(emitter: Plugin, scene: ForeignScene) -> None:
    if scene.surroundings is not None or any(lamp.values["type"] == "uniform" for lamp in scene.lamps):
        raise InputError(f"{emitter.place}: a scene has one light from all around, and this is a second one")


def _surroundings(envmap: Plugin, folder: Path) -> Surroundings | None:
    """None for one without light.

    Mitsuba's map has +Y on top, +Z in its middle and -X in its right half: half a turn about Z from our axes.
    """
    scale, to_world = envmap.number("scale"), _to_world(envmap)
    pixels = read_environment(asset(folder, envmap.text("filename"), f"{envmap.place}: 'filename'"))
    matrix = to_world @ np.diag([-1.0, -1.0, 1.0, 1.0])
    if np.linalg.det(matrix[:3, :3]) < 0:
        matrix, pixels = matrix @ np.diag([-1.0, 1.0, 1.0, 1.0]), pixels[:, ::-1]
    matrix[:3] /= [*np.linalg.norm(matrix[:3, :3], axis=0), 1.0]
    return Surroundings(matrix, pixels, scale) if scale > 0 and pixels.any() else None
