"""Camera rays and a light path for each, many at once: what is hit first, and unbiased radiance.

The estimator is path tracing with next-event estimation (Kajiya 1986) and multiple importance sampling
by the power heuristic (Veach 1997). At every hit each lamp is sampled, instead of one lamp chosen at random:
a candidate photon is accepted in proportion to its path's radiance, so the less that varies, the fewer
candidates are needed. Everything here stays on the renderer's side, as Dr.Jit arrays with an element for
each ray, and needs a compiled backend.
"""

from collections.abc import Sequence
from itertools import product
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from simgen.cameras import Rig
from simgen.renderer.backend import floats, gathered, load_drjit
from simgen.renderer.emission import sample_light
from simgen.renderer.mitsuba_scene import RenderScene
from simgen.renderer.ray_states import Light

STRATA = 2
"""At the first hit each lamp is sampled in 2 x 2 cells of its surface: what is near varies most."""
BOUNCES = 2
"""Directions that are followed from the first hit: a surface nearby that shines on it is rarely met."""
ROULETTE_THROUGHPUT = 0.05
"""Paths whose throughput since the first hit is below this end in proportion to it. Larger: more noise.
Smaller: longer paths, above all in closed white rooms."""
LEAST_REFLECTANCE = 0.001
"""A surface is never guessed to be less reflective than this: it may shine."""
LEAST_RADIANCE = 1e-9
"""The guess where nothing is hit, so that it can be divided by."""
DIRECTIONS = 256
"""Evenly spread directions in which light from all around is looked at."""


class FirstHits(NamedTuple):
    """What rays hit first: Mitsuba's record, shape number (0 a miss), z (+inf a miss), and a guess.

    `guess` is the radiance that is known without a light path: what the lamps would give if nothing stood
    in the way, and light from all around. What a surface that is hit shines itself is left out.
    """

    record: Any
    shape: Any
    z_mm: Any
    guess: Any


def film_rays(
    render_scene: RenderScene, rig: Rig, k: Any, l: Any, row_px: Any, col_px: Any, lens_point: Any = None
) -> Any:
    """Rays through points of the film, and of the lens (in mm) if there is one; see `Rig.rays`."""
    mi, frame = render_scene.mi, render_scene.frame
    camera = k * rig.grid.cols + l
    rotation, position = frame.rotation @ rig.rotation, frame.points(rig.position_mm)

    def of_camera(values: np.ndarray) -> Any:
        if (values == values.flat[0]).all():
            return float(values.flat[0])  # what all cameras share needs no look-up
        return gathered(floats(mi, values), camera)

    def rotate(*vector: Any, factor: float = 1.0) -> list[Any]:
        rows = factor * np.moveaxis(rotation, (-2, -1), (0, 1))
        return [_dot([of_camera(row[col]) for col in range(len(vector))], vector) for row in rows]

    axis_px = of_camera(rig.axis_px[..., 0]), of_camera(rig.axis_px[..., 1])
    x, y = rig.slopes(row_px, col_px, axis_px, lens_point)
    origin = mi.Point3f(*(of_camera(position[..., axis]) for axis in range(3)))
    if rig.lens is not None:
        origin += mi.Vector3f(*rotate(lens_point.x, lens_point.y, factor=frame.unit))
    direction = load_drjit().normalize(mi.Vector3f(*rotate(x, y, mi.Float(1))))
    return mi.RayDifferential3f(mi.Ray3f(origin, direction))


def _dot(row: Sequence[Any], vector: Sequence[Any]) -> Any:
    """Sum of products, without those of a plain 0, nor a factor that is a plain 1."""
    terms = []
    for factor, part in zip(row, vector, strict=True):
        if not isinstance(factor, float):
            terms.append(factor * part)
        elif factor != 0:
            terms.append(part if factor == 1 else factor * part)
    return sum(terms[1:], terms[0]) if terms else 0


