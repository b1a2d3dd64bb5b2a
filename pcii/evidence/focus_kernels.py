"""Compiled loop over photons: the gain of a plane over its blur.

Axes: C colours, (H, W) cells of 4 x 4 pixels.
"""

import math

import numpy as np

from pcii.base.compiled_loops import compiled
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
