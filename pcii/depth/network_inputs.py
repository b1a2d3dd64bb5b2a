"""What the network of depth is given: evidence, the posterior of a surface, brightness, coverage.

All of it is without unit, of planes between which the total disparity grows by half a block, so that other
cameras, other numbers of planes, larger blocks and any amount of light look alike.

The posterior is that of depth of a piecewise smooth surface. The depth of a block of pixels is one of Z
planes of evenly spaced total disparity. From a block to the next

    T(z' | z) = (1 - q) (1 - s) / (1 + s) s^|z' - z|  +  q / Z:

it moves by a few planes, or, at an outline or a fold, with the probability q to any. With the likelihoods
exp(e_x(z)), e_x the evidence of block x, and T along the edges of a tree that reaches all blocks, the
posterior of a block is exact and takes two messages for each edge (Pearl 1988). Each block is the middle of
two trees (Bleyer and Gelautz 2008): its column, from which all rows branch off, and its row, from which all
columns do. They share their messages, so that eight passes over the film serve all blocks. The posterior is
the mean of that on either tree.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from pcii.base import block_sums, each_in_threads, helper, shared
from pcii.evidence import TextureEvidence

NETWORK_CELL_BLOCKS = 2
"""Blocks of a cell along each axis: the surface's posterior and the coverage are of cells."""
MOST_RATE = 25.0
"""Of the mean of the film; brighter blocks are taken as so bright."""
LEAST_LOG_RATIO, MOST_LOG_RATIO = -8.0, 8.0
"""Ends of the logarithm of a probability relative to all planes being alike."""
LEAST_PHOTONS, MOST_PHOTONS = 1e-2, 1e3
"""Ends of the mean number of photons in a cell."""
HINT_WIDTHS = (1.5, 6.0)
"""Standard deviations, in planes, of the nearness of a plane to a requested one."""
LEAST = 1e-30
"""Least likelihood and probability relative to the largest: all below 69 nats are alike."""


@dataclass(frozen=True)
class SurfacePrior:
    """Constants of the prior, for planes of 1 px of total disparity and blocks of 2 px."""

    fall: float = 0.05
    """s: of the probability, from a plane to the next."""
    jump: float = 0.1
    """q: outlines are rare, but rows decide on them one by one, and evidence of neighbours is not independent
    of each other."""


class NetworkInputs(NamedTuple):
    """Inputs of a part of a film (Z planes), float32.

    `evidence` (Z, h, w): asinh of the nats of a block; `brightness` (Z, h, w): square root of its mean over
    that of the film; `coverage` (Z, h / 2, w / 2): share of the views' samples that a cell has; `surface`
    (Z, h / 2, w / 2): logarithm of the posterior of a smooth surface relative to equally likely planes;
    `light` (1,): log10 of the mean number of photons in a cell; `hint` (Z, 2): see `hint_of`.
    """

    evidence: np.ndarray
    brightness: np.ndarray
    coverage: np.ndarray
    surface: np.ndarray
    light: np.ndarray
    hint: np.ndarray


def hint_of(plane_count: int, requested_planes: np.ndarray) -> np.ndarray:
    """How near planes are to requested ones (R,), given by their positions among them: (Z, 2) float32.

    For either of `HINT_WIDTHS` a Gaussian of the distance to the nearest one; 0 where none is requested.
    """
    if requested_planes.size == 0:
        return np.zeros((plane_count, len(HINT_WIDTHS)), np.float32)
    distance = np.abs(np.arange(plane_count)[:, None] - requested_planes).min(axis=1, keepdims=True)
    return np.exp(-((distance / HINT_WIDTHS) ** 2) / 2).astype(np.float32)


