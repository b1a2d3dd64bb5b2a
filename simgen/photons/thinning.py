"""Photons, not pixels: photon-limited images by thinning, in the time that their photons take.

A Poisson process of rate n L / E on the films, L the radiance in the pixel's colour and E its sum over
the scope that the budget n is counted over, is a Poisson number of independent photons with the density
L / E. So the number is drawn first, and then each photon by rejection: a candidate pixel from a majorant
M, ONE light path through it in its own colour, kept with probability L(path) / M. The path's radiance is
an unbiased estimate, so the kept pixel has exactly the density L / E, and E never needs to be known: the
normaliser has no error, since nothing is normalised. No pixel is rendered and no rendering noise enters
the counts (the marking and thinning theorems for Poisson processes; Lewis and Shedler 1979). With scope
`exposure` the rate is absolute, g L: then the number of candidates is Poisson with mean g M, and those
that are kept are the photons.

Where a path exceeds the majorant (L > M) it gives floor(L / M) photons and one more with the remaining
probability: the mean stays exact, but these photons come in clumps. Each round lifts the majorant where it
was exceeded, for the rounds after it: a kept photon has the density L / E whatever majorant it was drawn
from. Photons are drawn in parts: all of some views, or a part of the exposure. Clumps are counted, and if a
test of the counts could see those of all parts so far (`pairs_allowed`) the last part is drawn again from
the majorant as it is by then.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from pcii.base.progress import Report, silent
from simgen.base import random_streams as seeds
from simgen.photons.candidates import CandidateSampler, Setup, paths_of
from simgen.photons.exploration import LEAST_SHARE, Exploration, explore, pairs_allowed, pairs_of
from simgen.photons.photon_scopes import WAVEFRONT, candidates_needed, cell_groups, places, scopes_for
from simgen.photons.samplers import sampler_for
from simgen.sensor.photon_table import PhotonTable, joined, no_photons
from simgen.spec.recipe import Photons

ATTEMPTS = 8
"""Draws of a part at most; of the least that exploration accepts, one in four within the rule, eight fail
in 10 % of cases."""

Part = Callable[[int], Iterator[PhotonTable]]
"""Rounds of a part, given which attempt it is."""


@dataclass
class _Tally:
    candidates: int = 0
    followed: int = 0
    kept: int = 0
    overshoot: int = 0
    pairs: int = 0
    """Of photons that one path gave."""


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
    Without `keeps_origins` the same photons, a row for each pixel that caught any: of more than memory holds.

    `photons_per_radiance` are those that a pixel catches of a unit of radiance, for scope `exposure`.
    `explored` is what `explore` found for the same setup and settings, if it is known already. Raises
    ValueError for scope `exposure` without `photons_per_radiance`, and for another scope with it.
    """
    if explored is None:
        explored = explore(setup, photons, photons_per_radiance)
    return _Drawing(setup, photons, seed, photons_per_radiance, explored, report).run(keeps_origins)


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
        self.gain = photons_per_radiance
        self.groups = cell_groups(photons.scope, setup.cfa)
        self.scopes = scopes_for(photons, setup.grid.view_count, len(self.groups), seed)
        self.tally = _Tally()
        self.explored, self.share = explored, explored.share
        self.majorant = None if explored.majorant is None else explored.majorant.copy()
        self.attempts, self.paths = 1, explored.paths

    def run(self, keeps_origins: bool) -> tuple[PhotonTable, dict[str, Any]]:
        """Draw all parts, each again while too many photons come in clumps."""
        parts = () if self.majorant is None else self._parts()
        drawn = joined([no_photons(), *parts]) if keeps_origins else self._summed(parts)
        tally, scopes = self.tally, self.scopes
        log = {
            "method": "thinning",
            "candidates": tally.candidates,
            "followed": tally.followed,
            "kept": tally.kept,
            "kept_share": round(tally.kept / max(tally.candidates, 1), 4),
            "overshoot_photons": tally.overshoot,
            "clump_pairs": tally.pairs,
            "clump_pairs_allowed": self._pairs_allowed(),
            "attempts": self.attempts,
            "paths": self.paths,
            "scopes_without_light": int(((scopes.got == 0) & (scopes.wanted > 0)).sum()),
        }
        return drawn.by_pixel(self.setup.grid), log

    def _parts(self) -> Iterator[PhotonTable]:
        """The photons of all parts; one that keeps too many clumps is the last."""
        for part in self._exposed() if self.gain is not None else self._budgeted():
            yield self._photons_of(part)
            if self._has_too_many_clumps():
                return

    def _photons_of(self, part: Part) -> PhotonTable:
        """The photons of a part, drawn again while too many come in clumps, `ATTEMPTS` times at most."""
        scopes, tally, attempt = self.scopes, self.tally, 0
        got, tried = scopes.got, scopes.tried
        while True:
            scopes.got, scopes.tried, self.tally = got.copy(), tried.copy(), replace(tally)
            photons = joined([no_photons(), *part(attempt)])
            attempt += 1
            self.attempts = max(self.attempts, attempt)
            if not self._has_too_many_clumps() or attempt == ATTEMPTS:
                return photons

    def _has_too_many_clumps(self) -> bool:
        return self.tally.pairs > self._pairs_allowed()

    def _pairs_allowed(self) -> float:
        """How many pairs of the photons so far may come from one path."""
        return pairs_allowed(self.tally.kept, math.prod(self.setup.grid.shape_KLHW))

    def _summed(self, rounds: Iterable[PhotonTable]) -> PhotonTable:
        """A row for each pixel that caught photons, in all of these rounds."""
        grid = self.setup.grid
        counts = np.zeros(math.prod(grid.shape_KLHW), dtype=np.int64)
        for photons in rounds:
            np.add.at(counts, photons.flat_pixels(grid), 1)
        pixel = np.flatnonzero(counts)
        k, l, i, j = np.unravel_index(pixel, grid.shape_KLHW)
        return PhotonTable(k, l, i, j, counts[pixel])

    def _sampler(self) -> CandidateSampler:
        assert self.majorant is not None
        return sampler_for(self.setup, self.majorant, self.groups, self.explored.ambient)

    def _budgeted(self) -> Iterator[Part]:
        """Blocks of scopes, each in rounds of candidates until all have their photons, or are dark."""
        most_dark, shown = self.explored.max_dark_candidates, 0

        def block_of(part: int, block: np.ndarray, attempt: int) -> Iterator[PhotonTable]:
            nonlocal shown
            round_number = 0
            while (wanting := np.intersect1d(self.scopes.open(most_dark), block)).size:
                missing = self.scopes.wanted[wanting] - self.scopes.got[wanting]
                candidates = candidates_needed(missing, round_number, self.share)
                yield self._round(wanting, candidates, self._sampler(), part, attempt, round_number)
                round_number += 1
                shown = max(shown, int(self.scopes.got.sum()))  # never less, if a block is drawn again
                self.report("photons", shown, int(self.scopes.wanted.sum()))

        for part, block in enumerate(self.scopes.blocks()):
            yield partial(block_of, part, block)

    def _exposed(self) -> Iterator[Part]:
        """The exposure in as many equal parts as make its candidates fit a wavefront each."""
        assert self.gain is not None
        gain, views = self.gain, np.arange(self.setup.grid.view_count)
        parts = int(np.ceil(gain * self._sampler().mass[0] * views.size / (WAVEFRONT / 2)))

        def exposed(part: int, attempt: int) -> Iterator[PhotonTable]:
            sampler = self._sampler()
            rng = seeds.generator(self.seed, stage="exposure candidates", part=part, attempt=attempt)
            candidates = rng.poisson(gain / parts * sampler.mass[0], views.size)
            yield self._round(views, candidates, sampler, part, attempt)
            self.report("parts of the exposure", part + 1, parts)

        for part in range(parts):
            yield partial(exposed, part)

    def _round(
        self,
        scopes: np.ndarray,
        candidates: np.ndarray,
        sampler: CandidateSampler,
        part: int,
        attempt: int,
        round_number: int = 0,
    ) -> PhotonTable:
        """Photons of one round of a part of the work: so many candidates for each of these scopes."""
        owner = scopes.repeat(candidates)
        views = None if self.photons.scope == "scene" else self.scopes.view[owner]
        path_seed = seeds.integer(
            self.seed, stage="candidate paths", part=part, attempt=attempt, round_number=round_number
        )
        found = sampler.try_candidates(self.scopes.group[owner], views, path_seed)
        # Light that is rare but spread far shows on few tiles at a time: it is sought ever farther around.
        sampler.majorant.lift(found.over, reach=1 + attempt)
        path = np.arange(found.candidate.size).repeat(found.photons.n)
        scope = owner[found.candidate[path]]
        rank = places(scope) + self.scopes.got[scope]
        taken = rank < self.scopes.wanted[scope]
        path, scope, rank = path[taken], scope[taken], rank[taken]
        self.scopes.got += np.bincount(scope, minlength=self.scopes.got.size)
        self.scopes.tried[scopes] += candidates
        self.tally.candidates += owner.size
        self.tally.followed += found.ratio.size
        self.paths += paths_of(sampler, owner.size, found.ratio.size)
        self.tally.kept += path.size
        of_path = np.bincount(path)
        self.tally.overshoot += int(np.maximum(of_path - 1, 0).sum())
        self.tally.pairs += pairs_of(of_path)
        self.share = max(found.photons.n.sum() / max(owner.size, 1), LEAST_SHARE)
        photons = found.photons.take(path)
        return replace(photons, n=np.ones_like(photons.n), scope=scope, rank=rank)
