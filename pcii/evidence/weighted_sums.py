"""Sums over cameras in the blocks of a section, with a weight for each camera.

A camera moves by whole pixels, and every pixel of it adds its value times the camera's weight to the block
it falls into. Photon events are added one by one; of images, sums over the blocks of a moved view are
differences of its running sums over rows and columns, so that they cost as much as there are blocks.
"""

from functools import partial

import numpy as np

from pcii.evidence.cells import BLOCK_PX
from pcii.types.camera_grid import CameraGrid
from pcii.types.geometry import depth_of_total_disparity_mm, parallax_px, shifts_to_centre_px
from pcii.types.images import Views
from pcii.types.photon_counts import PhotonCounts


def whole_shifts_px(grid: CameraGrid, total_disparity_px: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Whole shifts of the rows (Z, K) and columns (Z, L) of cameras, int32, at total disparities (Z,) in px.

    As `FocalPlanes.whole_shifts_px`, but also at 0, infinitely far, and below it, where no surface can be.
    """
    across, down = parallax_px(grid, depth_of_total_disparity_mm(grid, np.ones(1)))
    total = np.asarray(total_disparity_px, dtype=np.float64)
    exact = shifts_to_centre_px(grid, total * across - grid.shear_px[0], total * down - grid.shear_px[1])
    rows, cols = (np.floor(shifts + 0.5).astype(np.int32) for shifts in exact)
    return rows, cols


def camera_sums(
    data: PhotonCounts | Views, shifts: tuple[np.ndarray, np.ndarray], weights: np.ndarray, block_px: int
) -> tuple[np.ndarray, np.ndarray]:
    """Sums of photons or radiance and of samples, both (Z, G, h, w) float64, with G `weights` (G, K, L).

    Cameras are moved by the whole `shifts` of `whole_shifts_px`; blocks have `block_px` pixels along each
    axis, a multiple of `BLOCK_PX`, and there are enough for the film. A sample is a pixel of a view, all of
    its colours together.
    """
    edges = [
        _block_edges(moves, size, block_px) for moves, size in zip(shifts, data.grid.shape_HW, strict=True)
    ]
    by_row, by_col = (np.diff(each, axis=-1).astype(np.float64) for each in edges)
    samples = np.einsum("zka,gkl,zlb->zgab", by_row, weights, by_col, optimize=True)
    if isinstance(data, PhotonCounts) and data.is_sparse:
        return _of_events(data, shifts, weights, block_px, samples.shape), samples
    return _of_images(data, edges, weights, samples.shape), samples


def _block_edges(shifts: np.ndarray, size: int, block_px: int) -> np.ndarray:
    """First pixel (Z, N, blocks + 1) of each block, and past the last, of N shifted rows of cameras."""
    shift = shifts[..., None].astype(np.int64)
    first, last = np.maximum(shift, 0), np.minimum(size + shift, size)
    first, last = first + first % BLOCK_PX, last - last % BLOCK_PX
    edges = block_px * np.arange(-(-size // block_px) + 1)
    return np.clip(np.clip(edges, first, np.maximum(first, last)) - shift, 0, size)


def _of_events(
    counts: PhotonCounts,
    shifts: tuple[np.ndarray, np.ndarray],
    weights: np.ndarray,
    block_px: int,
    shape: tuple[int, ...],
) -> np.ndarray:
    from pcii.base.compiled_loops import each_in_threads
    from pcii.evidence.projection_kernels import cells_of_events

    events, shape_HW = counts.events, counts.grid.shape_HW
    place, n = (events.k, events.l, events.i, events.j), events.n
    weight = weights[:, events.k, events.l] * n
    sums = np.zeros(shape)

    def add_events(z: int) -> None:
        block = np.empty(n.size, np.int32)
        cells_of_events(*place, shifts[0][z], shifts[1][z], shape_HW, block_px, block)
        inside = block >= 0
        for group, own in enumerate(weight):
            sums[z, group] = np.bincount(block[inside], own[inside], sums[z, group].size).reshape(shape[2:])

    each_in_threads(add_events, range(len(sums)))
    return sums


def _of_images(
    data: PhotonCounts | Views, edges: list[np.ndarray], weights: np.ndarray, shape: tuple[int, ...]
) -> np.ndarray:
    from pcii.base.compiled_loops import each_in_threads

    sums = np.zeros(shape)
    running = np.zeros((data.grid.height + 1, data.grid.width + 1))

    def add_view(z: int, k: int, l: int, mean: float) -> None:
        rows, cols = edges[0][z, k], edges[1][z, l]
        blocks = np.diff(np.diff(running[rows[:, None], cols], axis=0), axis=1)
        blocks += mean * np.outer(np.diff(rows), np.diff(cols))
        for group in np.flatnonzero(weights[:, k, l]):
            sums[z, group] += weights[group, k, l] * blocks

    for k, l in np.ndindex(data.grid.rows, data.grid.cols):
        image = data.view(k, l).astype(np.float64)
        image = image.sum(axis=-1) if image.ndim == 3 else image
        # From the mean, running sums stay small and lose no digits.
        mean = float(image.mean())
        np.cumsum(np.cumsum(image - mean, axis=0), axis=1, out=running[1:, 1:])
        each_in_threads(partial(add_view, k=k, l=l, mean=mean), range(len(sums)))
    return sums
