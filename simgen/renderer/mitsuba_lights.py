"""Lights as Mitsuba's emitters, and how bright they make a plane.

In RGB mode radiance is linear sRGB scaled such that its luminance, 0.2126 R + 0.7152 G + 0.0722 B,
is in cd/m^2; in spectral mode see `spectra`.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pcii.base.errors import InputError
from pcii.base.srgb import LUMINANCE
from simgen.renderer.mitsuba_shapes import placed
from simgen.renderer.mitsuba_surfaces import light_spectrum, radiance_plugin
from simgen.renderer.world_frame import WorldFrame
from simgen.spec.lights import (
    AreaLight,
    DirectionalLight,
    EnvironmentLight,
    Level,
    Light,
    PointLight,
    SpotLight,
    UniformLight,
)
from simgen.spec.scene import Scene
from simgen.spectral.spectra import DAYLIGHT

NODES = 32
"""Gauss-Legendre nodes along each side of a lamp, for the light that it gives a plane."""


def light_plugin(
    mi: Any, light: Light, gain: float, surroundings: np.ndarray | None, frame: WorldFrame
) -> dict[str, Any]:
    """The Mitsuba emitter of a light that is `gain` times as bright as it says.

    `surroundings` (H, W, 3) are the pixels of an environment light's image; `frame` is that of the renderer.
    """
    per_cd = 1e6 * frame.unit**2  # in cd = cd/m^2 m^2, with lengths in the renderer's unit
    match light:
        case UniformLight():
            radiance = radiance_plugin(mi, gain * light.luminance_cd_m2, light.illuminant)
            return {"type": "constant", "radiance": radiance}
        case PointLight():
            intensity = radiance_plugin(mi, gain * light.intensity_cd * per_cd, light.illuminant)
            position = frame.points(np.array(light.position_mm)).tolist()
            return {"type": "point", "position": position, "intensity": intensity}
        case SpotLight():
            return {
                "type": "spot",
                "to_world": mi.ScalarTransform4f(_rigid(frame, _facing(light))),
                "intensity": radiance_plugin(mi, gain * light.intensity_cd * per_cd, light.illuminant),
                "beam_width": light.beam_deg,
                "cutoff_angle": light.cutoff_deg,
            }
        case DirectionalLight():
            irradiance = radiance_plugin(mi, gain * light.illuminance_lux, light.illuminant)
            direction = frame.directions(np.array(light.direction)).tolist()
            return {"type": "directional", "direction": direction, "irradiance": irradiance}
        case EnvironmentLight():
            assert surroundings is not None
            return _environment(mi, light, gain, surroundings, frame)
        case AreaLight():
            radiance = radiance_plugin(mi, gain * light.luminance_cd_m2, light.illuminant)
            return {
                "type": "rectangle",
                "to_world": placed(mi, frame, mi.ScalarTransform4f(area_light_pose(light))),
                "emitter": {"type": "area", "radiance": radiance},
                "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}},
            }


def area_light_pose(light: AreaLight) -> np.ndarray:
    """From the square [-1, 1] x [-1, 1] at z = 0, which shines towards +z, to the lamp; (4, 4)."""
    return _facing(light) * [light.width_mm / 2, light.height_mm / 2, 1, 1]


def _facing(light: AreaLight | SpotLight) -> np.ndarray:
    """From a lamp at the origin that shines towards +z to where it stands and what it faces; (4, 4)."""
    towards = np.subtract(light.target_mm, light.position_mm)
    towards = towards / np.linalg.norm(towards)
    up = np.array([0.0, -1.0, 0.0]) if abs(towards[1]) < 0.99 else np.array([0.0, 0.0, 1.0])
    left = np.cross(up, towards)
    left /= np.linalg.norm(left)
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1] = left, np.cross(towards, left)
    pose[:3, 2], pose[:3, 3] = towards, light.position_mm
    return pose


def _rigid(frame: WorldFrame, pose: np.ndarray) -> np.ndarray:
    """A pose without a size in the world as one in the renderer's axes."""
    if frame.is_world:
        return pose
    placed_pose = frame.matrix @ pose
    placed_pose[:3, :3] /= frame.unit
    return placed_pose


def _environment(
    mi: Any, light: EnvironmentLight, gain: float, pixels: np.ndarray, frame: WorldFrame
) -> dict[str, Any]:
    bitmap = mi.Bitmap(np.ascontiguousarray(pixels, dtype=np.float32))
    bitmap.set_srgb_gamma(False)
    T = mi.ScalarTransform4f
    # Mitsuba's map has +Y on top, +Z in its middle and -X in its right half; half a turn about Z brings
    # what is above to -Y and what is right to +X.
    to_world = T().rotate([0, 1, 0], light.turn_deg) @ T().rotate([0, 0, 1], 180)
    return {
        "type": "envmap",
        "bitmap": bitmap,
        "scale": gain * light.luminance_cd_m2,
        "to_world": placed(mi, replace(frame, unit=1.0, origin=np.zeros(3)), to_world),
    }


