"""Light paths, one for each of many camera rays at once: unbiased radiance and what was hit first.

The estimator is path tracing with next-event estimation (Kajiya 1986) and multiple importance sampling
by the power heuristic (Veach 1997). At every hit each lamp is sampled, instead of one lamp
chosen at random: a candidate photon is accepted in proportion to its path's radiance, so the less that
varies, the fewer candidates are needed. Needs a compiled backend.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from pcii.types import CameraGrid
from simgen.backend import load_drjit
from simgen.build import Built
from simgen.cameras import camera_x_mm, camera_y_mm

STRATA = 2
"""At the first hit each lamp is sampled in 2 x 2 cells of its surface: what is near varies most."""


@dataclass(frozen=True)
class Rays:
    """Camera rays (N,): camera (k, l) and the point of its film in px, pixel centres at integers."""

    k: np.ndarray
    l: np.ndarray
    row_px: np.ndarray
    col_px: np.ndarray


@dataclass(frozen=True)
class Paths:
    """What the rays brought: `radiance` (N, 3) float32, first hit's `object_id` (N,) and `z_mm` (N,)."""

    radiance: np.ndarray
    object_id: np.ndarray
    z_mm: np.ndarray


def trace(built: Built, grid: CameraGrid, rays: Rays, *, max_depth: int, seed: int) -> Paths:
    """One path for each ray; linear radiance whose luminance is in cd/m^2, z +inf for a miss.

    The same bytes for the same rays, in the same order, and the same seed.
    """
    mi, dr = built.mi, load_drjit()
    if rays.k.size == 0:
        return Paths(np.zeros((0, 3), np.float32), np.zeros(0, np.int16), np.zeros(0, np.float32))
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(seed, rays.k.size)
    radiance, shape, z = _estimate(mi, dr, built.scene, _camera_rays(mi, dr, grid, rays), sampler, max_depth)
    dr.eval(radiance, shape, z)
    numbers = np.array(shape)
    return Paths(
        np.array(radiance).T,
        built.object_of_shape[numbers],
        np.where(numbers > 0, np.array(z), np.float32(np.inf)),
    )


def _camera_rays(mi: Any, dr: Any, grid: CameraGrid, rays: Rays) -> Any:
    """Rays through points of the film: to the right is +X, downwards +Y, straight ahead +Z."""
    per_px = grid.pixel_mm / grid.focal_mm
    x = (rays.col_px - (grid.width - 1) / 2) * per_px
    y = (rays.row_px - (grid.height - 1) / 2) * per_px
    origin = mi.Point3f(
        mi.Float(camera_x_mm(grid)[rays.l].astype(np.float32)),
        mi.Float(camera_y_mm(grid)[rays.k].astype(np.float32)),
        mi.Float(0),
    )
    towards = mi.Vector3f(mi.Float(x.astype(np.float32)), mi.Float(y.astype(np.float32)), mi.Float(1))
    return mi.RayDifferential3f(mi.Ray3f(origin, dr.normalize(towards)))


def _estimate(mi: Any, dr: Any, scene: Any, ray: Any, sampler: Any, max_depth: int) -> tuple[Any, Any, Any]:
    """Radiance, and number and z of the shape hit first, along each ray.

    The paths are unrolled into one kernel: `max_depth` is small.
    """
    context = mi.BSDFContext()
    radiance, throughput = mi.Spectrum(0), mi.Spectrum(1)
    active = mi.Bool(True)
    before = dr.zeros(mi.Interaction3f)  # where the ray came from: the camera, at first
    pdf, by_chance = mi.Float(1), mi.Bool(False)  # by_chance: lamps could have been sampled instead
    side = 1
    # Light from all around is found by following the surface's own scattering: for uniform
    # surroundings that has no variance but for what stands in the way.
    lamps = [light for light in scene.emitters() if not light.is_environment()]
    shape, z = mi.UInt32(0), mi.Float(0)
    for segment in range(1, max_depth + 1):
        hit = scene.ray_intersect(ray, active)
        if segment == 1:
            shape = dr.reinterpret_array(mi.UInt32, hit.shape)
            z = mi.Float(hit.p.z)
        lamp = hit.emitter(scene, active)
        towards = mi.DirectionSample3f(scene, hit, before)
        reached = by_chance & hit.is_valid()  # what lies behind everything is no lamp to be aimed at
        pdf_lamp = dr.select(reached, side**2 * lamp.pdf_direction(before, towards, active), 0)
        radiance += dr.select(active, throughput * lamp.eval(hit, active) * _share(pdf, pdf_lamp), 0)
        active &= hit.is_valid()
        if segment == max_depth:
            break
        bsdf = hit.bsdf(ray)
        side = STRATA if segment == 1 else 1
        for light in lamps:
            for cell in np.ndindex(side, side):
                point = (mi.Vector2f(*cell) + sampler.next_2d(active)) / side
                direct = _direct(mi, dr, scene, light, hit, bsdf, context, point, side**2, active)
                radiance += throughput * direct / side**2
        sample, weight = bsdf.sample(context, hit, sampler.next_1d(active), sampler.next_2d(active), active)
        throughput *= weight
        active &= dr.any(throughput != 0)
        ray = hit.spawn_ray(hit.to_world(sample.wo))
        pdf = dr.select(sample.pdf > 0, sample.pdf, 1)
        by_chance = ~mi.has_flag(sample.sampled_type, mi.BSDFFlags.Delta)
        before = mi.Interaction3f(hit)
    return radiance, shape, z


def _direct(
    mi: Any,
    dr: Any,
    scene: Any,
    light: Any,
    hit: Any,
    bsdf: Any,
    context: Any,
    point: Any,
    tries: int,
    active: Any,
) -> Any:
    """Light that arrives straight from one lamp and is scattered towards where we came from."""
    able = active & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
    towards, weight = light.sample_direction(hit, point, able)
    able &= towards.pdf != 0
    blocked = scene.ray_test(hit.spawn_ray_to(towards.p), able)
    outgoing = hit.to_local(towards.d)
    value, pdf = bsdf.eval_pdf(context, hit, outgoing, able)
    share = dr.select(towards.delta, 1, _share(tries * towards.pdf, pdf))
    return dr.select(able & ~blocked, value * weight * share, 0)


def _share(own: Any, other: Any) -> Any:
    """Weight of a sample that two ways could have given: the power heuristic with exponent 2."""
    return own * own / (own * own + other * other)
