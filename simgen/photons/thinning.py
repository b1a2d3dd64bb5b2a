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
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pcii.base.errors import InputError
from pcii.base.progress import Report, silent
from simgen.base import random_streams as seeds
from simgen.photons.candidates import CandidateSampler, Setup, cell_groups, paths_of
from simgen.photons.disparity_layers import Samples
from simgen.photons.exploration import LEAST_SHARE, Exploration, explore
from simgen.photons.samplers import sampler_for
from simgen.sensor.photon_table import PhotonTable, joined, no_photons
from simgen.spec.recipe import Photons

WAVEFRONT = 1 << 21
"""Candidates traced at once at most."""
MOST_RAISES = 64
"""How often the majorant is raised in one draw at most; light that exceeds every bound is refused then."""
MOST_EXTRA = 256
"""Candidates above a raised majorant, as a multiple of all before them (or of a wavefront, if that is more):
what would take longer is refused."""
MOST_AT_ONCE = 1 << 25
"""Photons of more than this are drawn in parts, of which only the counts are kept."""


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
    if explored is None:
        explored = explore(setup, photons, photons_per_radiance)
    draw = _Drawing(setup, photons, seed, photons_per_radiance, explored, report)
    drawn = draw.all_photons() if keeps_origins else draw.counts()
    return drawn.by_pixel(setup.grid), draw.log()


@dataclass
class PhotonScopes:
    """What photons are counted over, (S,): view (-1: all together), group of cells, and progress."""

    view: np.ndarray
    group: np.ndarray
    wanted: np.ndarray

    def __post_init__(self) -> None:
        self.got = np.zeros(self.view.size, dtype=np.int64)
        self.tried = np.zeros(self.view.size, dtype=np.int64)
        self.time = np.zeros(self.view.size)
        """How long photons have been drawn, in candidates per unit of majorant."""

    def open(self, max_dark_candidates: int) -> np.ndarray:
        """Numbers of those that still want photons and are not dark.

        Dark are those of which `max_dark_candidates` found nothing.
        """
        dark = (self.got == 0) & (self.tried >= max_dark_candidates)
        return np.flatnonzero((self.got < self.wanted) & ~dark)

    def part(self, number: int, parts: int) -> "PhotonScopes":
        """Like scopes that want an equal share of the photons, the `number`-th of `parts`."""
        share = self.wanted * (number + 1) // parts - self.wanted * number // parts
        is_endless = self.wanted == np.iinfo(np.int64).max
        return PhotonScopes(self.view, self.group, np.where(is_endless, self.wanted, share))

    def blocks(self) -> Iterator[np.ndarray]:
        """Numbers of scopes to be drawn together: as many as are likely to fit a wavefront."""
        block = (np.cumsum(self.wanted) - 1) // (WAVEFRONT // 4)
        yield from np.split(np.arange(self.wanted.size), np.flatnonzero(np.diff(block)) + 1)


def scopes_for(photons: Photons, view_count: int, group_count: int, seed: int) -> PhotonScopes:
    """The scopes of so many views and groups of cells; how many photons each gets of a budget is random.

    An exposure has no budget: its scopes, one a view, take as many as come.
    """
    views = np.array([-1]) if photons.scope == "scene" else np.arange(view_count)
    view, group = views.repeat(group_count), np.tile(np.arange(group_count), views.size)
    if photons.scope == "exposure":
        wanted = np.full(view.size, np.iinfo(np.int64).max)
    elif photons.statistics == "multinomial":
        wanted = np.full(view.size, round(photons.budget))
    else:
        wanted = seeds.generator(seed, stage="budget totals").poisson(photons.budget, view.size)
    return PhotonScopes(view, group, wanted)


@dataclass
class _Tally:
    candidates: int = 0
    followed: int = 0
    kept: int = 0
    paths: int = 0
    raises: int = 0
    above_bound: int = 0
    """Paths that exceeded the majorant that they were drawn from."""


