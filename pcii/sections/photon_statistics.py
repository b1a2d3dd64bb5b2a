"""Statistics of photon counts: pooled samples, entropy, the variance of Poisson noise, and saturation.

At 1000 photons per view a voxel's own samples are degenerate: nine voxels of ten have no photon and
hardly any has two different non-zero samples. So samples are pooled over small neighbourhoods, which
is what the subscripts m, n of Muniraj et al. 2017, Eq. 7, can be read as.

Photons that meet in a pixel and a frame are counted as 2^bits - 1 at most. How often they meet follows from
how many there are in the same small part of a view. Of one bit, N of M pixels and frames that are set stand
for M (H_M - H_(M-N)) photons, H being harmonic numbers. For N ~ Binomial(M, p) that is the sum over r of the
unbiased estimates of p^r / r, the series of -ln(1 - p); a lone photon, which says nothing about saturation,
stands for one.
"""

import warnings
from dataclasses import dataclass

import numpy as np

from pcii.base import shared, sum_of, threads
from pcii.types import NEGLIGIBLE_LOSS, FocalPlanes, PhotonCounts, Readout, Sections, Views, colour_index

GREY_LEVELS = 256
"""Levels of the histogram of Eq. 9: the paper's images have 8 bits."""
PHOTONS_PER_WINDOW = 64.0
SMALLEST_WINDOW_PX = 3  # smaller windows may have no site of a Bayer colour
LARGEST_WINDOW_PX = 15
SATURATION_BLOCK_PX = 8
"""Side of the blocks over which light is taken as even, colour by colour: larger ones would average
bright spots away, smaller ones hardly ever hold two photons (docs/single_photon.md has other sizes)."""


def entropy_bits(values: np.ndarray, top: float) -> float:
    """Entropy of the grey-level histogram of `values`, in bits (Eq. 9).

    Levels are 256 equal steps from 0 to `top`; the histogram is normalised, 0 log 0 = 0, and an
    empty region has entropy 0.

    >>> entropy_bits(np.array([0.0, 0.0, 1.0, 1.0]), top=1.0)
    1.0
    """
    if values.size == 0 or top <= 0:
        return 0.0
    levels = np.clip(values / top * GREY_LEVELS, 0, GREY_LEVELS - 1).astype(np.int64)
    histogram = np.bincount(levels.ravel())
    share = histogram[histogram > 0] / values.size
    return float(abs((share * np.log2(share)).sum()))  # abs: -0.0 is 0


def section_window_px(sections: Sections) -> int:
    """Odd side of the square window over which sections are pooled for edges and entropies, 3 to 15 px.

    It holds about 64 photons where there are objects: a relative noise of 1/8.
    """
    rate = photons_around_a_photon(sections)
    side = np.sqrt(PHOTONS_PER_WINDOW / rate) if rate > 0 else LARGEST_WINDOW_PX
    return int(np.clip(2 * np.floor(side / 2) + 1, SMALLEST_WINDOW_PX, LARGEST_WINDOW_PX))


def photons_around_a_photon(sections: Sections) -> float:
    """Mean number of photons per voxel, over all colours, in which voxels are weighted by their photons K.

    It is sum K (K - 1) / sum K, a ratio that Poisson noise does not bias; 0 without photons.
    """
    photons = squares = 0.0
    for plane in sections.counts:
        total = sum_of(list(np.moveaxis(plane, -1, 0)), np.float64)  # faster than over a last axis of three
        photons += float(total.sum())
        squares += float(np.vdot(total, total))
    return squares / photons - 1 if photons > 0 else 0.0


def pooled_estimate(sections: Sections, window_px: int, samples: np.ndarray | None = None) -> np.ndarray:
    """Mean photons per sample over square windows, (Z, H, W, C) float64: counts over coverage.

    Sums are divided, so all samples have the same weight; a window that no sample reaches is 0. `samples` are
    the `pooled_samples` of other sections with this coverage, which are then not computed again.
    """
    mean = np.empty(sections.counts.shape)
    for plane in range(len(mean)):
        mean[plane] = pooled_plane(sections, plane, window_px, None if samples is None else samples[plane])
    return mean


def pooled_plane(
    sections: Sections, plane: int, window_px: int, samples: np.ndarray | None = None
) -> np.ndarray:
    """One plane of `pooled_estimate`, (H, W, C) float64: all planes at once may take much memory."""
    counts = _window_means(sections.counts[plane], window_px)
    if samples is None:
        samples = _window_means(sections.coverage[plane], window_px)
    # The filter's running sums leave rounding errors where the window is empty.
    floor = 0.5 / window_px**2
    mean = np.zeros_like(counts)
    return np.divide(counts, samples, out=mean, where=(samples > floor) & (counts > floor))


