"""Photons, not pixels: photon-limited images by thinning, in the time that their photons take.

The photons of a film are a Poisson process in time and place whose rate is the radiance L in the pixel's
colour. It is drawn from candidates of a known higher rate M, the majorant: ONE light path through each in its
own colour, kept with probability L(path) / M. The path's radiance is an unbiased estimate, so the kept ones
have exactly the rate L, whatever M is: no pixel is rendered and no rendering noise enters the counts (the
marking and thinning theorems for Poisson processes; Lewis and Shedler 1979). Light that comes straight from
something that shines is drawn on its surface instead (`emission_sampler`). For scope `exposure` the time is
given; for a budget it goes on until each scope has its photons, of which the first are kept, so the sum of
the light is never needed and has no error.

Where a path exceeds the majorant it was drawn from, the draw goes on: the majorant is raised there, and what
lies between the old one and the new one is drawn for all the time that has passed, until no path exceeds.
Nothing is drawn again and nothing discarded, so the result does not depend on what was met, and no two
photons come of one path. docs/theory.md has the proof.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from pcii.base.errors import InputError
from pcii.base.progress import Report, silent
from simgen.base import random_streams as seeds
from simgen.photons.candidates import Accepted, CandidateSampler, Setup, paths_of
from simgen.photons.disparity_layers import Samples
from simgen.photons.exploration import MIN_KEPT_SHARE, Exploration, explore, sampler_for
from simgen.photons.majorant import Majorant
from simgen.photons.scopes import ENDLESS, Scopes, places
from simgen.sensor.photon_table import PhotonTable, joined, no_photons
from simgen.spec.recipe import Photons

WAVEFRONT = 1 << 21
"""Largest number of candidates that are traced at once."""
MAX_RAISES = 64
"""How often the majorant is raised in one draw at most; light that exceeds every bound is refused then."""
MAX_EXTRA_RATIO = 256
"""Largest number of candidates above a raised majorant, as a multiple of all before them (or of a wavefront,
if that is more); what would take longer is refused."""
MAX_SINGLE_PHOTONS = 1 << 25
"""More photons than these are drawn in parts, of which only the counts are kept."""


def thin_photons(
    setup: Setup,
    photons: Photons,
    *,
    seed: int,
    photons_per_radiance: float | None = None,
    explored: Exploration | None = None,
    keeps_origins: bool = True,
    report: Report = silent,
) -> tuple[PhotonTable, dict[str, Any]]:
    """All photons of all views, ordered by view and pixel, and a log of how they came about.

    One row for each photon, with scope, rank and first hit; the same for the same setup, settings and seed.
    Without `keeps_origins` a row for each pixel that caught any: of more photons than memory holds.

    `photons_per_radiance` are those that a pixel catches of a unit of radiance, for scope `exposure`.
    `explored` is what `explore` found for the same setup and settings, if it is known already. Raises
    ValueError for scope `exposure` without `photons_per_radiance`, and for another scope with it;
    `InputError` for radiance that is not finite, and for light that exceeds every bound.
    """
    scopes = Scopes(photons, setup.grid, setup.cfa, photons_per_radiance)
    draw = _Drawing(setup, scopes, seed, explored or explore(setup, photons, photons_per_radiance), report)
    table = draw.single_photons() if keeps_origins else draw.counts()
    return table.by_pixel(setup.grid), draw.log()


@dataclass
class _Progress:
    """How far scopes (S,) are: photons that each wants and has, candidates tried, and the time drawn.

    Time is in candidates per unit of majorant.
    """

    wanted: np.ndarray

    def __post_init__(self) -> None:
        self.photons = np.zeros(self.wanted.size, dtype=np.int64)
        self.tried = np.zeros(self.wanted.size, dtype=np.int64)
        self.time = np.zeros(self.wanted.size)

    def unfinished(self, max_dark_candidates: int) -> np.ndarray:
        """Numbers of scopes that still want photons and are not dark.

        Dark are those of which `max_dark_candidates` found nothing.
        """
        is_dark = (self.photons == 0) & (self.tried >= max_dark_candidates)
        return np.flatnonzero((self.photons < self.wanted) & ~is_dark)

    def part(self, number: int, parts: int) -> "_Progress":
        """The start of a draw of the `number`-th of `parts` equal shares of the photons."""
        share = self.wanted * (number + 1) // parts - self.wanted * number // parts
        return _Progress(np.where(self.wanted == ENDLESS, ENDLESS, share))

    def blocks(self) -> Iterator[np.ndarray]:
        """Numbers of scopes to be drawn together: as many as are likely to fit a wavefront."""
        block = (np.cumsum(self.wanted) - 1) // (WAVEFRONT // 4)
        yield from np.split(np.arange(self.wanted.size), np.flatnonzero(np.diff(block)) + 1)


@dataclass
class _Photons:
    """Photons so far, each with its scope and its time, and paths that exceeded the majorant."""

    tables: list[PhotonTable] = field(default_factory=lambda: [no_photons()])
    scope: list[np.ndarray] = field(default_factory=lambda: [np.zeros(0, np.int64)])
    time: list[np.ndarray] = field(default_factory=lambda: [np.zeros(0)])
    exceeding: list[Samples] = field(default_factory=list)

    def take_exceeding(self) -> Samples | None:
        """The paths that exceeded the majorant since the last call, None if there are none."""
        parts, self.exceeding = [part for part in self.exceeding if part.k.size], []
        return Samples.joined(parts) if parts else None

    def first_of_each(self, wanted: np.ndarray) -> PhotonTable:
        """The photons in order of time, of each scope as many as it wants."""
        scope, time = np.concatenate(self.scope), np.concatenate(self.time)
        order = np.lexsort((time, scope))
        scope = scope[order]
        rank = places(scope)
        is_wanted = rank < wanted[scope]
        photons = joined(self.tables).take(order[is_wanted])
        return replace(photons, scope=scope[is_wanted], rank=rank[is_wanted])


@dataclass
class _Tally:
    candidates: int = 0
    followed: int = 0
    photons: int = 0
    paths: int = 0
    raises: int = 0
    exceeding: int = 0


class _Drawing:
    """One run: the settings, what was explored, and what has been drawn so far."""

    def __init__(
        self, setup: Setup, scopes: Scopes, seed: int, explored: Exploration, report: Report
    ) -> None:
        self.setup, self.scopes, self.seed, self.report = setup, scopes, seed, report
        self.explored, self.kept_share = explored, explored.kept_share
        self.progress = _Progress(scopes.draw_totals(seed))
        self.majorant = None if explored.majorant is None else explored.majorant.copy()
        self.tally = _Tally(paths=explored.paths)
        self.stream = 0
        """Number of the next round's random numbers."""

    def single_photons(self) -> PhotonTable:
        """Every photon one by one."""
        return self._draw(self.progress, self.scopes.photons_per_radiance)

    def counts(self) -> PhotonTable:
        """A row for each pixel that caught photons, drawn in parts that memory holds.

        Each part is a draw of its own for a share of the budgets or of the exposure. What one part has
        learned of the light the next ones know; the parts before it are not gone back to.
        """
        grid, gain = self.setup.grid, self.scopes.photons_per_radiance
        total = np.zeros(int(np.prod(grid.shape_KLHW)), dtype=np.int64)
        expected = float(self.progress.wanted.sum())
        if gain is not None:
            views = self.scopes.view.size
            expected = float(gain * self._mass(self._film_sampler()).sum() * views * self.kept_share)
        parts = int(np.ceil(expected / (MAX_SINGLE_PHOTONS / 4)))
        for number in range(parts):
            progress = self.progress.part(number, parts)
            photons = self._draw(progress, None if gain is None else gain / parts)
            np.add.at(total, photons.flat_pixels(grid), 1)
            self.progress.photons += progress.photons
            self.report("parts of the photons", number + 1, parts)
        pixel = np.flatnonzero(total)
        k, l, i, j = np.unravel_index(pixel, grid.shape_KLHW)
        return PhotonTable(k, l, i, j, total[pixel])

    def log(self) -> dict[str, Any]:
        """What the manifest says of the draw."""
        tally, progress = self.tally, self.progress
        return {
            "method": "thinning",
            "candidates": tally.candidates,
            "followed": tally.followed,
            "kept": tally.photons,
            "kept_share": round(tally.photons / max(tally.candidates, 1), 4),
            "paths_above_bound": tally.exceeding,
            "bound_raised": tally.raises,
            "share_above_bound_before": float(f"{self.explored.excess_share:.3g}"),
            "paths": tally.paths,
            "scopes_without_light": int(((progress.photons == 0) & (progress.wanted > 0)).sum()),
        }

    def _draw(self, progress: _Progress, gain: float | None) -> PhotonTable:
        """Photons of the exposure `gain`, or without one as many as each scope wants."""
        photons = _Photons()
        if self.majorant is not None or self.explored.emission.mass:
            if gain is None:
                self._fill_budgets(progress, photons)
            else:
                self._expose(progress, gain, photons)
            self._draw_above(progress, photons)
        table = photons.first_of_each(progress.wanted)
        assert table.scope is not None
        progress.photons[:] = np.bincount(table.scope, minlength=progress.photons.size)
        self.tally.photons += table.n.size
        return table

    def _fill_budgets(self, progress: _Progress, photons: _Photons) -> None:
        """Blocks of scopes, each in rounds of candidates until all have their photons, or are dark."""
        sampler, wanted = self._film_sampler(), int(progress.wanted.sum())
        max_dark_candidates = self.explored.max_dark_candidates
        for block in progress.blocks():
            round_number = 0
            while (some := np.intersect1d(progress.unfinished(max_dark_candidates), block)).size:
                missing = progress.wanted[some] - progress.photons[some]
                candidates = candidates_needed(missing, round_number, self.kept_share)
                time = candidates / self._mass(sampler)[self.scopes.group[some]]
                self._round(sampler, progress, some, progress.time[some], time, photons, emits=True)
                progress.time[some] += time
                round_number += 1
                self.report("photons", int(np.minimum(progress.photons, progress.wanted).sum()), wanted)

    def _expose(self, progress: _Progress, gain: float, photons: _Photons) -> None:
        """The exposure in as many equal parts as make their candidates fit a wavefront each."""
        sampler, everything = self._film_sampler(), np.arange(progress.wanted.size)
        parts = int(np.ceil(gain * self._mass(sampler).max() * everything.size / (WAVEFRONT / 2)))
        for part in range(parts):
            time = np.full(everything.size, gain / parts)
            self._round(sampler, progress, everything, progress.time, time, photons, emits=True)
            progress.time += time
            self.report("parts of the exposure", part + 1, parts)

    def _draw_above(self, progress: _Progress, photons: _Photons) -> None:
        """Raise the majorant where paths exceeded it, and draw what lies between, until none exceeds."""
        for raises in range(1, MAX_RAISES + 1):
            exceeding = photons.take_exceeding()
            if exceeding is None:
                return
            assert self.majorant is not None
            self.tally.raises += 1
            self.tally.exceeding += exceeding.k.size
            below, before = self.majorant.copy(), max(self.tally.candidates, WAVEFRONT)
            self.majorant.raise_bounds(exceeding, reach=raises)
            sampler = self._sampler(self.majorant, below)
            expected = progress.time * sampler.mass[self.scopes.group]
            if expected.sum() > MAX_EXTRA_RATIO * before:
                break
            scopes = np.flatnonzero(expected)
            block = expected[scopes].cumsum() // (WAVEFRONT / 2)
            for some in np.split(scopes, np.flatnonzero(np.diff(block)) + 1):
                self._round(sampler, progress, some, np.zeros(some.size), progress.time[some], photons)
            self.report("photons above the raised bound", raises, raises)
        else:
            if photons.take_exceeding() is None:
                return
        raise InputError(
            "photons: some light paths are so much brighter than all that were met before that single "
            "photons of them cannot be drawn; make lamps larger, metals rougher, or openings wider"
        )

    def _sampler(self, majorant: Majorant, below: Majorant | None = None) -> CandidateSampler:
        return sampler_for(self.setup, majorant, self.scopes.cell_groups, self.explored.ambient, below)

    def _film_sampler(self) -> CandidateSampler | None:
        return None if self.majorant is None else self._sampler(self.majorant)

    def _mass(self, sampler: CandidateSampler | None) -> np.ndarray:
        """Candidates of each group (G,) in one view and unit of time, of films and of what shines."""
        of_films = np.zeros(len(self.scopes.cell_groups)) if sampler is None else sampler.mass
        return of_films + self.explored.emission.mass

    def _round(
        self,
        sampler: CandidateSampler | None,
        progress: _Progress,
        some: np.ndarray,
        begin: np.ndarray,
        duration: np.ndarray,
        photons: _Photons,
        *,
        emits: bool = False,
    ) -> None:
        """Candidates of some scopes, from time `begin` on: of films, and with `emits` of what shines."""
        numbers = {"seed": self.seed, "round_number": self.stream}
        self.stream += 1
        rng = seeds.generator(stage="candidate numbers", **numbers)
        scopes, emission, photons_before = self.scopes, self.explored.emission, progress.photons.sum()
        candidates = 0

        def add(part: Accepted, scope: np.ndarray, number: np.ndarray) -> None:
            nonlocal candidates
            start, length = begin.repeat(number)[part.candidate], duration.repeat(number)[part.candidate]
            photons.tables.append(part.photons)
            photons.scope.append(scope[part.candidate])
            photons.time.append(start + length * rng.random(part.candidate.size))
            progress.photons += np.bincount(scope[part.candidate], minlength=progress.photons.size)
            progress.tried[some] += number
            candidates += scope.size

        if sampler is not None:
            number = rng.poisson(duration * sampler.mass[scopes.group[some]])
            scope = some.repeat(number)
            views = None if scopes.is_of_all_views else scopes.view[scope]
            path_seed = seeds.integer(stage="candidate paths", **numbers)
            part = sampler.try_candidates(scopes.group[scope], views, path_seed)
            add(part, scope, number)
            photons.exceeding.append(part.exceeding)
            self.tally.followed += part.ratio.size
            self.tally.paths += paths_of(sampler, scope.size, part.ratio.size)
        if emits and emission.mass:
            number = rng.poisson(duration * emission.mass)
            scope = some.repeat(number)
            views = scopes.view[scope]
            if scopes.is_of_all_views:
                views = rng.integers(0, self.setup.grid.view_count, scope.size)
            path_seed = seeds.integer(stage="emission candidates", **numbers)
            part = emission.try_candidates(scopes.group[scope], views, scopes.cell_groups, path_seed)
            add(part, scope, number)
            self.tally.paths += scope.size
        self.tally.candidates += candidates
        if emits:
            share = (progress.photons.sum() - photons_before) / max(candidates, 1)
            self.kept_share = max(share, MIN_KEPT_SHARE)


def candidates_needed(missing: np.ndarray, round_number: int, kept_share: float) -> np.ndarray:
    """How many to draw for each scope: about what is missing at first, then enough to be done.

    Together never more than fit a wavefront.
    """
    aim = missing if round_number == 0 else missing + 3.5 * np.sqrt(missing) + 4
    return np.clip(aim / kept_share, 16, max(WAVEFRONT // missing.size, 16)).astype(np.int64)
