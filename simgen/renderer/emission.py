"""Objects that shine by themselves: as Mitsuba's emitters, and the light that they give a plane."""

import math
from typing import Any, NamedTuple

import numpy as np

from pcii.base.errors import InputError
from pcii.base.srgb import LUMINANCE
from simgen.assets.asset_files import Assets
from simgen.assets.triangles import Triangles
from simgen.renderer.backend import is_scalar
from simgen.renderer.mitsuba_colours import is_spectral, radiance_plugin
from simgen.renderer.mitsuba_shapes import check_texcoords, mesh_of, pose_of, solid_parts
from simgen.renderer.mitsuba_surfaces import texture_plugin
from simgen.spec.scene import SceneObject
from simgen.spec.shapes import Box, Card, Cylinder, Sphere

POINTS = 1 << 12
"""On the surface of an object, at which its light is summed up and its picture looked at."""
SAME_PLACE = 1e-3
"""Of the size of a mesh: places nearer to each other than this are one."""


class _Points(NamedTuple):
    """Middles of parts of a surface: (N, 3) in mm, normals (N, 3), areas (N,) in mm^2, (u, v) or None."""

    position_mm: np.ndarray
    normal: np.ndarray
    area_mm2: np.ndarray
    texcoord: np.ndarray | None


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
    drawn_once = isinstance(shape, Card | Sphere) and thing.material.opacity is None
    if isinstance(shape, Box | Cylinder) or not (drawn_once or _has_own_pixels(mi, thing, assets)):
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
    points = _points_of(solid_parts(thing.shape, thing.material, assets))
    matrix = np.array(pose_of(mi, thing).matrix, dtype=np.float64)[:3]
    towards = points.position_mm @ matrix[:, :3].T + matrix[:, 3] - [0.0, 0.0, z_mm]
    at_lamp = np.maximum(-(points.normal @ matrix[:, :3].T * towards).sum(axis=1), 0)
    shares = points.area_mm2 * np.maximum(-towards[:, 2], 0) * at_lamp / (towards**2).sum(axis=1) ** 2
    if emission.texture is not None:
        assert points.texcoord is not None
        shares *= _luminance_at(points.texcoord, assets.image(emission.texture))
    return float(emission.luminance_cd_m2 * shares.sum())


def _luminance_at(texcoord: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    size = np.array(pixels.shape[1::-1])
    col, row = np.clip((texcoord * [1, -1] + [0, 1]) * size, 0, size - 1).astype(np.int64).T
    return pixels[row, col] @ LUMINANCE


def _points_of(mesh: Triangles) -> _Points:
    """Each triangle is divided into n x n like ones, such that there are some `POINTS` in all."""
    n = max(1, math.isqrt(POINTS // len(mesh.faces)))
    side = np.add.outer(np.arange(n), np.arange(n))
    upright, turned = np.argwhere(side < n) + 1 / 3, np.argwhere(side < n - 1) + 2 / 3
    second, third = np.concatenate([upright, turned]).T / n
    shares = np.stack([1 - second - third, second, third], axis=-1)

    def of_points(values: np.ndarray) -> np.ndarray:
        return np.einsum("pc,mcd->mpd", shares, values.astype(np.float64)[mesh.faces]).reshape(
            -1, values.shape[1]
        )

    corner = mesh.positions.astype(np.float64)[mesh.faces]
    across = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    doubled = np.linalg.norm(across, axis=1)
    normal = across / np.where(doubled > 0, doubled, 1)[:, None]
    return _Points(
        of_points(mesh.positions),
        np.repeat(normal, n * n, axis=0),
        np.repeat(doubled / (2 * n * n), n * n),
        None if mesh.texcoords is None else of_points(mesh.texcoords),
    )


def _has_own_pixels(mi: Any, thing: SceneObject, assets: Assets) -> bool:
    """Whether the renderer finds each point of a mesh again by its place on the picture."""
    triangles = solid_parts(thing.shape, thing.material, assets)
    assert triangles.texcoords is not None
    if triangles.texcoords.min() < 0 or triangles.texcoords.max() > 1:
        return False
    points = _points_of(triangles)
    assert points.texcoord is not None
    mesh = mesh_of(mi, triangles, np.eye(4), {})
    at = points.texcoord * [1, -1] + [0, 1]
    if is_scalar(mi):
        found = np.array([mesh.eval_parameterization(mi.Point2f(uv)).p for uv in at.tolist()])
    else:
        found = np.array(mesh.eval_parameterization(mi.Point2f(at.T.astype(np.float32))).p).T
    away = np.linalg.norm(found - points.position_mm, axis=1)
    return bool((away < SAME_PLACE * np.ptp(triangles.positions, axis=0).max()).all())