class _Drawing:
    """One run: the settings, what was explored, and what has been drawn so far."""

    def __init__(
        self,
        setup: Setup,
        photons: Photons,
        seed: int,
        photons_per_radiance: float | None,
        explored: Exploration,
        report: Report,
    ) -> None:
        self.setup, self.photons, self.seed, self.report = setup, photons, seed, report
        self.gain, self.explored, self.share = photons_per_radiance, explored, explored.share
        self.groups = cell_groups(photons.scope, setup.cfa)
        self.scopes = scopes_for(photons, setup.grid.view_count, len(self.groups), seed)
        self.majorant = None if explored.majorant is None else explored.majorant.copy()
        self.tally = _Tally(paths=explored.paths)
        self.stream = 0
        """Number of the next round's random numbers."""

    def all_photons(self) -> PhotonTable:
        """Every photon one by one."""
        return self._part(self.scopes, self.gain)

    def counts(self) -> PhotonTable:
        """A row for each pixel that caught photons, drawn in parts that memory holds.

        Each part is a draw of its own for a share of the budgets or of the exposure. What one part has
        learned of the light the next ones know; the parts before it are not gone back to.
        """
        grid = self.setup.grid
        shape, total = grid.shape_KLHW, np.zeros(int(np.prod(grid.shape_KLHW)), dtype=np.int64)
        parts = int(np.ceil(self._expected() / (MOST_AT_ONCE / 4)))
        for part in range(parts):
            scopes = self.scopes.part(part, parts)
            photons = self._part(scopes, None if self.gain is None else self.gain / parts)
            np.add.at(total, photons.flat_pixels(grid), 1)
            self.scopes.got += scopes.got
            self.scopes.tried += scopes.tried
            self.report("parts of the photons", part + 1, parts)
        pixel = np.flatnonzero(total)
        k, l, i, j = np.unravel_index(pixel, shape)
        return PhotonTable(k, l, i, j, total[pixel])

    def log(self) -> dict[str, Any]:
        """What the manifest says of the draw."""
        tally, scopes = self.tally, self.scopes
        return {
            "method": "thinning",
            "candidates": tally.candidates,
            "followed": tally.followed,
            "kept": tally.kept,
            "kept_share": round(tally.kept / max(tally.candidates, 1), 4),
            "paths_above_bound": tally.above_bound,
            "bound_raised": tally.raises,
            "share_above_bound_before": float(f"{self.explored.excess_share:.3g}"),
            "paths": tally.paths,
            "scopes_without_light": int(((scopes.got == 0) & (scopes.wanted > 0)).sum()),
        }

    def _expected(self) -> float:
        """Photons of all scopes, about."""
        if self.gain is None:
            return float(self.scopes.wanted.sum())
        return float(self.gain * self._mass(self._film_sampler()).sum() * self.scopes.view.size * self.share)

    def _part(self, scopes: PhotonScopes, gain: float | None) -> PhotonTable:
        """All photons of these scopes: of the exposure `gain`, or as many as each wants."""
        found = _Found()
        if self.majorant is not None or self.explored.emission.mass:
            if gain is None:
                self._fill_budgets(scopes, found)
            else:
                self._expose(scopes, gain, found)
            self._draw_above(scopes, found)
        return self._first_of_each(scopes, found)

    def _fill_budgets(self, scopes: PhotonScopes, found: "_Found") -> None:
        """Blocks of scopes, each in rounds of candidates until all have their photons, or are dark."""
        sampler, wanted = self._film_sampler(), int(scopes.wanted.sum())
        most_dark = self.explored.max_dark_candidates
        for block in scopes.blocks():
            round_number = 0
            while (wanting := np.intersect1d(scopes.open(most_dark), block)).size:
                missing = scopes.wanted[wanting] - scopes.got[wanting]
                candidates = candidates_needed(missing, round_number, self.share)
                time = candidates / self._mass(sampler)[scopes.group[wanting]]
                self._round(sampler, scopes, wanting, scopes.time[wanting], time, found, emits=True)
                scopes.time[wanting] += time
                round_number += 1
                self.report("photons", int(np.minimum(scopes.got, scopes.wanted).sum()), wanted)

    def _expose(self, scopes: PhotonScopes, gain: float, found: "_Found") -> None:
        """The exposure in as many equal parts as make their candidates fit a wavefront each."""
        sampler, everything = self._film_sampler(), np.arange(scopes.view.size)
        parts = int(np.ceil(gain * self._mass(sampler).max() * everything.size / (WAVEFRONT / 2)))
        for part in range(parts):
            time = np.full(everything.size, gain / parts)
            self._round(sampler, scopes, everything, scopes.time, time, found, emits=True)
            scopes.time += time
            self.report("parts of the exposure", part + 1, parts)

    def _draw_above(self, scopes: PhotonScopes, found: "_Found") -> None:
        """Raise the majorant where paths exceeded it, and draw what lies between, until none exceeds."""
        for raised in range(1, MOST_RAISES + 1):
            over = found.take_over()
            if over is None:
                return
            assert self.majorant is not None
            self.tally.raises += 1
            self.tally.above_bound += over.k.size
            below, before = self.majorant.copy(), max(self.tally.candidates, WAVEFRONT)
            self.majorant.raise_bounds(over, reach=raised)
            sampler = sampler_for(self.setup, self.majorant, self.groups, self.explored.ambient, below)
            expected = scopes.time * sampler.mass[scopes.group]
            if expected.sum() > MOST_EXTRA * before:
                break
            every = np.flatnonzero(expected)
            for some in np.split(
                every, np.flatnonzero(np.diff(expected[every].cumsum() // (WAVEFRONT / 2))) + 1
            ):
                self._round(sampler, scopes, some, np.zeros(some.size), scopes.time[some], found)
            self.report("photons above the raised bound", raised, raised)
        else:
            if found.take_over() is None:
                return
        raise InputError(
            "photons: some light paths are so much brighter than all that were met before that single "
            "photons of them cannot be drawn; make lamps larger, metals rougher, or openings wider"
        )

    def _first_of_each(self, scopes: PhotonScopes, found: "_Found") -> PhotonTable:
        """The photons in order of time, of each scope as many as it wants."""
        photons, scope, time = found.photons()
        order = np.lexsort((time, scope))
        scope = scope[order]
        rank = places(scope)
        taken = rank < scopes.wanted[scope]
        order, scope, rank = order[taken], scope[taken], rank[taken]
        scopes.got[:] = np.bincount(scope, minlength=scopes.got.size)
        self.tally.kept += order.size
        return replace(photons.take(order), scope=scope, rank=rank)

    def _film_sampler(self) -> CandidateSampler | None:
        if self.majorant is None:
            return None
        return sampler_for(self.setup, self.majorant, self.groups, self.explored.ambient)

    def _mass(self, sampler: CandidateSampler | None) -> np.ndarray:
        """Candidates of each group (G,) in one view and unit of time, of films and of what shines."""
        of_films = np.zeros(len(self.groups)) if sampler is None else sampler.mass
        return of_films + self.explored.emission.mass

    def _round(
        self,
        sampler: CandidateSampler | None,
        scopes: PhotonScopes,
        which: np.ndarray,
        begin: np.ndarray,
        duration: np.ndarray,
        found: "_Found",
        *,
        emits: bool = False,
    ) -> None:
        """Candidates of these scopes, from time `begin` on: of films, and with `emits` of what shines."""
        numbers = {"seed": self.seed, "round_number": self.stream}
        self.stream += 1
        rng = seeds.generator(stage="candidate numbers", **numbers)
        emission, photons_before = self.explored.emission, scopes.got.sum()
        candidates = 0
        if sampler is not None:
            number = rng.poisson(duration * sampler.mass[scopes.group[which]])
            owner = which.repeat(number)
            views = None if self.photons.scope == "scene" else scopes.view[owner]
            part = sampler.try_candidates(
                scopes.group[owner], views, seeds.integer(stage="candidate paths", **numbers)
            )
            start, length = begin.repeat(number), duration.repeat(number)
            found.add(part.photons, owner, part.candidate, start, length, rng)
            found.over.append(part.over)
            scopes.got += np.bincount(owner[part.candidate], minlength=scopes.got.size)
            scopes.tried[which] += number
            candidates += owner.size
            self.tally.followed += part.ratio.size
            self.tally.paths += paths_of(sampler, owner.size, part.ratio.size)
        if emits and emission.mass:
            number = rng.poisson(duration * emission.mass)
            owner = which.repeat(number)
            views = scopes.view[owner]
            if self.photons.scope == "scene":
                views = rng.integers(0, self.setup.grid.view_count, owner.size)
            part = emission.try_candidates(
                scopes.group[owner], views, self.groups, seeds.integer(stage="emission candidates", **numbers)
            )
            found.add(part.photons, owner, part.candidate, begin.repeat(number), duration.repeat(number), rng)
            scopes.got += np.bincount(owner[part.candidate], minlength=scopes.got.size)
            scopes.tried[which] += number
            candidates += owner.size
            self.tally.paths += owner.size
        self.tally.candidates += candidates
        if emits:
            self.share = max((scopes.got.sum() - photons_before) / max(candidates, 1), LEAST_SHARE)


class _Found:
    """Photons so far, each with its scope and its time, and paths that exceeded the majorant."""

    def __init__(self) -> None:
        self.tables: list[PhotonTable] = [no_photons()]
        self.scope: list[np.ndarray] = [np.zeros(0, np.int64)]
        self.time: list[np.ndarray] = [np.zeros(0)]
        self.over: list[Samples] = []

    def add(
        self,
        photons: PhotonTable,
        owner: np.ndarray,
        candidate: np.ndarray,
        start: np.ndarray,
        length: np.ndarray,
        rng: np.random.Generator,
    ) -> None:
        """Photons of these candidates, whose scopes are `owner`, at times within `length` after `start`."""
        self.tables.append(photons)
        self.scope.append(owner[candidate])
        self.time.append(start[candidate] + length[candidate] * rng.random(candidate.size))

    def photons(self) -> tuple[PhotonTable, np.ndarray, np.ndarray]:
        """All photons, their scopes and their times."""
        return joined(self.tables), np.concatenate(self.scope), np.concatenate(self.time)

    def take_over(self) -> Samples | None:
        """The paths that exceeded the majorant since the last call, None if there are none."""
        parts, self.over = [part for part in self.over if part.k.size], []
        if not parts:
            return None
        total = parts[0]
        for part in parts[1:]:
            total = total.join(part)
        return total


def candidates_needed(missing: np.ndarray, round_number: int, share: float) -> np.ndarray:
    """How many to draw for each scope: about what is missing at first, then enough to be done.

    Together never more than fit a wavefront.
    """
    aim = missing if round_number == 0 else missing + 3.5 * np.sqrt(missing) + 4
    return np.clip(aim / share, 16, max(WAVEFRONT // missing.size, 16)).astype(np.int64)


def places(scope: np.ndarray) -> np.ndarray:
    """Place (N,), from 0, of each photon in its scope; `scope` (N,) is sorted, so that each is a run."""
    number = np.bincount(scope)
    first = np.cumsum(number) - number
    return np.arange(scope.size) - first[scope]