def surrounding_radiance(render_scene: RenderScene, light: Light) -> np.ndarray:
    """What pixels of each colour see of the mean of what shines from all around; (3,) or (C,), float64."""
    mi, dr, around = render_scene.mi, load_drjit(), render_scene.scene.environment()
    number = dr.arange(mi.Float, DIRECTIONS) + 0.5  # of a point of a Fibonacci lattice
    up, turn = 1 - number / (DIRECTIONS / 2), number * (dr.pi * (3 - 5**0.5))
    across = dr.sqrt(1 - up * up)
    away = dr.zeros(mi.SurfaceInteraction3f, DIRECTIONS)
    away.wi = mi.Vector3f(across * dr.cos(turn), across * dr.sin(turn), up)
    # Multiples of the golden ratio, less their whole parts, are evenly spread.
    multiple = number * ((5**0.5 - 1) / 2)
    total: Any = 0.0
    for colour in light.colours_to_follow(dr.zeros(mi.UInt32, DIRECTIONS)):
        pixels = SimpleNamespace(colour=colour, wavelength_sample=multiple - dr.floor(multiple))
        away.wavelengths = light.aim(dr.zeros(mi.Ray3f, DIRECTIONS), pixels).wavelengths
        radiance = mi.Spectrum(0) if around is None else around.eval(away)
        visible = np.array(light.per_colour(radiance, pixels))
        total += visible.mean(axis=1, dtype=np.float64)
    return total


def bright_directions(render_scene: RenderScene, number: int, seed: int) -> np.ndarray:
    """Unit directions (N, 3) to the image of what shines from all around, drawn by its brightness.

    None, if there is no such image. Works in scalar mode too.
    """
    mi, points = render_scene.mi, np.random.default_rng(seed).random((number, 2))
    samples = [sample_light(mi, around, points)[0] for around in _surroundings(mi, render_scene.scene)]
    return render_scene.frame.world_directions(np.concatenate([np.zeros((0, 3)), *samples]))


def _surroundings(mi: Any, scene: Any) -> list[Any]:
    """The image of what shines from all around, if there is one: a sun in it is to be aimed at.

    Uniform surroundings are met by following the surface's own scattering, which has less variance.
    """
    around = scene.environment()
    varies = around is not None and mi.has_flag(around.flags(), mi.EmitterFlags.SpatiallyVarying)
    return [around] if varies else []


