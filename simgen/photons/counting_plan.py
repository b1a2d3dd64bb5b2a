"""How photon counts will be made: thinned one by one, or drawn from rendered views, and what led to it.

Counts drawn from a rendered view have the view's noise besides their own: a rate that is off by a random
amount of variance v makes counts whose variance is larger by v. That share of the Poisson variance is to
stay below `MAX_NOISE_SHARE`, so dimmer light needs fewer samples. A budget is divided by a view's light,
whose own standard error is to stay below `MAX_NORMALISER_ERROR`. Both are forecast here, by a probe of few
paths and by what is known of all that shines in view; the paths of a view are spread more evenly than the
probe's, and vary less. Each view is then rendered in two halves, whose difference tells the noise that there
is (see `photon_counting.draw_from_views`).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from pcii.base.errors import InputError
from pcii.types.camera_grid import CameraGrid
from pcii.types.photon_limit import sense
from simgen.base import random_streams as seeds
from simgen.cameras.rig import Rig
from simgen.photons.bright_light import LEAST_SHARE, BrightLight, lit_light, mirrored_light, straight_light
from simgen.photons.candidates import Setup
from simgen.photons.exploration import Exploration, explore, sampler_of_films
from simgen.photons.scopes import Scopes
from simgen.photons.thinning import MAX_SINGLE_PHOTONS
from simgen.renderer.radiance import render_view
from simgen.spec.recipe import MOST_PATHS, Photons

MAX_NOISE_SHARE = 0.01
MAX_NORMALISER_ERROR = 0.003
PHOTON_COST, SAMPLE_COST, PIXEL_COST = 1.5, 0.065, 0.015
"""Microseconds for a photon drawn by thinning, and for a sample and a pixel of a dense view, as measured by
`make bench` on two cores; only their ratios matter."""
SCALAR_PHOTON_COST, SCALAR_SAMPLE_COST = 77.0, 0.3
"""The same without a compiled backend."""
UNBOUNDED = "rare light paths, as by mirrors, are too bright for single photons"
PROBE_SEED = 0
"""The probe measures the scene, and its paths enter no data. With one seed for all, recipes that differ in
nothing else are made alike: all with the origins of photons or all without."""
PROBE_SAMPLES = 64
DEPTH_STEPS = 64
"""Depths are rounded to equal steps of disparity, this many up to the nearest."""
MAX_THINNED_PHOTONS = 1e10
"""Largest number of photons that are thinned, which takes two cores four hours, as a hundred views of
`MOST_PATHS` do."""


@dataclass(frozen=True, eq=False)
class Capture:
    """What decides which photons arrive where: cameras, Bayer pattern, budget or exposure, and the seed.

    `photons_per_radiance` are those that a pixel catches of a unit of radiance; None unless photons are
    counted over an exposure. `dark_map` is what pixels count without any, as of `detect`.
    """

    rig: Rig
    cfa: str | None
    photons: Photons
    photons_per_radiance: float | None
    seed: int
    dark_map: np.ndarray | None = None

    @property
    def grid(self) -> CameraGrid:
        """The cameras as they ought to be."""
        return self.rig.grid

    @cached_property
    def scopes(self) -> Scopes:
        """What the photons are counted over."""
        return Scopes(self.photons, self.grid, self.cfa, self.photons_per_radiance)


@dataclass(frozen=True)
class Plan:
    """How the counts will be made, and what led to it."""

    thins: bool
    samples: int
    """Samples per pixel of the dense views that the counts are drawn from, or would need at least."""
    photons_per_view: float
    keeps_origins: bool = True
    """Whether photons are few enough to be kept one by one, each with its origin, if they are thinned."""
    why_rendered: str = ""
    """A clause on why photons cannot be thinned, whatever that costs; "" if they could be."""
    noise: float = 0.0
    """Variance that rendering adds to dense counts, as a share of their Poisson variance."""
    normaliser_error: float = 0.0
    """Standard error of the light that a dense view's budget is divided by, as a share of it."""
    depths_mm: tuple[float, ...] = ()
    """Some of the depths that the corner cameras see, if photons are thinned."""
    bright_light: tuple[BrightLight, ...] = ()
    """Bright light that few paths meet, and that the forecast of rendered views counts in."""
    explored: Exploration | None = field(default=None, compare=False)
    """What is known of the light, if photons are thinned."""


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


