"""The pilot: a few paths that find where there is light, and from them the first majorant."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from simgen.base import random_streams as seeds
from simgen.photons.candidates import CandidateSampler, FilmPoints, Setup, even_film_points, paths_of
from simgen.photons.disparity_layers import RAYS_PER_TILE, TILES_ACROSS, Samples, layers_for, tile_px_for
from simgen.photons.emission_sampler import EmissionSampler
from simgen.photons.majorant import DIM_SHARE, Majorant, fit
from simgen.photons.samplers import sampler_for, surroundings
from simgen.renderer.backend import is_scalar
from simgen.renderer.path_tracing import bright_directions

EXPLORATION_SEED = 0
"""What is found before photons are drawn decides their cost, not where they fall: with one seed for all,
datasets that differ in nothing but their seed have it in common."""
FIRST_RAYS = 1 << 14
"""Rays of the first pilot, all of which are followed."""
RAYS_PER_PHOTON = 2.5
MOST_RAYS = RAYS_PER_TILE * TILES_ACROSS**2
"""The second pilot has so many rays for each photon that is wanted, until tiles are as fine as they get."""
FOLLOWED_SHARE = 0.5
AIMED_RAYS = 1 << 13
"""Rays that are aimed at what shines, and as many at what is bright of the surroundings: where these are seen
through glass or in a gap, rays that are spread over the films may miss them."""
RAYS_PER_CONTRAST = 300
"""Rays by which openings are looked for where surroundings are as bright as the mean, and as many times more
as they are brighter: 3 of them meet an opening that holds 1 % of the light, and 5 % of such are missed."""
LEAST_CONTRAST = 10.0
MOST_OPENING_RAYS = 1 << 21
MOST_OPENINGS = 256
"""Openings that are looked for in all views, at most: where the surroundings are seen on more tiles, they are
no small part of the picture."""
GUESSES, GUESSES_PER_VIEW = 1 << 20, (32, 1024)
"""Rays by which all of them are looked for again, and for each opening in each view at least and at most."""
OPENING_SPREAD_PX = 1.0
AMBIENT_SHARE = 3.0
"""Light that surfaces throw at each other is guessed to be so many times the mean radiance."""


@dataclass(frozen=True)
class Pilot:
    """What a pilot found: a majorant, mean radiance (C,) of all views, ambient light, paths it took.

    `majorant` is None if there is no light but what comes straight from something that shines.
    """

    majorant: Majorant | None
    mean: np.ndarray
    ambient: np.ndarray
    paths: int
    max_dark_candidates: int
    """Where so many candidates of a scope find no light it has none."""


def send_pilot(setup: Setup, emission: EmissionSampler, expected: Callable[[np.ndarray], float]) -> Pilot:
    """Find where there is light, and how much at most.

    `expected` says how many photons are wanted in all, given the mean radiance per colour: the effort
    is what they deserve.

    A first pilot of few rays measures the mean radiance. A second, also spread evenly, finds the surfaces;
    tiles are so large that each holds several of its rays. Others are aimed at what is known to be bright.
    """
    ambient_seen = surroundings(setup)
    first, paths = _first_pilot(setup, ambient_seen)
    mean = first.light.mean(axis=0)
    if not mean.any():
        most_dark = _sampler_of_films(setup, ambient_seen).max_dark_candidates
        return Pilot(None, mean, ambient_seen, paths, most_dark)
    ambient = ambient_seen + AMBIENT_SHARE * mean.mean()
    # A colour that the pilot did not find may be there nevertheless.
    dim = DIM_SHARE * np.maximum(mean, 0.01 * mean.max())
    sampler = _sampler_of_films(setup, ambient)
    rays = int(np.clip(RAYS_PER_PHOTON * expected(mean) / sampler.paths_each, FIRST_RAYS, MOST_RAYS))
    followed = int(FOLLOWED_SHARE * rays)
    path_seed = seeds.integer(EXPLORATION_SEED, stage="second pilot")
    known = first.join(sampler.trace(_evenly(setup, rays, path_seed), followed, path_seed))
    aimed = aimed_film_points(setup, emission)
    if aimed.view.size:
        path_seed = seeds.integer(EXPLORATION_SEED, stage="aimed pilot")
        known = known.join(sampler.trace(aimed, aimed.view.size, path_seed))
        paths += paths_of(sampler, aimed.view.size, aimed.view.size)
    openings, spent = _openings(setup, sampler, known, float(ambient_seen.max() / mean.max()))
    known, paths = known.join(openings), paths + spent
    layers = layers_for(setup.grid, tile_px_for(setup.grid, rays), known.z_mm)
    majorant = fit(setup.grid, layers, known, dim)
    paths += paths_of(sampler, rays, followed)
    return Pilot(majorant, mean, ambient, paths, sampler.max_dark_candidates)


def _first_pilot(setup: Setup, ambient: np.ndarray) -> tuple[Samples, int]:
    sampler = _sampler_of_films(setup, ambient)
    round_number, rays, spent = 0, FIRST_RAYS, 0
    while True:
        path_seed = seeds.integer(EXPLORATION_SEED, stage="first pilot", round_number=round_number)
        found = sampler.trace(_evenly(setup, rays, path_seed), rays, path_seed)
        found = found.take(found.followed)
        spent += paths_of(sampler, rays, rays)
        if found.light.any() or rays >= sampler.max_dark_candidates:
            return found, spent
        round_number, rays = round_number + 1, rays * 4


def _evenly(setup: Setup, rays: int, seed: int) -> FilmPoints:
    return even_film_points(setup.grid, rays, np.random.default_rng(seed))


def aimed_film_points(setup: Setup, emission: EmissionSampler) -> FilmPoints:
    """Where what shines, and what is bright of the surroundings, would be seen if nothing stood before it."""
    rng, rig, grid = seeds.generator(EXPLORATION_SEED, stage="aimed pilot"), setup.rig, setup.grid
    views, rows, columns = [np.zeros(0, np.int64)], [np.zeros(0)], [np.zeros(0)]
    if emission.mass:
        view = np.arange(AIMED_RAYS) % grid.view_count
        found = emission.film_points(view, rng)
        views.append(view)
        rows.append(found.row_px)
        columns.append(found.col_px)
    path_seed = seeds.integer(EXPLORATION_SEED, stage="aimed pilot", part=1)
    direction = bright_directions(setup.render_scene, AIMED_RAYS, path_seed)
    if len(direction):
        view = np.arange(AIMED_RAYS) % grid.view_count
        k, l = np.divmod(view, grid.cols)
        x, y, z = np.einsum("nba,nb->an", rig.rotation[k, l], direction)
        ahead = np.where(z > 0, z, np.nan)
        scale_px, axis_px = grid.focal_mm / grid.pixel_mm, rig.axis_px[k, l]
        views.append(view)
        rows.append(y / ahead * scale_px + axis_px[:, 1])
        columns.append(x / ahead * scale_px + axis_px[:, 0])
    view, row, col = np.concatenate(views), np.concatenate(rows), np.concatenate(columns)
    inside = (row >= -0.5) & (row < grid.height - 0.5) & (col >= -0.5) & (col < grid.width - 0.5)
    return FilmPoints(view[inside], row[inside] + 0.5, col[inside] + 0.5)


def _openings(
    setup: Setup, sampler: CandidateSampler, known: Samples, contrast: float
) -> tuple[Samples, int]:
    """First hits in openings to surroundings `contrast` times as bright as the mean, and rays traced.

    Rays that are followed no further find openings in some view. An opening moves from view to view with what
    is around it, at one of the depths that are known, so it is looked for in every view at such places.
    """
    if contrast < LEAST_CONTRAST or is_scalar(setup.render_scene.mi):
        return known.take(np.zeros(0, np.int64)), 0
    rays = int(min(RAYS_PER_CONTRAST * contrast, MOST_OPENING_RAYS))
    path_seed = seeds.integer(EXPLORATION_SEED, stage="aimed pilot", part=3)
    found = _misses(sampler, _evenly(setup, rays, path_seed), path_seed)
    depths_mm = known.z_mm[np.isfinite(known.z_mm)].astype(np.float64)
    if not found.k.size or not depths_mm.size:
        return found, rays
    grid, rng = setup.grid, seeds.generator(EXPLORATION_SEED, stage="aimed pilot", part=4)
    cells = np.unique(np.stack([found.row, found.col]) // 2, axis=1, return_index=True)[1]
    seen = found.take(rng.permutation(cells)[:MOST_OPENINGS])
    guesses = int(np.clip(GUESSES // (seen.k.size * grid.view_count), *GUESSES_PER_VIEW))
    each = guesses * grid.view_count
    k, l, row, col = (part.repeat(each) for part in (seen.k, seen.l, seen.row, seen.col))
    view = np.tile(np.arange(grid.view_count).repeat(guesses), seen.k.size)
    per_mm = grid.focal_mm / grid.pixel_mm / rng.choice(depths_mm, view.size)
    down, right = OPENING_SPREAD_PX * (2 * rng.random((2, view.size)) - 1)
    row = row + 0.5 + down - (view // grid.cols - k) * (grid.pitch_mm[1] * per_mm - grid.shear_px[1])
    col = col + 0.5 + right - (view % grid.cols - l) * (grid.pitch_mm[0] * per_mm - grid.shear_px[0])
    inside = (row >= 0) & (row < grid.height) & (col >= 0) & (col < grid.width)
    again = _misses(sampler, FilmPoints(view[inside], row[inside], col[inside]), path_seed)
    return found.join(again), rays + int(inside.sum())


def _misses(sampler: CandidateSampler, points: FilmPoints, seed: int) -> Samples:
    """Rays that hit nothing: what they see needs no light path, the guess is right."""
    found = sampler.trace(points, 1, seed)
    found = found.take(np.isinf(found.z_mm))
    return replace(found, light=found.guess)


def _sampler_of_films(setup: Setup, ambient: np.ndarray) -> CandidateSampler:
    """A sampler that knows of nothing but the films."""
    nowhere = layers_for(setup.grid, tile_px_for(setup.grid, MOST_RAYS), np.array([np.inf]))
    flat = Majorant(setup.grid, nowhere, np.ones(setup.channels))
    return sampler_for(setup, flat, [np.arange(4)], ambient)
