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

import math
from collections import Counter
from copy import deepcopy
from dataclasses import replace
from itertools import count
from typing import Any

import numpy as np

from pcii.base import InputError, Report, silent
from simgen.base import join_rows
from simgen.base import random_streams as seeds
from simgen.photons.candidates import CandidateSampler, Capture, ranks_in_scopes
from simgen.photons.exploration import MIN_KEPT_SHARE, Plan, explore, sampler_class
from simgen.photons.majorant import Samples
from simgen.photons.mirror_images import KnownPlaces
from simgen.sensor import PhotonTable, joined, no_photons

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
    capture: Capture, plan: Plan | None = None, report: Report = silent
) -> tuple[PhotonTable, dict[str, Any]]:
    """All photons of all views, ordered by view and pixel, and a log of how they came about.

    One row for each photon, with scope, rank and first hit; the same for the same capture. Where the plan is
    not to keep their origins a row for each pixel that caught any: of more photons than memory holds.

    The `plan` is explored now if it is not yet. Raises `InputError` for radiance that is not finite, and for
    light that exceeds every bound.
    """
    if plan is None or plan.known_places is None:
        plan = explore(capture, plan)
    drawing = _Drawing(capture, plan, report)
    if plan.keeps_origins:
        table = drawing.draw(drawing.totals, capture.photons_per_radiance)
    else:
        table = drawing.draw_counts()
    return table.by_pixel(capture.grid), drawing.log()


class _Photons:
    """Photons of scopes (S,) so far: how many each wants and has, candidates tried, and the time drawn.

    Time is in candidates per unit of majorant. `parts` are photons with the scope and time of each,
    `exceeding` paths that exceeded the majorant.
    """

    def __init__(self, wanted: np.ndarray) -> None:
        self.wanted = wanted
        self.number, self.tried = np.zeros((2, wanted.size), dtype=np.int64)
        self.time = np.zeros(wanted.size)
        self.parts = [(no_photons(), np.zeros(0, np.int64), np.zeros(0))]
        self.exceeding: list[Samples] = []

    def add(self, table: PhotonTable, scope: np.ndarray, time: np.ndarray) -> None:
        """Photons (N,), each with its scope and time."""
        self.parts.append((table, scope, time))
        self.number += np.bincount(scope, minlength=self.number.size)

    def first_of_each(self) -> PhotonTable:
        """The photons in order of time, of each scope as many as it wants."""
        tables, scopes, times = zip(*self.parts, strict=True)
        scope = np.concatenate(scopes)
        order = np.lexsort((np.concatenate(times), scope))
        scope = scope[order]
        rank = ranks_in_scopes(scope)
        is_wanted = rank < self.wanted[scope]
        photons = joined(tables).take(order[is_wanted])
        return replace(photons, scope=scope[is_wanted], rank=rank[is_wanted])


