"""Light paths, one for each of many camera rays at once: what is hit first, and unbiased radiance.

The estimator is path tracing with next-event estimation (Kajiya 1986) and multiple importance sampling
by the power heuristic (Veach 1997). At every hit each lamp is sampled, instead of one lamp
chosen at random: a candidate photon is accepted in proportion to its path's radiance, so the less that
varies, the fewer candidates are needed. Everything here stays on the renderer's side, as Dr.Jit arrays
with an element for each ray. Needs a compiled backend.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from simgen.renderer.backend import is_scalar, load_drjit
from simgen.renderer.device_arrays import floats
from simgen.renderer.mitsuba_scene import RenderScene
from simgen.renderer.wavelengths import Light

STRATA = 2
"""At the first hit each lamp is sampled in 2 x 2 cells of its surface: what is near varies most."""
BOUNCES = 2
"""From the first hit so many directions are followed: a surface nearby that shines on it is rarely met."""
LEAST_REFLECTANCE = 0.001
"""A surface is never guessed to be less reflective than this: it may shine."""
LEAST_RADIANCE = 1e-9
"""What is guessed of nothing, so that it can be divided by."""
GOLDEN = (5**0.5 - 1) / 2
"""Its multiples, less their whole parts, are evenly spread."""


@dataclass(frozen=True)
class FirstHits:
    """What rays hit first: Mitsuba's record, shape number (0 a miss), z (+inf a miss), and a guess.

    `guess` is the radiance that is known without a light path: what the lamps would give if nothing stood
    in the way, and light from all around. What a surface that is hit shines itself is left out.
    """

    record: Any
    shape: Any
    z_mm: Any
    guess: Any


def hit_first(render_scene: RenderScene, ray: Any, active: Any, ambient: Any) -> FirstHits:
    """What each active ray hits first; `ambient` is the radiance that is guessed to come from all around."""
    mi, dr = render_scene.mi, load_drjit()
    record = render_scene.scene.ray_intersect_preliminary(ray, coherent=False, active=active)
    hit = record.compute_surface_interaction(ray, mi.RayFlags.All, active)
    found = active & hit.is_valid()
    shape = dr.select(found, dr.reinterpret_array(mi.UInt32, hit.shape), 0)
    z_mm = dr.select(found, hit.p.z, dr.inf)
    missed = active & ~found
    guess = hit.emitter(render_scene.scene, missed).eval(hit, missed)
    bsdf, context = hit.bsdf(ray), mi.BSDFContext()
    for lamp in _lamps(render_scene.scene):
        towards, weight = lamp.sample_direction(hit, mi.Point2f(0.5, 0.5), found)
        scattered = bsdf.eval(context, hit, hit.to_local(towards.d), found)
        guess += dr.select(found & (towards.pdf > 0), scattered * weight, 0)
    reflectance = bsdf.eval_diffuse_reflectance(hit, found)
    guess += dr.select(found, ambient * dr.clip(reflectance, LEAST_REFLECTANCE, 1), LEAST_RADIANCE)
    return FirstHits(record, shape, z_mm, guess)


def surrounding_radiance(render_scene: RenderScene, light: Light) -> np.ndarray:
    """What pixels of each colour see of the mean of what shines from all around; (3,) or (C,), float64."""
    mi, dr = render_scene.mi, load_drjit()
    around = render_scene.scene.environment()
    number = dr.arange(mi.Float, 256) + 0.5
    # Evenly spread directions (a Fibonacci lattice).
    up, turn = 1 - number / 128, number * (dr.pi * (3 - 5**0.5))
    across = dr.sqrt(1 - up * up)
    away = dr.zeros(mi.SurfaceInteraction3f, 256)
    away.wi = mi.Vector3f(across * dr.cos(turn), across * dr.sin(turn), up)
    found: Any = 0.0
    for colour in light.colours_to_follow(dr.zeros(mi.UInt32, 256)):
        # The directions are in no order of colour, so that any will do for wavelengths.
        wavelength_sample = number * GOLDEN - dr.floor(number * GOLDEN)
        away.wavelengths = light.aim(dr.zeros(mi.Ray3f, 256), colour, wavelength_sample).wavelengths
        radiance = mi.Spectrum(0) if around is None else around.eval(away)
        found += np.array(light.per_colour(radiance, colour, wavelength_sample)).mean(
            axis=1, dtype=np.float64
        )
    return found


def bright_directions(render_scene: RenderScene, number: int, seed: int) -> np.ndarray:
    """Unit directions (N, 3) to the image of what shines from all around, drawn by its brightness.

    None, if there is no such image. Works in scalar mode too.
    """
    mi, around = render_scene.mi, _surroundings(render_scene.mi, render_scene.scene)
    if not around:
        return np.zeros((0, 3))
    points = np.random.default_rng(seed).random((number, 2))
    if is_scalar(mi):
        seen_from = mi.Interaction3f()
        drawn = (around[0].sample_direction(seen_from, mi.Point2f(point))[0] for point in points.tolist())
        return np.array([np.ravel(sample.d) for sample in drawn])
    seen_from = load_drjit().zeros(mi.Interaction3f, number)
    sample, _ = around[0].sample_direction(
        seen_from, mi.Point2f(*(floats(mi, column) for column in points.T))
    )
    return np.array(sample.d).T.astype(np.float64)


def _lamps(scene: Any) -> list[Any]:
    """Emitters that have a place."""
    return [light for light in scene.emitters() if not light.is_environment()]


def _surroundings(mi: Any, scene: Any) -> list[Any]:
    """The image of what shines from all around, if there is one: a sun in it is to be aimed at.

    Uniform surroundings are found by following the surface's own scattering, which has no variance but
    for what stands in the way.
    """
    around = scene.environment()
    varies = around is not None and mi.has_flag(around.flags(), mi.EmitterFlags.SpatiallyVarying)
    return [around] if varies else []


def radiance_along(render_scene: RenderScene, ray: Any, record: Any, sampler: Any, max_depth: int) -> Any:
    """Radiance (linear sRGB, luminance in cd/m^2) that one path from each first hit estimates.

    What the first hit shines itself is left out, but not what shines from all around where nothing is hit.
    The path is unrolled into one kernel: `max_depth` is small. It is split at the first hit, where
    `STRATA` x `STRATA` points of each lamp and `BOUNCES` directions are followed.
    """
    mi = render_scene.mi
    tracer = _Tracer(render_scene, sampler)
    hit = record.compute_surface_interaction(ray, mi.RayFlags.All, True)
    missed = ~hit.is_valid()
    radiance = hit.emitter(render_scene.scene, missed).eval(hit, missed)
    return radiance + tracer.scattered(ray, hit, hit.is_valid(), max_depth - 1, STRATA, BOUNCES)


class _Tracer:
    """The two halves of path tracing, which call each other: what leaves a hit, what arrives there."""

    def __init__(self, render_scene: RenderScene, sampler: Any) -> None:
        self.mi, self.dr, self.scene, self.sampler = (
            render_scene.mi,
            load_drjit(),
            render_scene.scene,
            sampler,
        )
        self.context = self.mi.BSDFContext()
        around = _surroundings(render_scene.mi, render_scene.scene)
        self.lamps, self.aims_around = _lamps(render_scene.scene) + around, bool(around)

    def scattered(self, ray: Any, hit: Any, active: Any, left: int, side: int, bounces: int) -> Any:
        """Radiance sent back along `ray` by what it hit, through at most `left` more segments."""
        mi, dr, sampler = self.mi, self.dr, self.sampler
        radiance = mi.Spectrum(0)
        if left == 0:
            return radiance
        bsdf = hit.bsdf(ray)
        for lamp in self.lamps:
            for cell in np.ndindex(side, side):
                point = (mi.Vector2f(*cell) + sampler.next_2d(active)) / side
                radiance += self._direct(lamp, hit, bsdf, point, side**2, bounces, active) / side**2
        for bounce in range(bounces):
            across = sampler.next_2d(active)
            across.x = (across.x + bounce) / bounces
            sample, weight = bsdf.sample(self.context, hit, sampler.next_1d(active), across, active)
            on = active & dr.any(weight != 0)
            onward = hit.spawn_ray(hit.to_world(sample.wo))
            arriving = self._arriving(onward, hit, sample, on, left, side, bounces)
            radiance += dr.select(on, weight * arriving, 0) / bounces
        return radiance

    def _arriving(
        self, ray: Any, before: Any, sample: Any, active: Any, left: int, side: int, bounces: int
    ) -> Any:
        """Radiance that arrives at `before` along `ray`, whose direction the surface chose."""
        mi, dr, scene = self.mi, self.dr, self.scene
        hit = scene.ray_intersect(ray, active)
        lamp = hit.emitter(scene, active)
        towards = mi.DirectionSample3f(scene, hit, mi.Interaction3f(before))
        # Lamps could have been aimed at instead, but not evenly lit surroundings behind everything.
        aimed = ~mi.has_flag(sample.sampled_type, mi.BSDFFlags.Delta)
        if not self.aims_around:
            aimed &= hit.is_valid()
        pdf_lamp = side**2 * lamp.pdf_direction(mi.Interaction3f(before), towards, active)
        share = dr.select(aimed, _share(bounces * sample.pdf, pdf_lamp), 1)
        radiance = lamp.eval(hit, active) * share
        return radiance + self.scattered(ray, hit, active & hit.is_valid(), left - 1, 1, 1)

    def _direct(
        self, lamp: Any, hit: Any, bsdf: Any, point: Any, tries: int, bounces: int, active: Any
    ) -> Any:
        """Light that arrives straight from one lamp and is scattered towards where we came from."""
        mi, dr = self.mi, self.dr
        able = active & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
        towards, weight = lamp.sample_direction(hit, point, able)
        able &= towards.pdf != 0
        blocked = self.scene.ray_test(hit.spawn_ray_to(towards.p), able)
        value, pdf = bsdf.eval_pdf(self.context, hit, hit.to_local(towards.d), able)
        share = dr.select(towards.delta, 1, _share(tries * towards.pdf, bounces * pdf))
        return dr.select(able & ~blocked, value * weight * share, 0)


def _share(pdf: Any, other: Any) -> Any:
    """Weight of a sample that two ways could have given: the power heuristic with exponent 2."""
    return pdf * pdf / (pdf * pdf + other * other)
