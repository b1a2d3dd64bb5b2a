"""The pilot: a few paths that find where there is light, and from them the first majorant."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from simgen.base import random_streams as seeds
from simgen.photons.candidates import Setup, paths_of
from simgen.photons.disparity_layers import Samples, layers_for, tile_px_for
from simgen.photons.majorant import COARSE_TILES, DIM_SHARE, Majorant, fit
from simgen.photons.samplers import sampler_for, surroundings

EVEN_PATHS = 1 << 15
AIMED_CANDIDATES = (1 << 14, 1 << 18)
"""Candidates of the second set, at least and at most; within that, as many as photons are wanted."""
FOLLOWED_SHARE = 0.5
AMBIENT_SHARE = 3.0
"""Light that surfaces throw at each other is guessed to be so many times the mean radiance."""


@dataclass(frozen=True)
class Pilot:
    """What a pilot found: a majorant, mean radiance (C,) of all views, ambient light, paths it took.

    `majorant` is None if there is no light at all.
    """

    majorant: Majorant | None
    mean: np.ndarray
    ambient: np.ndarray
    paths: int
    max_dark_candidates: int
    """Where so many candidates of a scope find no light it has none."""


def explore(setup: Setup, expected: Callable[[np.ndarray], float], seed: int) -> Pilot:
    """Find where there is light, and how much at most.

    `expected` says how many photons are wanted in all, given the mean radiance per colour: the effort
    is what they deserve.

    First paths go evenly through all films. They show which depths there are and where it is bright. A
    second set is drawn from that, most of it only to see what it hits.
    """
    ambient = surroundings(setup)
    even, paths = _look_evenly(setup, seed, ambient)
    mean = even.light.mean(axis=0)
    if not even.light.any():
        return Pilot(None, mean, ambient, paths, max_dark_candidates=0)
    ambient = ambient + AMBIENT_SHARE * mean.mean()
    # A colour that the pilot did not find may be there nevertheless.
    dim = DIM_SHARE * np.maximum(mean, 0.01 * mean.max())
    grid = setup.grid
    fine_px = tile_px_for(grid)
    coarse = fit(grid, layers_for(grid, COARSE_TILES * fine_px, even.z_mm), even, dim)
    sampler = sampler_for(setup, coarse, [np.arange(4)], ambient)
    path_seed = seeds.integer(seed, stage="aimed pilot")
    candidates = int(np.clip(expected(mean), *AIMED_CANDIDATES))
    followed = int(FOLLOWED_SHARE * candidates)
    aimed = sampler.trace_pilot(candidates, followed, path_seed)
    known = even.join(aimed)
    majorant = fit(grid, layers_for(grid, fine_px, known.z_mm), known, dim)
    return Pilot(
        majorant, mean, ambient, paths + paths_of(sampler, candidates, followed), sampler.max_dark_candidates
    )


def _look_evenly(setup: Setup, seed: int, ambient: np.ndarray) -> tuple[Samples, int]:
    nowhere = layers_for(setup.grid, tile_px_for(setup.grid), np.array([np.inf]))
    flat = Majorant(setup.grid, nowhere, np.ones(setup.channels))
    sampler = sampler_for(setup, flat, [np.arange(4)], ambient)
    round_number, paths, spent = 0, EVEN_PATHS, 0
    while True:
        path_seed = seeds.integer(seed, stage="even pilot", round_number=round_number)
        even = sampler.trace_pilot(paths, paths, path_seed)
        spent += paths_of(sampler, paths, paths)
        if even.light.any() or paths >= sampler.max_dark_candidates:
            return even, spent
        round_number, paths = round_number + 1, paths * 4
