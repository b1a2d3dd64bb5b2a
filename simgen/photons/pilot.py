"""The pilot: a few paths that find where there is light, and from them the first majorant."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from simgen.base import random_streams as seeds
from simgen.photons.candidates import CandidateSampler, Setup, paths_of
from simgen.photons.disparity_layers import RAYS_PER_TILE, TILES_ACROSS, Samples, layers_for, tile_px_for
from simgen.photons.majorant import DIM_SHARE, Majorant, fit
from simgen.photons.samplers import sampler_for, surroundings

EXPLORATION_SEED = 0
"""What is found before photons are drawn decides their cost, not where they fall: with one seed for all,
datasets that differ in nothing but their seed have it in common."""
FIRST_RAYS = 1 << 14
"""Rays of the first pilot, all of which are followed."""
RAYS_PER_PHOTON = 2.5
MOST_RAYS = RAYS_PER_TILE * TILES_ACROSS**2
"""The second pilot has so many rays for each photon that is wanted, until tiles are as fine as they get."""
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


def send_pilot(setup: Setup, expected: Callable[[np.ndarray], float]) -> Pilot:
    """Find where there is light, and how much at most.

    `expected` says how many photons are wanted in all, given the mean radiance per colour: the effort
    is what they deserve.

    A first pilot of few rays measures the mean radiance. A second, also spread evenly, finds the surfaces;
    tiles are so large that each holds several of its rays.
    """
    ambient = surroundings(setup)
    first, paths = _first_pilot(setup, ambient)
    mean = first.light.mean(axis=0)
    if not mean.any():
        return Pilot(None, mean, ambient, paths, max_dark_candidates=0)
    ambient = ambient + AMBIENT_SHARE * mean.mean()
    # A colour that the pilot did not find may be there nevertheless.
    dim = DIM_SHARE * np.maximum(mean, 0.01 * mean.max())
    sampler = _sampler_of_films(setup, ambient)
    rays = int(np.clip(RAYS_PER_PHOTON * expected(mean) / sampler.paths_each, FIRST_RAYS, MOST_RAYS))
    followed = int(FOLLOWED_SHARE * rays)
    known = first.join(
        sampler.trace_evenly(rays, followed, seeds.integer(EXPLORATION_SEED, stage="second pilot"))
    )
    layers = layers_for(setup.grid, tile_px_for(setup.grid, rays), known.z_mm)
    majorant = fit(setup.grid, layers, known, dim)
    paths += paths_of(sampler, rays, followed)
    return Pilot(majorant, mean, ambient, paths, sampler.max_dark_candidates)


def _first_pilot(setup: Setup, ambient: np.ndarray) -> tuple[Samples, int]:
    sampler = _sampler_of_films(setup, ambient)
    round_number, rays, spent = 0, FIRST_RAYS, 0
    while True:
        path_seed = seeds.integer(EXPLORATION_SEED, stage="first pilot", round_number=round_number)
        found = sampler.trace_evenly(rays, rays, path_seed)
        found = found.take(found.followed)
        spent += paths_of(sampler, rays, rays)
        if found.light.any() or rays >= sampler.max_dark_candidates:
            return found, spent
        round_number, rays = round_number + 1, rays * 4


def _sampler_of_films(setup: Setup, ambient: np.ndarray) -> CandidateSampler:
    """A sampler that knows of nothing but the films."""
    nowhere = layers_for(setup.grid, tile_px_for(setup.grid, MOST_RAYS), np.array([np.inf]))
    flat = Majorant(setup.grid, nowhere, np.ones(setup.channels))
    return sampler_for(setup, flat, [np.arange(4)], ambient)
