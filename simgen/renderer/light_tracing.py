"""Light followed from lamps: what of it mirrors and glass send to the cameras, however small the lamp is.

A path from a camera meets a lamp behind glass, or its image in a curved mirror, as rarely as that is small.
Light that leaves the lamp does not: what arrives in a disc around the cameras tells how much of it falls on
their films (particle tracing; Arvo 1986, Veach 1997, chapter 4). NumPy in and NumPy out.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np

from pcii.base import LUMINANCE
from simgen.base import join_rows, take_rows
from simgen.cameras import Rig
from simgen.renderer.backend import is_scalar, load_drjit, vectors
from simgen.renderer.mitsuba_scene import RenderScene

BEGIN_SHARE = 2e-4
"""Light begins this share of a lamp's distance from the cameras away from its surface. Larger: what touches a
lamp is passed over. Smaller: in single precision a small ball stands in its own light."""
MIDDLE_NM = 560.0
"""Wavelength at which the geometry of lamps is looked at in spectral mode."""


class Arrivals(NamedTuple):
    """Light (A,) that passes the disc around the cameras and falls on the film of one that stands there.

    `lamp` is its number among the tracer's, `object_id` the last mirror or clear thing that it met before
    anything else, 0 if that is no object. `light` is what it adds to the sum of radiance over a film's
    pixels, `radiance` that of the lamp where it left it, both in a random colour of the sensor; `peak` is the
    largest part of that as the renderer has it. `bounces` are those on perfect mirrors and through clear
    surfaces that came first, and `is_scattered` says whether something rough came after them. It passes the
    disc at `place_mm` (A, 2) from `slope` (A, 2), in mm to the right and down per mm ahead.
    """

    lamp: np.ndarray
    object_id: np.ndarray
    light: np.ndarray
    radiance: np.ndarray
    peak: np.ndarray
    bounces: np.ndarray
    is_scattered: np.ndarray
    place_mm: np.ndarray
    slope: np.ndarray


class _Rays(NamedTuple):
    """Rays (N,) in the renderer's axes and unit; `power` (N, S) is what each carries at its wavelengths."""

    origin: np.ndarray
    direction: np.ndarray
    power: np.ndarray
    wavelength_nm: np.ndarray


