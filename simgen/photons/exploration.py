"""What is found out about a scene's light before photons are drawn: the majorant, and what it keeps.

It depends on scene, cameras and photons wanted, not on the seed: datasets that differ in nothing else
share it. A pilot suggests the majorant; then candidates are drawn for nothing but to lift it where it is
exceeded, until a rehearsal, with as many candidates as the draw needs, rarely exceeds it. Where mirrors
reflect light onto other surfaces no majorant may suffice. What is learned here costs no photon its
independence.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from pcii.core.bayer import colour_cells
from simgen.base import random_streams as seeds
from simgen.photons.candidates import Accepted, CandidateSampler, Setup, cell_groups, paths_of
from simgen.photons.emission_sampler import EmissionSampler
from simgen.photons.majorant import Majorant
from simgen.photons.pilot import AIMED_RAYS, EXPLORATION_SEED, send_pilot
from simgen.photons.samplers import sampler_for
from simgen.spec.recipe import Photons

WARM_UP_SHARE = 0.15
"""The warm-up's rounds aim for this share of the photons, but take so many candidates at least, at most."""
WARM_UP_CANDIDATES = (1 << 13, 1 << 17)
WARM_UP_ROUNDS = 2
REHEARSALS = 16
"""Rehearsals at most, each of as many candidates as the photons take or of `REHEARSAL_PATHS`."""
REHEARSAL_PATHS = 1 << 18
MOST_MISSING_SD = 0.2
"""Light that may lie above the bounds before photons are drawn, in standard deviations of their number: if
none of it were drawn, n photons would be short by this times sqrt(n). What a draw meets of it is drawn."""
MEAN_OF = 4
"""Rehearsals end if the first is within `MOST_MISSING_SD`, or else the mean of this many is: of light in rare
paths one of them may have met little by chance. If neither is so, views are rendered."""
MOST_REACH = 4
EXCESS_SHARE = 1e-5
"""Share of the light that the warm-up leaves above the majorant."""
LIKELY_SHARE = 0.3
"""Share of the candidates that are kept, until it is known."""
LEAST_SHARE = 1e-4


@dataclass(frozen=True, eq=False)
class Exploration:
    """A majorant, ambient light (C,), the share of candidates that is kept, and the light paths it took.

    `majorant` is None if there is no light but what comes straight from something that shines; copy it before
    raising bounds. `is_bounded` is False if paths exceed every majorant too often: no thinning then.
    """

    majorant: Majorant | None
    emission: EmissionSampler
    ambient: np.ndarray
    share: float
    paths: int
    max_dark_candidates: int
    """Where so many candidates of a scope find no light it has none."""
    is_bounded: bool = True
    excess_share: float = 0.0
    """Share of the light that lay above the bounds in the last rehearsal."""


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

    emission = EmissionSampler(setup)
    share_of_emission = _share_of(emission, setup) if emission.mass else 0.0
    pilot = send_pilot(setup, emission, expected)
    found = Exploration(
        pilot.majorant, emission, pilot.ambient, LIKELY_SHARE, pilot.paths, pilot.max_dark_candidates
    )
    film_mass = 0.0
    if pilot.majorant is not None:
        direct = emission.mass * share_of_emission
        warmed = _Warming(setup, pilot.majorant, groups, pilot.ambient, expected(pilot.mean), direct)
        warmed.warm_up()
        is_bounded = warmed.rehearse()
        film_mass = float(warmed.sampler().mass.mean())
        paths = pilot.paths + warmed.paths
        found = replace(
            found, share=warmed.share, paths=paths, is_bounded=is_bounded, excess_share=warmed.excess_share
        )
    if emission.mass:
        share = (film_mass * found.share + emission.mass * share_of_emission) / (film_mass + emission.mass)
        found = replace(found, share=max(share, LEAST_SHARE))
    return found