def pooled_samples(sections: Sections, window_px: int) -> np.ndarray:
    """Mean samples per voxel over square windows, (Z, H, W, C) float64."""
    return np.stack([_window_means(plane, window_px) for plane in sections.coverage])


def _window_means(values: np.ndarray, window_px: int) -> np.ndarray:
    """Means (H, W, C) float64 over square windows of odd side; outside the film there is nothing."""
    from scipy.ndimage import uniform_filter1d

    H, W, C = values.shape
    padded, means = np.zeros((H + window_px, W * C)), np.empty((H, W, C))
    padded[window_px // 2 :][:H] = values.reshape(H, -1)
    # Whole rows at a time; SciPy takes columns one by one, and then memory is what limits it.
    total = padded[:window_px].sum(axis=0)
    for row, entering, leaving in zip(means.reshape(H, -1), padded[window_px:], padded, strict=False):
        np.divide(total, window_px, out=row)
        total += entering
        total -= leaving
    return uniform_filter1d(means, window_px, axis=1, mode="constant")


def region_entropy_bits(pooled: np.ndarray, region: np.ndarray, tops: np.ndarray) -> float:
    """Entropy of one section inside a region (H, W), the mean over its colours.

    `pooled` (H, W, C) is one plane of `pooled_estimate`; `tops` (C,) is the highest level of each
    colour, the same for all planes that are compared.
    """
    bits = [entropy_bits(pooled[..., c][region], tops[c]) for c in range(pooled.shape[-1])]
    return float(np.mean(bits))


@dataclass(frozen=True)
class ViewSamples:
    """Statistics of the samples that the views contribute to pooled voxels of one section.

    A cell is `cell_px` pixels wide and a window `window_cells` cells; each view's photons in the
    window are one sample. All arrays are (H / cell_px, W / cell_px), rounded up.
    """

    number: np.ndarray
    """Views whose sample is not zero."""
    mean: np.ndarray
    """Mean of the non-zero samples; 0 where there is none."""
    variance: np.ndarray
    """Unbiased variance of the non-zero samples; 0 below two samples."""


def view_samples(
    counts: PhotonCounts, planes: FocalPlanes, plane: int, *, cell_px: int, window_cells: int
) -> ViewSamples:
    """Mean and variance of the non-zero samples of each pooled voxel of a plane (for Eq. 7).

    With cells and windows of 1 these are the samples of single voxels, whatever their colour. In focus all
    views see the same surface point, so their samples differ by Poisson noise only; out of focus they see
    different points, and the variance is larger. A window of an even number of pixels holds the same number
    of sites of each Bayer colour, whatever the shift of the view.

    Variances are of the differences from each voxel's first sample, in double precision: exact where the sum
    of their squares times the number of views is below 2^53.
    """
    grid, events = counts.grid, counts.events
    row, col, inside = planes.project(events, plane)
    shape = (-(-grid.height // cell_px), -(-grid.width // cell_px))
    number, first, difference = (np.zeros(shape, dtype=np.int64) for _ in range(3))
    squares = np.zeros(shape)
    # Events are sorted by view.
    starts = np.append(0, np.cumsum(inside))[counts.view_starts]
    cells = row[inside] // cell_px, col[inside] // cell_px
    samples = number, first, difference, squares
    _window_samples(samples, *cells, events.n[inside], starts, window_cells, threads())
    mean = (number * first + difference) / np.maximum(number, 1)
    deviations = np.maximum(number * squares - difference.astype(np.float64) ** 2, 0)
    variance = deviations / np.maximum(number * (number - 1), 1)
    return ViewSamples(number, mean, np.where(number > 1, variance, 0.0))


@shared(lambda samples, row, col, n, starts, window, bands: bands)
def _window_samples(
    first_band: int,
    last_band: int,
    samples: tuple[np.ndarray, ...],
    row: np.ndarray,
    col: np.ndarray,
    n: np.ndarray,
    starts: np.ndarray,
    window: int,
    bands: int,
) -> None:
    """Statistics (H, W) of each window's samples that are not zero, from zeros.

    They are int64 but for the last: the number of samples, the first, and sums of the others' differences
    from it and of these squared. The squares of large samples themselves would not fit in 64 bits.

    A sample is the sum of one view's photons in the window of `window` x `window` cells about a cell. `row`,
    `col` and `n` (N,) are the photons' cells and numbers, view v's from `starts[v]` to `starts[v + 1]`. Each
    of the `bands` of rows goes through all photons, so there need be no more than threads. The cost follows
    the photons times the cells of a window.
    """
    number, first, difference, squares = samples
    height, width = number.shape
    above = (window - 1) // 2  # the window of a cell reaches further above and left of it if its size is even
    below = window // 2
    for band in range(first_band, last_band):
        start, stop = height * band // bands, height * (band + 1) // bands
        sample = np.zeros((stop - start, width), np.int64)
        for view in range(starts.size - 1):
            for e in range(starts[view], starts[view + 1]):
                for i in range(max(row[e] - above, start), min(row[e] + below + 1, stop)):
                    for j in range(max(col[e] - above, 0), min(col[e] + below + 1, width)):
                        sample[i - start, j] += n[e]
            for e in range(starts[view], starts[view + 1]):
                for i in range(max(row[e] - above, start), min(row[e] + below + 1, stop)):
                    for j in range(max(col[e] - above, 0), min(col[e] + below + 1, width)):
                        value = sample[i - start, j]
                        if value > 0:  # 0 once this cell's sample has been counted
                            if number[i, j] == 0:
                                first[i, j] = value
                            number[i, j] += 1
                            value -= first[i, j]
                            difference[i, j] += value
                            squares[i, j] += float(value) * float(value)
                            sample[i - start, j] = 0


def truncated_poisson_variance(mean: np.ndarray) -> np.ndarray:
    """Variance of the non-zero samples of a Poisson variable whose non-zero samples have this mean.

    If the rate is r, non-zero samples have the mean m = r / (1 - exp(-r)) and the variance
    m (1 + r - m). The rate is found from the mean by Newton's method; a mean of 1 or less is rate 0.

    >>> truncated_poisson_variance(np.array([1.0, 2.0, 50.0])).round(3).tolist()
    [0.0, 1.187, 50.0]
    """
    m = np.maximum(np.asarray(mean, dtype=np.float64), 1.0)
    rate = np.maximum(2 * (m - 1), 1e-9)  # exact to second order at small rates; m itself at large
    rate = np.where(rate > 1.5, m, rate)
    for _ in range(30):
        decay = np.exp(-rate)
        value = rate - m * (1 - decay)
        slope = 1 - m * decay
        rate = np.maximum(rate - value / np.where(np.abs(slope) < 1e-12, 1e-12, slope), 1e-9)
    return np.where(m > 1 + 1e-9, m * np.maximum(1 + rate - m, 0.0), 0.0)


def saturation_loss(counts: PhotonCounts) -> float:
    """Share of the photons that the frames of these counts did not hold, from 0 to 1, estimated.

    0 for counts without a limit, and without photons.
    """
    grid, most = counts.grid, counts.readout.most_per_frame
    if most is None or not counts.total:
        return 0.0
    down, across = (-(-size // SATURATION_BLOCK_PX) for size in grid.shape_HW)
    colours = counts.channel_count
    rows, cols = np.indices(grid.shape_HW) // SATURATION_BLOCK_PX
    block = ((rows * across + cols) * colours + colour_index(*grid.shape_HW, counts.cfa)).ravel()
    trials = np.bincount(block, minlength=down * across * colours) * float(counts.readout.frames)
    arrived = 0.0
    for number in range(grid.view_count):
        if counts.is_sparse:  # whole images of few photons would take ten times as long
            events, view = counts.events, slice(*counts.view_starts[number : number + 2])
            pixel = events.i[view].astype(np.int64) * grid.width + events.j[view]
            blocks, n = block[pixel], events.n[view]
        else:
            blocks, n = block, counts.view(*divmod(number, grid.cols)).ravel()
        counted = np.bincount(blocks, n, minlength=trials.size)
        lit = counted > 0
        arrived += float(_photons(counted[lit], trials[lit], counts.readout).sum())
    return max(0.0, 1 - counts.total / arrived)


def warn_of_saturation(data: PhotonCounts | Views) -> None:
    """Warn where saturation removed more photons than a model of Poisson counts can do without."""
    loss = 0.0 if isinstance(data, Views) else saturation_loss(data)
    if loss > NEGLIGIBLE_LOSS:
        warnings.warn(
            f"saturation removed about {loss:.0%} of the photons; depth and removal take counts for Poisson "
            f"numbers, which holds up to {NEGLIGIBLE_LOSS:.0%}: take more frames or less light",
            UserWarning,
            stacklevel=3,
        )


def _photons(counted: np.ndarray, trials: np.ndarray, readout: Readout) -> np.ndarray:
    """Photons of blocks (N,) with `counted` counts in `trials` pixels and frames."""
    from scipy.special import digamma

    if readout.bits == 1:
        return trials * (digamma(trials + 1) - digamma(trials - counted + 1))
    assert readout.most_per_frame is not None
    # Three photons or more have to meet, and a few in a block say next to nothing about that.
    below = np.minimum(counted, readout.most_per_frame * trials - 0.5)
    return trials * Readout(1, readout.bits).photons(below, trials)