def plan(
    capture: Capture,
    setup: Setup,
    kind: str,
    min_samples: int = 1,
    *,
    may_explore: Callable[[Plan], bool] = lambda _: True,
) -> Plan:
    """Thin, or render densely, whichever takes less time for counts without rendering noise.

    Thinning takes time with the photons. Dense rendering takes it with the pixels and with the samples that
    each needs, which are more the more light there is. A probe of the light tells how many, unless a budget
    is so small that one sample for each pixel takes longer than all its photons. What is to be thinned is
    explored first, if it `may_explore` (memory may not suffice), and rendered where the light has no bound.
    The seed has no part in it (see `PROBE_SEED`). `kind` is that of the backend; views that are rendered in
    any case have `min_samples` per pixel. Raises `InputError` for nested budgets of too many photons, and
    for more photons than can be made in either way.
    """
    scopes, why_rendered = capture.scopes, setup.render_scene.why_rendered
    cheaper = _choose_cheaper(scopes, setup, kind, min_samples, why_rendered)
    if not cheaper.thins or not may_explore(cheaper):
        return cheaper
    explored = explore(setup, scopes.photons, scopes.photons_per_radiance)
    if not explored.is_bounded:
        return _choose_cheaper(scopes, setup, kind, min_samples, UNBOUNDED, explored.unmet)
    return replace(cheaper, explored=explored)


def probe(setup: Setup, seed: int, found: Sequence[BrightLight] = ()) -> Probe:
    """A coarse look from the virtual centre; its pixels are larger, so it rather sees too much noise.

    What is known of bright light and its paths have likely not met is added, or what an exploration `found`
    of it, whichever has more noise: light that fills n pixels with the radiance L adds n L to the sum over
    the pixels, and n L^2 to the variance.
    """
    grid = setup.grid
    small, pixels = replace(setup.coarse_grid, rows=1, cols=1), grid.height * grid.width

    def mosaic(part: int) -> np.ndarray:
        view_seed = seeds.integer(seed, stage="plan probe", part=part)
        samples = {"samples_per_pixel": PROBE_SAMPLES, "independent": True}
        view = render_view(setup.render_scene, small, 0, 0, seed=view_seed, **samples)
        return sense(view, setup.cfa).astype(np.float64)

    first, second = mosaic(0), mosaic(1)
    # Half the squared difference of two means of n samples is 1 / n of one sample's variance.
    variance = PROBE_SAMPLES * ((first - second) ** 2).mean() / 2
    mean = float((first + second).mean() / 2)
    film_light, paths = mean * pixels, 2 * PROBE_SAMPLES * small.height * small.width
    known = straight_light(setup) + lit_light(setup, sampler_of_films(setup), film_light, paths)[0]
    known += mirrored_light(setup, film_light, paths, with_straight=True)
    bright = max(known, list(found), key=_noise)
    missed = _missed(bright, paths, pixels)
    # Of light in a single pixel two halves tell the variance badly, even if both have met it.
    variance = max(float(variance) + _noise(missed) / pixels, _noise(bright) / pixels)
    return Probe(mean + sum(row.light for row in missed) / pixels, variance, tuple(bright))


def _missed(rows: Sequence[BrightLight], paths: float, pixels: int) -> list[BrightLight]:
    """The part of each row that this many paths have not met, on average."""
    return [row._replace(light=row.light * math.exp(-row.hits(paths, pixels))) for row in rows]


def _noise(rows: Sequence[BrightLight]) -> float:
    """Variance of a single path, summed over the film's pixels."""
    return sum(row.light * row.radiance for row in rows)


