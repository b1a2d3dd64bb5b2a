"""Surfaces of a labelling: connected cells, and what outlines, surfaces and roughness cost.

Axes: (h, w) cells; labels count depths from far to near, -1 is the background.
"""

import numpy as np

from pcii.base.compiled_loops import compiled
from pcii.scene_model.parameters import SceneParameters
from pcii.scene_model.ray_kernels import JUMP

NEIGHBOURS = ((0, 1, np.pi / 8), (1, 0, np.pi / 8), (1, 1, np.pi / 8 / 2**0.5), (1, -1, np.pi / 8 / 2**0.5))
"""Steps to neighbours, and what a cut adds to the length of an outline (Boykov and Kolmogorov 2003)."""


def prior_nats(labels: np.ndarray, parameters: SceneParameters) -> np.ndarray:
    """Cost (h, w) of outlines by their length, of surfaces by their number, and of rough ones."""
    h, w = labels.shape
    cost = np.zeros((h, w))
    for down, across, length in NEIGHBOURS:
        here = np.s_[: h - down, max(0, -across) : w - max(0, across)]
        there = np.s_[down:, max(0, across) : w + min(0, across)]
        cut = ~of_one_surface(labels[here], labels[there])
        half = parameters.outline_nats_per_cell * length / 2 * cut
        cost[here] += half
        cost[there] += half
    numbers = surfaces_of(labels)
    cost += (parameters.surface_nats / np.bincount(numbers.ravel()))[numbers]
    return cost + parameters.roughness_nats * _from_mean(labels, parameters.roughness_cells) ** 2


def of_one_surface(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Whether cells of these labels would be of one surface as neighbours."""
    return (np.abs(one.astype(np.int32) - other) <= JUMP) & ((one < 0) == (other < 0))


@compiled
def surfaces_of(labels: np.ndarray) -> np.ndarray:
    """Number (h, w) int64, from 0, of the connected surface that each cell belongs to."""
    h, w = labels.shape
    parent = np.arange(h * w)
    for i in range(h):
        for j in range(w):
            for a, b in ((i, j + 1), (i + 1, j)):
                if a >= h or b >= w or abs(labels[i, j] - labels[a, b]) > JUMP:
                    continue
                if (labels[i, j] < 0) != (labels[a, b] < 0):
                    continue
                one, other = i * w + j, a * w + b
                while parent[one] != one:
                    parent[one] = parent[parent[one]]
                    one = parent[one]
                while parent[other] != other:
                    parent[other] = parent[parent[other]]
                    other = parent[other]
                parent[max(one, other)] = min(one, other)
    numbers = np.empty(h * w, np.int64)
    count = 0
    for cell in range(h * w):
        # A parent comes before what it is the parent of.
        if parent[cell] == cell:
            numbers[cell] = count
            count += 1
        else:
            numbers[cell] = numbers[parent[cell]]
    return numbers.reshape(h, w)


def window_decay(deviation_cells: float) -> float:
    """Factor from cell to cell of a two-sided exponential window of this standard deviation."""
    inverse = 1 / deviation_cells**2
    return 1 + inverse - ((1 + inverse) ** 2 - 1) ** 0.5


def _from_mean(labels: np.ndarray, deviation_cells: float) -> np.ndarray:
    """How far labels (h, w) are from the mean of their surface around them."""
    from pcii.scene_model.rate_kernels import ends_of, window_sums

    right, down = (np.empty(labels.shape, np.bool_) for _ in range(2))
    ends_of(labels, right, down)
    sums = [np.empty(labels.shape, np.float32) for _ in range(2)]
    for values, result in zip(
        (labels.astype(np.float32), np.ones(labels.shape, np.float32)), sums, strict=True
    ):
        window_sums(values, right, down, window_decay(deviation_cells), result)
    return labels - sums[0] / sums[1]
