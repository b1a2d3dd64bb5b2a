"""Evidence of depth from texture: at which plane does a section show more contrast than its noise explains?

In focus a section shows the texture of the surface; out of focus the views average it away, and what is left
is noise. The section is divided into octaves, differences of Gaussian means. With y a coefficient of an
octave, b the mean around it, v the variance of its noise and c the contrast that texture has in an octave,

    r = (c b)^2 / v,        e = r / (1 + r) (y^2 / v - 1) / 2

is the logarithm, but for a constant, of how much likelier y is with texture than without; without texture its
mean is 0. Where there is little light r is small in fine octaves and coarse ones decide; where there is much,
fine ones do: the scale follows the light.

An outline has far more contrast than texture, and would decide on the depth of all that is around it. So a
coefficient gives at most `saturation_nats` = S, with m its largest e at any plane, above 0:

    e / (1 + m / S),

which keeps how the planes compare. An octave's coefficients are evaluated at twice the density that they
need, and count by the area that each stands for.

Noise of photon counts is Poisson: v = w b / n + (a b)^2, n the samples of a block, w the sum of the squared
weights of the coefficient and a what is left of contrasts that are averaged away by some views. That of
radiance has the variance of the views' samples in place of b, so that a plane at which the views differ has
little evidence.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import NamedTuple

import numpy as np

from pcii.imaging.blocks import block_sums, sum_of
from pcii.sections.reconstruction import reconstruct
from pcii.types.focal_planes import FocalPlanes
from pcii.types.images import Views, binary_scale
from pcii.types.photon_counts import PhotonCounts


@dataclass(frozen=True)
class TextureModel:
    """Constants of the model: c, a and S of the equations above, and the number of octaves."""

    contrast: float = 0.1
    averaging_error: float = 0.02
    saturation_nats: float = 5.0
    octaves: int = 4
    """The finest is of single blocks; in the coarsest, means are Gaussian of 4 and 8 blocks."""
    least_coverage: float = 0.3
    """Coefficients with a smaller share of all views' samples are left out: they lie at the borders."""


class TextureEvidence(NamedTuple):
    """Evidence at Z planes: `nats` (Z, h, w) float32 for each block of pixels.

    `sums` and `samples` (Z, h, w) float32 are the sum over the views' samples in a block, photons or
    radiance, and their number. `photons` (Z, h / 4, w / 4, rounded up) is the number of photons in 4 x 4
    blocks; of radiance, the square of its mean over the variance of the mean, as it is of photons.
    """

    nats: np.ndarray
    sums: np.ndarray
    samples: np.ndarray
    photons: np.ndarray


ROUNDING = 0.75
"""Shifts are floor(x + this), not the nearest ones.

Cameras at equal distances on either side of the centre have the exact shifts x and -x. Their nearest whole
shifts are off by up to half a pixel in opposite directions, as if the disparity were another one; and with an
even number of cameras all pairs are off together where the disparity is an odd number of pixels, so that
planes up to 2 px of total disparity apart have the same shifts. With 3/4 the error of a pair has half the
size and twice the frequency, the least for one number for all cameras. The section lies 1/4 px off, an eighth
of a block.
"""
SAMPLES, SUMS, SPREAD = 0, 1, -1
"""Places of the number of samples, of their sum and of its variance in the values of blocks."""
CELL_BLOCKS = 4
LEAST_SAMPLES, LEAST_RATE = 1e-3, 1e-12
"""What is divided by where there are no samples, or no light."""


