"""Computational reconstruction of sections: Muniraj et al. 2017, Eqs. 2 and 3.

Each view is shifted to the virtual centre and added; the mean over the samples that meet at a voxel
is the section. Colours are summed apart, each with its own coverage, so that any shift is exact and
raw Bayer colours never mix. Photon counts stay integers until that last division; they are never
interpolated.
"""

from collections.abc import Sequence
from functools import partial

import numpy as np

from pcii.base import InputError, shared, threads
from pcii.sections.dense_sections import colours_apart, step_px, sum_counts, sum_views
from pcii.store import Dataset
from pcii.types import (
    LARGEST_COUNT,
    PLAIN,
    FocalPlanes,
    PhotonCounts,
    Sections,
    Shifts,
    Views,
    check_data,
    colour_cells,
    disparity_px,
    is_whole,
)

DENSE_SHARE = 1 / 16
"""If a larger share of the pixels has photons, adding whole images takes less time than adding each photon.

Measured on 100 views of 1024 x 1024, where both take as long if 6 to 8 % of the pixels have photons.
"""
BAND_BYTES = 1 << 18
"""Size of a band of a section. It fits in the cache of a core, so that photons are added there and not in
memory; halved or doubled, a section takes a tenth longer at most."""
PROBE_STEPS_PX = (-28.0, -14.0, 14.0, 28.0)
"""Distance of the probes from their plane, in px of total disparity; half of it is blur."""


def reconstruct(
    data: PhotonCounts | Views,
    z_mm: object,
    *,
    subpixel: int = 1,
    shifts: Shifts = "nearest",
    variance: bool = False,
) -> Sections:
    """Sections of photon counts (Eq. 3) or radiance (Eq. 2) at the depths `z_mm`, or at `FocalPlanes`.

    Returns `Sections` with arrays (Z, H M, W M, C): M = `subpixel`, C = 3 for Bayer or colour data,
    1 for monochrome. `variance` adds the unbiased variance of the samples at each voxel, 0 below two.

    `shifts` are "nearest" (views move by whole pixels) or "even". With "even" raw Bayer samples of all
    colours are added together, as the paper does, and the section is a mosaic to be demosaiced:
    `demosaic(sections.estimate[0, ..., 0], cfa=sections.cfa)`. That is right for even shifts only, so views
    move by the nearest even number of pixels, up to 1 px off instead of 1/2.

    Raises `InputError` for a depth not above 0, a subpixel division below 1, options that do not go together,
    radiance that is not finite or too large to be added up, and counts too large for their exact variance.

    Three cameras count a photon each of a point at 500 mm, where the disparity is 10 px:

    >>> import pcii
    >>> grid = pcii.CameraGrid(
    ...     rows=1, cols=3, pitch_mm=(5.0, 5.0), focal_mm=50.0, pixel_mm=0.05, height=2, width=24
    ... )
    >>> counts = pcii.PhotonCounts.from_events(
    ...     k=[0, 0, 0], l=[0, 1, 2], i=[0, 0, 0], j=[20, 10, 0], n=[1, 1, 1], grid=grid
    ... )
    >>> sections = pcii.reconstruct(counts, z_mm=[500, 1000])
    >>> sections.estimate.shape
    (2, 2, 24, 1)
    >>> sections.counts[:, 0, 5:16, 0].tolist()
    [[0, 0, 0, 0, 0, 3, 0, 0, 0, 0, 0], [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]]
    """
    _check(data, subpixel, shifts, variance)
    grid, planes, sample_variance = data.grid, FocalPlanes.at_depths(data.grid, z_mm), None
    cfa, channels = colours_apart(data, shifts)
    shape = (len(planes), grid.height * subpixel, grid.width * subpixel, channels)
    rows, cols = planes.voxel_indices(subpixel, step_px(shifts))
    coverage_of = partial(_coverage, planes, cfa, shape, rows, cols)
    if isinstance(data, PhotonCounts):
        if subpixel == 1 and _as_images(data):
            sums = sum_counts(data, planes, shifts)
        else:
            sums = _scatter(data, data.events.n, shape, rows, cols)
        if variance:
            sample_variance = _count_variance(data, sums, coverage_of(), rows, cols)
    elif subpixel > 1:
        sums = _sum_fine(data, rows, cols, shape)
    else:
        sums, sample_variance = sum_views(data, planes, shifts, variance=variance)
    mosaic = data.cfa if shifts == "even" else None
    readout = data.readout if isinstance(data, PhotonCounts) else PLAIN
    return Sections(planes, sums, coverage_of, subpixel, sample_variance, mosaic, readout)


