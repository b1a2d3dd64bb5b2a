"""Photons, not pixels: photon-limited images by thinning, in the time that their photons take.

A Poisson process of rate n L / E on the films, L the radiance in the pixel's colour and E its sum over
the scope that the budget n is counted over, is a Poisson number of independent photons with the density
L / E. So the number is drawn first, and then each photon by rejection: a candidate pixel from a majorant
M, ONE light path through it in its own colour, kept with probability L(path) / M. The path's radiance is
an unbiased estimate, so the kept pixel has exactly the density L / E, and E never needs to be known: the
normaliser has no error, since nothing is normalised. No pixel is rendered and no rendering noise enters
the counts (the marking and thinning theorems for Poisson processes; Lewis and Shedler 1979).

Where a path exceeds the majorant (L > M) it gives floor(L / M) photons and one more with the remaining
probability: the mean stays exact, but these photons come in clumps. Each round lifts the majorant where it
was exceeded, for the rounds after it: a kept photon has the density L / E whatever majorant it was drawn
from. Photons from clumps are counted, and if they are more than 1 in 10 000 everything is drawn anew from
the majorant as it is by then.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from pcii.bayer import channel_count, colour_cells
from pcii.types import CameraGrid
from simgen import seeds
from simgen.build import Built
from simgen.majorant import Majorant, explore, sensed
from simgen.paths import Rays, trace
from simgen.recipe import Photons

OVERSHOOT_SHARE = 1e-4
ATTEMPTS = 12
RAISE = 1.25
FIRST_SHARE = 0.2
"""Share of the photons that the first round aims for: it finds where the pilot missed something."""
WAVEFRONT = 1 << 22
"""Candidates traced at once at most."""
DARK_CANDIDATES = 1 << 20
"""A scope in which so many candidates in a row find no light has none."""


@dataclass(frozen=True)
class PhotonList:
    """Photons (N,): camera (k, l), pixel (i, j), first hit's `object_id` and `z_mm`.

    `stream` is the scope that each was drawn for and `rank` its place there: the first n of a scope
    are themselves an exact draw of n photons.
    """

    k: np.ndarray
    l: np.ndarray
    i: np.ndarray
    j: np.ndarray
    object_id: np.ndarray
    z_mm: np.ndarray
    stream: np.ndarray
    rank: np.ndarray
    log: dict[str, Any]


@dataclass
class _Stream:
    """One scope's sequence of candidates: which colour cells and views it draws from."""

    number: int
    view: int | None
    """View index; None draws the view too."""
    cells: np.ndarray
    """Flat indices of the Bayer cells (2 a + b) it draws from."""
    wanted: int
    rng: np.random.Generator
    got: int = 0
    tried: int = 0


@dataclass
class _Tally:
    candidates: int = 0
    kept: int = 0
    overshoot: int = 0


def draw_photons(
    built: Built, grid: CameraGrid, cfa: str | None, photons: Photons, *, max_depth: int, seed: int
) -> PhotonList:
    """All photons of all views; the same for the same scene, grid, settings and seed."""
    majorant = explore(built, grid, channel_count(cfa), max_depth=max_depth, seed=seed)
    if majorant is None:
        return _joined([], {"method": "thinning", "candidates": 0, "kept": 0, "overshoot_photons": 0})
    paths, attempt = majorant.paths, 0
    while True:
        tally = _Tally()
        streams = list(_streams(grid, cfa, photons, seed, attempt))
        drawn = [
            batch
            for number, block in enumerate(_blocks(streams))
            for batch in _draw_block(
                built, grid, cfa, majorant, block, tally, max_depth, seed, (attempt, number)
            )
        ]
        paths += tally.candidates
        attempt += 1
        if tally.overshoot <= OVERSHOOT_SHARE * tally.kept or attempt == ATTEMPTS:
            break
    log = {
        "method": "thinning",
        "candidates": tally.candidates,
        "kept": tally.kept,
        "kept_share": round(tally.kept / max(tally.candidates, 1), 4),
        "overshoot_photons": tally.overshoot,
        "attempts": attempt,
        "paths": paths,
        "scopes_without_light": sum(stream.got == 0 and stream.wanted > 0 for stream in streams),
    }
    return _joined(drawn, log)


