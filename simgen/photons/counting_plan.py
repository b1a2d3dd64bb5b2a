"""How photon counts will be made: thinned one by one, or drawn from rendered views, whichever costs less.

Neither has rendering noise to speak of. Counts drawn from a rendered view have the view's noise besides
their own: a rate that is off by a random amount of variance v makes counts whose variance is larger by v.
That share of the Poisson variance is to stay below `MAX_NOISE_SHARE`, so dimmer light needs fewer samples.
A budget is divided by a view's light, whose own standard error is to stay below `MAX_NORMALISER_ERROR`.
Both are forecast by a probe of few paths and by what is known of all that shines in view; paths of a view
are spread more evenly than these, and vary less. Each view is rendered in two halves, whose difference
tells the noise that there is (see `draw_from_views`).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from pcii.base import InputError
from pcii.types import sense
from simgen.base import random_streams as seeds
from simgen.photons.bright_light import LEAST_SHARE, BrightLight, lit_light, mirrored_light, straight_light
from simgen.photons.candidates import EXPLORATION_SEED, Capture
from simgen.photons.exploration import Plan, explore, sampler_of_films
from simgen.photons.thinning import MAX_SINGLE_PHOTONS
from simgen.renderer import render_view
from simgen.spec import MOST_PATHS

PHOTON_COST, SAMPLE_COST, PIXEL_COST = 1.5, 0.065, 0.015
"""Microseconds for a photon drawn by thinning, and for a sample and a pixel of a dense view, as measured by
`make bench` on two cores; only their ratios matter."""
SCALAR_PHOTON_COST, SCALAR_SAMPLE_COST = 77.0, 0.3
"""The same without a compiled backend."""
UNBOUNDED = "rare light paths, as by mirrors, are too bright for single photons"
DEPTH_STEPS = 64
"""Depths are rounded to equal steps of disparity, this many up to the nearest."""
MAX_THINNED_PHOTONS = 1e10
"""Largest number of photons that are thinned, which takes two cores four hours, as a hundred views of
`MOST_PATHS` do."""
MAX_NOISE_SHARE = 0.01
"""Largest variance that rendering adds to counts, as a share of their Poisson variance."""
MAX_NORMALISER_ERROR = 0.003
"""Largest standard error of the light that a budget is divided by, as a share of it."""
PROBE_SAMPLES = 64
"""Samples per pixel of each of the two halves of the probe."""
MIN_CAUSE_SHARE = 0.1
"""Least share of the noise that bright light has to make to be named as its cause: where the probe has met a
small lamp a few times its variance is too large by several times."""


class Probe(NamedTuple):
    """Of one pixel seen by the sensor: mean radiance, and variance of a single path, averaged over a view.

    `bright_light` is all bright light that is known, which both count in.
    """

    mean: float
    variance: float
    bright_light: tuple[BrightLight, ...] = ()

    def photon_noise(self, photons_per_radiance: float, samples: int) -> float:
        """Variance that rendering adds to counts, as a share of their Poisson variance."""
        return photons_per_radiance * self.variance / (samples * self.mean) if self.mean > 0 else 0.0

    def light_error(self, paths: int) -> float:
        """Standard error of the light that `paths` find, as a share of it."""
        return math.sqrt(self.variance / paths) / self.mean if self.mean > 0 else 0.0

    def samples_for(self, photons_per_radiance: float, pixels: int | None = None) -> int:
        """Samples per pixel that keep the noise below `MAX_NOISE_SHARE`, however many these are.

        With a budget that is counted over `pixels`, enough for `MAX_NORMALISER_ERROR` too.
        """
        noise = math.ceil(self.photon_noise(photons_per_radiance, 1) / MAX_NOISE_SHARE)
        error = 0.0 if pixels is None else self.light_error(pixels) / MAX_NORMALISER_ERROR
        return max(noise, math.ceil(error**2), 1)

    def why_noisy(self, pixels: int) -> str:
        """A clause on the bright light that makes most of the noise of a film of `pixels`, if any does."""
        worst = max(self.bright_light, key=lambda row: _noise([row]), default=None)
        if worst is None or _noise([worst]) < MIN_CAUSE_SHARE * self.variance * pixels:
            return ""
        share = worst.light / (self.mean * pixels)
        return (
            f", as {worst.what} gives {share:.0%} of the light from {worst.image_px:.2g} px of a film; make "
            "it larger and as much dimmer, or leave it out"
        )


def probe(capture: Capture, seed: int, known_rows: Sequence[BrightLight] = ()) -> Probe:
    """A coarse look from the virtual centre; its pixels are larger, so it rather sees too much noise.

    What is known of bright light and its paths have likely not met is added, or what an exploration found of
    it, `known_rows`, whichever has more noise: light that fills n pixels with the radiance L adds n L to the
    sum over the pixels, and n L^2 to the variance.
    """
    small, pixels = replace(capture.coarse_grid, rows=1, cols=1), capture.pixels
    samples = {"samples_per_pixel": PROBE_SAMPLES, "independent": True}
    halves = [seeds.integer(seed, stage="plan probe", part=part) for part in (0, 1)]
    views = (render_view(capture.render_scene, small, 0, 0, seed=half, **samples) for half in halves)
    first, second = (sense(view, capture.cfa).astype(np.float64) for view in views)
    # Half the squared difference of two means of n samples is 1 / n of one sample's variance.
    variance = PROBE_SAMPLES * ((first - second) ** 2).mean() / 2
    mean = float((first + second).mean() / 2)
    film_light, paths = mean * pixels, 2 * PROBE_SAMPLES * small.height * small.width
    known = straight_light(capture) + lit_light(sampler_of_films(capture), film_light, paths)[0]
    known += mirrored_light(capture, film_light, paths, with_straight=True)
    bright = max(known, list(known_rows), key=_noise)
    # The part of each that this many paths have not met, on average.
    missed = [row._replace(light=row.light * math.exp(-row.hits(paths, pixels))) for row in bright]
    # Of light in a single pixel two halves tell the variance badly, even if both have met it.
    variance = max(float(variance) + _noise(missed) / pixels, _noise(bright) / pixels)
    return Probe(mean + sum(row.light for row in missed) / pixels, variance, tuple(bright))


def _noise(rows: Sequence[BrightLight]) -> float:
    """Variance of a single path, summed over the film's pixels."""
    return sum(row.light * row.radiance for row in rows)