def with_probes(planes: FocalPlanes, *, clear_px: float = 7.0) -> FocalPlanes:
    """The requested planes (Z,), followed by their probe planes.

    A probe less than `clear_px` of total disparity from a requested plane is left out, one less than half a
    probe step from another probe, and one whose total disparity would not be above 0 (beyond infinity).
    """
    requested, probes = planes.total_disparity_px, []
    if not requested.all():  # a single camera has no disparity at any depth
        return planes
    spacing = min(abs(step) for step in PROBE_STEPS_PX) / 2
    for total in requested:
        for step in PROBE_STEPS_PX:
            probe = total + step
            is_clear = np.all(np.abs(probe - requested) > clear_px - 1e-9)  # rounding of the sum
            if probe > 0 and is_clear and all(abs(probe - added) > spacing for added in probes):
                probes.append(probe)
    return planes.followed_by(probes)


def extend(sections: Sections, counts: PhotonCounts, planes: FocalPlanes) -> Sections:
    """Sections of the counts at `planes`, of which the first are those of `sections`, which are reused.

    For sections that `reconstruct` made with its default options.
    """
    known = len(sections.planes)
    if len(planes) == known:
        return sections
    added = reconstruct(counts, planes.take(slice(known, None)))
    counts_of_all, samples = np.concatenate([sections.counts, added.counts]), added.samples

    def coverage() -> np.ndarray:
        # Not from the sections of the added planes, which would stay in memory beside the joined ones.
        return np.concatenate([sections.coverage, samples if isinstance(samples, np.ndarray) else samples()])

    return Sections(planes, counts_of_all, coverage, readout=counts.readout)


def _check(data: PhotonCounts | Views, subpixel: int, shifts: Shifts, variance: bool) -> None:
    check_data(data)
    if not is_whole(subpixel) or subpixel < 1:
        raise InputError(f"subpixel: expected a whole number of at least 1, got {subpixel!r}")
    if shifts not in ("nearest", "even"):
        raise InputError(f"shifts: use 'nearest' or 'even', not {shifts!r}")
    if shifts != "nearest" and subpixel > 1:
        raise InputError(f"shifts: {shifts!r} is for whole pixels (subpixel = 1)")
    if variance and subpixel > 1:
        raise InputError("variance: is for whole pixels (subpixel = 1)")
    if shifts == "even" and data.cfa is None:
        raise InputError("shifts: 'even' is for Bayer mosaics; these data have no pattern (cfa)")


def _as_images(counts: PhotonCounts) -> bool:
    """Whether whole images are added: of dense counts with many photons, if float64 holds all sums."""
    is_exact = counts.grid.view_count * LARGEST_COUNT <= 1 << 53 or counts.total <= 1 << 53
    return not counts.is_sparse and counts.occupied_share > DENSE_SHARE and is_exact