def _streams(
    grid: CameraGrid, cfa: str | None, photons: Photons, seed: int, attempt: int
) -> Iterator[_Stream]:
    """The scopes of the budget, each with the number of photons that it gets."""
    cells = colour_cells(cfa).ravel()
    views: list[int | None] = [None] if photons.scope == "scene" else list(range(grid.view_count))
    colours: list[int | None] = [None]
    if photons.scope == "channel":
        colours = list(range(channel_count(cfa)))
    number = 0
    for view in views:
        for colour in colours:
            own = np.arange(4) if colour is None else np.flatnonzero(cells == colour)
            # The number of photons does not depend on the attempt: it is part of the experiment.
            totals = seeds.generator(seed, view=number, stage="totals")
            fixed = photons.statistics == "multinomial"
            wanted = round(photons.budget) if fixed else int(totals.poisson(photons.budget))
            rng = seeds.generator(seed, view=number, stage="candidates", part=attempt)
            yield _Stream(number, view, own, wanted, rng)
            number += 1


def _blocks(streams: list[_Stream]) -> Iterator[list[_Stream]]:
    """Streams traced together: as many as are likely to fit a wavefront, whoever draws them."""
    block: list[_Stream] = []
    for stream in streams:
        if block and sum(s.wanted for s in block) + stream.wanted > WAVEFRONT // 4:
            yield block
            block = []
        block.append(stream)
    if block:
        yield block


def _draw_block(
    built: Built,
    grid: CameraGrid,
    cfa: str | None,
    majorant: Majorant,
    block: list[_Stream],
    tally: _Tally,
    max_depth: int,
    seed: int,
    key: tuple[int, int],
) -> Iterator[dict[str, np.ndarray]]:
    """Rounds of candidates until every stream of the block has its photons, or is dark."""
    attempt, block_number = key
    share, round_number = 0.4, 0
    while True:
        open_streams = [s for s in block if s.got < s.wanted and not _is_dark(s)]
        if not open_streams:
            return
        numbers = [_candidates_needed(s, round_number, share, len(open_streams)) for s in open_streams]
        rays, bound, colour, chance, owner = _candidates(grid, cfa, majorant, open_streams, numbers)
        path_seed = seeds.integer(seed, view=block_number, stage="paths", part=attempt * 4096 + round_number)
        paths = trace(built, grid, rays, max_depth=max_depth, seed=path_seed)
        channels = channel_count(cfa)
        light = sensed(paths.radiance, channels)[np.arange(colour.size), colour]
        ratio = light.astype(np.float64) / bound
        copies = np.floor(ratio + 1 - chance).astype(np.int64)  # a share of ratio - floor gets one more
        kept = np.flatnonzero(copies)
        source = kept.repeat(copies[kept])
        rank, taken = _ranks(owner[source], open_streams)
        tally.candidates += sum(numbers)
        tally.kept += int(taken.sum())
        over = source[taken][ratio[source[taken]] > 1]
        tally.overshoot += over.size - np.unique(over).size
        _lift(majorant, rays, colour, ratio)
        source, rank = source[taken], rank[taken]
        accepted = np.bincount(owner[kept], minlength=len(open_streams))
        share = max(accepted.sum() / max(sum(numbers), 1), 1e-4)
        round_number += 1
        yield {
            "k": rays.k[source],
            "l": rays.l[source],
            "i": np.rint(rays.row_px[source]).astype(np.int64),
            "j": np.rint(rays.col_px[source]).astype(np.int64),
            "object_id": paths.object_id[source],
            "z_mm": paths.z_mm[source],
            "stream": np.array([s.number for s in open_streams])[owner[source]],
            "rank": rank,
        }


def _is_dark(stream: _Stream) -> bool:
    return stream.got == 0 and stream.tried >= DARK_CANDIDATES