class PathTracer:
    """What camera rays meet in a scene: their first hits, and radiance along a path from each.

    A path finds nothing of what is seen by perfect mirrors and clear surfaces alone and is brighter than its
    `hidden_above`; inf hides nothing.
    """

    def __init__(self, render_scene: RenderScene) -> None:
        self.render_scene, self.mi, self.dr = render_scene, render_scene.mi, load_drjit()
        self.scene, self.context = render_scene.scene, self.mi.BSDFContext()
        self.lamps = [light for light in self.scene.emitters() if not light.is_environment()]
        self.aimed_at = self.lamps + _surroundings(self.mi, self.scene)

    def hit_first(self, ray: Any, active: Any, ambient: Any) -> FirstHits:
        """What each active ray hits first; `ambient` is the radiance guessed to come from all around."""
        mi, dr = self.mi, self.dr
        record = self.scene.ray_intersect_preliminary(ray, coherent=False, active=active)
        hit = record.compute_surface_interaction(ray, mi.RayFlags.All, active)
        is_hit, missed = active & hit.is_valid(), active & ~hit.is_valid()
        shape = dr.select(is_hit, self.render_scene.shape_number(hit), 0)
        z_mm = dr.select(is_hit, self.render_scene.frame.z_mm(hit.p), dr.inf)
        guess, bsdf = self._surroundings_seen(hit, missed), hit.bsdf(ray)
        for lamp in self.lamps:
            towards, weight = lamp.sample_direction(hit, mi.Point2f(0.5, 0.5), is_hit)
            scattered = bsdf.eval(self.context, hit, hit.to_local(towards.d), is_hit)
            guess += dr.select(is_hit & (towards.pdf > 0), scattered * weight, 0)
        reflectance = bsdf.eval_diffuse_reflectance(hit, is_hit)
        guess += dr.select(is_hit, ambient * dr.clip(reflectance, LEAST_REFLECTANCE, 1), LEAST_RADIANCE)
        return FirstHits(record, shape, z_mm, guess)

    def _surroundings_seen(self, hit: Any, missed: Any) -> Any:
        """What a camera sees of what shines from all around, where its rays have missed everything."""
        if self.render_scene.hides_surroundings:
            return self.mi.Spectrum(0)
        return hit.emitter(self.scene, missed).eval(hit, missed)

    def mirrored_radiance(self, ray: Any, record: Any, sampler: Any, above: Any) -> tuple[Any, Any]:
        """Radiance that one path from each first hit finds of what is brighter than `above`, in any colour,
        and seen by perfect mirrors and clear surfaces alone: what `radiance_along` leaves out on request.

        And the number of mirrors and clear surfaces before the last that it has found.
        """
        mi, dr, scene, max_depth = self.mi, self.dr, self.scene, self.render_scene.max_depth

        def lengthen(*path: Any) -> tuple[Any, ...]:
            active, left, ray, hit, radiance, weight, last_bright, sampler = path
            choice, pair = sampler.next_1d(active), sampler.next_2d(active)
            sample, of_segment = hit.bsdf(ray).sample(self.context, hit, choice, pair, active)
            active &= mi.has_flag(sample.sampled_type, mi.BSDFFlags.Delta) & dr.any(of_segment != 0)
            ray = hit.spawn_ray(hit.to_world(sample.wo))
            hit, weight = scene.ray_intersect(ray, active), weight * of_segment
            shines = dr.select(active, hit.emitter(scene, active).eval(hit, active), 0)
            is_bright = dr.max(shines) > above
            radiance += dr.select(is_bright, weight * shines, 0)
            last_bright = dr.select(is_bright, longest - left, last_bright)
            return active & hit.is_valid(), left - 1, ray, hit, radiance, weight, last_bright, sampler

        hit = record.compute_surface_interaction(ray, mi.RayFlags.All, True)
        longest, left = (dr.opaque(mi.UInt32, depth) for depth in (max_depth, max_depth - 1))
        path = hit.is_valid(), left, mi.Ray3f(ray), hit, mi.Spectrum(0), mi.Spectrum(1), mi.UInt32(0), sampler
        path = dr.while_loop(path, lambda active, left, *_: active & (left > 0), lengthen)
        return path[4], path[6]

    def radiance_along(
        self, ray: Any, record: Any, sampler: Any, left_out: tuple[Any, Any] | None = None
    ) -> Any:
        """Radiance (linear sRGB, luminance in cd/m^2) that one path from each first hit estimates.

        What the first hit shines itself is left out, but not what shines from all around where nothing is
        hit. A path is split at the first hit, where `STRATA` x `STRATA` points of each lamp and `BOUNCES`
        directions are followed, each as one path. Of `left_out`, whether for each ray and the radiance above
        which, `mirrored_radiance` is left out too.
        """
        mi, dr, max_depth = self.mi, self.dr, self.render_scene.max_depth
        hidden_above = mi.Float(dr.inf) if left_out is None else dr.select(*left_out, dr.inf)
        hit = record.compute_surface_interaction(ray, mi.RayFlags.All, True)
        is_hit = hit.is_valid()
        radiance = self._surroundings_seen(hit, ~is_hit)
        if max_depth == 1:
            return radiance
        bsdf = hit.bsdf(ray)
        radiance += self._direct_light(hit, bsdf, sampler, is_hit, STRATA, BOUNCES)
        left = dr.opaque(mi.UInt32, max_depth - 2)  # as data, so that paths of all lengths share one kernel
        for bounce in range(BOUNCES):
            segment = self._next_segment(hit, bsdf, sampler, is_hit, hidden_above, bounce)
            ray, end, active, emitted, weight, still_hidden = segment
            path = active, left, ray, end, emitted, mi.Spectrum(1), still_hidden, sampler
            if max_depth > 2:
                # A loop also for short paths: it is as fast as unrolled segments.
                path = dr.while_loop(path, lambda active, left, *_: active & (left > 0), self._lengthen)
            *_, light, _, _, sampler = path
            radiance += weight * light / BOUNCES
        return radiance

    def _lengthen(self, *path: Any) -> tuple[Any, ...]:
        """Paths with one more segment, unless Russian roulette (Arvo and Kirk 1990) ends them.

        `ray` and `hit` are of the last segment, `radiance` is what all segments from the second hit on have
        brought so far, and `throughput` what share of the light that leaves `hit` arrives at the path's
        beginning. Paths that are active have `left` more segments at most.
        """
        active, left, ray, hit, radiance, throughput, hidden_above, sampler = path
        dr, bsdf = self.dr, hit.bsdf(ray)
        direct = throughput * self._direct_light(hit, bsdf, sampler, active)
        segment = self._next_segment(hit, bsdf, sampler, active, hidden_above)
        ray, hit, active, emitted, weight, hidden_above = segment
        throughput = throughput * weight
        radiance = radiance + direct + throughput * emitted
        left = left - 1
        active &= dr.any(throughput != 0) & (left > 0)
        largest = dr.max(throughput)
        is_faint = active & (largest < ROULETTE_THROUGHPUT)
        # Only faint paths draw a number, so that the others are those without roulette.
        active &= ~is_faint | (sampler.next_1d(is_faint) * ROULETTE_THROUGHPUT < largest)
        throughput = dr.select(is_faint, throughput * (ROULETTE_THROUGHPUT / largest), throughput)
        return active, left, ray, hit, radiance, throughput, hidden_above, sampler

    def _direct_light(
        self, hit: Any, bsdf: Any, sampler: Any, active: Any, side: int = 1, bounces: int = 1
    ) -> Any:
        """Light straight from all lamps, from `side` x `side` points of each, that leaves `hit` backwards."""
        mi, dr, radiance = self.mi, self.dr, self.mi.Spectrum(0)
        scatters = active & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
        for lamp, cell in product(self.aimed_at, np.ndindex(side, side)):
            point = (mi.Vector2f(*cell) + sampler.next_2d(active)) / side
            towards, weight = lamp.sample_direction(hit, point, scatters)
            able = scatters & (towards.pdf != 0)
            blocked = self.scene.ray_test(hit.spawn_ray_to(towards.p), able)
            value, pdf = bsdf.eval_pdf(self.context, hit, hit.to_local(towards.d), able)
            mis_weight = dr.select(towards.delta, 1, _power_heuristic(side**2 * towards.pdf, bounces * pdf))
            radiance += dr.select(able & ~blocked, value * weight * mis_weight, 0) / side**2
        return radiance

    def _next_segment(
        self, hit: Any, bsdf: Any, sampler: Any, active: Any, hidden_above: Any, bounce: int | None = None
    ) -> tuple[Any, ...]:
        """The segment that leaves `hit`, the first one as number `bounce`, in a direction that `bsdf` chose.

        Its ray, its end, whether a path goes on from there, what shines there, weighted against aiming at it,
        the share of the light along the ray that leaves `hit`, and `hidden_above` from there on.
        """
        side, bounces = (1, 1) if bounce is None else (STRATA, BOUNCES)
        mi, dr, place = self.mi, self.dr, self.mi.Interaction3f(hit)
        across = sampler.next_2d(active)
        across.x = (across.x + (bounce or 0)) / bounces
        sample, weight = bsdf.sample(self.context, hit, sampler.next_1d(active), across, active)
        active = active & dr.any(weight != 0)
        ray = hit.spawn_ray(hit.to_world(sample.wo))
        arrival = self.scene.ray_intersect(ray, active)
        lamp = arrival.emitter(self.scene, active)
        towards = mi.DirectionSample3f(self.scene, arrival, place)
        # Lamps could have been aimed at instead, but not evenly lit surroundings behind everything.
        is_mirrored = mi.has_flag(sample.sampled_type, mi.BSDFFlags.Delta)
        could_be_aimed_at, hidden_above = ~is_mirrored, dr.select(is_mirrored, hidden_above, dr.inf)
        if self.aimed_at == self.lamps:
            could_be_aimed_at &= arrival.is_valid()
        pdf_lamp = side**2 * lamp.pdf_direction(place, towards, active)
        mis_weight = dr.select(could_be_aimed_at, _power_heuristic(bounces * sample.pdf, pdf_lamp), 1)
        shines = lamp.eval(arrival, active)
        emitted = dr.select(active & ~(dr.max(shines) > hidden_above), shines * mis_weight, 0)
        goes_on, weight = active & arrival.is_valid(), dr.select(active, weight, 0)
        return ray, arrival, goes_on, emitted, weight, hidden_above


def _power_heuristic(pdf: Any, other: Any) -> Any:
    """Weight of a sample that two ways could have given: the power heuristic with exponent 2.

    Of the ratio, since the square of a density has no room in single precision where a lamp is met edge-on.
    """
    ratio = other / pdf
    return 1 / (1 + ratio * ratio)
