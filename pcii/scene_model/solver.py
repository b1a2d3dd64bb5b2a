"""The search for the labelling of least energy: from several starts, proposal by proposal.

Lempitsky, Rother, Roth, Blake 2010, "Fusion moves for Markov random field optimization": of the state and a
proposal the better is taken for each piece. Energies are not sums over neighbours here, so that pieces are
judged by what changes near them, and together by the whole energy, which never rises.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pcii.scene_model.energy import SceneEnergy
from pcii.scene_model.proposals import (
    Proposal,
    hulls,
    merged,
    other_labelling,
    outlines_moved,
    shifted,
)

NEAR_CELLS = 5
"""A piece is judged by what changes within so many cells of it: parallax brings it there."""
MOST_GROUPS = 4
"""Pieces that touch are judged apart: of a map four colours are enough."""
PLANE_STEP = 4
"""A plane is tried at every fourth label: one is a start."""
FOLLOWED = 2
"""Starts from which the search sets out; of the others it takes pieces."""
SHIFTS = (1, -1, 2, -2, 4, -4)
RANKS = 3
"""Surfaces move by so many labels, and to one of so many neighbours."""
OUTLINES = ((3, 12), (2, 8), (1, 6))
"""By how many cells outlines move, and the tiles in cells that decide on it by themselves."""
ROUNDS = 3
LEAST_NATS = 5.0
"""A round that saves less is the last: a surface costs more."""


@dataclass(frozen=True, eq=False)
class State:
    """A labelling (h, w) int16, its energy (h, w), and the total after each accepted proposal."""

    labels: np.ndarray
    nats: np.ndarray
    history: tuple[float, ...] = ()

    @property
    def total(self) -> float:
        """The energy in nats."""
        return float(self.nats.sum())


def least_energy(energy: SceneEnergy, starts: Sequence[np.ndarray] = ()) -> State:
    """The state that the search ends in, from the best plane and other `starts`, labels (h, w) int16.

    Any of them may be wrong. Deterministic.
    """
    states = [best_plane(energy, PLANE_STEP), *(state_of(energy, start) for start in starts)]
    states.sort(key=_total)
    best = min((_round(energy, state) for state in states[:FOLLOWED]), key=_total)
    for state in states:
        best = fused(energy, best, other_labelling(best.labels, state.labels))
    for _ in range(ROUNDS - 1):
        before = best.total
        best = _round(energy, best)
        if best.total > before - LEAST_NATS:
            break
    return best


def best_plane(energy: SceneEnergy, step: int = 1) -> State:
    """The plane of least energy parallel to the film, of every `step`-th label."""
    labels = range(0, len(energy.rays.planes), step)
    return min(
        (state_of(energy, np.full(energy.rays.shape, label, np.int16)) for label in labels), key=_total
    )


def fused(energy: SceneEnergy, state: State, proposal: Proposal) -> State:
    """The state with those pieces of a proposal that lower its energy; the same state if none does."""
    pieces = np.where(proposal.labels != state.labels, proposal.pieces, 0)
    if not pieces.any():
        return state
    groups = _apart(_nearest(pieces))
    # All together first: what is wrong in the state may be wrong in many places at once.
    for group in range(groups.max() + 1):
        chosen = groups == group if group else groups > 0
        trial = _with_pieces(energy, state, proposal, chosen[pieces])
        near = _nearest(np.where(chosen[pieces], pieces, 0))
        change = np.bincount(near.ravel(), (trial.nats - state.nats).ravel(), groups.size)
        lower = chosen & (change < 0)
        if not np.array_equal(lower, chosen):
            trial = _with_pieces(energy, state, proposal, lower[pieces])
        if trial.total < state.total:
            state = replace(trial, history=(*state.history, trial.total))
            pieces = np.where(lower[pieces], 0, pieces)
    return state


def state_of(energy: SceneEnergy, labels: np.ndarray) -> State:
    """A labelling (h, w) int16 with its energy."""
    return State(labels, energy.of(labels))


def _total(state: State) -> float:
    return state.total


def _with_pieces(energy: SceneEnergy, state: State, proposal: Proposal, where: np.ndarray) -> State:
    """The state that has the proposed labels `where` (h, w) bool; itself if that is nowhere."""
    return (
        replace(state_of(energy, np.where(where, proposal.labels, state.labels)), history=state.history)
        if where.any()
        else state
    )


def _apart(near: np.ndarray) -> np.ndarray:
    """Group of each piece, from 1 on, so that few pieces of a group are near each other; 0 for no piece.

    `near` (h, w) are the numbers of the pieces that cells are nearest to.
    """
    pairs = np.concatenate(
        [
            np.stack([near[a].ravel(), near[b].ravel()], axis=1)
            for a, b in ((np.s_[:-1], np.s_[1:]), (np.s_[:, :-1], np.s_[:, 1:]))
        ]
    )
    pairs = pairs[(pairs[:, 0] != pairs[:, 1]) & (pairs > 0).all(axis=1)]
    pairs = np.unique(np.concatenate([pairs, pairs[:, ::-1]]), axis=0)
    starts = np.searchsorted(pairs[:, 0], np.arange(near.max() + 2))
    groups = np.zeros(near.max() + 1, np.int64)
    for piece in range(1, groups.size):
        taken = groups[pairs[starts[piece] : starts[piece + 1], 1]]
        free = [group for group in range(1, MOST_GROUPS + 1) if group not in taken]
        groups[piece] = free[0] if free else 1 + piece % MOST_GROUPS
    return groups


def _nearest(pieces: np.ndarray) -> np.ndarray:
    """The number (h, w) of the piece that each cell is nearest to, 0 where none is near."""
    from scipy.ndimage import distance_transform_edt

    distance, (i, j) = distance_transform_edt(pieces == 0, return_indices=True)  # type: ignore[misc]
    return np.where(distance <= NEAR_CELLS, pieces[i, j], 0)


def _round(energy: SceneEnergy, state: State) -> State:
    """The state after every kind of proposal was made once."""
    for by in SHIFTS:
        state = fused(energy, state, shifted(state.labels, by, len(energy.rays.planes)))
    for rank in range(RANKS):
        state = fused(energy, state, merged(state.labels, rank))
    for proposal in hulls(state.labels):
        state = fused(energy, state, proposal)
    for nearer in (True, False):
        for cells, tile_cells in OUTLINES:
            state = fused(energy, state, outlines_moved(state.labels, cells, nearer, tile_cells))
    return state