def inputs_of(
    evidence: TextureEvidence,
    samples_per_block: float,
    prior: SurfacePrior,
    part: tuple[slice, slice],
    hint: np.ndarray,
) -> NetworkInputs:
    """Inputs of a part of the film, made from the evidence of the whole film.

    All views together have `samples_per_block` samples in a block. `part` is rows and columns of blocks,
    whole cells. Beyond its end the film is mirrored: an empty border would look like the dark around things.
    """
    planes = range(len(evidence.nats))

    def in_cells(values: Any) -> np.ndarray:
        return np.stack(
            each_in_threads(lambda z: block_sums(values[z], NETWORK_CELL_BLOCKS, np.float32), planes)
        )

    def part_of(values: np.ndarray, side: int = 1) -> np.ndarray:
        box = tuple(slice(each.start // side, each.stop // side) for each in part)
        ends = [(0, max(each.stop - size, 0)) for each, size in zip(box, values.shape, strict=True)]
        return np.pad(values, ends, mode="symmetric")[box]

    def in_whole_cells(values: np.ndarray) -> np.ndarray:
        return np.pad(values, [(0, -size % NETWORK_CELL_BLOCKS) for size in values.shape])

    posterior = surface_posterior(in_cells(evidence.nats), prior).transpose(2, 0, 1)
    ratio = np.log(np.maximum(posterior * len(planes), np.float32(np.exp(LEAST_LOG_RATIO))))
    share = in_cells(evidence.samples) / np.float32(samples_per_block * NETWORK_CELL_BLOCKS**2)
    total, number = float(evidence.sums.sum(dtype=np.float64)), float(evidence.samples.sum(dtype=np.float64))
    mean = np.float32(total / number if total > 0 and number > 0 else 1.0)

    def of_plane(z: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        nats, sums, samples = (part_of(in_whole_cells(values[z])) for values in evidence[:3])
        rate = sums / np.maximum(samples, 1e-3) / mean
        return (
            _asinh(nats),
            np.sqrt(np.clip(rate, 0, MOST_RATE)),
            part_of(share[z], NETWORK_CELL_BLOCKS),
            part_of(np.minimum(ratio[z], np.float32(MOST_LOG_RATIO)), NETWORK_CELL_BLOCKS),
        )

    photons = float(evidence.photons.mean(dtype=np.float64)) / 4
    light = np.array([np.log10(np.clip(photons, LEAST_PHOTONS, MOST_PHOTONS))], np.float32)
    nats, rates, coverage, surface = map(np.stack, zip(*each_in_threads(of_plane, planes), strict=True))
    return NetworkInputs(nats, rates, coverage, surface, light, hint)


def _asinh(values: np.ndarray) -> np.ndarray:
    """The inverse of sinh by a logarithm, to 1e-7: NumPy's own takes seven times as long."""
    size = np.abs(values)
    return np.copysign(np.log(size + np.sqrt(size * size + 1)), values)


def surface_posterior(nats: np.ndarray, prior: SurfacePrior) -> np.ndarray:
    """Posterior probabilities (h, w, Z) float32 of the planes, from evidence (Z, h, w) in nats."""

    def along_rows(likelihood: np.ndarray) -> np.ndarray:
        posterior = np.empty(likelihood.shape, np.float32)
        _chain_posteriors(posterior, np.ascontiguousarray(likelihood), prior.fall, prior.jump, LEAST)
        return posterior

    def along_columns(likelihood: np.ndarray) -> np.ndarray:
        return along_rows(likelihood.swapaxes(0, 1)).swapaxes(0, 1)

    likelihood = np.maximum(np.exp(nats - nats.max(axis=0)), np.float32(LEAST)).transpose(1, 2, 0)
    posterior = _normalised(along_columns(along_rows(likelihood)))
    posterior += _normalised(along_rows(along_columns(likelihood)))
    posterior /= 2
    return posterior


def _normalised(weights: np.ndarray) -> np.ndarray:
    return weights / weights.sum(axis=-1, keepdims=True)


@helper
def _pass_on(belief: np.ndarray, message: np.ndarray, fall: float, jump: float) -> None:
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
def _chain_posteriors(
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
            _pass_on(belief, forward[j], fall, jump)
        for j in range(w - 1, -1, -1):
            largest = np.float32(0)
            for z in range(Z):
                belief[z] = backward[z] * likelihood[i, j, z]
                posterior[i, j, z] = forward[j, z] * belief[z]
                largest = max(largest, posterior[i, j, z])
            for z in range(Z):
                posterior[i, j, z] = max(posterior[i, j, z] / largest, np.float32(least))
            _pass_on(belief, backward, fall, jump)