def _share_of(emission: EmissionSampler, setup: Setup) -> float:
    """The share of the candidates of what shines that are kept."""
    view = np.arange(AIMED_RAYS) % setup.grid.view_count
    path_seed = seeds.integer(EXPLORATION_SEED, stage="emission candidates")
    kept = emission.try_candidates(np.zeros_like(view), view, [np.arange(4)], path_seed)
    return kept.photons.k.size / AIMED_RAYS


@dataclass
class _Warming:
    """A majorant that is lifted where candidates exceed it, the share that it keeps, the paths it took."""

    setup: Setup
    majorant: Majorant
    groups: list[np.ndarray]
    ambient: np.ndarray
    photons: float
    direct: float
    """Light that comes straight from what shines, in one view, in the unit of `CandidateSampler.mass`."""
    share: float = LIKELY_SHARE
    paths: int = 0
    rounds: int = 0
    excess_share: float = 0.0

    def warm_up(self) -> None:
        """Bring all bounds to about what the light needs."""
        number = int(np.clip(WARM_UP_SHARE * self.photons / LIKELY_SHARE, *WARM_UP_CANDIDATES))
        for _ in range(WARM_UP_ROUNDS):
            found = self._try(self.sampler(), number)
            factor = _factor(found.ratio)
            self.share = max(self.share / factor, LEAST_SHARE)
            self.majorant.scale(factor)
            self.majorant.lift(found.over)

    def rehearse(self) -> bool:
        """Rehearse and lift until little enough light is above the bounds; whether that is so in the end."""
        allowed, shares = MOST_MISSING_SD / math.sqrt(max(self.photons, 1.0)), list[float]()
        for turn in range(REHEARSALS):
            sampler = self.sampler()
            most = REHEARSAL_PATHS // sampler.paths_each
            found = self._try(sampler, int(np.clip(self.photons / self.share, WARM_UP_CANDIDATES[0], most)))
            # Rare light shows on few tiles at a time, so tiles farther away are raised too.
            self.majorant.lift(found.over, reach=min(1 + turn // 2, MOST_REACH))
            shares.append(self._share_above(sampler, found))
            self.excess_share = float(np.mean(shares[-MEAN_OF:]))
            if (turn == 0 or turn >= MEAN_OF - 1) and self.excess_share <= allowed:
                return True
        return False

    def _share_above(self, sampler: CandidateSampler, found: Accepted) -> float:
        """The share of all light that these candidates found above the bounds."""
        of_films = float(sampler.mass.mean()) * self.share
        photons = max(float(found.ratio.sum(dtype=np.float64)), 1.0)
        return excess(found.ratio) / photons * of_films / (of_films + self.direct)

    def sampler(self) -> CandidateSampler:
        """Candidates by the majorant as it is now."""
        return sampler_for(self.setup, self.majorant, self.groups, self.ambient)

    def _try(self, sampler: CandidateSampler, number: int) -> Accepted:
        path_seed = seeds.integer(EXPLORATION_SEED, stage="warm-up", round_number=self.rounds)
        found = sampler.try_candidates(np.arange(number) % len(self.groups), None, path_seed)
        self.rounds += 1
        self.paths += paths_of(sampler, number, found.ratio.size)
        self.share = max(found.photons.k.size / number, LEAST_SHARE)
        return found


def excess(ratio: np.ndarray) -> float:
    """Photons that paths of these ratios of radiance to bound should have given and did not."""
    return float(np.maximum(ratio.astype(np.float64) - 1, 0).sum())


def _factor(ratio: np.ndarray) -> float:
    """By how much to raise all limits for the light above them to be at most `EXCESS_SHARE`."""
    allowed = EXCESS_SHARE * ratio.sum()
    ratio = np.sort(ratio)[::-1]
    # Above the n-th largest lies the sum of the n - 1 that are larger less as many times itself.
    above = np.cumsum(ratio) - np.arange(1, ratio.size + 1) * ratio
    if allowed <= 0:
        return 1.0
    return float(np.clip(ratio[min(np.searchsorted(above, allowed), ratio.size - 1)], 0.5, 2.0))
