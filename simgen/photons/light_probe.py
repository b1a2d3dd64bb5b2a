"""A coarse look at a scene's light: how bright it is, how noisy rendered views of it are, and why.

Counts drawn from a rendered view have the view's noise besides their own: a rate that is off by a random
amount of variance v makes counts whose variance is larger by v. That share of the Poisson variance is to
stay below `MAX_NOISE_SHARE`, so dimmer light needs fewer samples. A budget is divided by a view's light,
whose own standard error is to stay below `MAX_NORMALISER_ERROR`. Both are forecast here, by few paths and by
what is known of all that shines in view; paths of a view are spread more evenly than these, and vary less.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from pcii.types.photon_limit import sense
from simgen.base import random_streams as seeds
from simgen.photons.bright_light import BrightLight, lit_light, mirrored_light, straight_light
from simgen.photons.capture import Capture
from simgen.photons.exploration import sampler_of_films
from simgen.renderer.radiance import render_view

MAX_NOISE_SHARE = 0.01
MAX_NORMALISER_ERROR = 0.003
PROBE_SAMPLES = 64
WORST_SHARE = 0.1
"""Least share of the noise of light that is named as its cause: where the probe has met a small lamp a few
times its variance is too large by several times."""


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
        if worst is None or _noise([worst]) < WORST_SHARE * self.variance * pixels:
            return ""
        share = worst.light / (self.mean * pixels)
        return (
            f", as {worst.what} gives {share:.0%} of the light from {worst.image_px:.2g} px of a film; make "
            "it larger and as much dimmer, or leave it out"
        )


def probe(capture: Capture, seed: int, found: Sequence[BrightLight] = ()) -> Probe:
    """A coarse look from the virtual centre; its pixels are larger, so it rather sees too much noise.

    What is known of bright light and its paths have likely not met is added, or what an exploration `found`
    of it, whichever has more noise: light that fills n pixels with the radiance L adds n L to the sum over
    the pixels, and n L^2 to the variance.
    """
    grid = capture.grid
    small, pixels = replace(capture.coarse_grid, rows=1, cols=1), grid.height * grid.width

    def mosaic(part: int) -> np.ndarray:
        view_seed = seeds.integer(seed, stage="plan probe", part=part)
        samples = {"samples_per_pixel": PROBE_SAMPLES, "independent": True}
        view = render_view(capture.render_scene, small, 0, 0, seed=view_seed, **samples)
        return sense(view, capture.cfa).astype(np.float64)

    first, second = mosaic(0), mosaic(1)
    # Half the squared difference of two means of n samples is 1 / n of one sample's variance.
    variance = PROBE_SAMPLES * ((first - second) ** 2).mean() / 2
    mean = float((first + second).mean() / 2)
    film_light, paths = mean * pixels, 2 * PROBE_SAMPLES * small.height * small.width
    known = straight_light(capture) + lit_light(sampler_of_films(capture), film_light, paths)[0]
    known += mirrored_light(capture, film_light, paths, with_straight=True)
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
