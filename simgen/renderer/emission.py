"""What shines: lamps and objects as Mitsuba's emitters, the light that they give a plane, and where they are.

Radiance is linear sRGB whose luminance, 0.2126 R + 0.7152 G + 0.0722 B, is in cd/m^2, or see `spectra`.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pcii.base import LUMINANCE, InputError, srgb_to_linear
from simgen.assets import Assets, Triangles, bears_pictures_once, globe, surface_points, triangles_of
from simgen.renderer.backend import is_scalar, is_spectral, load_drjit, vectors
from simgen.renderer.mitsuba_objects import (
    WorldFrame,
    check_texcoords,
    linear_bitmap,
    pose_of,
    solid_parts,
    spectrum_plugin,
    texture_plugin,
)
from simgen.spec import Card, Illuminant, Scene, SceneObject, Sphere, lights
from simgen.spectral import DAYLIGHT, Filters, integral, spectra

NODES = 32
"""Gauss-Legendre nodes along each side of a lamp, for the light that it gives a plane."""
POINTS = 1 << 12
"""Points on the surface of an object at which its light is summed up."""
NARROW_DEG = 1.0
"""A spot lamp whose cutoff is below this is a projector: Mitsuba compares cosines in single precision, by
which a spot of 1 degree is right to 4e-4, of 0.1 degrees to 4e-2, and one of 0.01 degrees gives no light."""
BEAM_PX, BEAM_PARTS, BEAM_MARGIN = 128, 8, 1.02
"""Side of the beam's picture, parts of a pixel's side that it is averaged over, and its half width over the
cutoff."""
BALL_ROWS = 16
"""Rows of the triangles that a ball's points are drawn on, before they are moved onto the ball itself."""


@dataclass(frozen=True, eq=False)
class ShiningSurface:
    """A surface of an object (0: of a lamp) that shines on the side of its normals, evenly in all directions.

    Its triangles `corners_mm` (M, 3, 3), in the world, turn about their normals as Mitsuba's do. `radiance`
    (C,) is in the unit of rendered views; with a `picture` (H, W, 3) it is multiplied by the pixel at
    `texcoords` (M, 3, 2), linear in between. Of a `ball` (centre, radius, pose) the triangles are only near.
    """

    number: int
    corners_mm: np.ndarray
    radiance: np.ndarray
    picture: np.ndarray | None = None
    texcoords: np.ndarray | None = None
    ball: tuple[np.ndarray, float, np.ndarray] | None = None


