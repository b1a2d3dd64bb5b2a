"""Compiled loops over rays: which layer does each camera see, and what is behind it?

Axes: V = K x L views, (H, W) cells, N events. A layer's cell (a, b) is seen by view (k, l) at its cell
(a - rows[k], b - cols[l]). `near` (V, H, W) counts the nearer layers that cover each cell of each view.
"""

import math

import numba as nb
import numpy as np

from pcii.kernels import compiled, helper


@compiled
def paint(
    mask: np.ndarray, light: np.ndarray, rows: np.ndarray, cols: np.ndarray, behind: np.ndarray
) -> None:
    """Where the layer's `mask` (H, W) is, views show its `light` (H, W): overwrites `behind` (V, H, W)."""
    H, W = mask.shape
    for view in nb.prange(behind.shape[0]):
        v = np.int64(view)
        down, right = rows[v // cols.size], cols[v % cols.size]
        for a in range(max(0, down), min(H, H + down)):
            for b in range(max(0, right), min(W, W + right)):
                if mask[a, b]:
                    behind[v, a - down, b - right] = light[a, b]


@compiled
def free_views(
    near: np.ndarray, rows: np.ndarray, cols: np.ndarray, free: np.ndarray, within: np.ndarray
) -> None:
    """How many views see a layer's cell, `free` (H, W), and would if nothing were nearer, `within` (H, W)."""
    _, H, W = near.shape
    for line in nb.prange(H):
        a = np.int64(line)
        for b in range(W):
            seen = 0
            inside = 0
            for v in range(near.shape[0]):
                i, j = a - rows[v // cols.size], b - cols[v % cols.size]
                if 0 <= i < H and 0 <= j < W:
                    inside += 1
                    seen += near[v, i, j] == 0
            free[a, b] = seen
            within[a, b] = inside


@compiled
def less_light(
    near: np.ndarray,
    behind: np.ndarray,
    rows: np.ndarray,
    cols: np.ndarray,
    light: np.ndarray,
    gain: np.ndarray,
) -> None:
    """Photons that are expected less if the layer hides what is `behind` (V, H, W): `gain` (H, W)."""
    _, H, W = near.shape
    for line in nb.prange(H):
        a = np.int64(line)
        for b in range(W):
            total = 0.0
            for v in range(near.shape[0]):
                i, j = a - rows[v // cols.size], b - cols[v % cols.size]
                if 0 <= i < H and 0 <= j < W and near[v, i, j] == 0:
                    total += behind[v, i, j] - light[a, b]
            gain[a, b] = total


@helper
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


@helper
def hide(mask: np.ndarray, cell: np.ndarray, step: int, hidden: np.ndarray) -> None:
    """Adds `step` to `hidden` (N,), how many nearer layers an event comes from or is hidden by."""
    W = mask.shape[1]
    for e in range(cell.size):
        if cell[e] >= 0 and mask[cell[e] // W, cell[e] % W]:
            hidden[e] += step


@helper
def claim(mask: np.ndarray, cell: np.ndarray, rate: np.ndarray, rate_behind: np.ndarray) -> None:
    """Events in the layer's `mask` have its `rate`, then behind what is nearer: `rate_behind` (N,)."""
    W = mask.shape[1]
    for e in range(cell.size):
        if cell[e] >= 0 and rate[e] > 0 and mask[cell[e] // W, cell[e] % W]:
            rate_behind[e] = rate[e]
