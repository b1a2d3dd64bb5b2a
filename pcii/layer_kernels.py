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
def free_views(near: np.ndarray, rows: np.ndarray, cols: np.ndarray, free: np.ndarray) -> None:
    """How many views see a layer's cell: `free` (H, W), overwritten."""
    _, H, W = near.shape
    for line in nb.prange(H):
        a = np.int64(line)
        free[a] = 0
        for v in range(near.shape[0]):
            i, right = a - rows[v // cols.size], cols[v % cols.size]
            if 0 <= i < H:
                for b in range(max(0, right), min(W, W + right)):
                    free[a, b] += near[v, i, b - right] == 0


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
        total = np.zeros(W, np.float32)
        for v in range(near.shape[0]):
            i, right = a - rows[v // cols.size], cols[v % cols.size]
            if 0 <= i < H:
                for b in range(max(0, right), min(W, W + right)):
                    seen = near[v, i, b - right] == 0
                    total[b] += np.float32(seen) * (behind[v, i, b - right] - light[a, b])
        gain[a] = total


@compiled
def gathered(values: np.ndarray, rows: np.ndarray, cols: np.ndarray, result: np.ndarray) -> None:
    """The views' `values` (V, H, W) where a layer would show them, summed: `result` (H, W), overwritten.

    What a view shows beside the layer's frame counts at its nearest border.
    """
    _, H, W = values.shape
    for line in nb.prange(H):
        a = np.int64(line)
        result[a] = 0
        for v in range(values.shape[0]):
            down, right = rows[v // cols.size], cols[v % cols.size]
            first, last = a - down, a - down
            if a == 0:
                first = 0
            if a == H - 1:
                last = H - 1
            for i in range(max(0, first), min(H - 1, last) + 1):
                for j in range(W):
                    result[a, min(max(j + right, 0), W - 1)] += values[v, i, j]


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