class SceneLights:
    """All that shines in a scene, as bright as its level says, and its emitters in the axes of `frame`.

    `surroundings` (H, W, 3) are the image of what shines from all around, if there is one; a Mitsuba file's
    lights send `referenced_lux` to the plane of the level. Raises `InputError` if that gets no light.
    """

    def __init__(
        self, mi: Any, scene: Scene, assets: Assets, frame: WorldFrame, referenced_lux: float
    ) -> None:
        self.mi, self.scene, self.assets, self.frame = mi, scene, assets, frame
        around = scene.light_around
        is_image = isinstance(around, lights.EnvironmentLight)
        self.surroundings = assets.environments[around.file] if is_image else None
        self.gain = self._level_gain(referenced_lux)

    def surfaces(self, filters: Filters | None) -> Iterator[ShiningSurface]:
        """All that shines and can be seen: lamps with a surface, and objects."""

        def radiance(luminance_cd_m2: float, illuminant: Illuminant) -> np.ndarray:
            if filters is None:
                return np.array(_radiance_plugin(self.mi, self.gain * luminance_cd_m2, illuminant)["value"])
            spectrum = self.gain * luminance_cd_m2 * light_spectrum(self.mi, illuminant)
            return integral(filters.sensitivity * spectrum)

        def corners_mm(mesh: Triangles, pose: np.ndarray) -> np.ndarray:
            return (mesh.positions.astype(np.float64) @ pose[:3, :3].T + pose[:3, 3])[mesh.faces]

        for light in self.scene.lights:
            if isinstance(light, lights.AreaLight):
                pose = _area_light_pose(light) * [1, -1, -1, 1]  # a card faces -Z, Mitsuba's rectangle +Z
                corners = corners_mm(triangles_of(Card(width_mm=2.0, height_mm=2.0), {}), pose)
                yield ShiningSurface(0, corners, radiance(light.luminance_cd_m2, light.illuminant))
        for number, thing in enumerate(self.scene.objects, start=1):
            emission, shape = thing.material.emission, thing.shape
            if emission is None:
                continue
            pose = np.array(pose_of(self.mi, thing).matrix, dtype=np.float64)
            triangles, ball = solid_parts(shape, thing.material, self.assets), None
            if isinstance(shape, Sphere):
                triangles = globe(shape.radius_mm, BALL_ROWS)
                ball = pose[:3, 3], shape.radius_mm, pose[:3, :3]
            own_radiance = radiance(emission.luminance_cd_m2, emission.illuminant)
            picture, texcoords = None, None
            if emission.texture is not None:
                assert triangles.texcoords is not None
                own_radiance = np.full(3, self.gain * emission.luminance_cd_m2)
                picture = self.assets.image(emission.texture)
                texcoords = triangles.texcoords.astype(np.float64)[triangles.faces]
            yield ShiningSurface(number, corners_mm(triangles, pose), own_radiance, picture, texcoords, ball)

    def object_plugin(self, thing: SceneObject) -> dict[str, Any] | None:
        """The emitter of an object, None if it does not shine.

        Raises `InputError` for a texture in spectral mode, and for one of which a pixel has no place or
        several: such a lamp is aimed at by the brightness of its image.
        """
        emission, shape, where = thing.material.emission, thing.shape, "material.emission.texture"
        if emission is None:
            return None
        luminance = self.gain * emission.luminance_cd_m2
        if emission.texture is None:
            return {"type": "area", "radiance": _radiance_plugin(self.mi, luminance, emission.illuminant)}
        if is_spectral(self.mi):
            raise InputError(f"{where}: images shine only in linear sRGB; leave it or sensor.camera out")
        check_texcoords(where, shape, self.assets)
        if not (
            isinstance(shape, Card | Sphere) or bears_pictures_once(triangles_of(shape, self.assets.meshes))
        ):
            raise InputError(
                f"{where}: the shape bears parts of the picture several times or reaches beyond it; use each "
                "texture coordinate from 0 to 1 once"
            )
        pixels = self.assets.image(emission.texture) * np.float32(luminance)
        return {"type": "area", "radiance": texture_plugin(self.mi, pixels, shape, raw=True)}

    def light_plugin(self, light: lights.Light) -> dict[str, Any]:
        """The Mitsuba emitter of a light."""
        mi, gain, frame, T = self.mi, self.gain, self.frame, self.mi.ScalarTransform4f
        per_cd = 1e6 * frame.unit**2  # cd = cd/m^2 m^2, with lengths in the renderer's unit

        def bright(value: float, per_unit: float = 1.0) -> dict[str, Any]:
            return _radiance_plugin(mi, gain * value * per_unit, getattr(light, "illuminant", DAYLIGHT))

        match light:
            case lights.UniformLight():
                return {"type": "constant", "radiance": bright(light.luminance_cd_m2)}
            case lights.PointLight():
                position = frame.points(np.array(light.position_mm)).tolist()
                intensity = bright(light.intensity_cd, per_cd)
                return {"type": "point", "position": position, "intensity": intensity}
            case lights.SpotLight() if light.cutoff_deg < NARROW_DEG:
                return _narrow_spot(mi, light, gain * per_cd, T(frame.rigid_pose(_lamp_pose(light))))
            case lights.SpotLight():
                angles = {"beam_width": light.beam_deg, "cutoff_angle": light.cutoff_deg}
                to_world = T(frame.rigid_pose(_lamp_pose(light)))
                intensity = bright(light.intensity_cd, per_cd)
                return {"type": "spot", "to_world": to_world, "intensity": intensity} | angles
            case lights.DirectionalLight():
                direction = frame.directions(np.array(light.direction)).tolist()
                irradiance = bright(light.illuminance_lux)
                return {"type": "directional", "direction": direction, "irradiance": irradiance}
            case lights.EnvironmentLight():
                bitmap = linear_bitmap(mi, np.ascontiguousarray(self.surroundings, dtype=np.float32))
                # Mitsuba's map has +Y on top, +Z in its middle and -X in its right half; half a turn about Z
                # brings what is above to -Y and what is right to +X.
                turned = T().rotate([0, 1, 0], light.turn_deg) @ T().rotate([0, 0, 1], 180)
                to_world, scale = WorldFrame(frame.rotation).pose(mi, turned), gain * light.luminance_cd_m2
                return {"type": "envmap", "bitmap": bitmap, "scale": scale, "to_world": to_world}
            case lights.AreaLight():
                black = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}}
                emitter = {"type": "area", "radiance": bright(light.luminance_cd_m2)}
                to_world = frame.pose(mi, T(_area_light_pose(light)))
                return {"type": "rectangle", "to_world": to_world, "emitter": emitter, "bsdf": black}

    def main_spectrum(self) -> np.ndarray:
        """Mean spectrum (N,) of all that shines, each at luminance 1; daylight if only Mitsuba files do."""
        emissions = filter(None, (thing.material.emission for thing in self.scene.objects))
        colours = [getattr(lamp, "illuminant", DAYLIGHT) for lamp in (*self.scene.lights, *emissions)]
        return np.mean([light_spectrum(self.mi, colour) for colour in colours or [DAYLIGHT]], axis=0)

    def _level_gain(self, referenced_lux: float) -> float:
        """By how much to make all that shines brighter for the scene's level; 1 without a level."""
        level = self.scene.level
        if level is None:
            return 1.0
        lux = sum(_illuminance_lux(light, level.z_mm, self.surroundings) for light in self.scene.lights)
        lux += sum(self._object_lux(thing, level.z_mm) for thing in self.scene.objects) + referenced_lux
        if not lux > 0:
            raise InputError(
                f"level: nothing shines on a surface at z_mm = {level.z_mm:g} that faces the cameras"
            )
        return level.illuminance_lux / lux

    def _object_lux(self, thing: SceneObject, z_mm: float) -> float:
        """Illuminance, in lux, that an object gives a surface as in `_illuminance_lux`."""
        emission = thing.material.emission
        if emission is None:
            return 0.0
        points = surface_points(solid_parts(thing.shape, thing.material, self.assets), POINTS)
        matrix = np.array(pose_of(self.mi, thing).matrix, dtype=np.float64)[:3]
        towards = points.position @ matrix[:, :3].T + matrix[:, 3] - [0.0, 0.0, z_mm]
        shares = _shares(points.area, towards, points.normal @ matrix[:, :3].T)
        if emission.texture is not None:
            assert points.texcoord is not None
            pixels = self.assets.image(emission.texture)
            size = np.array(pixels.shape[1::-1])
            col, row = np.clip((points.texcoord * [1, -1] + [0, 1]) * size, 0, size - 1).astype(np.int64).T
            shares *= pixels[row, col] @ LUMINANCE
        return float(emission.luminance_cd_m2 * shares.sum())


