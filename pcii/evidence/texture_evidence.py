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

from dataclasses import dataclass, replace
from functools import cache, reduce
from typing import Any, NamedTuple

import numpy as np

from pcii.base import block_sums, compiled, each_in_threads, helper, sum_of
from pcii.sections import reconstruct
from pcii.types import FocalPlanes, PhotonCounts, Views, binary_scale


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
PHOTON_CELL_BLOCKS = 4
LEAST_SAMPLES, LEAST_RATE = 1e-3, 1e-12
"""What is divided by where there are no samples, or no light."""


def evidence_of_texture(
    data: PhotonCounts | Views, planes: FocalPlanes, block_px: int = 2, model: TextureModel | None = None
) -> TextureEvidence:
    """Evidence of blocks of `block_px` x `block_px` pixels at each of the Z planes, h x w blocks.

    The sum over a window is the logarithm, but for a constant, of how likely its samples are if the surface
    is at this plane. A mosaic has all colours in a block of 2 pixels or more, for any shift.
    """
    planes = replace(planes, rounding=ROUNDING)
    texture_model = model or TextureModel()
    colours = data.radiance.shape[-1] if isinstance(data, Views) else 1
    if isinstance(data, PhotonCounts):
        data = replace(data, cfa=None)  # colours are summed, sooner is faster
    least_samples = texture_model.least_coverage * data.grid.view_count * colours * block_px**2
    scale = binary_scale(data) if isinstance(data, Views) else 1.0
    h, w = (-(-size // block_px) for size in data.grid.shape_HW)
    nats, sums, samples = (np.empty((len(planes), h, w), np.float32) for _ in range(3))

    def of_plane(plane: int) -> tuple[list[np.ndarray], np.ndarray]:
        single = planes.take([plane])
        blocks = _block_sums(data, single, block_px, scale)
        number = colours * _samples_of_blocks(single, 0, block_px), _samples_of_blocks(single, 1, block_px)
        sums[plane] = blocks[0][:h, :w]
        np.outer(number[0][:h], number[1][:w], out=samples[plane])
        of_cells, spread = (
            block_sums(part, PHOTON_CELL_BLOCKS, np.float32) for part in (blocks[0], blocks[-1])
        )
        photons = of_cells**2 / np.maximum(spread, LEAST_RATE)
        return _of_section(blocks, number, texture_model, least_samples), photons

    octaves, photons = zip(*each_in_threads(of_plane, range(len(planes))), strict=True)
    largest = [reduce(np.maximum, each).clip(min=0) for each in zip(*octaves, strict=True)]

    def sum_octaves(plane: int) -> None:
        total: Any = np.float32(-0.0)  # which changes nothing that it is added to
        for octave, evidence in reversed([*enumerate(octaves[plane])]):
            reduction = 1 + largest[octave] / np.float32(texture_model.saturation_nats)
            evidence = np.where(evidence > 0, evidence / reduction, evidence)
            if 0 < octave < texture_model.octaves - 1:  # the first two octaves have the same grid
                total = doubled(total[None], *evidence.shape)[0]
            total = evidence + np.float32(0.25) * total
        nats[plane] = total[:h, :w]

    each_in_threads(sum_octaves, range(len(planes)))
    return TextureEvidence(nats, sums, samples, np.stack(photons))


def _block_sums(
    data: PhotonCounts | Views, plane: FocalPlanes, block_px: int, scale: float
) -> list[np.ndarray]:
    """The sum of samples (h, w) in the blocks of one section, and of radiance the variance of the sum.

    They are float32; radiance is in units of `scale`. Sizes are rounded up to multiples of a cell, with empty
    blocks.
    """

    def in_blocks(values: np.ndarray) -> np.ndarray:
        blocks = block_sums(sum_of(list(np.moveaxis(values, -1, 0)), np.float32), block_px, np.float32)
        return np.pad(blocks, [(0, -size % PHOTON_CELL_BLOCKS) for size in blocks.shape])

    section = reconstruct(data, plane, variance=isinstance(data, Views))
    if section.variance is None:  # it is that of a Poisson variable, its mean
        return [in_blocks(section.counts[0])]
    variance = section.variance[0] / scale / scale
    return [in_blocks(section.counts[0] / scale), in_blocks(variance * section.coverage[0])]


def _samples_of_blocks(plane: FocalPlanes, axis: int, block_px: int) -> np.ndarray:
    """Pixels of all camera rows, or columns, in each row or column of blocks: float32, as many as blocks."""
    size, shift = plane.grid.shape_HW[axis], plane.nearest_shifts_px()[axis][0]
    edges = np.minimum(block_px * np.arange(-(-size // block_px) + 1), size)
    # The pixels of a shifted row before each edge.
    before = np.clip(edges - np.maximum(shift, 0)[:, None], 0, np.maximum(size - np.abs(shift), 0)[:, None])
    blocks = np.diff(before.sum(axis=0)).astype(np.float32)
    return np.pad(blocks, (0, -blocks.size % PHOTON_CELL_BLOCKS))


def _of_section(
    blocks: list[np.ndarray], number: tuple[np.ndarray, ...], model: TextureModel, least_samples: float
) -> list[np.ndarray]:
    """The e of each octave on its own grid, from the values of `_block_sums` and `_samples_of_blocks`."""
    from scipy.ndimage import gaussian_filter1d

    excess = list[np.ndarray]()
    for octave in range(model.octaves):
        if octave > 1:
            blocks = [block_sums(part, 2, np.float32) / 4 for part in blocks]
            number = tuple(map(_halved, number))
        finer = blocks[0], *number
        blocks = [gaussian_mean(part, gaussian_weights(_blur(octave), 4)) for part in blocks]
        number = tuple(gaussian_filter1d(part, _blur(octave), mode="constant") for part in number)
        coefficients = _noise_weight(octave), model.averaging_error, model.contrast
        constants = np.array([*coefficients, least_samples, LEAST_SAMPLES, LEAST_RATE], np.float32)
        excess.append(_octave_evidence(finer, (blocks[0], *number), blocks[-1], constants))
    return excess


def _halved(number: np.ndarray) -> np.ndarray:
    """Means of pairs; half of the last where it has no other."""
    return np.pad(number, (0, number.size % 2)).reshape(-1, 2).sum(axis=1) / np.float32(2)


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

    finer_mean = np.eye(64 << octave)
    for finer in range(octave):
        finer_mean = gaussian_filter1d(finer_mean, _blur(finer), axis=0, mode="constant")
        if finer > 0:
            finer_mean = (finer_mean[::2] + finer_mean[1::2]) / 2
    coarser_mean = gaussian_filter1d(finer_mean, _blur(octave), axis=0, mode="constant")
    a, b = finer_mean[finer_mean.shape[0] // 2], coarser_mean[finer_mean.shape[0] // 2]
    return float((a @ a) ** 2 + (b @ b) ** 2 - 2 * (a @ b) ** 2)


# Compiled, in single precision: loops along rows, of which the compiler takes several blocks at a time.


@compiled
def gaussian_mean(values: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Means of `values` (h, w) float32, 0 beyond the borders, by Gaussian weights along either axis.

    `weight` (R + 1,) float32 are those of the blocks 0 to R away.
    """
    h, w = values.shape
    reach = weight.size - 1
    result, dark = np.zeros((h, w), np.float32), np.zeros(w, np.float32)
    line = np.zeros(w + 2 * reach, np.float32)
    for i in range(h):
        middle = line[reach : reach + w]
        middle[:] = 0
        for r in range(reach + 1):
            above = values[i - r] if i >= r else dark
            below = values[i + r] if 0 < r < h - i else dark
            _add_pair(middle, above, below, weight[r])
        for r in range(reach + 1):
            right = line[reach + r : reach + r + w] if r > 0 else dark
            _add_pair(result[i], line[reach - r : reach - r + w], right, weight[r])
    return result


@cache
def gaussian_weights(sigma: float, deviations: int) -> np.ndarray:
    """Weights (R + 1,) float32 of the blocks 0 to R away in a Gaussian that ends at `deviations` sigma."""
    distance = np.arange(int(deviations * sigma + 0.5) + 1)
    weight = np.exp(-((distance / sigma) ** 2) / 2)
    return (weight / (2 * weight.sum() - weight[0])).astype(np.float32)


@helper
def _add_pair(total: np.ndarray, one: np.ndarray, other: np.ndarray, weight: float) -> None:
    # Of slices, so that the compiler sees that neighbours exist and takes several at a time.
    for j in range(total.size):
        total[j] += weight * (one[j] + other[j])


@compiled
def doubled(coarse: np.ndarray, h: int, w: int) -> np.ndarray:
    """Maps (C, h, w) float32 of blocks half as large as those of `coarse`, interpolated between the centres
    and continued beyond the borders."""
    C, rows, cols = coarse.shape
    fine, line = np.empty((C, h, w), np.float32), np.empty(cols, np.float32)
    three, sixteenth = np.float32(3), np.float32(1 / 16)
    for c in range(C):
        for i in range(h):
            neighbour = min(i // 2 + 1, rows - 1) if i % 2 else max(i // 2 - 1, 0)
            line[:] = (three * coarse[c, i // 2] + coarse[c, neighbour]) * sixteenth
            row = fine[c, i]
            for b in range((w + 1) // 2):
                row[2 * b] = three * line[b] + line[max(b - 1, 0)]
                if 2 * b + 1 < w:
                    row[2 * b + 1] = three * line[b] + line[min(b + 1, cols - 1)]
    return fine


@compiled
def _octave_evidence(
    finer: tuple[np.ndarray, ...], coarser: tuple[np.ndarray, ...], spread: np.ndarray, constants: np.ndarray
) -> np.ndarray:
    """The e (h, w) float32 of coefficients, the difference of two means of blocks.

    `finer` and `coarser` are the sum (h, w) and the number of samples, the product of that of a row (h,) and
    of a column (w,); `spread` (h, w) is the variance of the coarser sum. `constants` float32 are the weight
    of the noise, a, c, the least number of samples that counts, and the least samples and rate to divide by.
    """
    weight, averaging_error, contrast, least_counted, least_samples, least_rate = constants
    result = np.empty(spread.shape, np.float32)
    half, one, zero = np.float32(0.5), np.float32(1), np.float32(0)
    fine_samples, samples = finer[2], coarser[2]
    for i in range(spread.shape[0]):
        fine_row, row, spread_row, line = finer[0][i], coarser[0][i], spread[i], result[i]
        fine_share, share = finer[1][i], coarser[1][i]
        for j in range(line.size):
            number = max(share * samples[j], least_samples)
            around = row[j] / number
            difference = fine_row[j] / max(fine_share * fine_samples[j], least_samples) - around
            left, texture = averaging_error * around, contrast * around
            noise = weight * max(spread_row[j], zero) / (number * number)
            noise = max(noise, least_rate * least_rate) + left * left
            texture *= texture
            excess = texture / (noise + texture) * (difference * difference / noise - one) * half
            line[j] = excess if share * samples[j] >= least_counted else zero
    return result
