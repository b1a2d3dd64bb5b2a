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
from. Photons from clumps are counted, and if they are more than 1 in 10 000 everything is drawn anew from
the majorant as it is by then.
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from pcii.bayer import colour_cells
from simgen import seeds
from simgen.candidates import Pool, Setup, try_candidates
from simgen.pilot import Pilot, explore
from simgen.recipe import Photons

OVERSHOOT_SHARE = 1e-4
ATTEMPTS = 12
WARM_UP_SHARE = 0.15
"""The warm-up's rounds aim for this share of the photons, but take so many candidates at least, at most."""
WARM_UP_CANDIDATES = (1 << 13, 1 << 17)
WARM_UP_ROUNDS = 2
EXCESS_SHARE = 5e-5
"""Share of the light that the warm-up leaves above the majorant."""
LIKELY_SHARE = 0.3
"""Share of the candidates that are kept, until it is known."""
LEAST_SHARE = 1e-4
WAVEFRONT = 1 << 21
"""Candidates traced at once at most."""
DARK_CANDIDATES = 1 << 20
"""A scope in which so many candidates in a row find no light has none."""


@dataclass(frozen=True)
class PhotonList:
    """Photons (N,): camera (k, l), pixel (i, j), point of the film, first hit's `object_id` and `z_mm`.

    `scope` is the number of the scope that each was drawn for and `rank` its place there: the first n
    of a scope are themselves an exact draw of n photons. `log` says how they came about.
    """

    k: np.ndarray
    l: np.ndarray
    i: np.ndarray
    j: np.ndarray
    row_px: np.ndarray
    col_px: np.ndarray
    object_id: np.ndarray
    z_mm: np.ndarray
    scope: np.ndarray
    rank: np.ndarray
    log: dict[str, Any]


@dataclass
class _Scopes:
    """What photons are counted over, (S,): view (-1: all together), group of cells, and progress."""

    view: np.ndarray
    group: np.ndarray
    wanted: np.ndarray
    got: np.ndarray
    tried: np.ndarray

    def open(self) -> np.ndarray:
        """Numbers of those that still want photons and are not known to be dark."""
        dark = (self.got == 0) & (self.tried >= DARK_CANDIDATES)
        return np.flatnonzero((self.got < self.wanted) & ~dark)


@dataclass
class _Tally:
    candidates: int = 0
    followed: int = 0
    kept: int = 0
    overshoot: int = 0


def draw_photons(setup: Setup, photons: Photons, *, seed: int) -> PhotonList:
    """All photons of all views; the same for the same setup, settings and seed."""
    wanted = int(_scopes(setup, photons, seed).wanted.sum())
    pilot = explore(setup, wanted, seed)
    paths, share = pilot.paths, 1.0
    if pilot.majorant is not None:
        spent, share = _warm_up(setup, photons, pilot, wanted, seed)
        paths += spent
    drawn: list[dict[str, np.ndarray]] = []
    tally, attempt = _Tally(), 0
    scopes = _scopes(setup, photons, seed)
    while pilot.majorant is not None:
        tally, scopes = _Tally(), _scopes(setup, photons, seed)
        drawn = []
        for number, block in enumerate(_blocks(scopes.wanted)):
            key = attempt, number
            drawn += _draw_block(setup, photons, pilot, scopes, block, tally, share, seed, key)
        paths += tally.candidates
        attempt += 1
        if tally.overshoot <= OVERSHOOT_SHARE * tally.kept or attempt == ATTEMPTS:
            break
    log = {
        "method": "thinning",
        "candidates": tally.candidates,
        "followed": tally.followed,
        "kept": tally.kept,
        "kept_share": round(tally.kept / max(tally.candidates, 1), 4),
        "overshoot_photons": tally.overshoot,
        "attempts": attempt,
        "paths": paths,
        "scopes_without_light": int(((scopes.got == 0) & (scopes.wanted > 0)).sum()),
    }
    return _joined(setup, drawn, log)


def _warm_up(setup: Setup, photons: Photons, pilot: Pilot, wanted: int, seed: int) -> tuple[int, float]:
    """Draw candidates for nothing but to lift the majorant where it is exceeded.

    Returns how many it took and what share of them was kept. What is learned here costs no photon its
    independence.
    """
    assert pilot.majorant is not None
    number = int(np.clip(WARM_UP_SHARE * wanted / LIKELY_SHARE, *WARM_UP_CANDIDATES))
    groups = _groups(setup, photons)
    share = LIKELY_SHARE
    for done in range(WARM_UP_ROUNDS):
        pool = Pool(setup, pilot.majorant, groups, pilot.ambient)
        group = np.arange(number) % len(groups)
        found = try_candidates(pool, group, None, seeds.integer(seed, view=2, stage="pilot", part=done))
        factor = _factor(found.ratio)
        share = max(found.copies.sum() / number / factor, LEAST_SHARE)
        pilot.majorant.scale(factor)
        if found.over.k.size:
            pilot.majorant.lift(found.over)
    return number * WARM_UP_ROUNDS, share


def _factor(ratio: np.ndarray) -> float:
    """By how much to raise all limits for the light above them to be at most `EXCESS_SHARE`."""
    allowed = EXCESS_SHARE * ratio.sum()
    ratio = np.sort(ratio)[::-1]
    # Above the n-th largest lies the sum of the n - 1 that are larger less as many times itself.
    above = np.cumsum(ratio) - np.arange(1, ratio.size + 1) * ratio
    return float(np.clip(ratio[np.searchsorted(above, allowed)], 0.5, 2.0)) if allowed > 0 else 1.0