def _radiance_plugin(mi: Any, luminance_cd_m2: float, colour: Illuminant) -> dict[str, Any]:
    """Light of this luminance in cd/m^2, with a CIE illuminant's spectrum or colour, or of an sRGB colour."""
    if is_spectral(mi):
        return spectrum_plugin(luminance_cd_m2 * light_spectrum(mi, colour))
    if isinstance(colour, str):
        rgb = spectra.tint(colour)
    else:
        rgb = srgb_to_linear(np.array(colour))
        rgb /= LUMINANCE @ rgb
    return {"type": "rgb", "value": (luminance_cd_m2 * rgb).tolist()}


def light_spectrum(mi: Any, colour: Illuminant) -> np.ndarray:
    """The spectrum (N,) at luminance 1 of a CIE illuminant, or of an sRGB colour.

    A colour is daylight D65 behind a filter with the smooth spectrum of Jakob and Hanika (2019).
    """
    if isinstance(colour, str):
        return spectra.illuminant(colour)
    rgb = srgb_to_linear(np.array(colour))
    slope = np.polyval(np.array(mi.srgb_model_fetch((rgb / rgb.max()).tolist())), spectra.WAVELENGTH_NM)
    filtered = (0.5 + slope / (2 * np.sqrt(1 + slope**2))) * spectra.illuminant(spectra.DAYLIGHT)
    luminosity = spectra.observer()[1]
    luminance = spectra.integral(luminosity * spectra.illuminant(spectra.DAYLIGHT))
    return filtered * (luminance / spectra.integral(luminosity * filtered))