class _Drawing:
    """One run: the capture, its plan, and what has been drawn so far.

    `totals` (S,) are the photons that each scope is to have, `number` (S,) those that it has.
    """

    def __init__(self, capture: Capture, plan: Plan, report: Report) -> None:
        self.capture, self.plan, self.report = capture, plan, report
        self.known_places, self.kept_share = plan.known_places or KnownPlaces([]), plan.kept_share
        self.totals = capture.draw_totals()
        self.number = np.zeros(self.totals.size, dtype=np.int64)
        self.majorant = None if plan.majorant is None else deepcopy(plan.majorant)
        self.tally = Counter(paths=plan.paths)

    def draw(self, wanted: np.ndarray, gain: float | None) -> PhotonTable:
        """Every photon one by one: of the exposure `gain`, or without one as many as each scope wants."""
        photons = _Photons(wanted)
        if self.majorant is not None or self.known_places.mass:
            if gain is None:
                self._fill_budgets(photons)
            else:
                self._expose(photons, gain)
            self._draw_above(photons)
        self.number += np.minimum(photons.number, wanted)
        return photons.first_of_each()

    def draw_counts(self) -> PhotonTable:
        """A row for each pixel that caught photons, drawn in parts that memory holds.

        Each part is a draw of its own for a share of the budgets or of the exposure. What one part has
        learned of the light the next ones know; the parts before it are not gone back to.
        """
        grid, wanted, gain = self.capture.grid, self.totals, self.capture.photons_per_radiance
        total = np.zeros(int(np.prod(grid.shape_KLHW)), dtype=np.int64)
        expected = float(wanted.sum())
        if gain is not None:
            expected = float(gain * self._mass(self._film_sampler()).sum() * wanted.size * self.kept_share)
        parts = int(np.ceil(expected / (MAX_SINGLE_PHOTONS / 4)))
        for part in range(parts):
            if gain is not None:
                photons = self.draw(wanted, gain / parts)
            else:
                photons = self.draw(wanted * (part + 1) // parts - wanted * part // parts, None)
            np.add.at(total, photons.flat_pixels(grid), 1)
            self.report("parts of the photons", part + 1, parts)
        pixel = np.flatnonzero(total)
        k, l, i, j = np.unravel_index(pixel, grid.shape_KLHW)
        return PhotonTable(k, l, i, j, total[pixel])

    def log(self) -> dict[str, Any]:
        """What the manifest says of the draw."""
        tally, kept = self.tally, int(self.number.sum())
        return {
            "method": "thinning",
            "candidates": tally["candidates"],
            "followed": tally["followed"],
            "kept": kept,
            "kept_share": round(kept / max(tally["candidates"], 1), 4),
            "paths_above_bound": tally["exceeding"],
            "bound_raised": tally["raises"],
            "share_above_bound_before": float(f"{self.plan.excess_share:.3g}"),
            "paths": tally["paths"],
            "aimed_at": [light.log for light in self.plan.bright_light],
            "scopes_without_light": int(((self.number == 0) & (self.totals > 0)).sum()),
            "dense_paths_instead": self.plan.samples * math.prod(self.capture.grid.shape_KLHW),
            "normaliser_standard_error": 0.0,
        }

    def _fill_budgets(self, photons: _Photons) -> None:
        """Rounds of candidates until all scopes have their photons, or are dark.

        Scopes are drawn in blocks whose photons are likely to fit a wavefront.
        """
        sampler, wanted = self._film_sampler(), photons.wanted
        max_dark_candidates = sampler_class(self.capture).max_dark_candidates
        for block in _split(np.arange(wanted.size), (np.cumsum(wanted) - 1) // (WAVEFRONT // 4)):
            for round_number in count():
                is_dark = (photons.number == 0) & (photons.tried >= max_dark_candidates)
                some = block[((photons.number < wanted) & ~is_dark)[block]]
                if not some.size:
                    break
                missing = wanted[some] - photons.number[some]
                # About what is missing at first, then enough to be done; no more than fit a wavefront.
                aim = missing if round_number == 0 else missing + 3.5 * np.sqrt(missing) + 4
                most = max(WAVEFRONT // missing.size, 16)
                candidates = np.clip(aim / self.kept_share, 16, most).astype(np.int64)
                time = candidates / self._mass(sampler)[self.capture.group_of_scope[some]]
                self._round(photons, sampler, some, photons.time[some], time, emits=True)
                photons.time[some] += time
                self.report("photons", int(np.minimum(photons.number, wanted).sum()), int(wanted.sum()))

    def _expose(self, photons: _Photons, gain: float) -> None:
        """The exposure in as many equal parts as make their candidates fit a wavefront each."""
        sampler, everything = self._film_sampler(), np.arange(photons.wanted.size)
        parts = int(np.ceil(gain * self._mass(sampler).max() * everything.size / (WAVEFRONT / 2)))
        for part in range(parts):
            time = np.full(everything.size, gain / parts)
            self._round(photons, sampler, everything, photons.time, time, emits=True)
            photons.time += time
            self.report("parts of the exposure", part + 1, parts)

    def _draw_above(self, photons: _Photons) -> None:
        """Raise the majorant where paths exceeded it, and draw what lies between, until none exceeds."""
        for raises in count(1):
            parts, photons.exceeding = [part for part in photons.exceeding if part.k.size], []
            if not parts:
                return
            assert self.majorant is not None
            exceeding = join_rows(parts)
            self.tally.update(raises=1, exceeding=exceeding.k.size)
            below, before = deepcopy(self.majorant), max(self.tally["candidates"], WAVEFRONT)
            self.majorant.raise_bounds(exceeding, reach=raises)
            sampler = self.plan.sampler(self.capture, self.majorant, below)
            expected = photons.time * sampler.mass[self.capture.group_of_scope]
            if raises > MAX_RAISES or expected.sum() > MAX_EXTRA_RATIO * before:
                raise InputError(
                    "photons: some light paths are so much brighter than all that were met before that "
                    "single photons of them cannot be drawn; make lamps larger, metals rougher, or "
                    "openings wider"
                )
            scopes = np.flatnonzero(expected)
            for some in _split(scopes, expected[scopes].cumsum() // (WAVEFRONT / 2)):
                self._round(photons, sampler, some, np.zeros(some.size), photons.time[some])
            self.report("photons above the raised bound", raises, raises)

    def _film_sampler(self) -> CandidateSampler | None:
        return None if self.majorant is None else self.plan.sampler(self.capture, self.majorant)

    def _mass(self, sampler: CandidateSampler | None) -> np.ndarray:
        """Candidates of each group (G,) in one view and unit of time, of films and of what shines."""
        of_films = np.zeros(len(self.capture.cell_groups)) if sampler is None else sampler.mass
        return of_films + self.known_places.mass

    def _round(
        self,
        photons: _Photons,
        sampler: CandidateSampler | None,
        some: np.ndarray,
        begin: np.ndarray,
        duration: np.ndarray,
        *,
        emits: bool = False,
    ) -> None:
        """Candidates of some scopes, from time `begin` on: of films, and with `emits` of what shines."""
        capture, known, tally = self.capture, self.known_places, self.tally
        numbers = {"seed": capture.seed, "round_number": tally["rounds"]}
        rng = seeds.generator(stage="candidate numbers", **numbers)
        candidates_before, photons_before = tally["candidates"], photons.number.sum()

        def add(table: PhotonTable, candidate: np.ndarray, number: np.ndarray, paths: int) -> None:
            of_scope = np.arange(some.size).repeat(number)[candidate]
            time = begin[of_scope] + duration[of_scope] * rng.random(of_scope.size)
            photons.add(table, some[of_scope], time)
            photons.tried[some] += number
            tally.update(candidates=int(number.sum()), paths=paths)

        if sampler is not None:
            number = rng.poisson(duration * sampler.mass[capture.group_of_scope[some]])
            scope = some.repeat(number)
            view = None if capture.has_one_budget else capture.view_of_scope[scope]
            path_seed = seeds.integer(stage="candidate paths", **numbers)
            part = sampler.try_candidates(capture.group_of_scope[scope], view, path_seed)
            add(part.photons, part.candidate, number, sampler.count_paths(scope.size, part.ratio.size))
            photons.exceeding.append(part.exceeding)
            tally.update(followed=part.ratio.size)
        if emits and known.mass:
            number = rng.poisson(duration * known.mass)
            scope = some.repeat(number)
            view = capture.view_of_scope[scope]
            if capture.has_one_budget:
                view = rng.integers(0, self.capture.grid.view_count, scope.size)
            path_seed = seeds.integer(stage="emission candidates", **numbers)
            cells = capture.is_cell_of_group[capture.group_of_scope[scope]]
            add(*known.draw(cells, view, path_seed), number, scope.size)
        tally["rounds"] += 1
        if emits:
            candidates = max(tally["candidates"] - candidates_before, 1)
            self.kept_share = max((photons.number.sum() - photons_before) / candidates, MIN_KEPT_SHARE)


def _split(scopes: np.ndarray, block: np.ndarray) -> list[np.ndarray]:
    """Scopes (N,) in runs of the same number of `block` (N,)."""
    return np.split(scopes, np.flatnonzero(np.diff(block)) + 1)
