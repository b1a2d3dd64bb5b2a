"""The search for the opaque layers of least energy: sweeps over the layers, then proposals of whole pieces.

Fitting one layer after another ends in the nearest local minimum: photons of a hidden surface do not count
for it, so that what a wrong piece hides stays hidden. So whole pieces are proposed (`proposals`), put in
place and fitted with everything else; a proposal is kept where it lowers the energy around it. Surfaces are
then compared with the rate of each estimated from its own photons. A piece that differs from its
surroundings would lower the energy at any depth, so it must also explain the photons better, by its own
rate, at the proposed depth than, by its own rate, at the depth where it was.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pcii.evidence.cells import CELL_PX
from pcii.imaging.bright_regions import box_around, dilated
from pcii.removal.likelihood.layers import BESIDE_SHARE, Layers, background_bounds
from pcii.removal.likelihood.proposals import AROUND_CELLS, Proposal, proposals_of
from pcii.types.camera_grid import CameraGrid
from pcii.types.focal_planes import FocalPlanes
from pcii.types.photon_counts import PhotonCounts

MOST_PHOTONS, MOST_PHOTONS_PER_PX = 150_000, 0.15
"""Of brighter films as many photons are drawn, or as many per px of a large one. A layer is flat and things
are round: with more photons E would rather cut a thing in two than let its front be a little out of focus."""
SWEEPS = 5
ROUNDS, SWEEPS_OF_A_PROPOSAL = 2, 2
LIT_NATS = 0.1
"""Two thirds of what cells cost, while pieces are proposed: else the middle of a thing before something
bright is not worth its cells, since what it hides costs as much as before. Not from the start: where that is
wrong in front of all, what is wrong is to go."""
LEAST_NATS, PRIOR_SHARE = 5.0, 0.35
"""By how much a proposal must lower the energy. Of the cost of outlines, and of cells that else were dark,
such a share counts: a fit that follows noise pays in full, but proposals are few."""


def layered(counts: PhotonCounts, total_disparity_px: np.ndarray, start: np.ndarray) -> np.ndarray:
    """The layer (h, w) int64 that the virtual centre sees in each cell, -1 where it is dark.

    `total_disparity_px` (D,) ascends, from far to near; layers are fitted from `start` (h, w), then
    pieces are proposed. Deterministic.
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
        _keep_better_pieces(layers, Layers(cut, np.repeat(total_disparity_px, 2), dark))
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


def _keep_better_pieces(layers: Layers, doubled: Layers) -> None:
    """Propose pieces of other layers, and keep those that lower the energy.

    `doubled` has each of the `layers` twice, for surfaces that are told by themselves at the same depth.
    """
    layers.put(_masks_of(layers.visible(), len(layers.masks)))
    changed = np.ones(layers.masks.shape[1:], dtype=bool)
    for _ in range(ROUNDS):
        for _ in range(SWEEPS_OF_A_PROPOSAL):
            layers.sweep(LIT_NATS)
        explained = _explained(doubled, layers.masks)
        # Where nothing has changed since, the same proposal would fail again.
        proposals = [piece for piece in proposals_of(layers) if (piece.around & changed).any()]
        changed = np.zeros_like(changed)
        for together in _apart(proposals):
            explained, kept = _tried(layers, doubled, together, explained)
            for piece in kept:
                changed |= piece.around
        if not changed.any():
            break


def _apart(proposals: Sequence[Proposal]) -> list[list[Proposal]]:
    """The proposals in groups in which no two have to do with each other."""
    groups: list[tuple[np.ndarray, list[Proposal]]] = []
    for piece in proposals:
        for taken, group in groups:
            if not (taken & piece.around).any():
                taken |= piece.around
                group.append(piece)
                break
        else:
            groups.append((piece.around.copy(), [piece]))
    return [group for _, group in groups]


def _tried(
    layers: Layers, doubled: Layers, proposals: Sequence[Proposal], explained: np.ndarray
) -> tuple[np.ndarray, list[Proposal]]:
    """What is explained (h, w) after those proposals were kept that lower the energy, and which they are."""
    before, seen, cost = layers.masks.copy(), layers.visible(), layers.cost_seen()
    proposed = before.copy()
    for piece in proposals:
        proposed[:, piece.cells] = False
        proposed[piece.layer, piece.cells] = True
    layers.put(proposed)
    for _ in range(SWEEPS_OF_A_PROPOSAL):
        layers.sweep(LIT_NATS)
    after, shown = layers.masks.copy(), layers.visible()
    cheaper = PRIOR_SHARE * (cost - layers.cost_seen())
    saved = _explained(doubled, after) - explained + cheaper
    better = [piece for piece in proposals if saved[piece.around].sum() > LEAST_NATS]
    kept: list[Proposal] = []
    if better:
        # Is it the depth that is better, or that the piece is told by itself? So it may be where it was, too.
        moved = np.any([piece.around for piece in better], axis=0) & (shown != seen)
        was, now = (moved & _masks_of(where, len(before)) for where in (seen, shown))
        old, new = _told_by_itself(doubled, before, was), _told_by_itself(doubled, after, now)
        for piece in better:
            here = piece.around
            light = max(one[here].sum() for one in new) - max(one[here].sum() for one in old)
            if light + cheaper[here].sum() > LEAST_NATS:
                kept.append(piece)
    for piece in kept:
        before[:, piece.around] = after[:, piece.around]
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
