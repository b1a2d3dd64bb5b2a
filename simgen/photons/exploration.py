"""What is found out about a scene's light before photons are drawn: the majorant, and what it keeps.

It depends on scene, cameras and photons wanted, not on the seed: datasets that differ in nothing else
share it. A pilot suggests the majorant; then candidates are drawn for nothing but to lift it where it is
exceeded, until a rehearsal, with as many candidates as the draw needs, rarely exceeds it. Where mirrors
reflect light onto other surfaces no majorant may suffice. What is learned here costs no photon its
independence.
"""

import math
from dataclasses import dataclass

import numpy as np

from pcii.core.bayer import colour_cells
from simgen.base import random_streams as seeds
from simgen.photons.candidates import Accepted, CandidateSampler, Setup, paths_of
from simgen.photons.majorant import Majorant
from simgen.photons.photon_scopes import cell_groups
from simgen.photons.pilot import EXPLORATION_SEED, send_pilot
from simgen.photons.samplers import sampler_for
from simgen.spec.recipe import Photons

WARM_UP_SHARE = 0.15
"""The warm-up's rounds aim for this share of the photons, but take so many candidates at least, at most."""
WARM_UP_CANDIDATES = (1 << 13, 1 << 17)
WARM_UP_ROUNDS = 2
REHEARSALS = 8
"""Rehearsals at most, each of as many candidates as the photons take or of `REHEARSAL_PATHS`."""
REHEARSAL_PATHS = 1 << 18
ENOUGH = 0.5
"""A rehearsal with at most this share of the allowed pairs (`pairs_allowed`) is the last."""
LEAST_PASSED = 2
"""If there is none, so many rehearsals must be within the rule; if a draw in four is, eight all fail in 10 %
of cases, and views are rendered then."""
EXCESS_SHARE = 1e-5
"""Share of the light that the warm-up leaves above the majorant."""
LIKELY_SHARE = 0.3
"""Share of the candidates that are kept, until it is known."""
LEAST_SHARE = 1e-4


@dataclass(frozen=True, eq=False)
class Exploration:
    """A majorant, ambient light (C,), the share of candidates that is kept, and the light paths it took.

    `majorant` is None if there is no light at all; copy it before raising bounds. `is_bounded` is False if
    paths exceed every majorant so often that photons come in clumps, several from one path: no thinning then.
    """

    majorant: Majorant | None
    ambient: np.ndarray
    share: float
    paths: int
    max_dark_candidates: int
    """Where so many candidates of a scope find no light it has none."""
    is_bounded: bool = True


def explore(setup: Setup, photons: Photons, photons_per_radiance: float | None = None) -> Exploration:
    """The majorant for so many photons; see `thin_photons` for the arguments and for what is raised."""
    if (photons_per_radiance is None) == (photons.scope == "exposure"):
        raise ValueError("photons_per_radiance: needed for photons of scope 'exposure', and for no others")
    groups, grid = cell_groups(photons.scope, setup.cfa), setup.grid

    def expected(mean: np.ndarray) -> float:
        """Photons in all, given the mean radiance of each colour."""
        if photons_per_radiance is None:
            return photons.budget * len(groups) * (1 if photons.scope == "scene" else grid.view_count)
        cells = colour_cells(setup.cfa).ravel()
        pixels = grid.view_count * grid.height * grid.width
        return float(photons_per_radiance * mean[cells].mean() * pixels)

    pilot = send_pilot(setup, expected)
    if pilot.majorant is None:
        return Exploration(None, pilot.ambient, LIKELY_SHARE, pilot.paths, pilot.max_dark_candidates)
    warmed = _Warming(setup, pilot.majorant, groups, pilot.ambient, expected(pilot.mean))
    warmed.warm_up()
    is_bounded = warmed.rehearse()
    paths = pilot.paths + warmed.paths
    return Exploration(
        pilot.majorant, pilot.ambient, warmed.share, paths, pilot.max_dark_candidates, is_bounded
    )


@dataclass
class _Warming:
    """A majorant that is lifted where candidates exceed it, the share that it keeps, the paths it took."""

    setup: Setup
    majorant: Majorant
    groups: list[np.ndarray]
    ambient: np.ndarray
    photons: float
    share: float = LIKELY_SHARE
    paths: int = 0
    rounds: int = 0

    def warm_up(self) -> None:
        """Bring all bounds to about what the light needs."""
        number = int(np.clip(WARM_UP_SHARE * self.photons / LIKELY_SHARE, *WARM_UP_CANDIDATES))
        for _ in range(WARM_UP_ROUNDS):
            found = self._try(self._sampler(), number)
            factor = _factor(found.ratio)
            self.share = max(self.share / factor, LEAST_SHARE)
            self.majorant.scale(factor)
            self.majorant.lift(found.over)

    def rehearse(self) -> bool:
        """Rehearse and lift until a draw would be within `pairs_allowed`; whether one in four will be."""
        passed = 0
        for turn in range(REHEARSALS):
            sampler = self._sampler()
            most = REHEARSAL_PATHS // sampler.paths_each
            found = self._try(sampler, int(np.clip(self.photons / self.share, WARM_UP_CANDIDATES[0], most)))
            # As in a draw: rare light shows on few tiles at a time, so tiles farther away are raised too.
            self.majorant.lift(found.over, reach=1 + turn // 2)
            pairs, photons = pairs_of(found.photons.n), int(found.photons.n.sum())
            allowed = pairs_allowed(photons, math.prod(self.setup.grid.shape_KLHW))
            if pairs <= ENOUGH * allowed:
                return True
            passed += pairs <= allowed
        return passed >= LEAST_PASSED

    def _sampler(self) -> CandidateSampler:
        return sampler_for(self.setup, self.majorant, self.groups, self.ambient)

    def _try(self, sampler: CandidateSampler, number: int) -> Accepted:
        path_seed = seeds.integer(EXPLORATION_SEED, stage="warm-up", round_number=self.rounds)
        found = sampler.try_candidates(np.arange(number) % len(self.groups), None, path_seed)
        self.rounds += 1
        self.paths += paths_of(sampler, number, found.ratio.size)
        self.share = max(found.photons.n.sum() / number, LEAST_SHARE)
        return found


def pairs_of(photons: np.ndarray) -> int:
    """Pairs of photons that one path gave, from the number of photons of each path."""
    return int((photons * (photons - 1) // 2).sum())


def pairs_allowed(photons: int, pixels: int) -> float:
    """How many pairs of photons that one path gave no test of the counts can tell from chance.

    Poisson counts with the rates r_x have r_x^2 / 2 pairs of photons in pixel x on average, and as much
    variance; clumps add a share of r_x. A test that knows all rates weighs the pairs of each pixel by
    1 / r_x: then chance has the variance P / 2 over P pixels, and a share of 1 / sqrt(2 P) of the photons is
    one standard deviation. No other weights see clumps better. So much is allowed, P being all `pixels` of
    all views.
    """
    return photons / float(np.sqrt(2 * pixels))


def _factor(ratio: np.ndarray) -> float:
    """By how much to raise all limits for the light above them to be at most `EXCESS_SHARE`."""
    allowed = EXCESS_SHARE * ratio.sum()
    ratio = np.sort(ratio)[::-1]
    # Above the n-th largest lies the sum of the n - 1 that are larger less as many times itself.
    above = np.cumsum(ratio) - np.arange(1, ratio.size + 1) * ratio
    if allowed <= 0:
        return 1.0
    return float(np.clip(ratio[min(np.searchsorted(above, allowed), ratio.size - 1)], 0.5, 2.0))