def _narrow_spot(mi: Any, light: lights.SpotLight, gain: float, to_world: Any) -> dict[str, Any]:
    """A spot lamp as a projector of its beam's picture. Raises `InputError` in spectral mode."""
    if is_spectral(mi):
        raise InputError(
            f"lights: a spot lamp with a cutoff_deg below {NARROW_DEG:g} shines only in linear sRGB; make it "
            "wider, or leave sensor.camera out"
        )
    reach_deg = BEAM_MARGIN * light.cutoff_deg
    parts = BEAM_PX * BEAM_PARTS
    side = np.tan(np.radians(reach_deg)) * ((np.arange(parts) + 0.5) / (parts / 2) - 1)
    slope = np.hypot(*np.meshgrid(side, side))
    beyond_deg = light.cutoff_deg - np.degrees(np.arctan(slope))
    share = np.clip(beyond_deg / (light.cutoff_deg - light.beam_deg), 0, 1)
    # A projector of irradiance E has the intensity pi E / cos^3.
    share *= (1 + slope**2) ** -1.5 / np.pi
    share = share.reshape(BEAM_PX, BEAM_PARTS, BEAM_PX, BEAM_PARTS).mean(axis=(1, 3))
    rgb = np.array(_radiance_plugin(mi, gain * light.intensity_cd, light.illuminant)["value"])
    bitmap = linear_bitmap(mi, np.ascontiguousarray(share[..., None] * rgb, dtype=np.float32))
    picture = {"type": "bitmap", "bitmap": bitmap, "raw": True, "wrap_mode": "clamp"}
    return {"type": "projector", "irradiance": picture, "fov": 2 * reach_deg, "to_world": to_world}


def _area_light_pose(light: lights.AreaLight) -> np.ndarray:
    """From the square [-1, 1] x [-1, 1] at z = 0, which shines towards +z, to the lamp; (4, 4)."""
    return _lamp_pose(light) * [light.width_mm / 2, light.height_mm / 2, 1, 1]


def _lamp_pose(light: lights.AreaLight | lights.SpotLight) -> np.ndarray:
    """From a lamp at the origin that shines towards +z to where it stands and what it faces; (4, 4)."""
    towards = np.subtract(light.target_mm, light.position_mm)
    towards = towards / np.linalg.norm(towards)
    up = np.array([0.0, -1.0, 0.0]) if abs(towards[1]) < 0.99 else np.array([0.0, 0.0, 1.0])
    left = np.cross(up, towards)
    left /= np.linalg.norm(left)
    pose = np.eye(4)
    pose[:3] = np.column_stack([left, np.cross(towards, left), towards, light.position_mm])
    return pose


def sample_light(
    mi: Any, light: Any, numbers: np.ndarray, position: Sequence[float] = (0.0, 0.0, 0.0)
) -> tuple[np.ndarray, np.ndarray]:
    """Directions (N, 3) from a position to a light of Mitsuba for random numbers (N, 2), in the renderer's
    axes, and radiance (N, C) over their density."""
    place = mi.Interaction3f() if is_scalar(mi) else load_drjit().zeros(mi.Interaction3f, len(numbers))
    place.p = position
    if is_scalar(mi):
        pairs = [light.sample_direction(place, mi.Point2f(pair)) for pair in numbers.tolist()]
        towards = np.array([np.ravel(sample.d) for sample, _ in pairs])
        return towards, np.array([np.ravel(weight) for _, weight in pairs])
    sample, weight = light.sample_direction(place, vectors(mi, mi.Point2f, numbers))
    return np.array(sample.d, dtype=np.float64).T, np.array(weight).T


