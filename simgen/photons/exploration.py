"""What is found out about a scene's light before photons are drawn: the majorant, and what it keeps.

It depends on scene, cameras and photons wanted, not on the seed: datasets that differ in nothing else share
it. A pilot of few paths suggests the majorant; paths spread evenly miss what is small and bright, so others
are aimed at what is known to shine. Then candidates are drawn for nothing but to raise the majorant where it
is exceeded, until a rehearsal, with as many candidates as the draw needs, rarely exceeds it. Where mirrors
reflect light onto other surfaces no majorant may suffice. What is learned here costs no photon its
independence.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from simgen.base import join_rows, take_rows
from simgen.base import random_streams as seeds
from simgen.photons.bright_light import LEAST_SHARE, SURE_HITS, BrightLight, lit_light, mirrored_light
from simgen.photons.candidates import (
    EXPLORATION_SEED,
    Accepted,
    CandidateSampler,
    Capture,
    FilmPoints,
    ImageCells,
    cells_of,
)
from simgen.photons.emission_sampler import EmissionSampler
from simgen.photons.majorant import (
    DIM_SHARE,
    RAYS_PER_TILE,
    TILES_ACROSS,
    Majorant,
    Samples,
    fit,
    layers_for,
    tile_px_for,
)
from simgen.photons.mirror_images import KnownPlaces, MirrorImages, find_images
from simgen.photons.scalar_sampler import ScalarSampler
from simgen.photons.wavefront_sampler import WavefrontSampler
from simgen.renderer import bright_directions, is_scalar, light_of, surrounding_radiance

FIRST_RAYS = 1 << 14
"""Rays of the first pilot, all of which are followed; the second has no fewer."""
RAYS_PER_PHOTON = 2.5
"""Rays of the second pilot for each photon that is wanted, until tiles are as fine as they get."""
MAX_RAYS = RAYS_PER_TILE * TILES_ACROSS**2
FOLLOWED_SHARE = 0.5
AIMED_RAYS = 1 << 13
"""Rays that are aimed at what shines, and as many at what is bright of the surroundings: where these are seen
through glass or in a gap, rays that are spread over the films may miss them."""
RAYS_PER_CONTRAST = 300
"""Rays by which openings are looked for where surroundings are as bright as the mean, and as many times more
as they are brighter: 3 of them meet an opening that holds 1 % of the light, and 5 % of such are missed."""
MIN_CONTRAST = 10.0
MAX_OPENING_RAYS = 1 << 21
MAX_OPENINGS = 256
"""Openings that are looked for in all views, at most: where the surroundings are seen on more tiles, they are
no small part of the picture."""
GUESSES, GUESSES_PER_VIEW = 1 << 20, (32, 1024)
"""Rays by which all of them are looked for again, and the least and largest number for one in one view."""
OPENING_SPREAD_PX = 1.0
AMBIENT_SHARE = 3.0
"""Light that surfaces throw at each other is guessed to be this many times the mean radiance."""
KEPT_SHARE_GUESS = 0.3
"""Share of the candidates that are kept, until it is known."""
MIN_FOUND_SHARE = 0.5
"""Least share of the light that lamps send by a number of mirrors that paths of the cameras have to find, or
else these images are taken as missing. If it is larger, more scenes are rendered or refused; if it is
smaller, the second of two equal images may be missing."""
MAX_HIDDEN_SHARE = LEAST_SHARE / 4
"""Share of a film's light that may be in images that were not found: curved glass gathers them, so that one
camera gets several times the mean of the disc."""
WARM_UP_SHARE = 0.15
"""Share of the photons that a round of the warm-up aims for, within `WARM_UP_CANDIDATES`."""
WARM_UP_CANDIDATES = (1 << 13, 1 << 17)
WARM_UP_ROUNDS = 2
MAX_REHEARSALS = 16
"""Each has as many candidates as the photons take, or `REHEARSAL_PATHS`."""
REHEARSAL_PATHS = 1 << 18
MAX_MISSING_SD = 0.2
"""Light that may lie above the bounds before photons are drawn, in standard deviations of their number: if
none of it were drawn, n photons would be short by this times sqrt(n). What a draw meets of it is drawn."""
REHEARSALS_AVERAGED = 4
"""Rehearsals end if the first is within `MAX_MISSING_SD`, or else the mean of this many is: of light in rare
paths one of them may have met little by chance. If neither is so, views are rendered."""
MAX_REACH_TILES = 4
MIN_KEPT_SHARE = 1e-4
RARE = "light in rare paths, as by mirrors,"
"""What rehearsals find above the bounds, whatever it is."""


@dataclass(frozen=True)
class Plan:
    """How the photon counts of a capture will be made, and what is known of its light.

    What follows `paths` is known once the light was explored, if photons are thinned: see `explore`.
    """

    thins: bool
    """Whether photons are drawn one by one; else counts are drawn from rendered views."""
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
    """Bright light that few paths meet: what photons are aimed at, or what the forecast of rendered views
    counts in. Of an exploration after which photons cannot be thinned, what stands in the way."""
    paths: int = 0
    """Light paths that the exploration took."""
    known_places: KnownPlaces | None = field(default=None, compare=False)
    """What shines in view, and images of lamps that are drawn apart; None before the exploration."""
    majorant: Majorant | None = field(default=None, compare=False)
    """None if there is no other light than that of known places; copy it before its bounds are raised."""
    ambient: np.ndarray = field(default_factory=lambda: np.zeros(1), compare=False)
    """Light (C,) that is guessed to come from all around."""
    kept_share: float = KEPT_SHARE_GUESS
    """Share of the candidates that is kept."""
    excess_share: float = 0.0
    """Share of the light that lay above the bounds in the last rehearsals."""

    def sampler(
        self, capture: Capture, majorant: Majorant, below: Majorant | None = None
    ) -> CandidateSampler:
        """The sampler of a majorant in this light; it leaves out images of lamps, which are drawn apart."""
        cells = None if self.known_places is None else self.known_places.image_cells
        return sampler_class(capture)(capture, majorant, self.ambient, cells, below)


def explore(capture: Capture, plan: Plan | None = None) -> Plan:
    """The plan with what its photons are drawn from; not `thins` if no majorant holds.

    A first pilot of few rays measures the mean radiance. A second, also spread evenly, finds the surfaces;
    tiles are so large that each holds several of its rays. Others are aimed at what is known to be bright.
    Then the majorant is warmed up and rehearsed. The seed has no part in it. Raises `InputError` for radiance
    that is not finite.
    """
    plan, mean = _send_pilot(capture, plan or Plan(True, 1, 0.0))
    known, photons, film_mass = plan.known_places, capture.expected_photons(mean), 0.0
    if known is None:
        return plan
    direct = known.mass * _kept_share(capture, known)
    if plan.majorant is not None:
        plan, film_mass = _warm_up(capture, plan, plan.majorant, photons, direct)
    if known.mass:
        kept = (film_mass * plan.kept_share + direct) / (film_mass + known.mass)
        plan = replace(plan, kept_share=max(kept, MIN_KEPT_SHARE))
    return plan


def _send_pilot(capture: Capture, plan: Plan) -> tuple[Plan, np.ndarray]:
    """The plan with what is known after few paths, and the mean radiance (C,) of all views.

    Where bright light is met by no path that could be aimed at it, photons are not thinned.
    """
    grid, surroundings = capture.grid, np.zeros(capture.channels)
    if not is_scalar(capture.render_scene.mi):  # where candidates are guessed at
        surroundings = surrounding_radiance(capture.render_scene, light_of(capture.render_scene, capture.cfa))
    sampler, emission = sampler_of_films(capture, surroundings), EmissionSampler(capture)
    first, paths = _send_first_pilot(sampler)
    mean = first.light.mean(axis=0)
    ambient = surroundings + AMBIENT_SHARE * mean.mean()
    photons, sampler = capture.expected_photons(mean), sampler_of_films(capture, ambient)
    rays = int(np.clip(RAYS_PER_PHOTON * photons / sampler.paths_each, FIRST_RAYS, MAX_RAYS))
    followed = int(FOLLOWED_SHARE * rays)
    film_light = float(mean.mean()) * capture.pixels
    film_light += emission.mass * _kept_share(capture, emission)
    known_paths = first.k.size + followed, int(photons / KEPT_SHARE_GUESS)
    known, aimed_at, unmet, lit = _meet_bright_light(sampler, known_paths, film_light, emission)
    if unmet:
        return replace(plan, thins=False, bright_light=tuple(unmet)), mean
    if known.image_cells is not None:  # without the light of these
        first, more = _send_first_pilot(sampler_of_films(capture, surroundings, known.image_cells))
        sampler = sampler_of_films(capture, ambient, known.image_cells)
        paths, mean = paths + more, first.light.mean(axis=0)
    majorant = None
    if mean.any():
        # A colour that the pilot did not find may be there nevertheless.
        dim = DIM_SHARE * np.maximum(mean, 0.01 * mean.max())
        path_seed = seeds.integer(EXPLORATION_SEED, stage="second pilot")
        points = FilmPoints.evenly(grid, rays, path_seed)
        samples = [first, lit, sampler.trace(points, followed, path_seed)]
        aimed = _aimed_points(capture, emission)
        if aimed.view.size:
            path_seed = seeds.integer(EXPLORATION_SEED, stage="aimed pilot")
            samples.append(sampler.trace(aimed, aimed.view.size, path_seed))
        contrast = float(surroundings.max() / mean.max())
        if contrast >= MIN_CONTRAST and not capture.render_scene.hides_surroundings:
            openings, traced = _look_for_openings(sampler, join_rows(samples).z_mm, contrast)
            samples.append(openings)
            paths += traced
        joined = join_rows(samples)
        layers = layers_for(grid, tile_px_for(grid, rays), joined.z_mm)
        paths += sampler.count_paths(rays + aimed.view.size, followed + aimed.view.size)
        majorant = fit(grid, layers, joined, dim)
    light = {"bright_light": tuple(aimed_at), "ambient": ambient, "paths": paths}
    return replace(plan, known_places=known, majorant=majorant, **light), mean


def _meet_bright_light(
    sampler: CandidateSampler, known_paths: tuple[int, int], film_light: float, emission: EmissionSampler
) -> tuple[KnownPlaces, list[BrightLight], list[BrightLight], Samples]:
    """What is drawn where it is known to be; bright light that few paths meet, first such as paths can be
    aimed at and then such as matters and they cannot; and paths to what is lit brightly.

    `known_paths` are the numbers of paths of the pilot and of a rehearsal, `film_light` is the sum of
    radiance over a film. Images of lamps are drawn apart, where a compiled backend runs. Paths cannot be
    aimed at light of which they find less than lamps send.
    """
    capture, paths = sampler.capture, known_paths[0]
    lit, traced = lit_light(sampler, film_light, paths)
    mirrored = mirrored_light(capture, film_light, paths, with_straight=False)
    film_light += sum(light.light for light in lit + mirrored)
    pixels, images = capture.pixels, None
    lamps = [row for row in mirrored if row.arrivals is not None and row.hits(paths, pixels) < SURE_HITS]
    # What surfaces scatter a rehearsal finds as well.
    scattered, all_paths = [row for row in mirrored if row.arrivals is None], sum(known_paths)
    unmet = [row for row in scattered if row.hits(all_paths, pixels) < SURE_HITS]
    if lamps and isinstance(sampler, WavefrontSampler):
        images = find_images(sampler, lamps)
    known = KnownPlaces([emission] if images is None else [emission, images])
    if images is None:
        unmet += lamps
    else:
        path_seed = seeds.integer(EXPLORATION_SEED, stage="lamp rays", part=1 << 20)
        light_by_bounces = images.light_by_bounces(AIMED_RAYS, path_seed)
        bounces, light = [row.bounces for row in lamps], [row.light for row in lamps]
        sent = np.bincount(bounces, light, minlength=light_by_bounces.size)
        # What the cameras see of a lamp differs from what arrives around them, but not by a half.
        is_missing = light_by_bounces < MIN_FOUND_SHARE * sent
        hidden = [row for row in lamps if is_missing[row.bounces]]
        if sum(row.light for row in hidden) > MAX_HIDDEN_SHARE * film_light:
            return known, lit + lamps, hidden, traced
    if sum(row.light for row in unmet) <= LEAST_SHARE * film_light:
        unmet = []
    return known, lit + lamps, unmet, traced


def _send_first_pilot(sampler: CandidateSampler) -> tuple[Samples, int]:
    """Paths spread evenly, more and more of them until some find light; and how many they were."""
    round_number, rays, paths = 0, FIRST_RAYS, 0
    while True:
        path_seed = seeds.integer(EXPLORATION_SEED, stage="first pilot", round_number=round_number)
        points = FilmPoints.evenly(sampler.capture.grid, rays, path_seed)
        samples = sampler.trace(points, rays, path_seed)
        samples = take_rows(samples, samples.followed)
        paths += sampler.count_paths(rays, rays)
        if samples.light.any() or rays >= sampler.max_dark_candidates:
            return samples, paths
        round_number, rays = round_number + 1, rays * 4


def _aimed_points(capture: Capture, emission: EmissionSampler) -> FilmPoints:
    """Where what shines, and what is bright of the surroundings, would be seen if nothing stood before it."""
    rng, places_px = seeds.generator(EXPLORATION_SEED, stage="aimed pilot"), [np.zeros((2, 0))]
    view = np.arange(AIMED_RAYS) % capture.grid.view_count
    if emission.mass:
        points = emission.film_points(view, rng)
        places_px.append(np.stack([points.row, points.col]))
    path_seed = seeds.integer(EXPLORATION_SEED, stage="aimed pilot", part=1)
    direction = bright_directions(capture.render_scene, AIMED_RAYS, path_seed)
    if len(direction):
        places_px.append(np.stack(capture.rig.film_px(view, direction)[:2]) + 0.5)
    row, col = np.concatenate(places_px, axis=1)
    return FilmPoints(np.resize(view, row.size), row, col).on_film(capture.grid)


def _look_for_openings(sampler: CandidateSampler, z_mm: np.ndarray, contrast: float) -> tuple[Samples, int]:
    """First hits in openings to surroundings `contrast` times as bright as the mean, and rays traced.

    Rays that are followed no further find openings in some view. An opening moves from view to view with what
    is around it, at one of the depths that are known, so it is looked for in every view at such places.
    """
    capture, grid = sampler.capture, sampler.capture.grid
    rays = int(min(RAYS_PER_CONTRAST * contrast, MAX_OPENING_RAYS))
    path_seed = seeds.integer(EXPLORATION_SEED, stage="aimed pilot", part=3)
    openings = _trace_misses(sampler, FilmPoints.evenly(capture.grid, rays, path_seed), path_seed)
    depths_mm = z_mm[np.isfinite(z_mm)].astype(np.float64)
    if not openings.k.size or not depths_mm.size:
        return openings, rays
    rng = seeds.generator(EXPLORATION_SEED, stage="aimed pilot", part=4)
    cells = np.unique(np.stack([openings.row, openings.col]) // 2, axis=1, return_index=True)[1]
    sources = take_rows(openings, rng.permutation(cells)[:MAX_OPENINGS])
    guesses = int(np.clip(GUESSES // (sources.k.size * grid.view_count), *GUESSES_PER_VIEW))
    each = guesses * grid.view_count
    k, l, row, col = (part.repeat(each) for part in (sources.k, sources.l, sources.row, sources.col))
    view = np.tile(np.arange(grid.view_count).repeat(guesses), sources.k.size)
    per_mm = grid.focal_mm / grid.pixel_mm / rng.choice(depths_mm, view.size)
    down, right = OPENING_SPREAD_PX * (2 * rng.random((2, view.size)) - 1)
    row = row + 0.5 + down - (view // grid.cols - k) * (grid.pitch_mm[1] * per_mm - grid.shear_px[1])
    col = col + 0.5 + right - (view % grid.cols - l) * (grid.pitch_mm[0] * per_mm - grid.shear_px[0])
    points = FilmPoints(view, row, col).on_film(grid)
    again = _trace_misses(sampler, points, path_seed)
    return join_rows([openings, again]), rays + points.view.size


def _trace_misses(sampler: CandidateSampler, points: FilmPoints, seed: int) -> Samples:
    """Rays that hit nothing: what they see needs no light path, the guess is right."""
    samples = sampler.trace(points, 1, seed)
    samples = take_rows(samples, np.isinf(samples.z_mm))
    return samples._replace(light=samples.guess)


def sampler_of_films(
    capture: Capture, ambient: np.ndarray | None = None, image_cells: ImageCells | None = None
) -> CandidateSampler:
    """A sampler that knows of nothing but the films; it guesses light `ambient` (C,) all around, or none."""
    ambient = np.zeros(capture.channels) if ambient is None else ambient
    nowhere = layers_for(capture.grid, tile_px_for(capture.grid, MAX_RAYS), np.array([np.inf]))
    flat = Majorant(capture.grid, nowhere, np.ones(capture.channels))
    return sampler_class(capture)(capture, flat, ambient, image_cells)


def sampler_class(capture: Capture) -> type[CandidateSampler]:
    """How candidates are drawn: all at once where a compiled backend runs, else one by one."""
    return ScalarSampler if is_scalar(capture.render_scene.mi) else WavefrontSampler


def _kept_share(capture: Capture, known: EmissionSampler | MirrorImages | KnownPlaces) -> float:
    """Share of the candidates of known places that is kept."""
    if not known.mass:
        return 0.0
    view = np.arange(AIMED_RAYS) % capture.grid.view_count
    path_seed = seeds.integer(EXPLORATION_SEED, stage="emission candidates")
    return known.draw(np.ones((AIMED_RAYS, 4), bool), view, path_seed)[0].k.size / AIMED_RAYS


def _warm_up(
    capture: Capture, plan: Plan, majorant: Majorant, photons: float, direct: float
) -> tuple[Plan, float]:
    """Warm the majorant up, then rehearse and raise it until little enough light is above the bounds.

    `photons` are wanted; `direct` is light that comes straight from what shines, in the unit of
    `CandidateSampler.mass`. What is known then, and the mass of the films.
    """
    paths, kept_share, excess_share, is_bounded = plan.paths, KEPT_SHARE_GUESS, 0.0, False
    rare, shares = list[BrightLight](), list[float]()
    allowed, groups = MAX_MISSING_SD / math.sqrt(max(photons, 1.0)), len(capture.cell_groups)
    for turn in range(-WARM_UP_ROUNDS, MAX_REHEARSALS):
        sampler = plan.sampler(capture, majorant)
        wanted, most = photons / kept_share, REHEARSAL_PATHS // sampler.paths_each
        if turn < 0:
            wanted, most = WARM_UP_SHARE * photons / KEPT_SHARE_GUESS, WARM_UP_CANDIDATES[1]
        number = int(np.clip(wanted, WARM_UP_CANDIDATES[0], most))
        path_seed = seeds.integer(EXPLORATION_SEED, stage="warm-up", round_number=turn + WARM_UP_ROUNDS)
        accepted = sampler.try_candidates(np.arange(number) % groups, None, path_seed)
        paths += sampler.count_paths(number, accepted.ratio.size)
        kept_share = max(accepted.photons.k.size / number, MIN_KEPT_SHARE)
        if turn < 0:
            kept_share = max(kept_share / majorant.fit_scale(accepted.ratio), MIN_KEPT_SHARE)
        # Rare light shows on few tiles at a time, so tiles farther away are raised too.
        majorant.list_and_raise(accepted.exceeding, reach=int(np.clip(1 + turn // 2, 1, MAX_REACH_TILES)))
        if turn < 0:
            continue
        of_films = float(sampler.mass.mean()) * kept_share
        ratio = accepted.ratio.astype(np.float64)
        above = float(np.maximum(ratio - 1, 0).sum()) / max(float(ratio.sum()), 1.0)
        shares.append(above * of_films / (of_films + direct))
        excess_share = float(np.mean(shares[-REHEARSALS_AVERAGED:]))
        rare += _above_bounds(accepted, float(sampler.mass.mean()) / number, sampler.colours)
        is_bounded = (turn == 0 or turn >= REHEARSALS_AVERAGED - 1) and excess_share <= allowed
        if is_bounded:
            break
    plan = replace(plan, thins=is_bounded, paths=paths, kept_share=kept_share, excess_share=excess_share)
    if not is_bounded:  # rehearsals are draws of the same light
        unmet = tuple(row._replace(light=row.light / len(shares)) for row in rare)
        plan = replace(plan, bright_light=unmet)
    return plan, float(plan.sampler(capture, majorant).mass.mean())


def _above_bounds(accepted: Accepted, mass_per_candidate: float, colours: np.ndarray) -> list[BrightLight]:
    """Light of a rehearsal's paths that exceeded their bounds, as it is on a film: one row, or none.

    A path that may bring B at most stands for the mass per candidate over B of the film's pixels.
    """
    exceeding = accepted.exceeding
    if not exceeding.k.size:
        return []
    radiance = exceeding.light[np.arange(exceeding.k.size), colours[cells_of(exceeding)]]
    ratio = accepted.ratio[accepted.ratio > 1].astype(np.float64)
    return [BrightLight.of(RARE, ratio * mass_per_candidate, radiance)]
