"""Compiled: posterior probabilities along chains of blocks, by passing messages forward and backward.

Axes: i rows, j blocks of a row, z planes. A block's depth is that of its neighbour, or moves from plane to
plane with probabilities that fall by a factor with each plane, or jumps to any plane.
"""

import numpy as np

from pcii.base import helper, shared


@helper
def pass_on(belief: np.ndarray, message: np.ndarray, fall: float, jump: float) -> None:
    """Fill `message` (Z,) with what a block of this `belief` (Z,) says of its neighbour; its largest is 1."""
    Z = belief.size
    total = before = after = np.float32(0)
    factor, share = np.float32(fall), np.float32((1 - jump) * (1 - fall) / (1 + fall))
    for z in range(Z):
        before = before * factor + belief[z]
        message[z] = before
        total += belief[z]
    anywhere, largest = np.float32(jump / Z) * total, np.float32(0)
    for z in range(Z - 1, -1, -1):
        message[z] = (message[z] + after) * share + anywhere
        after = (after + belief[z]) * factor
        largest = max(largest, message[z])
    for z in range(Z):
        message[z] /= largest


@shared(lambda posterior, *_: len(posterior))
def chain_posteriors(
    first: int,
    last: int,
    posterior: np.ndarray,
    likelihood: np.ndarray,
    fall: float,
    jump: float,
    least: float,
) -> None:
    """Writes to `posterior` the probabilities of blocks, from likelihoods of rows of them: (h, w, Z) float32.

    The largest of a block is 1. Values below `least` are raised to it.
    """
    _, w, Z = likelihood.shape
    for i in range(first, last):
        forward = np.empty((w, Z), np.float32)
        backward, belief = np.ones(Z, np.float32), np.empty(Z, np.float32)
        forward[0, :] = np.float32(1)
        for j in range(1, w):
            for z in range(Z):
                belief[z] = forward[j - 1, z] * likelihood[i, j - 1, z]
            pass_on(belief, forward[j], fall, jump)
        for j in range(w - 1, -1, -1):
            largest = np.float32(0)
            for z in range(Z):
                belief[z] = backward[z] * likelihood[i, j, z]
                posterior[i, j, z] = forward[j, z] * belief[z]
                largest = max(largest, posterior[i, j, z])
            for z in range(Z):
                posterior[i, j, z] = max(posterior[i, j, z] / largest, np.float32(least))
            pass_on(belief, backward, fall, jump)
