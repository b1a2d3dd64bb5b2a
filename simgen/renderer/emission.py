"""Objects that shine by themselves: as Mitsuba's emitters, and the light that they give a plane."""

from typing import Any

import numpy as np

from pcii.base.errors import InputError
from pcii.base.srgb import LUMINANCE
from simgen.assets.asset_files import Assets
from simgen.assets.mesh_points import bears_pictures_once, surface_points
from simgen.assets.solids import triangles_of
from simgen.renderer.mitsuba_colours import is_spectral, radiance_plugin
from simgen.renderer.mitsuba_shapes import check_texcoords, pose_of, solid_parts
from simgen.renderer.mitsuba_surfaces import texture_plugin
from simgen.spec.scene import SceneObject
from simgen.spec.shapes import Card, Sphere

POINTS = 1 << 12
"""On the surface of an object, at which its light is summed up."""


def emission_plugin(mi: Any, thing: SceneObject, assets: Assets, gain: float) -> dict[str, Any] | None:
    """The emitter of an object that is `gain` times as bright as it says; None if it does not shine.

    Raises `InputError` for a texture in spectral mode, and for one on a shape that bears parts of it several
    times: such a lamp is aimed at by the brightness of its image, so each of its pixels must have one place.
    """
    emission, shape = thing.material.emission, thing.shape
    if emission is None:
        return None
    luminance = gain * emission.luminance_cd_m2
    if emission.texture is None:
        return {"type": "area", "radiance": radiance_plugin(mi, luminance, emission.illuminant)}
    where = "material.emission.texture"
    if is_spectral(mi):
        raise InputError(
            f"{where}: images shine only where light is linear sRGB; give the luminance alone, or a recipe "
            "without sensor.camera"
        )
    check_texcoords(where, "give the luminance alone", shape, assets)
    if not (isinstance(shape, Card | Sphere) or bears_pictures_once(triangles_of(shape, assets))):
        raise InputError(
            f"{where}: the shape bears parts of the picture several times, or reaches beyond it; give the "
            "luminance alone, or texture coordinates from 0 to 1 of which each is used once"
        )
    pixels = assets.image(emission.texture) * np.float32(luminance)
    return {"type": "area", "radiance": texture_plugin(mi, pixels, shape, raw=True)}


def object_lux(mi: Any, thing: SceneObject, z_mm: float, assets: Assets) -> float:
    """Illuminance, in lux, that an object gives a surface at (0, 0, z) that faces the cameras.

    As of lights (see `illuminance_lux`): nothing stands in the way, not even the object itself.
    """
    emission = thing.material.emission
    if emission is None:
        return 0.0
    points = surface_points(solid_parts(thing.shape, thing.material, assets), POINTS)
    matrix = np.array(pose_of(mi, thing).matrix, dtype=np.float64)[:3]
    towards = points.position @ matrix[:, :3].T + matrix[:, 3] - [0.0, 0.0, z_mm]
    at_lamp = np.maximum(-(points.normal @ matrix[:, :3].T * towards).sum(axis=1), 0)
    shares = points.area * np.maximum(-towards[:, 2], 0) * at_lamp / (towards**2).sum(axis=1) ** 2
    if emission.texture is not None:
        assert points.texcoord is not None
        shares *= _luminance_at(points.texcoord, assets.image(emission.texture))
    return float(emission.luminance_cd_m2 * shares.sum())


def _luminance_at(texcoord: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    size = np.array(pixels.shape[1::-1])
    col, row = np.clip((texcoord * [1, -1] + [0, 1]) * size, 0, size - 1).astype(np.int64).T
    return pixels[row, col] @ LUMINANCE
