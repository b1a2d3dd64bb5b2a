"""Light paths, one for each of many camera rays at once: what is hit first, and unbiased radiance.

The estimator is path tracing with next-event estimation (Kajiya 1986) and multiple importance sampling
by the power heuristic (Veach 1997). At every hit each lamp is sampled, instead of one lamp chosen at random:
a candidate photon is accepted in proportion to its path's radiance, so the less that varies, the fewer
candidates are needed. Everything here stays on the renderer's side, as Dr.Jit arrays with an element for
each ray, and needs a compiled backend.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from simgen.renderer.backend import is_scalar, load_drjit, vectors
from simgen.renderer.mitsuba_scene import RenderScene, shape_number
from simgen.renderer.wavelengths import Light

STRATA = 2
"""At the first hit each lamp is sampled in 2 x 2 cells of its surface: what is near varies most."""
BOUNCES = 2
"""Directions that are followed from the first hit: a surface nearby that shines on it is rarely met."""
ROULETTE_THROUGHPUT = 0.05
"""Russian roulette ends paths whose throughput since the first hit is below this, in proportion to it.

Larger: more noise from what is left of such a path. Smaller: longer paths, above all in closed white rooms.
"""
LEAST_REFLECTANCE = 0.001
"""A surface is never guessed to be less reflective than this: it may shine."""
LEAST_RADIANCE = 1e-9
"""The guess where nothing is hit, so that it can be divided by."""
DIRECTIONS = 256
"""Evenly spread directions in which light from all around is looked at."""
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
    is_hit, missed = active & hit.is_valid(), active & ~hit.is_valid()
    shape = dr.select(is_hit, shape_number(render_scene, hit), 0)
    z_mm = dr.select(is_hit, render_scene.frame.z_mm(hit.p), dr.inf)
    guess = hit.emitter(render_scene.scene, missed).eval(hit, missed)
    bsdf, context = hit.bsdf(ray), mi.BSDFContext()
    for lamp in _lamps(render_scene.scene):
        towards, weight = lamp.sample_direction(hit, mi.Point2f(0.5, 0.5), is_hit)
        scattered = bsdf.eval(context, hit, hit.to_local(towards.d), is_hit)
        guess += dr.select(is_hit & (towards.pdf > 0), scattered * weight, 0)
    reflectance = bsdf.eval_diffuse_reflectance(hit, is_hit)
    guess += dr.select(is_hit, ambient * dr.clip(reflectance, LEAST_REFLECTANCE, 1), LEAST_RADIANCE)
    return FirstHits(record, shape, z_mm, guess)


def surrounding_radiance(render_scene: RenderScene, light: Light) -> np.ndarray:
    """What pixels of each colour see of the mean of what shines from all around; (3,) or (C,), float64."""
    mi, dr, around = render_scene.mi, load_drjit(), render_scene.scene.environment()
    number = dr.arange(mi.Float, DIRECTIONS) + 0.5
    # A Fibonacci lattice.
    up, turn = 1 - number / (DIRECTIONS / 2), number * (dr.pi * (3 - 5**0.5))
    across = dr.sqrt(1 - up * up)
    away = dr.zeros(mi.SurfaceInteraction3f, DIRECTIONS)
    away.wi = mi.Vector3f(across * dr.cos(turn), across * dr.sin(turn), up)
    # The directions are in no order of colour, so that any numbers will do for wavelengths.
    wavelength_sample = number * GOLDEN - dr.floor(number * GOLDEN)
    total: Any = 0.0
    for colour in light.colours_to_follow(dr.zeros(mi.UInt32, DIRECTIONS)):
        away.wavelengths = light.aim(dr.zeros(mi.Ray3f, DIRECTIONS), colour, wavelength_sample).wavelengths
        radiance = mi.Spectrum(0) if around is None else around.eval(away)
        seen = np.array(light.per_colour(radiance, colour, wavelength_sample))
        total += seen.mean(axis=1, dtype=np.float64)
    return total


def bright_directions(render_scene: RenderScene, number: int, seed: int) -> np.ndarray:
    """Unit directions (N, 3) to the image of what shines from all around, drawn by its brightness.

    None, if there is no such image. Works in scalar mode too.
    """
    mi, around = render_scene.mi, _surroundings(render_scene.mi, render_scene.scene)
    if not around:
        return np.zeros((0, 3))
    points = np.random.default_rng(seed).random((number, 2))
    if is_scalar(mi):
        place = mi.Interaction3f()
        samples = (around[0].sample_direction(place, mi.Point2f(point))[0] for point in points.tolist())
        directions = np.array([np.ravel(sample.d) for sample in samples])
    else:
        place = load_drjit().zeros(mi.Interaction3f, number)
        sample, _ = around[0].sample_direction(place, vectors(mi, mi.Point2f, points))
        directions = np.array(sample.d).T.astype(np.float64)
    return render_scene.frame.world_directions(directions)


def _lamps(scene: Any) -> list[Any]:
    """Emitters that have a place."""
    return [light for light in scene.emitters() if not light.is_environment()]


def _surroundings(mi: Any, scene: Any) -> list[Any]:
    """The image of what shines from all around, if there is one: a sun in it is to be aimed at.

    Uniform surroundings are met by following the surface's own scattering, which has no variance but for what
    stands in the way.
    """
    around = scene.environment()
    varies = around is not None and mi.has_flag(around.flags(), mi.EmitterFlags.SpatiallyVarying)
    return [around] if varies else []


def radiance_along(render_scene: RenderScene, ray: Any, record: Any, sampler: Any, max_depth: int) -> Any:
    """Radiance (linear sRGB, luminance in cd/m^2) that one path from each first hit estimates.

    What the first hit shines itself is left out, but not what shines from all around where nothing is hit.
    A path has at most `max_depth` segments. It is split at the first hit, where `STRATA` x `STRATA` points
    of each lamp and `BOUNCES` directions are followed; what each direction meets is followed in a loop, as
    one path. `sampler` gives the random numbers.
    """
    mi, dr = render_scene.mi, load_drjit()
    tracer = _Tracer(render_scene)
    hit = record.compute_surface_interaction(ray, mi.RayFlags.All, True)
    is_hit = hit.is_valid()
    radiance = hit.emitter(render_scene.scene, ~is_hit).eval(hit, ~is_hit)
    if max_depth == 1:
        return radiance
    bsdf = hit.bsdf(ray)
    radiance += tracer.direct_light(hit, bsdf, sampler, STRATA, BOUNCES, is_hit)
    left = dr.opaque(mi.UInt32, max_depth - 2)  # as data, so that paths of all lengths share one kernel
    for bounce in range(BOUNCES):
        onward, weight = tracer.next_segment(hit, bsdf, sampler, STRATA, BOUNCES, bounce, is_hit)
        path = _Path(*onward, mi.Spectrum(1), left, sampler)
        if max_depth > 2:
            # A loop also for short paths: it is as fast as unrolled segments.
            (path,) = dr.while_loop(
                (path,),
                lambda path: path.active & (path.left > 0),
                lambda path: (tracer.lengthen(path),),
                label="path",
            )
        sampler = path.sampler
        radiance += weight * path.radiance / BOUNCES
    return radiance


@dataclass
class _Path:
    """Paths from the second hit on: what a loop's iteration changes (Dr.Jit sets the fields).

    `ray` and `hit` are of the last segment, `radiance` is what all segments have brought so far, and
    `throughput` what share of the light that leaves `hit` arrives at the path's beginning. Paths that are
    active have `left` more segments at most.
    """

    ray: Any
    hit: Any
    active: Any
    radiance: Any
    throughput: Any
    left: Any
    sampler: Any


class _Tracer:
    """The parts of a path: light that comes straight from lamps, and the segment that goes on."""

    def __init__(self, render_scene: RenderScene) -> None:
        self.mi, self.dr, self.scene = render_scene.mi, load_drjit(), render_scene.scene
        self.context = self.mi.BSDFContext()
        around = _surroundings(self.mi, self.scene)
        self.lamps, self.aims_around = _lamps(self.scene) + around, bool(around)

    def lengthen(self, path: _Path) -> _Path:
        """Paths with one more segment, unless Russian roulette (Arvo and Kirk 1990) ends them."""
        dr, sampler = self.dr, path.sampler
        bsdf = path.hit.bsdf(path.ray)
        direct = self.direct_light(path.hit, bsdf, sampler, 1, 1, path.active)
        (ray, hit, active, emitted), weight = self.next_segment(path.hit, bsdf, sampler, 1, 1, 0, path.active)
        throughput = path.throughput * weight
        radiance = path.radiance + path.throughput * direct + throughput * emitted
        left = path.left - 1
        active &= dr.any(throughput != 0) & (left > 0)
        largest = dr.max(throughput)
        is_faint = active & (largest < ROULETTE_THROUGHPUT)
        # Only faint paths draw a number, so that the others are those without roulette.
        active &= ~is_faint | (sampler.next_1d(is_faint) * ROULETTE_THROUGHPUT < largest)
        throughput = dr.select(is_faint, throughput * (ROULETTE_THROUGHPUT / largest), throughput)
        return _Path(ray, hit, active, radiance, throughput, left, sampler)

    def direct_light(self, hit: Any, bsdf: Any, sampler: Any, side: int, bounces: int, active: Any) -> Any:
        """Light straight from all lamps, from `side` x `side` points of each, that leaves `hit` backwards."""
        radiance = self.mi.Spectrum(0)
        for lamp in self.lamps:
            for cell in np.ndindex(side, side):
                point = (self.mi.Vector2f(*cell) + sampler.next_2d(active)) / side
                radiance += self._direct(lamp, hit, bsdf, point, side**2, bounces, active) / side**2
        return radiance

    def _direct(
        self, lamp: Any, hit: Any, bsdf: Any, point: Any, tries: int, bounces: int, active: Any
    ) -> Any:
        mi, dr = self.mi, self.dr
        able = active & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
        towards, weight = lamp.sample_direction(hit, point, able)
        able &= towards.pdf != 0
        blocked = self.scene.ray_test(hit.spawn_ray_to(towards.p), able)
        value, pdf = bsdf.eval_pdf(self.context, hit, hit.to_local(towards.d), able)
        mis_weight = dr.select(towards.delta, 1, _power_heuristic(tries * towards.pdf, bounces * pdf))
        return dr.select(able & ~blocked, value * weight * mis_weight, 0)

    def next_segment(
        self, hit: Any, bsdf: Any, sampler: Any, side: int, bounces: int, bounce: int, active: Any
    ) -> tuple[tuple[Any, Any, Any, Any], Any]:
        """The segment that leaves `hit` as number `bounce` of `bounces`, in a direction that `bsdf` chose.

        Its ray, its end, whether a path goes on from there, and what shines there, weighted against aiming at
        it: at `side` x `side` points of each lamp. Last the share of the light along the ray that leaves
        `hit`, 0 for rays that are not active.
        """
        mi, dr, scene = self.mi, self.dr, self.scene
        across = sampler.next_2d(active)
        across.x = (across.x + bounce) / bounces
        sample, weight = bsdf.sample(self.context, hit, sampler.next_1d(active), across, active)
        active = active & dr.any(weight != 0)
        ray = hit.spawn_ray(hit.to_world(sample.wo))
        arrival = scene.ray_intersect(ray, active)
        lamp = arrival.emitter(scene, active)
        towards = mi.DirectionSample3f(scene, arrival, mi.Interaction3f(hit))
        # Lamps could have been aimed at instead, but not evenly lit surroundings behind everything.
        could_be_aimed_at = ~mi.has_flag(sample.sampled_type, mi.BSDFFlags.Delta)
        if not self.aims_around:
            could_be_aimed_at &= arrival.is_valid()
        pdf_lamp = side**2 * lamp.pdf_direction(mi.Interaction3f(hit), towards, active)
        mis_weight = dr.select(could_be_aimed_at, _power_heuristic(bounces * sample.pdf, pdf_lamp), 1)
        emitted = dr.select(active, lamp.eval(arrival, active) * mis_weight, 0)
        return (ray, arrival, active & arrival.is_valid(), emitted), dr.select(active, weight, 0)


def _power_heuristic(pdf: Any, other: Any) -> Any:
    """Weight of a sample that two ways could have given: the power heuristic with exponent 2."""
    return pdf * pdf / (pdf * pdf + other * other)