def _groups(setup: Setup, photons: Photons) -> list[np.ndarray]:
    """Bayer cells (2 a + b) that each scope of a view draws from: all, or those of one colour."""
    if photons.scope != "channel":
        return [np.arange(4)]
    cells = colour_cells(setup.cfa).ravel()
    return [np.flatnonzero(cells == colour) for colour in range(setup.channels)]


def _scopes(setup: Setup, photons: Photons, seed: int) -> _Scopes:
    """The scopes of the budget; how many photons each gets is part of the experiment."""
    views = np.array([-1]) if photons.scope == "scene" else np.arange(setup.grid.view_count)
    groups = np.arange(len(_groups(setup, photons)))
    view, group = views.repeat(groups.size), np.tile(groups, views.size)
    if photons.statistics == "multinomial":
        wanted = np.full(view.size, round(photons.budget))
    else:
        wanted = seeds.generator(seed, view=0, stage="totals").poisson(photons.budget, view.size)
    return _Scopes(view, group, wanted, np.zeros_like(wanted), np.zeros_like(wanted))


def _blocks(wanted: np.ndarray) -> Iterator[np.ndarray]:
    """Numbers of scopes to be drawn together: as many as are likely to fit a wavefront."""
    block = (np.cumsum(wanted) - 1) // (WAVEFRONT // 4)
    yield from np.split(np.arange(wanted.size), np.flatnonzero(np.diff(block)) + 1)


def _draw_block(
    setup: Setup,
    photons: Photons,
    pilot: Pilot,
    scopes: _Scopes,
    block: np.ndarray,
    tally: _Tally,
    share: float,
    seed: int,
    key: tuple[int, int],
) -> Iterator[dict[str, np.ndarray]]:
    """Rounds of candidates until every scope of the block has its photons, or is dark."""
    attempt, block_number = key
    majorant = pilot.majorant
    assert majorant is not None
    round_number = 0
    while True:
        wanting = np.intersect1d(scopes.open(), block)
        if not wanting.size:
            return
        missing = scopes.wanted[wanting] - scopes.got[wanting]
        numbers = _candidates_needed(missing, round_number, share)
        owner = wanting.repeat(numbers)
        pool = Pool(setup, majorant, _groups(setup, photons), pilot.ambient)
        part = attempt << 16 | round_number
        views = None if photons.scope == "scene" else scopes.view[owner]
        path_seed = seeds.integer(seed, view=block_number, stage="paths", part=part)
        found = try_candidates(pool, scopes.group[owner], views, path_seed)
        if found.over.k.size:
            majorant.lift(found.over)
        path = np.arange(found.k.size).repeat(found.copies)
        scope = owner[found.candidate[path]]
        rank = _ranks(scope, scopes.got)
        taken = rank < scopes.wanted[scope]
        path, scope, rank = path[taken], scope[taken], rank[taken]
        scopes.got += np.bincount(scope, minlength=scopes.got.size)
        scopes.tried[wanting] += numbers
        tally.candidates += owner.size
        tally.followed += found.ratio.size
        tally.kept += path.size
        tally.overshoot += int((np.diff(path) == 0).sum())
        share = max(found.copies.sum() / owner.size, LEAST_SHARE)
        round_number += 1
        names = {field.name for field in fields(PhotonList)} & {field.name for field in fields(found)}
        yield {name: getattr(found, name)[path] for name in names} | {"scope": scope, "rank": rank}


def _candidates_needed(missing: np.ndarray, round_number: int, share: float) -> np.ndarray:
    """How many to draw for each scope: about what is missing at first, then enough to be done.

    Together never more than fit a wavefront.
    """
    aim = missing if round_number == 0 else missing + 3.5 * np.sqrt(missing) + 4
    return np.clip(aim / share, 16, max(WAVEFRONT // missing.size, 16)).astype(np.int64)


def _ranks(scope: np.ndarray, got: np.ndarray) -> np.ndarray:
    """Place of each photon in its scope; `scope` is sorted, so that a scope's photons are a run."""
    number = np.bincount(scope, minlength=got.size)
    first = np.cumsum(number) - number
    return np.arange(scope.size) - first[scope] + got[scope]


def _joined(setup: Setup, drawn: list[dict[str, np.ndarray]], log: dict[str, Any]) -> PhotonList:
    """All batches as one list, ordered by view and pixel, those of one pixel as they were drawn."""
    kinds = dict.fromkeys(("k", "l", "i", "j", "scope", "rank"), np.int64)
    kinds |= {"row_px": np.float32, "col_px": np.float32, "object_id": np.int16, "z_mm": np.float32}
    empty = {name: np.zeros(0, kind) for name, kind in kinds.items()}
    columns = {name: np.concatenate([batch[name] for batch in [empty, *drawn]]) for name in kinds}
    pixel = np.ravel_multi_index([columns[name] for name in "klij"], setup.grid.shape_KLHW)
    # With the place in the list as a last digit no two are equal, and any sort will do.
    order = np.argsort(pixel * pixel.size + np.arange(pixel.size))
    columns = {name: values[order] for name, values in columns.items()}
    return PhotonList(**columns, log=log)
