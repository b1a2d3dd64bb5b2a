"""Compiled: means of the blocks of a section, and the evidence of octaves, from fine to coarse and back.

All in single precision, by loops along rows that the compiler takes several blocks at a time.
"""

from functools import cache

import numpy as np

from pcii.base import compiled, helper


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
    """Weights (R + 1,) float32 of the blocks 0 to R away in a Gaussian, up to so many standard deviations."""
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
def octave_evidence(
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


@compiled
def add_saturated(
    evidence: np.ndarray, largest: np.ndarray, saturation: float, total: np.ndarray, step: int
) -> None:
    """Add to the `evidence` of an octave (h, w) a fourth of the `total` of coarser ones, and bound its own.

    Its own is reduced by how large it is at any plane, `largest` (h, w); what is below 0 is left as it is.
    `total` has blocks of `step` blocks, 1 or 2, and is interpolated between their centres, continued beyond
    the borders; of no size where there is none.
    """
    h, w = evidence.shape
    size, quarter, three = np.float32(saturation), np.float32(0.25), np.float32(3)
    line = np.empty(total.shape[1], np.float32)
    for i in range(h):
        row, most = evidence[i], largest[i]
        for j in range(w):
            row[j] = row[j] / (np.float32(1) + most[j] / size) if row[j] > 0 else row[j]
        if total.size and step == 1:
            row += quarter * total[i]
        elif total.size:
            last = total.shape[0] - 1
            neighbour = min(i // 2 + 1, last) if i % 2 else max(i // 2 - 1, 0)
            line[:] = (three * total[i // 2] + total[neighbour]) * quarter
            last = line.size - 1
            for b in range(line.size):
                row[2 * b] += (three * line[b] + line[max(b - 1, 0)]) * quarter * quarter
                if 2 * b + 1 < w:
                    row[2 * b + 1] += (three * line[b] + line[min(b + 1, last)]) * quarter * quarter
