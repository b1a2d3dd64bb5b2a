"""What is found out about a scene's light before photons are drawn: the majorant, and what it keeps.

It depends on scene, cameras and photons wanted, not on the seed: datasets that differ in nothing else share
it. A pilot of few paths suggests the majorant; then candidates are drawn for nothing but to raise it where it
is exceeded, until a rehearsal, with as many candidates as the draw needs, rarely exceeds it. Where mirrors
reflect light onto other surfaces no majorant may suffice. What is learned here costs no photon its
independence.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from simgen.base import random_streams as seeds
from simgen.photons.bright_light import BrightLight
from simgen.photons.candidates import Accepted, CandidateSampler, ImageCells
from simgen.photons.capture import Capture
from simgen.photons.emission_sampler import EmissionSampler
from simgen.photons.majorant import Majorant
from simgen.photons.mirror_images import KnownPlaces
from simgen.photons.pilot import EXPLORATION_SEED, KEPT_SHARE_GUESS, kept_share_of, sampler_class, send_pilot

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

    @property
    def image_cells(self) -> ImageCells | None:
        """Cells of the films that paths leave out, since images of lamps are drawn there apart."""
        return None if self.known_places is None else self.known_places.image_cells


def explore(capture: Capture, plan: Plan | None = None) -> Plan:
    """The plan with what its photons are drawn from; not `thins` if no majorant holds.

    A first pilot of few rays measures the mean radiance. A second, also spread evenly, finds the surfaces;
    tiles are so large that each holds several of its rays. Others are aimed at what is known to be bright.
    Then the majorant is warmed up and rehearsed. The seed has no part in it. Raises `InputError` for radiance
    that is not finite.
    """
    pilot = send_pilot(capture, EmissionSampler(capture))
    photons, known, film_mass = capture.expected_photons(pilot.mean), pilot.known_places, 0.0
    plan = plan or Plan(True, 1, photons / capture.grid.view_count)
    if pilot.unmet:
        return replace(plan, thins=False, bright_light=tuple(pilot.unmet))
    plan = replace(
        plan,
        bright_light=tuple(pilot.aimed_at),
        paths=pilot.paths,
        known_places=known,
        majorant=pilot.majorant,
        ambient=pilot.ambient,
    )
    direct = known.mass * kept_share_of(capture, known)
    if pilot.majorant is not None:
        plan, film_mass = _warm_up(capture, plan, pilot.majorant, photons, direct)
    if known.mass:
        kept = (film_mass * plan.kept_share + direct) / (film_mass + known.mass)
        plan = replace(plan, kept_share=max(kept, MIN_KEPT_SHARE))
    return plan


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

    def sampler_of_majorant() -> CandidateSampler:
        return sampler_class(capture)(capture, majorant, plan.ambient, plan.image_cells)

    for turn in range(-WARM_UP_ROUNDS, MAX_REHEARSALS):
        sampler = sampler_of_majorant()
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
    return plan, float(sampler_of_majorant().mass.mean())


def _above_bounds(accepted: Accepted, mass_per_candidate: float, colours: np.ndarray) -> list[BrightLight]:
    """Light of a rehearsal's paths that exceeded their bounds, as it is on a film: one row, or none.

    A path that may bring B at most stands for the mass per candidate over B of the film's pixels.
    """
    exceeding = accepted.exceeding
    if not exceeding.k.size:
        return []
    colour = colours[exceeding.row % 2 * 2 + exceeding.col % 2]
    radiance = exceeding.light[np.arange(colour.size), colour]
    ratio = accepted.ratio[accepted.ratio > 1].astype(np.float64)
    return [BrightLight.of(RARE, ratio * mass_per_candidate, radiance)]