def evidence_of_texture(
    data: PhotonCounts | Views, planes: FocalPlanes, block_px: int = 2, model: TextureModel | None = None
) -> TextureEvidence:
    """Evidence of blocks of `block_px` x `block_px` pixels at each of the Z planes, h x w blocks.

    The sum over a window is the logarithm, but for a constant, of how likely its samples are if the surface
    is at this plane. A mosaic has all colours in a block of 2 pixels or more, for any shift.
    """
    from pcii.base.compiled_loops import each_in_threads

    planes = replace(planes, rounding=ROUNDING)
    chosen = model or TextureModel()
    colours = data.radiance.shape[-1] if isinstance(data, Views) else 1
    least_samples = chosen.least_coverage * data.grid.view_count * colours * block_px**2
    scale = binary_scale(data) if isinstance(data, Views) else 1.0

    h, w = -(-data.grid.height // block_px), -(-data.grid.width // block_px)

    def of_plane(plane: int) -> tuple[list[np.ndarray], np.ndarray, np.ndarray, np.ndarray]:
        blocks = _block_sums(data, planes.take([plane]), block_px, scale)
        cells = [block_sums(part, CELL_BLOCKS, np.float32) for part in blocks]
        photons = cells[SUMS] ** 2 / np.maximum(cells[SPREAD], LEAST_RATE)
        octaves = _of_section(blocks, chosen, least_samples)
        return octaves, blocks[SUMS][:h, :w], blocks[SAMPLES][:h, :w], photons

    octaves, *others = zip(*each_in_threads(of_plane, range(len(planes))), strict=True)
    largest = [np.maximum(np.max(each, axis=0), 0) for each in zip(*octaves, strict=True)]
    nats = each_in_threads(lambda excess: _summed(_saturated(excess, largest, chosen))[:h, :w], octaves)
    return TextureEvidence(np.stack(nats), *(np.stack(each) for each in others))


def _block_sums(
    data: PhotonCounts | Views, plane: FocalPlanes, block_px: int, scale: float
) -> list[np.ndarray]:
    """The number of samples, their sum and the variance of the sum (h, w) in the blocks of one section.

    Radiance is in units of `scale`. Of photon counts the last two are the same, and the sum is the last.
    Sizes are rounded up to multiples of a cell, with empty blocks.
    """
    is_counted = isinstance(data, PhotonCounts)
    section = reconstruct(data, plane, variance=not is_counted)

    def in_blocks(values: np.ndarray) -> np.ndarray:
        blocks = block_sums(sum_of(list(np.moveaxis(values, -1, 0)), np.float32), block_px, np.float32)
        return np.pad(blocks, [(0, -size % CELL_BLOCKS) for size in blocks.shape])

    blocks = [
        in_blocks(section.coverage[0]),
        in_blocks(section.counts[0] if scale == 1 else section.counts[0] / scale),
    ]
    if section.variance is not None:  # else that of a Poisson variable, its mean
        variance = section.variance[0] if scale == 1 else section.variance[0] / scale / scale
        blocks.append(in_blocks(variance * section.coverage[0]))
    return blocks


def _of_section(blocks: list[np.ndarray], model: TextureModel, least_samples: float) -> list[np.ndarray]:
    """The e of each octave on its own grid, from the values of `_block_sums`."""
    from scipy.ndimage import gaussian_filter

    parts, excess = blocks, list[np.ndarray]()
    for octave in range(model.octaves):
        if octave > 1:
            parts = [block_sums(part, 2, np.float32) / 4 for part in parts]
        finer, parts = parts, [gaussian_filter(part, _blur(octave), mode="constant") for part in parts]
        mean, around = (part[SUMS] / np.maximum(part[SAMPLES], LEAST_SAMPLES) for part in (finer, parts))
        number = np.maximum(parts[SAMPLES], LEAST_SAMPLES)
        noise = _noise_weight(octave) * np.maximum(parts[SPREAD], 0) / number**2
        noise = np.maximum(noise, LEAST_RATE**2) + (model.averaging_error * around) ** 2
        texture = (model.contrast * around) ** 2
        share = np.where(parts[SAMPLES] >= least_samples, texture / (noise + texture), 0)
        excess.append(share * ((mean - around) ** 2 / noise - 1) / 2)
    return excess


def _saturated(
    excess: Sequence[np.ndarray], largest: Sequence[np.ndarray], model: TextureModel
) -> list[np.ndarray]:
    """The e of each octave, reduced by how large it is at any plane; what is below 0 is left as it is."""
    return [
        np.where(each > 0, each / (1 + most / model.saturation_nats), each)
        for each, most in zip(excess, largest, strict=True)
    ]


def _summed(octaves: Sequence[np.ndarray]) -> np.ndarray:
    """Sum of values of octaves per block (h, w): a coefficient of an octave stands for 4^octave blocks."""
    total = octaves[-1]
    for octave in reversed(range(len(octaves) - 1)):
        if octave > 0:  # the first two octaves have the same grid
            h, w = octaves[octave].shape  # an odd one has one row less than twice its half
            total = _expanded(total)[:h, :w]
        total = octaves[octave] + total / 4
    return total


def _blur(octave: int) -> float:
    """Standard deviation that widens the finer mean of an octave to the coarser one, on the octave's grid.

    From single blocks to 1 in the finest octave, then from 1 to 2.
    """
    return 1.0 if octave == 0 else 3.0**0.5


@cache
def _noise_weight(octave: int) -> float:
    """Sum of the squared weights with which blocks enter a coefficient of an octave.

    Both terms of the coefficient are products of weights by row and by column.
    """
    from scipy.ndimage import gaussian_filter1d

    own = np.eye(64 << octave)
    for finer in range(octave):
        own = gaussian_filter1d(own, _blur(finer), axis=0, mode="constant")
        if finer > 0:
            own = (own[::2] + own[1::2]) / 2
    around = gaussian_filter1d(own, _blur(octave), axis=0, mode="constant")
    a, b = own[own.shape[0] // 2], around[own.shape[0] // 2]
    return float((a @ a) ** 2 + (b @ b) ** 2 - 2 * (a @ b) ** 2)


def _expanded(values: np.ndarray) -> np.ndarray:
    """Twice the size in both axes (h, w), interpolated between centres; continued beyond the borders."""
    return _expanded_rows(_expanded_rows(values).T).T


def _expanded_rows(values: np.ndarray) -> np.ndarray:
    padded = np.pad(values, ((1, 1), (0, 0)), mode="edge")
    sides = np.stack([padded[:-2], padded[2:]], axis=1)
    return ((3 * values[:, None] + sides) / 4).reshape(2 * values.shape[0], -1)
