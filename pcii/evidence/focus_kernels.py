"""Compiled loops over photons and planes: the gain of a plane over its blur, and planes compared.

Axes: Z planes, C colours, (H, W) cells of 4 x 4 pixels unless said otherwise, N events.
"""

import math

import numpy as np

from pcii.base.compiled_loops import compiled, shared
from pcii.evidence.prediction_types import PlacedEvents, Predicted


@compiled
def gain_over_blur(events: PlacedEvents, predicted: Predicted, gain: np.ndarray, photons: np.ndarray) -> None:
    """Adds to `gain` (H, W) the log-likelihood ratio, in nats, of the section to its blur at each event.

    `photons` (C, H, W), from zeros, counts the events' photons by colour and cell.
    """
    w = gain.shape[1]
    cell, colour, n = events.cell, events.colour, events.n
    rate, base = predicted.rate, predicted.base
    for e in range(cell.size):
        if cell[e] >= 0:
            a, b = cell[e] // w, cell[e] % w
            gain[a, b] += n[e] * math.log(rate[e] / base[e])
            photons[colour[e], a, b] += n[e]


@shared(lambda expected, rows, cols, weight, views: len(views))
def views_of_planes(
    first: int,
    last: int,
    expected: np.ndarray,
    rows: np.ndarray,
    cols: np.ndarray,
    weight: float,
    views: np.ndarray,
) -> None:
    """Adds to `views` (V, H, W) `weight` times the photons per cell of each camera that all planes predict.

    `expected` (Z, H, W) are the photons per cell of the planes; `rows` (Z, A) and `cols` (Z, B) the shifts of
    A x B = V cameras in whole cells.
    """
    Z, H, W = expected.shape
    across = cols.shape[1]
    for v in range(first, last):
        for z in range(Z):
            down, right = rows[z, v // across], cols[z, v % across]
            for i in range(max(0, down), min(H, H + down)):
                for j in range(max(0, right), min(W, W + right)):
                    views[v, i - down, j - right] += weight * expected[z, i, j]


@shared(lambda views, expected, *_: len(expected))
def duel_planes(
    first: int,
    last: int,
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
    """Log-likelihood gain of each plane over the mean of all planes, by cell: `result` (Z, H, W) from zeros.

    `predicted` (Z, N) is the rate of each event by each plane, `together` (N,) by their mean; `expected`
    (Z, H, W) are the photons per cell of each plane, `views` (V, H, W) those of their mean in each camera.
    """
    _, H, W = expected.shape
    across = cols.shape[1]
    for z in range(first, last):
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
            flat = cell[z, e]
            if flat >= 0:
                result[z, flat // W, flat % W] += n[e] * math.log(predicted[z, e] / together[e])