def plan_counts(
    capture: Capture, kind: str, min_samples: int = 1, *, may_explore: Callable[[Plan], bool] = lambda _: True
) -> Plan:
    """Thin, or render densely, whichever takes less time for counts without rendering noise.

    Thinning takes time with the photons. Dense rendering takes it with the pixels and with the samples that
    each needs, which are more the more light there is. A probe of the light tells how many, unless a budget
    is so small that one sample for each pixel takes longer than all its photons. What is to be thinned is
    explored first, if it `may_explore` (memory may not suffice), and rendered where the light has no bound.
    The seed has no part in it. `kind` is that of the backend; views that are rendered in any case have
    `min_samples` per pixel. Raises `InputError` for nested budgets of too many photons, and for more photons
    than can be made in either way.
    """
    budget, why_rendered = capture.budget_per_view, capture.render_scene.why_rendered
    is_small = budget is not None and _are_few(capture, budget) and _thins(capture, kind, budget, min_samples)
    if budget is not None and is_small and not why_rendered:
        plan = Plan(True, min_samples, budget, depths_mm=_few_depths_mm(capture.coarse_z_mm))
    else:
        plan = _plan_by_probe(capture, kind, min_samples, why_rendered)
    if not plan.thins or not may_explore(plan):
        return plan
    explored = explore(capture, plan)
    if explored.thins:
        return explored
    return _plan_by_probe(capture, kind, min_samples, UNBOUNDED, explored.bright_light)


def _thins(capture: Capture, kind: str, photons: float, samples: int) -> bool:
    """Whether thinning `photons` of a view takes no more time than rendering it with `samples` per pixel."""
    photon_cost, sample_cost = PHOTON_COST, SAMPLE_COST
    if kind == "scalar":
        photon_cost, sample_cost = SCALAR_PHOTON_COST, SCALAR_SAMPLE_COST
    return photon_cost * photons <= (sample_cost * samples + PIXEL_COST) * capture.pixels


def _are_few(capture: Capture, photons: float) -> bool:
    """Whether this number of photons in each view can be kept one by one."""
    return photons * capture.grid.view_count <= MAX_SINGLE_PHOTONS


def _plan_by_probe(
    capture: Capture, kind: str, min_samples: int, why_rendered: str, bright_light: Sequence[BrightLight] = ()
) -> Plan:
    """The cheaper way, or with a reason `why_rendered` the dense one; see `probe` for `bright_light`."""
    probed = probe(capture, EXPLORATION_SEED, bright_light)
    pixels, views = capture.pixels, capture.grid.view_count
    photons, gain = capture.budget_per_view, capture.photons_per_radiance
    if photons is None:
        assert gain is not None
        photons = gain * probed.mean * pixels
    else:
        gain = photons / (pixels * probed.mean) if probed.mean > 0 else 0.0
    samples = max(probed.samples_for(gain, capture.budget_pixels), min_samples)
    if capture.photons.nested and not _are_few(capture, photons):
        raise InputError(
            f"photons.nested: {photons * views:.3g} photons are too many to be told apart; "
            f"at most {MAX_SINGLE_PHOTONS} can be"
        )
    # Where the virtual centre sees no light there may be none at all, which rendered views show at once.
    may_thin = not why_rendered and probed.mean > 0
    max_thinned = MAX_THINNED_PHOTONS / views if may_thin else 0.0
    max_samples = (MOST_PATHS - 1) // pixels
    is_better = _thins(capture, kind, photons, samples) or samples > max_samples
    thins = may_thin and photons <= max_thinned and is_better
    if not thins and samples > max_samples:
        most = 0.95 * max(max_thinned, photons * max_samples / samples)  # two digits are off by up to 5 %
        name = "exposure" if capture.photons.scope == "exposure" else "photons.budget"
        raise InputError(
            f"{name}: {photons:.3g} photons per view are more than can be made without rendering noise; "
            f"at most {most:.2g} can be{probed.why_noisy(pixels)}"
        )
    budget_pixels, least_light = capture.budget_pixels, LEAST_SHARE * probed.mean * pixels
    return Plan(
        thins,
        samples,
        photons,
        keeps_origins=_are_few(capture, photons),
        why_rendered=why_rendered,
        noise=probed.photon_noise(gain, samples),
        normaliser_error=0.0 if budget_pixels is None else probed.light_error(samples * budget_pixels),
        depths_mm=_few_depths_mm(capture.coarse_z_mm) if thins else (),
        bright_light=tuple(row for row in probed.bright_light if row.light >= least_light),
    )


def _few_depths_mm(z_mm: np.ndarray) -> tuple[float, ...]:
    """Depths (N,) in mm rounded to `DEPTH_STEPS` at most; inf where there is nothing."""
    nearest = float(z_mm.min())
    if not nearest < math.inf:
        return (math.inf,)
    steps = np.unique(np.rint(DEPTH_STEPS * nearest / z_mm.astype(np.float64)))
    return tuple((DEPTH_STEPS * nearest / steps[steps > 0]).tolist())
