"""What the network of depth is given: evidence, the posterior of a surface, brightness, coverage.

All of it is without unit, of planes between which the total disparity grows by half a block, so that other
cameras, other numbers of planes, larger blocks and any amount of light look alike.
"""

from typing import Any, NamedTuple

import numpy as np

from pcii.base import block_sums
from pcii.depth.smooth_surface import SurfacePrior, surface_posterior
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
    from pcii.base import each_in_threads

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
