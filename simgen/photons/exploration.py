"""What is found out about a scene's light before photons are drawn: the majorant, and what it keeps.

It depends on scene, cameras and photons wanted, not on the seed: datasets that differ in nothing else
share it. A pilot suggests the majorant; then candidates are drawn for nothing but to lift it where it is
exceeded. What is learned here costs no photon its independence.
"""

from dataclasses import dataclass

import numpy as np

from pcii.core.bayer import colour_cells
from simgen.base import random_streams as seeds
from simgen.photons.candidates import Setup, paths_of
from simgen.photons.majorant import Majorant
from simgen.photons.photon_scopes import cell_groups
from simgen.photons.pilot import EXPLORATION_SEED, send_pilot
from simgen.photons.samplers import sampler_for
from simgen.spec.recipe import Photons

WARM_UP_SHARE = 0.15
"""The warm-up's rounds aim for this share of the photons, but take so many candidates at least, at most."""
WARM_UP_CANDIDATES = (1 << 13, 1 << 17)
WARM_UP_ROUNDS = 2
EXCESS_SHARE = 1e-5
"""Share of the light that the warm-up leaves above the majorant."""
LIKELY_SHARE = 0.3
"""Share of the candidates that are kept, until it is known."""
LEAST_SHARE = 1e-4


@dataclass(frozen=True, eq=False)
class Exploration:
    """A majorant, ambient light (C,), the share of candidates that is kept, and the light paths it took.

    `majorant` is None if there is no light at all; who lifts it lifts a copy.
    """

    majorant: Majorant | None
    ambient: np.ndarray
    share: float
    paths: int
    max_dark_candidates: int
    """Where so many candidates of a scope find no light it has none."""


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
    share, paths = LIKELY_SHARE, 0
    if pilot.majorant is not None:
        share, paths = _warm_up(setup, pilot.majorant, groups, pilot.ambient, expected(pilot.mean))
    return Exploration(pilot.majorant, pilot.ambient, share, pilot.paths + paths, pilot.max_dark_candidates)


def _warm_up(
    setup: Setup, majorant: Majorant, groups: list[np.ndarray], ambient: np.ndarray, photons: float
) -> tuple[float, int]:
    """Lift a majorant where candidates exceed it; the share that it keeps, and the paths that took."""
    number = int(np.clip(WARM_UP_SHARE * photons / LIKELY_SHARE, *WARM_UP_CANDIDATES))
    share, paths = LIKELY_SHARE, 0
    for done in range(WARM_UP_ROUNDS):
        path_seed = seeds.integer(EXPLORATION_SEED, stage="warm-up", round_number=done)
        sampler = sampler_for(setup, majorant, groups, ambient)
        found = sampler.try_candidates(np.arange(number) % len(groups), None, path_seed)
        paths += paths_of(sampler, number, found.ratio.size)
        factor = _factor(found.ratio)
        share = max(found.photons.n.sum() / number / factor, LEAST_SHARE)
        majorant.scale(factor)
        majorant.lift(found.over)
    return share, paths


def _factor(ratio: np.ndarray) -> float:
    """By how much to raise all limits for the light above them to be at most `EXCESS_SHARE`."""
    allowed = EXCESS_SHARE * ratio.sum()
    ratio = np.sort(ratio)[::-1]
    # Above the n-th largest lies the sum of the n - 1 that are larger less as many times itself.
    above = np.cumsum(ratio) - np.arange(1, ratio.size + 1) * ratio
    if allowed <= 0:
        return 1.0
    return float(np.clip(ratio[min(np.searchsorted(above, allowed), ratio.size - 1)], 0.5, 2.0))
