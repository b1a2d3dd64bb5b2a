"""Compiled loops over events: which layers hide them, and how well layers predict them.

Axes: (H, W) cells of 4 px, N events; `cell` (N,) is the flat index of the cell of a layer in which each event
lands, -1 outside it.
"""

import math

import numpy as np

from pcii.base.compiled_loops import compiled


@compiled
def better_predicted(
    cell: np.ndarray,
    n: np.ndarray,
    hidden: np.ndarray,
    rate: np.ndarray,
    rate_behind: np.ndarray,
    gain: np.ndarray,
) -> None:
    """Adds to `gain` (H, W) the nats by which a layer predicts the events that it is seen by better."""
    W = gain.shape[1]
    for e in range(cell.size):
        if hidden[e] == 0 and cell[e] >= 0:
            gain[cell[e] // W, cell[e] % W] += n[e] * math.log(rate[e] / rate_behind[e])


@compiled
def hide(mask: np.ndarray, cell: np.ndarray, step: int, hidden: np.ndarray) -> None:
    """Adds `step` to `hidden` (N,), how many nearer layers an event comes from or is hidden by."""
    W = mask.shape[1]
    for e in range(cell.size):
        if cell[e] >= 0 and mask[cell[e] // W, cell[e] % W]:
            hidden[e] += step


@compiled
def claim(mask: np.ndarray, cell: np.ndarray, rate: np.ndarray, rate_behind: np.ndarray) -> None:
    """Events in the layer's `mask` have its `rate`, then behind what is nearer: `rate_behind` (N,)."""
    W = mask.shape[1]
    for e in range(cell.size):
        if cell[e] >= 0 and rate[e] > 0 and mask[cell[e] // W, cell[e] % W]:
            rate_behind[e] = rate[e]
