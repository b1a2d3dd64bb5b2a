"""What the network of depth is given: evidence, the posterior of a surface, brightness, coverage.

All of it is without unit and per plane of 1 px of total disparity, so that other cameras, other numbers of
planes and any amount of light look alike.
"""

from typing import NamedTuple

import numpy as np

from pcii.depth.smooth_surface import SurfacePrior, surface_posterior
from pcii.evidence.texture_evidence import TextureEvidence
from pcii.imaging.blocks import block_sums

CELL_SIDE_BLOCKS = 2
"""Blocks of a cell along each axis: the surface's posterior and the coverage are of cells."""
MOST_RATE = 25.0
"""Of the mean of the film; brighter blocks are taken as so bright."""
LEAST_LOG_RATIO, MOST_LOG_RATIO = -8.0, 8.0
"""Ends of the logarithm of a probability relative to all planes being alike."""
LEAST_PHOTONS, MOST_PHOTONS = 1e-2, 1e3
"""Ends of the mean number of photons in a cell."""
HINT_WIDTHS_PX = (1.5, 6.0)
"""Standard deviations, in total disparity, of the nearness of a plane to a requested one."""


class NetworkInputs(NamedTuple):
    """Inputs (Z planes), float32. Films are mirrored at their ends where the network needs more blocks.

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

    def part(self, rows: slice, cols: slice) -> "NetworkInputs":
        """The inputs of some rows and columns of blocks, whole cells; the light stays that of the film."""
        of_cells = (
            slice(each.start // CELL_SIDE_BLOCKS, each.stop // CELL_SIDE_BLOCKS) for each in (rows, cols)
        )
        blocks, cells = np.s_[:, rows, cols], (slice(None), *of_cells)
        return NetworkInputs(
            self.evidence[blocks],
            self.brightness[blocks],
            self.coverage[cells],
            self.surface[cells],
            self.light,
            self.hint,
        )


def hint_of(total_px: np.ndarray, requested_px: np.ndarray) -> np.ndarray:
    """How near planes of total disparities (Z,) are to requested ones (R,): (Z, 2) float32.

    For either of `HINT_WIDTHS_PX` a Gaussian of the distance to the nearest one; 0 where none is requested.
    """
    if requested_px.size == 0:
        return np.zeros((total_px.size, len(HINT_WIDTHS_PX)), np.float32)
    distance_px = np.abs(total_px[:, None] - requested_px).min(axis=1, keepdims=True)
    return np.exp(-((distance_px / HINT_WIDTHS_PX) ** 2) / 2).astype(np.float32)


def inputs_of(
    evidence: TextureEvidence,
    samples_per_block: float,
    prior: SurfacePrior,
    multiple: int,
    hint: np.ndarray,
) -> NetworkInputs:
    """Inputs from the evidence of blocks, in which all views have `samples_per_block` samples.

    Films are mirrored up to whole multiples of so many blocks: an empty border would look like the dark
    around things.
    """

    def in_whole_cells(values: np.ndarray) -> np.ndarray:
        return np.pad(values, [(0, 0), *((0, -size % CELL_SIDE_BLOCKS) for size in values.shape[1:])])

    h, w = (-(-size // multiple) * multiple for size in evidence.nats.shape[1:])

    def mirrored(values: np.ndarray, side: int = 1) -> np.ndarray:
        ends = [
            (0, 0),
            *((0, full // side - size) for full, size in zip((h, w), values.shape[1:], strict=True)),
        ]
        return np.pad(values, ends, mode="symmetric")

    nats, sums, samples = (in_whole_cells(part) for part in (evidence.nats, evidence.sums, evidence.samples))
    in_cells = [block_sums(part, CELL_SIDE_BLOCKS, np.float32) for part in (nats, samples)]
    posterior = surface_posterior(in_cells[0], prior).transpose(2, 0, 1)
    ratio = np.log(np.maximum(posterior * len(nats), np.float32(np.exp(LEAST_LOG_RATIO))))
    total, number = float(evidence.sums.sum(dtype=np.float64)), float(evidence.samples.sum(dtype=np.float64))
    mean = total / number if total > 0 and number > 0 else 1.0
    rate = sums / np.maximum(samples, 1e-3) / np.float32(mean)
    photons = float(evidence.photons.mean(dtype=np.float64)) / 4
    of_cell = samples_per_block * CELL_SIDE_BLOCKS**2
    return NetworkInputs(
        mirrored(np.arcsinh(nats)),
        mirrored(np.sqrt(np.clip(rate, 0, MOST_RATE))),
        mirrored(in_cells[1] / np.float32(of_cell), CELL_SIDE_BLOCKS),
        mirrored(np.minimum(ratio, np.float32(MOST_LOG_RATIO)), CELL_SIDE_BLOCKS),
        np.array([np.log10(np.clip(photons, LEAST_PHOTONS, MOST_PHOTONS))], np.float32),
        hint,
    )