@dataclass(frozen=True, eq=False)
class LampTracer:
    """Follows light of a scene's lamps to a disc of radius `disc_mm` around the cameras of `rig`.

    The sensor is behind the Bayer pattern `cfa`.
    """

    render_scene: RenderScene
    rig: Rig
    cfa: str | None
    disc_mm: float

    @cached_property
    def lamps(self) -> list[Any]:
        """The emitters of Mitsuba's scene that a path from a camera may meet: surfaces and surroundings."""
        mi, scene = self.render_scene.mi, self.render_scene.scene
        return [
            lamp
            for lamp in scene.emitters()
            if lamp.is_environment() or mi.has_flag(lamp.flags(), mi.EmitterFlags.Surface)
        ]

    @cached_property
    def has_mirrors(self) -> bool:
        """Whether a surface is a perfect mirror or clear, at least in part."""
        mi = self.render_scene.mi
        surfaces = (shape.bsdf() for shape in self.render_scene.scene.shapes())
        return any(one is not None and mi.has_flag(one.flags(), mi.BSDFFlags.Delta) for one in surfaces)

    @cached_property
    def objects(self) -> list[int]:
        """The object that each lamp belongs to: 0 if it is a lamp of the scene, -1 for the surroundings."""
        ids = self.render_scene.objects_by_shape()
        return [-1 if lamp.is_environment() else int(ids[lamp.get_shape().id()]) for lamp in self.lamps]

    def radiance_of(self, lamp: np.ndarray, seed: int) -> np.ndarray:
        """Radiance (N,), in random colours of the sensor, of a point of each lamp, drawn by brightness."""
        return self._leave(lamp, np.random.default_rng(seed))[2]

    def follow(self, lamp: np.ndarray, seed: int, least_radiance: float) -> tuple[Arrivals, float]:
        """What arrives of one ray from each lamp (N,), if it is at least so bright there; and the light on a
        film of the brightest ray that could.

        Light that a rough surface scatters before it met anything else ends there: paths from the cameras
        meet it as they meet that surface. The sum of `light` is that of a film, divided by the number of
        lamps if as many of the rays are of each.
        """
        rng = np.random.default_rng(seed)
        rays, weight, radiance, peak = self._leave(lamp, rng)
        particle = np.flatnonzero(radiance >= least_radiance)
        whole, real, pairs = np.zeros(0, np.int64), np.zeros(0), np.zeros((0, 2))
        arrivals = [Arrivals(whole, whole, real, real, real, whole, real > 0, pairs, pairs)]
        rays, number = take_rows(rays, particle), lamp.size
        bounces, met = np.zeros((2, number), dtype=np.int64)
        is_scattered = np.zeros(number, dtype=bool)
        power = (rays.power * weight[particle]).sum(axis=1)
        brightest = self._light_per_power * power.max(initial=0) / number
        for _ in range(self.render_scene.max_depth):
            if not particle.size:
                break
            distance, object_id, is_perfect, onwards = self._end(rays, rng.random((particle.size, 3)))
            share, place_mm, slope = self._on_film(rays, distance)
            here = np.flatnonzero(share)
            p = particle[here]
            light = (rays.power[here] * weight[p]).sum(axis=1) * share[here] / number
            history = bounces[p], is_scattered[p], place_mm[here], slope[here]
            arrivals.append(Arrivals(lamp[p], met[p], light, radiance[p], peak[p], *history))
            is_scattered[particle] |= ~is_perfect
            met[particle] = np.where(is_scattered[particle], met[particle], object_id)
            bounces[particle] += ~is_scattered[particle]
            goes_on = onwards.power.any(axis=1) & (bounces[particle] > 0)
            rays, particle = take_rows(onwards, goes_on), particle[goes_on]
        return join_rows(arrivals), float(brightest)

    @cached_property
    def _light_per_power(self) -> float:
        """Light on a film per power that passes the disc along the axis."""
        scale_px = self.rig.grid.focal_mm / self.rig.grid.pixel_mm
        return scale_px**2 / (np.pi * (self.disc_mm * self.render_scene.frame.unit) ** 2)

    def find_lit_places(self, number: int, seed: int) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """What each lamp that stands at a point, as a spot lamp, lights first, by `number` of its rays.

        Places (N, 3) in mm, their unit normals (N, 3) on its side, and the area (N,) in mm^2 of each.
        """
        mi, dr, scene = self.render_scene.mi, load_drjit(), self.render_scene.scene
        rng, frame = np.random.default_rng(seed), self.render_scene.frame
        wavelength_nm = np.full((number, 0 if self.render_scene.filters is None else 4), MIDDLE_NM)

        def light(lamp: Any, given: Any, wavelengths: Any) -> tuple[Any, ...]:
            pairs = mi.Point2f(given[0], given[1]), mi.Point2f(given[2], given[3])
            ray, power = lamp.sample_ray(0.0, 0.5, *pairs)
            hit = scene.ray_intersect(mi.Ray3f(ray.o, ray.d, 0.0, wavelengths))
            towards, lit = lamp.sample_direction(hit, pairs[0], hit.is_valid())
            side = dr.dot(towards.d, hit.n)
            # Power over irradiance is the area that a ray stands for.
            area = dr.sum(power) / dr.maximum(dr.sum(lit) * dr.abs(side), np.finfo(np.float32).tiny)
            return hit.p, hit.n * dr.sign(side), dr.select(hit.is_valid() & (dr.sum(lit) > 0), area, 0.0)

        for lamp in scene.emitters():
            if mi.has_flag(lamp.flags(), mi.EmitterFlags.DeltaPosition):
                values = self._each(partial(light, lamp), rng.random((number, 4)), wavelength_nm)
                point, normal, area = np.split(values[values[:, 6] > 0], [3, 6], axis=1)
                area_mm2 = area[:, 0] / (number * frame.unit**2)
                yield frame.points_mm(point), frame.world_directions(normal), area_mm2

    def _on_film(self, rays: _Rays, distance: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Light on a film (N,) per power of rays that pass the disc within their length, 0 of others; where
        they pass it and from which slope.

        Power P through an area A, from a direction at the angle t to the cameras' axis, is P / (A cos t) per
        solid angle, of which a px of the film has (pixel / f)^2 cos^3 t.
        """
        frame, grid = self.render_scene.frame, self.rig.grid
        start_mm, direction = frame.points_mm(rays.origin), frame.world_directions(rays.direction)
        towards = np.where(direction[:, 2] < 0, -direction[:, 2], np.nan)
        length_mm = start_mm[:, 2] / towards
        place_mm = (start_mm + length_mm[:, None] * direction)[:, :2]
        # Films are shifted by the shear of the camera that is nearest to where the light passes.
        most = (np.array([grid.cols, grid.rows]) - 1) / 2
        shift_px = np.clip(place_mm / np.array(grid.pitch_mm), -most, most) * grid.shear_px
        scale_px, size_px = grid.focal_mm / grid.pixel_mm, np.array([grid.width, grid.height])
        slope = -direction[:, :2] / towards[:, None]
        film_px = shift_px + slope * scale_px
        is_caught = (length_mm > 0) & (length_mm * frame.unit < distance)
        is_caught &= (np.abs(film_px) < size_px / 2).all(axis=1)
        is_caught &= (place_mm**2).sum(axis=1) < self.disc_mm**2
        return np.where(is_caught, self._light_per_power / towards**4, 0.0), place_mm, slope

    def _leave(
        self, lamp: np.ndarray, rng: np.random.Generator
    ) -> tuple[_Rays, np.ndarray, np.ndarray, np.ndarray]:
        """A ray from a point of each lamp (N,), drawn by brightness; how much of its power a pixel of a
        random colour sees (N, S), the radiance (N,) of the point as it sees it, and its largest part."""
        filters, number = self.render_scene.filters, lamp.size
        wavelength_nm, weight = np.zeros((number, 0)), np.eye(3)[rng.integers(0, 3, number)]
        if filters is not None:
            wavelength_nm, weight = filters.draw(
                rng.integers(0, len(filters.sensitivity), number), rng.random(number)
            )
        elif self.cfa is None:
            weight = np.tile(LUMINANCE, (number, 1))
        parts, numbers = weight.shape[1], rng.random((number, 4))
        values = np.zeros((number, 6 + 2 * parts))
        for which in np.unique(lamp):
            here = np.flatnonzero(lamp == which)
            one = self.lamps[which]
            leave = self._leave_around if one.is_environment() else self._leave_surface
            values[here] = self._each(partial(leave, one), numbers[here], wavelength_nm[here])
        origin, direction, power, radiance = np.split(values, [3, 6, 6 + parts], axis=1)
        rays = _Rays(origin, direction, power, wavelength_nm)
        return rays, weight, (radiance * weight).sum(axis=1), radiance.max(axis=1)

    def _leave_surface(self, lamp: Any, numbers: Any, wavelengths: Any) -> tuple[Any, ...]:
        """Origin, direction, power and radiance of a ray that leaves a surface."""
        mi = self.render_scene.mi
        place, area = lamp.sample_position(0.0, mi.Point2f(numbers[0], numbers[1]))
        if lamp.get_shape().class_name() == "Sphere":  # of a turned one Mitsuba has another place's normal
            place.n = load_drjit().normalize(mi.Normal3f(place.p - lamp.get_shape().bbox().center()))
        start = mi.SurfaceInteraction3f(place, wavelengths)
        start.wi = [0.0, 0.0, 1.0]
        radiance = lamp.eval(start)
        away = mi.warp.square_to_cosine_hemisphere(mi.Point2f(numbers[2], numbers[3]))
        ray = start.spawn_ray(start.to_world(away))
        # A ray that begins nearer to a small ball would hit it, for rounding.
        cameras = mi.Point3f(*self.render_scene.frame.points(np.zeros(3)).tolist())
        ahead = BEGIN_SHARE * load_drjit().norm(ray.o - cameras)
        return ray.o + ahead * ray.d, ray.d, radiance * (area * np.pi), radiance

    def _leave_around(self, lamp: Any, numbers: Any, wavelengths: Any) -> tuple[Any, ...]:
        """The same of one that comes from all around, from a disc as wide as the scene."""
        mi, ball = self.render_scene.mi, self.render_scene.scene.bbox().bounding_sphere()
        middle = mi.Interaction3f() if is_scalar(mi) else load_drjit().zeros(mi.Interaction3f, 1)
        middle.p, middle.wavelengths = ball.center, wavelengths
        sample, radiance = lamp.sample_direction(middle, mi.Point2f(numbers[0], numbers[1]))
        across = mi.warp.square_to_uniform_disk_concentric(mi.Point2f(numbers[2], numbers[3]))
        aside = mi.Frame3f(sample.d).to_world(mi.Vector3f(across.x, across.y, 1.0))
        power = radiance * (np.pi * ball.radius**2)
        return mi.Point3f(ball.center) + ball.radius * aside, -sample.d, power, radiance * sample.pdf

    def _end(self, rays: _Rays, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, _Rays]:
        """Length of each ray (inf for a miss), object that it ends on, whether that is to it a perfect mirror
        or clear; and how it goes on from there, by random `numbers` (N, 3)."""
        mi, scene = self.render_scene.mi, self.render_scene.scene
        context = mi.BSDFContext(mi.TransportMode.Importance)
        ids = self.render_scene.objects_by_shape() if is_scalar(mi) else {}

        def end(columns: Any, wavelengths: Any) -> tuple[Any, ...]:
            ray = mi.RayDifferential3f(
                mi.Ray3f(mi.Point3f(*columns[:3]), mi.Vector3f(*columns[3:6]), 0.0, wavelengths)
            )
            hit = scene.ray_intersect(ray)
            is_hit = hit.is_valid()
            if is_scalar(mi) and not is_hit:
                return np.inf, 0, False, mi.Spectrum(0), ray.o, ray.d
            pair = mi.Point2f(columns[7], columns[8])
            sample, weight = hit.bsdf(ray).sample(context, hit, columns[6], pair, is_hit)
            onwards = hit.spawn_ray(hit.to_world(sample.wo))
            is_perfect = mi.has_flag(sample.sampled_type, mi.BSDFFlags.Delta)
            shape = ids[(hit.instance or hit.shape).id()] if ids else self.render_scene.shape_number(hit)
            return hit.t, shape, is_perfect, weight, onwards.o, onwards.d

        columns = np.concatenate([rays.origin, rays.direction, numbers], axis=1)
        values = self._each(end, columns, rays.wavelength_nm)
        object_id = values[:, 1].astype(np.int64)
        if not is_scalar(mi):
            object_id = self.render_scene.object_of_shape[object_id].astype(np.int64)
        weight, origin, direction = np.split(values[:, 3:], [-6, -3], axis=1)
        onwards = _Rays(origin, direction, rays.power * np.nan_to_num(weight), rays.wavelength_nm)
        return values[:, 0], object_id, values[:, 2] > 0, onwards

    def _each(
        self, function: Callable[..., tuple[Any, ...]], given: np.ndarray, wavelength_nm: np.ndarray
    ) -> np.ndarray:
        """The numbers (N, M) that a function makes of each row of `given` (N, G) and of its wavelengths."""
        mi = self.render_scene.mi
        if is_scalar(mi):
            rows = zip(given.tolist(), wavelength_nm.tolist(), strict=True)
            return np.array([np.concatenate([np.ravel(part) for part in function(*row)]) for row in rows])
        columns = vectors(mi, lambda *parts: parts, given)
        wavelengths = vectors(mi, mi.Spectrum, wavelength_nm) if wavelength_nm.size else []
        parts = function(columns, wavelengths)
        load_drjit().eval(*parts)
        rows = [np.broadcast_to(row, len(given)) for part in parts for row in np.atleast_2d(np.array(part))]
        return np.array(rows, dtype=np.float64).T