def _choose_cheaper(
    scopes: Scopes,
    setup: Setup,
    kind: str,
    min_samples: int,
    why_rendered: str,
    found: Sequence[BrightLight] = (),
) -> Plan:
    """The cheaper way, or with a reason `why_rendered` the dense one; see `probe` for what was `found`."""
    grid = scopes.grid
    pixels = grid.height * grid.width
    photon_cost, sample_cost = PHOTON_COST, SAMPLE_COST
    if kind == "scalar":
        photon_cost, sample_cost = SCALAR_PHOTON_COST, SCALAR_SAMPLE_COST

    def is_cheaper(photons: float, samples: int) -> bool:
        return photon_cost * photons <= (sample_cost * samples + PIXEL_COST) * pixels

    def are_few(photons: float) -> bool:
        return photons * grid.view_count <= MAX_SINGLE_PHOTONS

    budget, gain = scopes.photons_per_view, scopes.photons_per_radiance
    if budget is not None and not why_rendered and are_few(budget) and is_cheaper(budget, min_samples):
        return Plan(True, min_samples, budget, depths_mm=_few_depths_mm(setup.coarse_z_mm))
    probed = probe(setup, PROBE_SEED, found)
    # The virtual centre tells how many photons an exposure has, and what a unit of radiance has of a budget.
    if gain is None:
        assert budget is not None
        per_view, gain = budget, budget / (pixels * probed.mean) if probed.mean > 0 else 0.0
    else:
        per_view = gain * probed.mean * pixels
    samples = max(probed.samples_for(gain, scopes.pixels), min_samples)
    if scopes.photons.nested and not are_few(per_view):
        raise InputError(
            f"photons.nested: {per_view * grid.view_count:.3g} photons are too many to be told apart; "
            f"at most {MAX_SINGLE_PHOTONS} can be"
        )
    # Where the virtual centre sees no light there may be none at all, which rendered views show at once.
    may_thin = not why_rendered and probed.mean > 0
    max_thinned = MAX_THINNED_PHOTONS / grid.view_count if may_thin else 0.0
    max_samples = (MOST_PATHS - 1) // pixels
    is_better = is_cheaper(per_view, samples) or samples > max_samples
    thins = may_thin and per_view <= max_thinned and is_better
    if not thins and samples > max_samples:
        most = 0.95 * max(max_thinned, per_view * max_samples / samples)  # two digits are off by up to 5 %
        name = "photons.budget" if budget is not None else "exposure"
        raise InputError(
            f"{name}: {per_view:.3g} photons per view are more than can be made without rendering noise; "
            f"at most {most:.2g} can be{_why_noisy(probed, pixels)}"
        )
    noise = probed.photon_noise(gain, samples)
    error = 0.0 if scopes.pixels is None else probed.light_error(samples * scopes.pixels)
    depths_mm = _few_depths_mm(setup.coarse_z_mm) if thins else ()
    bright_light = tuple(
        row for row in probed.bright_light if row.light >= LEAST_SHARE * probed.mean * pixels
    )
    how = thins, samples, per_view, are_few(per_view), why_rendered, noise, error, depths_mm
    return Plan(*how, bright_light)


def _why_noisy(probed: Probe, pixels: int) -> str:
    """A clause on the bright light that makes most of the noise, if any does."""
    worst = max(probed.bright_light, key=lambda row: _noise([row]), default=None)
    # Where the probe has met a small lamp a few times its variance is too large by several times.
    if worst is None or _noise([worst]) < probed.variance * pixels / 10:
        return ""
    share = worst.light / (probed.mean * pixels)
    return (
        f", as {worst.what} gives {share:.0%} of the light from {worst.image_px:.2g} px of a film; make it "
        "larger and as much dimmer, or leave it out"
    )


def _few_depths_mm(z_mm: np.ndarray) -> tuple[float, ...]:
    """Depths (N,) in mm rounded to `DEPTH_STEPS` at most; inf where there is nothing."""
    nearest = float(z_mm.min())
    if not nearest < math.inf:
        return (math.inf,)
    steps = np.unique(np.rint(DEPTH_STEPS * nearest / z_mm.astype(np.float64)))
    return tuple((DEPTH_STEPS * nearest / steps[steps > 0]).tolist())