def _candidates_needed(stream: _Stream, round_number: int, share: float, streams: int) -> int:
    """How many to draw: a part at first, then about what is missing, then enough to be done.

    Never more than fit a wavefront.
    """
    missing = stream.wanted - stream.got
    if round_number == 0:
        missing *= FIRST_SHARE
    elif round_number > 1:
        missing += 2 * np.sqrt(missing) + 2
    return int(np.clip(missing / share, 16, max(WAVEFRONT // streams, 16)))


def _candidates(
    grid: CameraGrid, cfa: str | None, majorant: Majorant, streams: list[_Stream], numbers: list[int]
) -> tuple[Rays, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Rays through candidate pixels; their bound, colour, chance in [0, 1), and stream (by position).

    A candidate's tile and Bayer cell are drawn by the majorant, its pixel evenly among the cell's
    pixels of the tile, its ray evenly within the pixel. Candidates beside the film are dropped.
    """
    cells = colour_cells(cfa).ravel()
    rows, cols, _ = majorant.bound.shape
    by_cell = majorant.bound[..., cells].reshape(rows * cols, 4)
    cumulative: dict[tuple[int, ...], np.ndarray] = {}
    chosen: list[np.ndarray] = []
    views: list[np.ndarray] = []
    chances = np.empty((sum(numbers), 4))
    start = 0
    for stream, number in zip(streams, numbers, strict=True):
        stream.tried += number
        random = stream.rng.random((number, 4))
        key = tuple(stream.cells.tolist())
        if key not in cumulative:
            running = np.cumsum(by_cell[:, stream.cells].ravel())
            cumulative[key] = running / running[-1]
        index = np.searchsorted(cumulative[key], random[:, 0], side="right")
        index = np.minimum(index, cumulative[key].size - 1)
        tile, cell = np.divmod(index, stream.cells.size)
        chosen.append(tile * 4 + stream.cells[cell])
        if stream.view is None:
            views.append(stream.rng.integers(0, grid.view_count, number))
        else:
            views.append(np.full(number, stream.view))
        chances[start : start + number] = random
        start += number
    where, view = np.concatenate(chosen), np.concatenate(views)
    owner = np.repeat(np.arange(len(streams)), numbers)
    tile, cell = np.divmod(where, 4)
    k, l = np.divmod(view, grid.cols)
    # One number gives the pixel (its whole part) and the place within the pixel (the rest).
    place = chances[:, 1:3] * (majorant.tile_px // 2)
    whole = np.floor(place)
    row = tile // cols * majorant.tile_px + 2 * whole[:, 0] + cell // 2 - majorant.row_shift[k]
    col = tile % cols * majorant.tile_px + 2 * whole[:, 1] + cell % 2 - majorant.col_shift[l]
    keep = (row >= 0) & (row < grid.height) & (col >= 0) & (col < grid.width)
    inner = place - whole - 0.5
    rays = Rays(k[keep], l[keep], (row + inner[:, 0])[keep], (col + inner[:, 1])[keep])
    bound = by_cell.ravel()[where[keep]]
    return rays, bound, cells[cell[keep]], chances[keep, 3], owner[keep]


def _ranks(owner: np.ndarray, streams: list[_Stream]) -> tuple[np.ndarray, np.ndarray]:
    """Place of each accepted photon in its stream, and whether the stream still wants it.

    `owner` is sorted, so a stream's photons are a run in the order in which they were drawn.
    """
    number = np.bincount(owner, minlength=len(streams))
    first = np.cumsum(number) - number
    got = np.array([stream.got for stream in streams])
    wanted = np.array([stream.wanted for stream in streams])
    rank = np.arange(owner.size) - first[owner] + got[owner]
    for stream, more in zip(streams, number, strict=True):
        stream.got = min(stream.wanted, stream.got + int(more))
    return rank, rank < wanted[owner]


def _lift(majorant: Majorant, rays: Rays, colour: np.ndarray, ratio: np.ndarray) -> None:
    """Raise the majorant, in place, where paths exceeded it: on the tile and on those around it."""
    over = np.flatnonzero(ratio > 1)
    row, col = majorant.tiles_of(Rays(rays.k[over], rays.l[over], rays.row_px[over], rays.col_px[over]))
    level = majorant.bound[row, col, colour[over]] * ratio[over] * RAISE
    for r, c, n, height in zip(row, col, colour[over], level, strict=True):
        around = majorant.bound[max(r - 1, 0) : r + 2, max(c - 1, 0) : c + 2, n]
        np.maximum(around, height, out=around)


def _joined(drawn: list[dict[str, np.ndarray]], log: dict[str, Any]) -> PhotonList:
    """All batches as one list, ordered by view and pixel, then by scope and rank."""
    kinds = {"k": np.int64, "l": np.int64, "i": np.int64, "j": np.int64, "object_id": np.int16}
    kinds |= {"z_mm": np.float32, "stream": np.int64, "rank": np.int64}
    empty = {name: np.zeros(0, kind) for name, kind in kinds.items()}
    columns = {name: np.concatenate([batch[name] for batch in [empty, *drawn]]) for name in kinds}
    order = np.lexsort([columns[name] for name in ("rank", "stream", "j", "i", "l", "k")])
    columns = {name: values[order] for name, values in columns.items()}
    return PhotonList(**columns, log=log)
