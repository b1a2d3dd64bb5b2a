"""The search for the opaque layers of least energy: sweeps, then guess by guess.

Fitting one layer after another ends in the nearest valley: what a wrong piece hides is not believed, so that
nothing behind it can show that it is there. So whole pieces are guessed (`guesses`), put in place and
fitted with everything else; where that costs less around the piece, it stays. Surfaces are compared with the
light of each told by itself; a piece that differs from what is around it would then save something at any
depth, so the piece must also be better told by itself where it is than told by itself where it was.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pcii.core.camera_grid import CameraGrid
from pcii.core.focal_planes import FocalPlanes
from pcii.core.photon_counts import PhotonCounts
from pcii.evidence.cells import CELL_PX
from pcii.imaging.bright_regions import box_around, dilated
from pcii.removal.likelihood.guesses import AROUND_CELLS, Guess, guesses_of
from pcii.removal.likelihood.layers import BESIDE_SHARE, Layers, background_bounds

MOST_PHOTONS, MOST_PHOTONS_PER_PX = 150_000, 0.15
"""Of brighter films as many photons are drawn, or as many per px of a large one. A layer is flat and things
are round: with more photons E would rather cut a thing in two than let its front be a little out of focus."""
SWEEPS = 5
ROUNDS, SWEEPS_OF_A_GUESS = 2, 2
LIT_NATS = 0.1
"""Two thirds of what cells cost, while pieces are guessed: else the middle of a thing before something bright
is not worth its cells, since what it hides costs as much as before. Not from the start: where that is wrong
in front of all, what is wrong is to go."""
LEAST_NATS, PRIOR_SHARE = 5.0, 0.35
"""What a guess must save; of what outlines cost, and cells that else were dark, such a share counts for it. A
fit that follows noise pays in full, but of pieces that are guessed there are few."""


def layered(counts: PhotonCounts, total_disparity_px: np.ndarray, start: np.ndarray) -> np.ndarray:
    """The layer (h, w) int64 that the virtual centre sees in each cell, -1 where it is dark.

    `total_disparity_px` (D,) ascends, from far to near; `start` (h, w) is a guess of the result, from
    which layers are fitted; then pieces are guessed. Deterministic.
    """
    lit = start >= 0
    if not lit.any():
        return start
    grid = counts.grid
    most = max(MOST_PHOTONS, MOST_PHOTONS_PER_PX * grid.height * grid.width)
    few = counts.subsample(most, np.random.default_rng(0))
    dark = background_bounds(few, float(total_disparity_px[len(total_disparity_px) // 2]))
    box = _box_of_light(lit, grid, total_disparity_px)
    cut = _cut_out(few, box)
    layers = Layers(cut, total_disparity_px, dark)
    layers.put(_masks_of(start[box], len(layers.masks)))
    for _ in range(SWEEPS):
        layers.sweep()
    if len(total_disparity_px) > 1:
        _guess_anew(layers, Layers(cut, np.repeat(total_disparity_px, 2), dark))
    result = np.full(start.shape, -1)
    result[box] = layers.visible()
    return result


def _box_of_light(lit: np.ndarray, grid: CameraGrid, total_disparity_px: np.ndarray) -> tuple[slice, slice]:
    """Rows and columns of cells around all that is `lit` (h, w), and as far as its light goes by parallax."""
    down, right = (
        int(np.ceil(np.abs(shifts).max() / CELL_PX)) + AROUND_CELLS
        for shifts in FocalPlanes.at_total_disparity(grid, total_disparity_px).whole_shifts_px
    )
    return box_around(lit, (down, right))


def _cut_out(counts: PhotonCounts, box: tuple[slice, slice]) -> PhotonCounts:
    """The same cells of every view: a smaller film, whose cells have the same shifts."""
    events, grid = counts.events, counts.grid
    (top, bottom), (left, right) = ((part.start * CELL_PX, part.stop * CELL_PX) for part in box)
    cut_grid = replace(grid, height=min(bottom, grid.height) - top, width=min(right, grid.width) - left)
    inside = (events.i >= top) & (events.i < bottom) & (events.j >= left) & (events.j < right)
    k, l, i, j, n = (getattr(events, name)[inside] for name in "klijn")
    return PhotonCounts.from_events(k, l, i - top, j - left, n, cut_grid, cfa=counts.cfa)


def _masks_of(seen: np.ndarray, count: int) -> np.ndarray:
    return np.arange(count)[:, None, None] == seen


def _guess_anew(layers: Layers, doubled: Layers) -> None:
    """Guess pieces of the layers, and keep those that cost less.

    `doubled` has each of the `layers` twice, for surfaces that are told by themselves at the same depth.
    """
    layers.put(_masks_of(layers.visible(), len(layers.masks)))
    changed = np.ones(layers.masks.shape[1:], dtype=bool)
    for _ in range(ROUNDS):
        for _ in range(SWEEPS_OF_A_GUESS):
            layers.sweep(LIT_NATS)
        explained = _explained(doubled, layers.masks)
        # Where nothing has changed since, the same guess would fail again.
        guesses = [guess for guess in guesses_of(layers) if (guess.around & changed).any()]
        changed = np.zeros_like(changed)
        for together in _apart(guesses):
            explained, kept = _tried(layers, doubled, together, explained)
            for guess in kept:
                changed |= guess.around
        if not changed.any():
            break


def _apart(guesses: Sequence[Guess]) -> list[list[Guess]]:
    """The guesses in groups in which no two have to do with each other."""
    groups: list[tuple[np.ndarray, list[Guess]]] = []
    for guess in guesses:
        for taken, group in groups:
            if not (taken & guess.around).any():
                taken |= guess.around
                group.append(guess)
                break
        else:
            groups.append((guess.around.copy(), [guess]))
    return [group for _, group in groups]


def _tried(
    layers: Layers, doubled: Layers, guesses: Sequence[Guess], explained: np.ndarray
) -> tuple[np.ndarray, list[Guess]]:
    """What is explained (h, w) after those of the guesses were kept that lessen E, and which they are."""
    before, seen, cost = layers.masks.copy(), layers.visible(), layers.cost_seen()
    guessed = before.copy()
    for guess in guesses:
        guessed[:, guess.cells] = False
        guessed[guess.layer, guess.cells] = True
    layers.put(guessed)
    for _ in range(SWEEPS_OF_A_GUESS):
        layers.sweep(LIT_NATS)
    after, shown = layers.masks.copy(), layers.visible()
    cheaper = PRIOR_SHARE * (cost - layers.cost_seen())
    saved = _explained(doubled, after) - explained + cheaper
    better = [guess for guess in guesses if saved[guess.around].sum() > LEAST_NATS]
    kept: list[Guess] = []
    if better:
        # Is it the depth that is better, or that the piece is told by itself? So it may be where it was, too.
        moved = np.any([guess.around for guess in better], axis=0) & (shown != seen)
        was, now = (moved & _masks_of(where, len(before)) for where in (seen, shown))
        old, new = _told_by_itself(doubled, before, was), _told_by_itself(doubled, after, now)
        for guess in better:
            here = guess.around
            light = max(one[here].sum() for one in new) - max(one[here].sum() for one in old)
            if light + cheaper[here].sum() > LEAST_NATS:
                kept.append(guess)
    for guess in kept:
        before[:, guess.around] = after[:, guess.around]
    layers.put(before)
    return (_explained(doubled, before) if kept else explained), kept


def _explained(doubled: Layers, masks: np.ndarray) -> np.ndarray:
    """How well masks (D, h, w) explain the light, in nats (h, w), each surface told by itself."""
    return _explained_in_pairs(doubled, masks, np.zeros_like(masks))


def _told_by_itself(doubled: Layers, masks: np.ndarray, piece: np.ndarray) -> list[np.ndarray]:
    """The same if a piece (D, h, w) of the masks is told by itself: in front of the rest, and behind it.

    Of what shines in from beside a surface, what is behind it takes nothing. A piece beside something bright
    would so be better told by itself at any depth farther away.
    """
    # What is behind goes on under what is in front: through a seam the dark would show.
    under = np.array([dilated(own, 1) for own in piece]) & masks
    return [
        _explained_in_pairs(doubled, masks, piece),
        _explained_in_pairs(doubled, under, masks & ~piece),
    ]


def _explained_in_pairs(doubled: Layers, behind: np.ndarray, front: np.ndarray) -> np.ndarray:
    """How well masks (D, h, w) explain the light, two for each depth, the one behind the other."""
    both = np.empty_like(doubled.masks)
    both[::2], both[1::2] = behind, front
    doubled.put(both)
    return doubled.light_explained(beside=BESIDE_SHARE)