def _shares(area: np.ndarray, towards: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Area times cos a cos b / d^2 (N,) of parts of a lamp, for a surface that faces the cameras."""
    at_lamp = np.maximum(-(normal * towards).sum(axis=1), 0)
    return area * np.maximum(-towards[:, 2], 0) * at_lamp / (towards**2).sum(axis=1) ** 2


def _illuminance_lux(light: lights.Light, z_mm: float, surroundings: np.ndarray | None) -> float:
    """Illuminance, in lux, of a surface at (0, 0, z) that faces the cameras, with nothing in a light's way.

    That is the integral of L cos a cos b / d^2 over the lamp, a and b the angles at the surface and at it.
    """
    point = np.array([0.0, 0.0, z_mm])
    match light:
        case lights.UniformLight():
            return float(np.pi * light.luminance_cd_m2)
        case lights.PointLight() | lights.SpotLight():
            towards = np.subtract(light.position_mm, point)
            distance, share = np.linalg.norm(towards), 1.0
            if isinstance(light, lights.SpotLight):
                cosine = np.clip(-towards / distance @ _lamp_pose(light)[:3, 2], -1, 1)
                beyond_deg = light.cutoff_deg - np.degrees(np.arccos(cosine))
                share = np.clip(beyond_deg / (light.cutoff_deg - light.beam_deg), 0, 1)
            return float(share * light.intensity_cd * 1e6 * max(-towards[2], 0) / distance**3)
        case lights.DirectionalLight():
            return float(light.illuminance_lux * max(light.direction[2] / np.linalg.norm(light.direction), 0))
        case lights.EnvironmentLight():
            assert surroundings is not None
            return light.luminance_cd_m2 * _lux_from_around(light, surroundings)
        case lights.AreaLight():
            pose, (node, weight) = _area_light_pose(light), np.polynomial.legendre.leggauss(NODES)
            x, y = np.meshgrid(node, node)
            towards = np.column_stack([x.ravel(), y.ravel()]) @ pose[:3, :2].T + pose[:3, 3] - point
            area = np.outer(weight, weight).ravel() * (light.width_mm * light.height_mm / 4)
            return float(light.luminance_cd_m2 * _shares(area, towards, pose[:3, 2]).sum())


def _lux_from_around(light: lights.EnvironmentLight, pixels: np.ndarray) -> float:
    """The integral of the image's luminance times the cosine over the half space behind the cameras."""
    height, width = pixels.shape[:2]
    # Midpoints of equal parts of the unit interval, 8 a pixel or more.
    down, right = ((np.arange(n) + 0.5) / n for n in np.maximum([8 * height, 8 * width], 4096))
    longitude = (right - 0.5) * 2 * np.pi + np.radians(light.turn_deg)
    # The area on the sphere has one factor sin(polar), the cosine sin(polar) cos(longitude) another. Like the
    # renderer's, the image is linear between pixels, and its rows lie at polar angles from 0 to pi.
    row_weight = np.sin(down * np.pi) ** 2 * (np.pi / down.size)
    col_weight = np.maximum(-np.cos(longitude), 0) * (2 * np.pi / right.size)
    of_rows = _divide_weights(down * (height - 1), row_weight, height)
    of_columns = _divide_weights(right * width - 0.5, col_weight, width)
    return float(of_rows @ (pixels @ LUMINANCE) @ of_columns)


def _divide_weights(position_px: np.ndarray, weight: np.ndarray, pixels: int) -> np.ndarray:
    """Weights at these places, each divided among the two pixels beside it; the first follows the last."""
    before = np.floor(position_px).astype(np.int64)
    after = position_px - before
    total = np.bincount(before % pixels, weight * (1 - after), pixels)
    return total + np.bincount((before + 1) % pixels, weight * after, pixels)
