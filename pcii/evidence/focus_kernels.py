"""Compiled loops over photons and planes: what a plane predicts of photons, and which of several does best.

Axes: Z planes, C colours, (H, W) cells of 4 x 4 pixels unless said otherwise, N events.
"""

import math

import numba as nb
import numpy as np

from pcii.base.compiled_loops import compiled, helper
from pcii.evidence.prediction_types import PlacedEvents, Predicted


@helper
def gain_over_blur(events: PlacedEvents, predicted: Predicted, gain: np.ndarray, photons: np.ndarray) -> None:
    """Adds to `gain` (H, W) by how much events are better predicted than by the blurred section alone.

    `photons` (C, H, W), from zeros, counts them by colour and cell.
    """
    w = gain.shape[1]
    cell, colour, n = events.cell, events.colour, events.n
    rate, base = predicted.rate, predicted.base
    for e in range(cell.size):
        if cell[e] >= 0:
            a, b = cell[e] // w, cell[e] % w
            gain[a, b] += n[e] * math.log(rate[e] / base[e])
            photons[colour[e], a, b] += n[e]


@compiled
def views_of_planes(
    expected: np.ndarray, rows: np.ndarray, cols: np.ndarray, weight: float, views: np.ndarray
) -> None:
    """What the planes (Z, H, W) together send to cameras, on cells: adds `weight` times to `views` (V, H, W).

    `rows` (Z, A) and `cols` (Z, B) are shifts of A x B = V cameras in whole cells.
    """
    Z, H, W = expected.shape
    across = cols.shape[1]
    for view in nb.prange(views.shape[0]):
        v = np.int64(view)
        for z in range(Z):
            down, right = rows[z, v // across], cols[z, v % across]
            for i in range(max(0, down), min(H, H + down)):
                for j in range(max(0, right), min(W, W + right)):
                    views[v, i - down, j - right] += weight * expected[z, i, j]


@compiled
def duel_planes(
    views: np.ndarray,
    expected: np.ndarray,
    rows: np.ndarray,
    cols: np.ndarray,
    predicted: np.ndarray,
    cell: np.ndarray,
    together: np.ndarray,
    n: np.ndarray,
    result: np.ndarray,
) -> None:
    """Log-likelihood that each plane gains over all of them together, by cell: `result` (Z, H, W) from zeros.

    `together` (N,) is the rate that the planes predict for each event together, `views` (V, H, W) for all.
    """
    Z, H, W = expected.shape
    across = cols.shape[1]
    for plane in nb.prange(Z):
        z = np.int64(plane)
        total = np.zeros((H, W), np.float32)
        number = np.zeros((H, W), np.float32)
        for v in range(views.shape[0]):
            down, right = rows[z, v // across], cols[z, v % across]
            for i in range(max(0, down), min(H, H + down)):
                for j in range(max(0, right), min(W, W + right)):
                    total[i, j] += views[v, i - down, j - right]
                    number[i, j] += 1
        for i in range(H):
            for j in range(W):
                if number[i, j] > 0:
                    result[z, i, j] = total[i, j] / number[i, j] - expected[z, i, j]
        for e in range(cell.shape[1]):
            at = cell[z, e]
            if at >= 0:
                result[z, at // W, at % W] += n[e] * math.log(predicted[z, e] / together[e])
