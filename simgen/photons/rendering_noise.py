"""How many samples a dense rendering needs for its noise not to show in the photon counts.

Counts drawn from a rendered view have the view's noise besides their own: a rate that is off by a random
amount of variance v makes counts whose variance is larger by v. That share of the Poisson variance is
to stay below `NOISE_SHARE`, so dimmer light needs fewer samples. The paths of a pixel are spread evenly and
vary less than independent ones, of which that is said. A budget is divided by a view's light, whose own
standard error is to stay below `NORMALISER_ERROR`.

That is a forecast, by a probe of few paths and by what is known of all that shines in view. Each view is then
rendered in two halves, whose difference tells the noise that there is: see `photon_counting.draw_from_views`.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from pcii.core.camera_grid import CameraGrid
from pcii.core.photon_limit import sense
from simgen.base import random_streams as seeds
from simgen.cameras.rig import corners, with_larger_pixels
from simgen.photons.candidates import Setup
from simgen.photons.emission_sampler import EmissionSampler
from simgen.photons.pilot import EXPLORATION_SEED
from simgen.renderer.mitsuba_scene import RenderScene
from simgen.renderer.radiance import render_view
from simgen.truth.first_hits import first_hits_of_view

NOISE_SHARE = 0.01
NORMALISER_ERROR = 0.003
PROBE_PX = 64
"""The probe renders a film of so few pixels across, twice."""
PROBE_SAMPLES = 64
AIMED_POINTS = 1 << 13
"""Points of what shines in view, by which its light and its share of the film are known."""
DEPTHS = 64
"""Depths are rounded to so many equal steps of disparity."""


@dataclass(frozen=True)
class Probe:
    """Of one pixel seen by the sensor: mean radiance, and variance of a single path, averaged over a view."""

    mean: float
    variance: float

    def photon_noise(self, photons_per_radiance: float, samples: int) -> float:
        """Variance that rendering adds to counts, as a share of their Poisson variance."""
        if self.mean <= 0:
            return 0.0
        return photons_per_radiance * self.variance / (samples * self.mean)

    def light_error(self, paths: int) -> float:
        """Standard error of the light that so many paths find, as a share of it."""
        return math.sqrt(self.variance / paths) / self.mean if self.mean > 0 else 0.0

    def samples_for(self, photons_per_radiance: float, pixels: int | None = None) -> int:
        """Samples per pixel that keep the noise below `NOISE_SHARE`, however many these are.

        With a budget that is counted over so many `pixels`, enough for `NORMALISER_ERROR` too.
        """
        noise = math.ceil(self.photon_noise(photons_per_radiance, 1) / NOISE_SHARE)
        error = 0.0 if pixels is None else self.light_error(pixels) / NORMALISER_ERROR
        return max(noise, math.ceil(error**2), 1)


def probe(render_scene: RenderScene, grid: CameraGrid, cfa: str | None, seed: int) -> Probe:
    """A coarse look from the virtual centre; its pixels are larger, so it rather sees too much noise."""
    small = replace(_coarse(grid), rows=1, cols=1)
    first, second = (
        sense(
            render_view(
                render_scene,
                small,
                0,
                0,
                samples_per_pixel=PROBE_SAMPLES,
                seed=seeds.integer(seed, stage="plan probe", part=part),
                independent=True,
            ),
            cfa,
        ).astype(np.float64)
        for part in range(2)
    )
    # Half the squared difference of two means of n samples is 1 / n of one sample's variance.
    variance = PROBE_SAMPLES * ((first - second) ** 2).mean() / 2
    missed_mean, missed_variance = _missed(render_scene, small, cfa, grid)
    return Probe(float((first + second).mean() / 2) + missed_mean, float(variance) + missed_variance)


def _missed(
    render_scene: RenderScene, small: CameraGrid, cfa: str | None, grid: CameraGrid
) -> tuple[float, float]:
    """Mean radiance of a pixel, and variance of a path, that the probe's paths are likely not to have met.

    A surface of radiance L that fills the share a of a pixel, small beside 1, has the mean a L and the
    variance a L^2. The probe misses it with the probability exp(-n) if n of its paths hit it on average.
    """
    centre = replace(grid, rows=1, cols=1)
    emission = EmissionSampler(Setup(render_scene, centre, cfa, 1))
    if not emission.mass:
        return 0.0, 0.0
    rng = seeds.generator(EXPLORATION_SEED, stage="aimed pilot", part=2)
    arriving = emission.arriving(np.zeros(AIMED_POINTS, dtype=np.int64), rng)
    pixels, paths = grid.height * grid.width, 2 * PROBE_SAMPLES * small.height * small.width
    light = emission.mass / AIMED_POINTS / pixels  # of each that arrives, per pixel
    number = len(emission.surfaces)
    film_share = np.bincount(arriving.surface, light / arriving.radiance, minlength=number)
    unmet = np.exp(-paths * film_share)[arriving.surface]
    return float(light * unmet.sum()), float(light * (unmet * arriving.radiance).sum())


def first_hit_depths_mm(render_scene: RenderScene, grid: CameraGrid) -> tuple[float, ...]:
    """Up to `DEPTHS` depths in mm, of what a coarse look from the corner cameras finds; inf for nothing."""
    hits = [first_hits_of_view(render_scene, _coarse(grid), k, l) for k, l in corners(grid)]
    z_mm = np.concatenate([of_view.z_mm.ravel() for of_view in hits])
    nearest = float(z_mm.min())
    if not nearest < math.inf:
        return (math.inf,)
    steps = np.unique(np.rint(DEPTHS * nearest / z_mm.astype(np.float64)))
    return tuple((DEPTHS * nearest / steps[steps > 0]).tolist())


def _coarse(grid: CameraGrid) -> CameraGrid:
    """The same cameras with the same field of view on few pixels."""
    return with_larger_pixels(grid, max(grid.height, grid.width) / PROBE_PX, least_px=2)
