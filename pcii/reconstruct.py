"""Computational reconstruction of sections: Muniraj et al. 2017, Eqs. 2 and 3.

Each view is shifted to the virtual centre and added; the mean over the samples that meet at a voxel
is the section. Colours are summed apart, each with its own coverage, so that any shift is exact and
raw Bayer colours never mix. Photon counts stay integers until that last division, and no count is
ever spread by interpolation.
"""

import numpy as np

from pcii.bayer import colour_cells
from pcii.errors import InputError
from pcii.geometry import landing, target_indices
from pcii.types import CameraGrid, Normalisation, PhotonCounts, Sections, Views, check_z_mm


def reconstruct(
    data: PhotonCounts | Views,
    z_mm: object,
    *,
    subpixel: int = 1,
    normalisation: Normalisation = "overlap",
) -> Sections:
    """Sections of photon counts (Eq. 3) or radiance (Eq. 2) at the depths `z_mm`.

    Returns `Sections` with arrays (Z, H M, W M, C): M = `subpixel`, C = 3 for Bayer or colour data,
    1 for monochrome. `normalisation` "overlap" divides by the samples that reach a voxel, "views"
    by the number of cameras as the paper does, which darkens borders.
    Raises `InputError` for a depth not above 0 or a subpixel division below 1.

    >>> sections = reconstruct(counts, z_mm=[540, 620])          # doctest: +SKIP
    >>> sections.estimate.shape                                  # doctest: +SKIP
    (2, 1024, 1024, 3)
    """
    z = check_z_mm(z_mm)
    if not isinstance(data, PhotonCounts | Views):
        raise InputError(f"data: expected PhotonCounts or Views, got {type(data).__name__}")
    if isinstance(subpixel, bool) or not isinstance(subpixel, int) or subpixel < 1:
        raise InputError(f"subpixel: expected a whole number of at least 1, got {subpixel!r}")
    if normalisation not in ("overlap", "views"):
        raise InputError(f"normalisation: use 'overlap' or 'views', not {normalisation!r}")
    grid, C = data.grid, data.channel_count
    shape = (z.size, C, grid.height * subpixel, grid.width * subpixel)
    coverage = np.stack([coverage_of(grid, data.cfa, C, depth, subpixel) for depth in z])
    if isinstance(data, Views):
        sums = np.zeros(shape, dtype=np.float64)
        _add_views(sums, data, z, subpixel)
    else:
        sums = np.zeros(shape, dtype=np.int64)
        for plane, depth in zip(sums, z, strict=True):
            _add_events(plane, data, depth, subpixel)
    return Sections(grid, z, np.moveaxis(sums, 1, -1), np.moveaxis(coverage, 1, -1), subpixel, normalisation)


def _add_events(plane: np.ndarray, data: PhotonCounts, z_mm: float, subpixel: int) -> None:
    """Scatter the photons into the section `plane` (C, H M, W M): the cost follows the photons."""
    events = data.events
    row, col, inside = landing(data.grid, events, z_mm, subpixel)
    voxel = np.ravel_multi_index((data.event_colours[inside], row[inside], col[inside]), plane.shape)
    np.add.at(plane.reshape(-1), voxel, events.n[inside])


def _add_views(sums: np.ndarray, data: Views, z: np.ndarray, subpixel: int) -> None:
    """Add radiance, one view at a time for all depths: a view is read once, however many planes."""
    grid = data.grid
    cells = colour_cells(data.cfa)
    targets = [target_indices(grid, depth, subpixel) for depth in z]
    for k in range(grid.rows):
        for l in range(grid.cols):
            image = data.view(k, l)
            for plane, (rows, cols) in zip(sums, targets, strict=True):
                if data.cfa is None:
                    for colour in range(image.shape[2]):
                        _add_image(plane[colour], image[..., colour], rows[k], cols[l])
                    continue
                for (a, b), colour in np.ndenumerate(cells):
                    cell = image[a::2, b::2, 0]
                    _add_image(plane[colour], cell, rows[k, a::2], cols[l, b::2])


def _add_image(plane: np.ndarray, image: np.ndarray, row: np.ndarray, col: np.ndarray) -> None:
    """Add pixels at voxel (row[i], col[j]); within one camera no two pixels share a voxel."""
    H, W = plane.shape
    i, j = _inside(row, H), _inside(col, W)
    row, col = row[i], col[j]
    if row.size and col.size:
        # Targets are equally spaced but for a rounding once in 1e13, which a slice would miss.
        if _is_spaced(row) and _is_spaced(col):
            plane[_strided(row), _strided(col)] += image[i, j]
        else:
            plane[np.ix_(row, col)] += image[i, j]


def _inside(target: np.ndarray, size: int) -> slice:
    """The run of pixels whose (increasing) targets fall on the voxel grid."""
    return slice(int(np.searchsorted(target, 0)), int(np.searchsorted(target, size)))


def _is_spaced(target: np.ndarray) -> bool:
    return bool(np.all(np.diff(target, 2) == 0))


def _strided(target: np.ndarray) -> slice:
    step = int(target[1] - target[0]) if target.size > 1 else 1
    return slice(int(target[0]), int(target[-1]) + 1, step)


def coverage_of(grid: CameraGrid, cfa: str | None, channels: int, z_mm: float, subpixel: int) -> np.ndarray:
    """How many samples of each colour meet at each voxel, (C, H M, W M) uint32, in closed form.

    The samples of Bayer phase (a, b) at voxel (r, c) are (camera rows whose pixel of row parity a
    lands on r) x (camera columns whose pixel of column parity b lands on c): it separates.
    """
    rows, cols = target_indices(grid, z_mm, subpixel)
    by_row = [_landings(rows[:, a::2], grid.height * subpixel) for a in (0, 1)]
    by_col = [_landings(cols[:, b::2], grid.width * subpixel) for b in (0, 1)]
    coverage = np.zeros((channels, by_row[0].size, by_col[0].size), dtype=np.uint32)
    if cfa is None:
        coverage[:] = np.outer(by_row[0] + by_row[1], by_col[0] + by_col[1])
        return coverage
    for (a, b), colour in np.ndenumerate(colour_cells(cfa)):
        coverage[colour] += np.outer(by_row[a], by_col[b])
    return coverage


def _landings(targets: np.ndarray, size: int) -> np.ndarray:
    """How many targets fall on each of the voxel rows 0 .. size-1, uint32."""
    inside = targets[(targets >= 0) & (targets < size)]
    return np.bincount(inside, minlength=size).astype(np.uint32)
