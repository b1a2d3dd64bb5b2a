"""What shines and has a place: as Mitsuba's emitters, the light that it gives a plane, and where it is."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from pcii.base.errors import InputError
from pcii.base.srgb import LUMINANCE
from simgen.assets.asset_files import Assets
from simgen.assets.triangles import bears_pictures_once, card_triangles, globe, surface_points, triangles_of
from simgen.renderer.mitsuba_lights import area_light_pose
from simgen.renderer.mitsuba_shapes import check_texcoords, pose_of, solid_parts
from simgen.renderer.mitsuba_surfaces import is_spectral, light_spectrum, radiance_plugin, texture_plugin
from simgen.spec.lights import AreaLight, Illuminant
from simgen.spec.scene import Scene, SceneObject
from simgen.spec.shapes import Card, Sphere
from simgen.spectral.filters import Filters
from simgen.spectral.spectra import integral

POINTS = 1 << 12
"""On the surface of an object, at which its light is summed up."""
BALL_ROWS = 16
"""Rows of the triangles that a ball's points are drawn on, before they are moved onto the ball itself."""


@dataclass(frozen=True, eq=False)
class ShiningSurface:
    """A surface that shines on the side of its normals, evenly in all directions, as triangles.

    `corners_mm` (M, 3, 3), in the world, turn about their normals as Mitsuba's do. `radiance` (C,) is in the
    unit of rendered views, C = 3 where light is linear sRGB; with a `picture` (H, W, 3) it is multiplied by
    the pixel at `texcoords` (M, 3, 2), linear in between as Mitsuba has it. `number` is that of the object, 0
    for a lamp. Of a `ball` (centre, radius, and the columns of its pose) the triangles are only near.
    """

    number: int
    corners_mm: np.ndarray
    radiance: np.ndarray
    picture: np.ndarray | None = None
    texcoords: np.ndarray | None = None
    ball: tuple[np.ndarray, float, np.ndarray] | None = None


def shining_surfaces(
    mi: Any, scene: Scene, assets: Assets, gain: float, filters: Filters | None
) -> Iterator[ShiningSurface]:
    """All that shines and can be seen: objects, and lamps with a surface."""

    def radiance(luminance_cd_m2: float, illuminant: Illuminant) -> np.ndarray:
        if filters is None:
            return np.array(radiance_plugin(mi, gain * luminance_cd_m2, illuminant)["value"])
        spectrum = gain * luminance_cd_m2 * light_spectrum(mi, illuminant)
        return integral(filters.sensitivity * spectrum)

    for light in scene.lights:
        if isinstance(light, AreaLight):
            square = card_triangles(2.0, 2.0)
            pose = area_light_pose(light) * [1, -1, -1, 1]  # a card faces -Z, Mitsuba's rectangle +Z
            yield ShiningSurface(
                0,
                _placed(square.positions, pose)[square.faces],
                radiance(light.luminance_cd_m2, light.illuminant),
            )
    for number, thing in enumerate(scene.objects, start=1):
        emission, shape = thing.material.emission, thing.shape
        if emission is None:
            continue
        pose = np.array(pose_of(mi, thing).matrix, dtype=np.float64)
        is_ball = isinstance(shape, Sphere)
        triangles = (
            globe(shape.radius_mm, BALL_ROWS) if is_ball else solid_parts(shape, thing.material, assets)
        )
        picture, texcoords = None, None
        if emission.texture is not None and triangles.texcoords is not None:
            picture = assets.image(emission.texture)
            texcoords = triangles.texcoords.astype(np.float64)[triangles.faces]
        yield ShiningSurface(
            number,
            _placed(triangles.positions, pose)[triangles.faces],
            radiance(emission.luminance_cd_m2, emission.illuminant)
            if picture is None
            else np.full(3, gain * emission.luminance_cd_m2),
            picture,
            texcoords,
            (pose[:3, 3], shape.radius_mm, pose[:3, :3]) if is_ball else None,
        )


def _placed(positions: np.ndarray, pose: np.ndarray) -> np.ndarray:
    return positions.astype(np.float64) @ pose[:3, :3].T + pose[:3, 3]


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
    if not (isinstance(shape, Card | Sphere) or bears_pictures_once(triangles_of(shape, assets.meshes))):
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