def main_spectrum(mi: Any, scene: Scene) -> np.ndarray:
    """The mean spectrum (N,) of all that shines, each at luminance 1; daylight if only Mitsuba files do."""
    emissions = [thing.material.emission for thing in scene.objects if thing.material.emission is not None]
    colours = [getattr(lamp, "illuminant", DAYLIGHT) for lamp in (*scene.lights, *emissions)]
    return np.mean([light_spectrum(mi, colour) for colour in colours or [DAYLIGHT]], axis=0)


def gain_for(
    level: Level | None,
    lights: Sequence[Light],
    surroundings: np.ndarray | None,
    lux_of_objects: Callable[[float], float],
) -> float:
    """By how much to make all that shines brighter for a plane to get its level.

    `lux_of_objects` is what objects that shine give a plane at a depth in mm. `InputError` if there is no
    light on it.
    """
    if level is None:
        return 1.0
    lux = sum(illuminance_lux(light, level.z_mm, surroundings) for light in lights)
    lux += lux_of_objects(level.z_mm)
    if not lux > 0:
        raise InputError(
            f"level: nothing shines on a surface at z_mm = {level.z_mm:g} that faces the cameras"
        )
    return level.illuminance_lux / lux


def illuminance_lux(light: Light, z_mm: float, surroundings: np.ndarray | None) -> float:
    """Illuminance, in lux, that a light gives a surface at (0, 0, z) that faces the cameras.

    That is the integral of L cos a cos b / d^2 over the lamp, a and b the angles at the surface and at the
    lamp; nothing stands in the way.
    """
    point = np.array([0.0, 0.0, z_mm])
    match light:
        case UniformLight():
            return float(np.pi * light.luminance_cd_m2)
        case PointLight() | SpotLight():
            towards = np.subtract(light.position_mm, point)
            distance = np.linalg.norm(towards)
            share = _share_of_axis(light, -towards / distance) if isinstance(light, SpotLight) else 1.0
            return float(share * light.intensity_cd * 1e6 * max(-towards[2], 0) / distance**3)
        case DirectionalLight():
            along = light.direction[2] / np.linalg.norm(light.direction)
            return float(light.illuminance_lux * max(along, 0))
        case EnvironmentLight():
            assert surroundings is not None
            return light.luminance_cd_m2 * _from_around(light, surroundings)
        case AreaLight():
            pose, (node, weight) = area_light_pose(light), np.polynomial.legendre.leggauss(NODES)
            x, y = np.meshgrid(node, node)
            places = pose[:3, :3] @ np.stack([x.ravel(), y.ravel(), np.zeros(x.size)]) + pose[:3, 3:]
            towards = places - point[:, None]
            squared = (towards**2).sum(axis=0)
            at_surface, at_lamp = np.maximum(-towards[2], 0), np.maximum(-pose[:3, 2] @ towards, 0)
            shares = np.outer(weight, weight).ravel() * (light.width_mm * light.height_mm / 4)
            return float(light.luminance_cd_m2 * (shares * at_surface * at_lamp / squared**2).sum())


def _share_of_axis(light: SpotLight, direction: np.ndarray) -> float:
    """How bright a spot is in a direction (3,) of length 1, as a share of its intensity along the axis."""
    angle = np.degrees(np.arccos(np.clip(direction @ _facing(light)[:3, 2], -1, 1)))
    return float(np.clip((light.cutoff_deg - angle) / (light.cutoff_deg - light.beam_deg), 0, 1))


def _from_around(light: EnvironmentLight, pixels: np.ndarray) -> float:
    """The integral of the image's luminance times the cosine over the half space behind the cameras.

    Like the renderer, between pixels it is linear: the rows lie at polar angles from 0 to pi.
    """
    height, width = pixels.shape[:2]
    down, right = _midpoints(height), _midpoints(width)
    longitude = (right - 0.5) * 2 * np.pi + np.radians(light.turn_deg)
    # Of the area on the sphere, and of the cosine, which is sin(polar) cos(longitude) in size.
    of_rows = _shared(down * (height - 1), np.sin(down * np.pi) ** 2 * (np.pi / down.size), height)
    of_columns = _shared(
        right * width - 0.5, np.maximum(-np.cos(longitude), 0) * (2 * np.pi / right.size), width
    )
    return float(of_rows @ (pixels @ LUMINANCE) @ of_columns)


def _midpoints(pixels: int) -> np.ndarray:
    """Of equal parts of the unit interval, 8 a pixel or more."""
    number = max(8 * pixels, 4096)
    return (np.arange(number) + 0.5) / number


def _shared(position_px: np.ndarray, weight: np.ndarray, pixels: int) -> np.ndarray:
    """Weights at these places, each divided among the two pixels beside it; beyond the last is the first."""
    before = np.floor(position_px).astype(np.int64)
    after = position_px - before
    total = np.bincount(before % pixels, weight * (1 - after), pixels)
    return total + np.bincount((before + 1) % pixels, weight * after, pixels)