def _scatter(
    data: PhotonCounts, n: np.ndarray, shape: tuple[int, ...], rows: np.ndarray, cols: np.ndarray
) -> np.ndarray:
    """Sums per voxel and colour of `n` (N,), a whole number for each event; the cost follows the photons."""
    events = data.events
    # 32 bits hold the sum of any voxel if they hold the total; half the bytes take half the time.
    counts = np.empty(shape, np.int32 if n is events.n and data.total < 2**31 else np.int64)
    colours = data.event_colours if shape[3] == data.channel_count else np.zeros_like(data.event_colours)
    place = data.view_starts, events.i, events.j, colours
    bands = min(max(threads(), counts[0].nbytes // BAND_BYTES), shape[1])
    _add_photons(counts, rows, cols, *place, n, bands)
    return counts


def _count_variance(
    data: PhotonCounts, sums: np.ndarray, coverage: np.ndarray, rows: np.ndarray, cols: np.ndarray
) -> np.ndarray:
    """Unbiased variance of the counts that meet at each voxel, those of zero included: float64.

    (m Q - S^2) / (m (m - 1)) of m samples with the sum S and sum of squares Q: it is exact in integers.
    """
    n = data.events.n
    # No sum of squares is above the largest count times the largest sum.
    if n.size and int(n.max()) * int(sums.max()) * int(coverage.max()) >= 2**63:
        raise InputError("variance: the counts are too large for their squares to be added up exactly")
    squares = _scatter(data, n * n, sums.shape, rows, cols)
    samples = coverage.astype(np.int64)
    return (samples * squares - sums.astype(np.int64) ** 2) / np.maximum(samples * (samples - 1), 1)


def _coverage(
    planes: FocalPlanes, cfa: str | None, shape: tuple[int, ...], rows: np.ndarray, cols: np.ndarray
) -> np.ndarray:
    """Number of samples of each colour at each voxel (Z, H M, W M, C), in closed form.

    The number of samples of Bayer phase (a, b) at voxel (r, c) is a product: of the number of camera rows
    with a pixel of row parity a at r, and of camera columns with a pixel of column parity b at c.
    """
    _, H, W, C = shape
    cells = np.zeros((2, 2), np.int64) if cfa is None else colour_cells(cfa)
    coverage = np.empty(shape, np.uint16 if planes.grid.view_count < 1 << 16 else np.uint32)
    for plane in range(len(planes)):
        by_row, by_col = (
            np.array([_samples_at(targets[plane, :, parity::2], size) for parity in (0, 1)])
            for targets, size in ((rows, H), (cols, W))
        )
        # Few rows are distinct: away from the borders the pattern repeats.
        _, first, kinds = np.unique(by_row[0] << 32 | by_row[1], return_index=True, return_inverse=True)
        distinct = np.zeros((first.size, W, C), dtype=coverage.dtype)
        for (a, b), colour in np.ndenumerate(cells):
            distinct[..., colour] += (by_row[a, first][:, None] * by_col[b]).astype(distinct.dtype)
        if cfa is None:  # every pixel has all colours
            distinct[..., 1:] = distinct[..., :1]
        np.take(distinct, kinds, axis=0, out=coverage[plane], mode="clip")
    return coverage


def _samples_at(targets: np.ndarray, size: int) -> np.ndarray:
    """How many targets fall on each of the voxel rows 0 .. size-1."""
    inside = targets[(targets >= 0) & (targets < size)]
    return np.bincount(inside, minlength=size)


def has_depths(dataset: Dataset, z_mm: Sequence[float] | None = None) -> bool:
    """Whether depths are given, or suggested by the recipe of the dataset."""
    return bool(z_mm or dataset.analysis.get("z_mm"))


def planes_of(dataset: Dataset, z_mm: Sequence[float] | None = None) -> FocalPlanes:
    """Focal planes at the depths `z_mm`, else at those that the recipe suggests.

    Depths that are the same in six digits, as names of files and scores have them, are one plane. Raises
    `InputError` if there are none, or if no neighbouring views overlap at one: nothing is in focus.
    """
    if not has_depths(dataset, z_mm):
        advice = "name depths with --z-mm, or a range with --z-range-mm"
        raise InputError(f"{dataset.path}: suggests no depths; {advice}")
    grid = dataset.grid
    planes = FocalPlanes.at_depths(grid, z_mm or dataset.analysis["z_mm"])
    _, first = np.unique([f"{z:g}" for z in planes.z_mm], return_index=True)
    planes = planes.take(np.sort(first))
    across, down = (np.abs(px) for px in disparity_px(grid, planes.z_mm))
    overlap = ((across < grid.width) & (grid.cols > 1)) | ((down < grid.height) & (grid.rows > 1))
    if grid.view_count > 1 and not overlap.all():
        z = planes.z_mm[~overlap][0]
        raise InputError(f"z_mm: {z:g} mm is so near that no views overlap; depths are in mm")
    return planes


def depth_range_of(dataset: Dataset, z_mm: Sequence[float] | None = None) -> tuple[float, float]:
    """Nearest and farthest depth in mm to search: the recipe's, else 4/5 to 5/4 of those of `planes_of`."""
    suggested = dataset.analysis.get("z_range_mm")
    if suggested:
        return float(suggested[0]), float(suggested[1])
    z = planes_of(dataset, z_mm).z_mm
    return 0.8 * float(z.min()), 1.25 * float(z.max())


def _sum_fine(data: Views, rows: np.ndarray, cols: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Sums (Z, H M, W M, C), float64, of radiance on finer voxels.

    `rows` (Z, K, H) and `cols` (Z, L, W) are `FocalPlanes.voxel_indices`, which send no two pixels of a view
    to the same voxel. A view is read once, however many planes. Raises `InputError` for radiance that is NaN
    or infinite, or whose sums would be.
    """
    total, cells = np.zeros(shape), np.zeros((0, 2), np.int64) if data.cfa is None else colour_cells(data.cfa)
    for k, l in np.ndindex(data.grid.rows, data.grid.cols):
        image = data.view(k, l).astype(np.float64)
        for section, row_of, col_of in zip(total, rows[:, k], cols[:, l], strict=True):
            _add_fine(section, image, row_of, col_of, cells)
    if not np.isfinite(total).all():
        raise InputError("radiance: values are too large for their sum to be a number")
    return total


@shared(lambda total, image, *_: len(image))
def _add_fine(
    first_row: int,
    last_row: int,
    total: np.ndarray,
    image: np.ndarray,
    rows: np.ndarray,
    cols: np.ndarray,
    cells: np.ndarray,
) -> None:
    """Add one image (H, W, N) to sums on finer voxels (H M, W M, C).

    Pixel (i, j) belongs to voxel (`rows[i]`, `cols[j]`): no two of an image to the same. `cells` (2, 2) are
    the colours of a mosaic's Bayer cells, empty where every pixel holds all colours.
    """
    height, width, _ = total.shape
    for i in range(first_row, last_row):
        row = rows[i]
        if row < 0 or row >= height:
            continue
        for j in range(image.shape[1]):
            if 0 <= cols[j] < width:
                for channel in range(image.shape[2]):
                    colour = cells[i % 2, j % 2] if cells.size else channel
                    total[row, cols[j], colour] += image[i, j, channel]


@shared(lambda counts, rows, cols, starts, i, j, colour, n, bands: len(counts) * bands)
def _add_photons(
    first_part: int,
    last_part: int,
    counts: np.ndarray,
    rows: np.ndarray,
    cols: np.ndarray,
    starts: np.ndarray,
    i: np.ndarray,
    j: np.ndarray,
    colour: np.ndarray,
    n: np.ndarray,
    bands: int,
) -> None:
    """Sums of photons per voxel and colour: `counts` (Z, H, W, C), overwritten.

    `rows` (Z, K, h) and `cols` (Z, L, w) are the voxels of the pixels of each camera; `starts` (K L + 1,) is
    where each view's photons begin, which are sorted by row. Each section is divided into `bands` of rows: a
    thread clears a band and adds the photons that fall in it.
    """
    _, height, width, _ = counts.shape
    across = cols.shape[1]
    begin = np.empty(starts.size - 1, np.int64)  # of each view, its first photon that is not yet added
    for part in range(first_part, last_part):
        plane, band = part // bands, part % bands
        first, last = height * band // bands, height * (band + 1) // bands
        counts[plane, first:last, :, :] = 0
        for view in range(starts.size - 1):
            row_of, col_of = rows[plane, view // across], cols[plane, view % across]
            if part == first_part or band == 0:
                low, high = starts[view], starts[view + 1]
                while low < high:  # the first photon at or below the band's first row
                    middle = (low + high) // 2
                    if row_of[i[middle]] < first:
                        low = middle + 1
                    else:
                        high = middle
                begin[view] = low
            e = begin[view]
            while e < starts[view + 1] and row_of[i[e]] < last:
                row, col = row_of[i[e]], col_of[j[e]]
                if 0 <= col < width:
                    counts[plane, row, col, colour[e]] += n[e]
                e += 1
            begin[view] = e
