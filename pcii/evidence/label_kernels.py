"""Compiled loops over cells: evidence summed between edges, and labels by belief propagation.

Axes: Z planes or labels, C colours, (H, W) cells.
"""

import math

import numpy as np

from pcii.base.compiled_loops import helper, shared


@helper
def _recursive_mean(values: np.ndarray, left: np.ndarray, up: np.ndarray) -> None:
    """Recursive exponential means, in place, along rows and then columns, forwards and backwards.

    `left` and `up` (H, W) are the weights of the previous cell.
    """
    H, W = values.shape
    for i in range(H):
        for j in range(1, W):
            values[i, j] += left[i, j] * (values[i, j - 1] - values[i, j])
        for j in range(W - 2, -1, -1):
            values[i, j] += left[i, j + 1] * (values[i, j + 1] - values[i, j])
    for i in range(1, H):
        for j in range(W):
            values[i, j] += up[i, j] * (values[i - 1, j] - values[i, j])
    for i in range(H - 2, -1, -1):
        for j in range(W):
            values[i, j] += up[i + 1, j] * (values[i + 1, j] - values[i, j])


@shared(lambda narrow, *_: len(narrow))
def windows_within_edges(
    first: int,
    last: int,
    narrow: np.ndarray,
    picture: np.ndarray,
    noise: float,
    stiffness: float,
    scales: np.ndarray,
    weights: np.ndarray,
    result: np.ndarray,
) -> None:
    """Writes to `result` `narrow` (Z, H, W) plus its weighted means over wider windows up to edges.

    `picture` (Z, C, H, W) is the section at each plane; a step in it of more than `noise` lengthens the
    distance to the next cell, by `stiffness` for twice the noise. Domain transform of Gastal and Oliveira
    2011.
    """
    _, H, W = narrow.shape
    for z in range(first, last):
        distance = np.ones((2, H, W), np.float32)
        for i in range(H):
            for j in range(W):
                across = 0.0
                down = 0.0
                for c in range(picture.shape[1]):
                    if j > 0:
                        across += (picture[z, c, i, j] - picture[z, c, i, j - 1]) ** 2
                    if i > 0:
                        down += (picture[z, c, i, j] - picture[z, c, i - 1, j]) ** 2
                distance[0, i, j] += stiffness * max(math.sqrt(across) / noise - 1, 0.0) ** 2
                distance[1, i, j] += stiffness * max(math.sqrt(down) / noise - 1, 0.0) ** 2
        left = np.empty((H, W), np.float32)
        up = np.empty((H, W), np.float32)
        for i in range(H):
            for j in range(W):
                result[z, i, j] = narrow[z, i, j]
        for scale in range(scales.size):
            mean = narrow[z].copy()
            for turn in range(2):
                length = scales[scale] * math.sqrt(3.0) * 2.0 ** (1 - turn) / math.sqrt(15.0)
                for i in range(H):
                    for j in range(W):
                        left[i, j] = math.exp(-math.sqrt(2.0) / length * distance[0, i, j])
                        up[i, j] = math.exp(-math.sqrt(2.0) / length * distance[1, i, j])
                _recursive_mean(mean, left, up)
            for i in range(H):
                for j in range(W):
                    result[z, i, j] += weights[scale] * mean[i, j]


@helper
def _pass_to_neighbour(message: np.ndarray, steps: np.ndarray, jump: float) -> None:
    """Least cost of each label given the neighbour's, in place: `steps` between labels, at most `jump`."""
    low = message[0]
    for z in range(1, message.size):
        low = min(low, message[z])
    top = low + jump
    for z in range(1, message.size):
        message[z] = min(message[z], message[z - 1] + steps[z - 1])
    for z in range(message.size - 2, -1, -1):
        message[z] = min(message[z], message[z + 1] + steps[z])
    for z in range(message.size):
        message[z] = min(message[z], top) - low


@shared(lambda cost, messages, direction, *_: cost.shape[direction // 2])
def pass_messages(
    first: int,
    last: int,
    cost: np.ndarray,
    messages: np.ndarray,
    direction: int,
    steps: np.ndarray,
    jump: float,
) -> None:
    """One sweep of belief propagation: costs (H, W, Z), messages (4, H, W, Z) from left, right, above, below.

    A change to the next label costs `steps` (Z - 1,), any change at most `jump`. Lines are independent.
    """
    H, W, Z = cost.shape
    sideways = direction < 2
    opposite = direction + 1 if direction % 2 == 0 else direction - 1
    for line in range(first, last):
        length = W if sideways else H
        message = np.zeros(Z, np.float32)
        for step in range(length):
            position = step if direction % 2 == 0 else length - 1 - step
            i, j = (line, position) if sideways else (position, line)
            for z in range(Z):
                messages[direction, i, j, z] = message[z]
            for z in range(Z):
                total = cost[i, j, z]
                for source in range(4):
                    if source != opposite:
                        total += messages[source, i, j, z]
                message[z] = total
            _pass_to_neighbour(message, steps, jump)
