"""Slow loops that read as the formulas, and small synthetic scenes; shared by the tests."""

import math
from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from pcii.types import CameraGrid, PhotonCounts


def unit_grid(
    rows: int,
    cols: int,
    height: int,
    width: int,
    pitch_mm: tuple[float, float] = (1.0, 1.0),
    shear_px: tuple[float, float] = (0.0, 0.0),
) -> CameraGrid:
    """A grid whose parallax at z = 1 mm is `pitch_mm` read as pixels, exactly: focal and pixel are 1."""
    film = {"focal_mm": 1.0, "pixel_mm": 1.0, "height": height, "width": width}
    return CameraGrid(rows=rows, cols=cols, pitch_mm=pitch_mm, shear_px=shear_px, **film)


def paper_grid(height: int = 1024, width: int = 1024) -> CameraGrid:
    """The paper's cameras, on a film of as many of its pixels."""
    return CameraGrid(
        rows=10, cols=10, pitch_mm=(5.0, 5.0), focal_mm=50.0, pixel_mm=0.0352, height=height, width=width
    )


def project_px(
    grid: CameraGrid, point_mm: tuple[float, float, float], k: float, l: float
) -> tuple[float, float]:
    """(row, column) of the image of the point (X, Y, Z) in camera (k, l), pixel centres at integers.

    The virtual centre is the camera ((K-1)/2, (L-1)/2).
    """
    X, Y, Z = point_mm
    down, right = k - (grid.rows - 1) / 2, l - (grid.cols - 1) / 2
    scale_px = grid.focal_mm / grid.pixel_mm / Z
    i = (grid.height - 1) / 2 + down * grid.shear_px[1] + scale_px * (Y - down * grid.pitch_mm[1])
    j = (grid.width - 1) / 2 + right * grid.shear_px[0] + scale_px * (X - right * grid.pitch_mm[0])
    return i, j


def colour_of(i: int, j: int, cfa: str | None) -> int:
    """Colour of one pixel, by reading the pattern's name."""
    return 0 if cfa is None else "RGB".index(cfa[2 * (i % 2) + j % 2])


def voxel_of(pixel: int, camera: int, cameras: int, disparity: float, subpixel: int) -> int:
    """The contract's rule for one axis: row i of camera row k, seen at the depth of this disparity."""
    shift = (camera - (cameras - 1) / 2) * disparity
    if subpixel == 1:
        return pixel + math.floor(shift + 1 / 2)
    return math.floor((pixel + 1 / 2 + shift) * subpixel)


def samples_of(
    images: np.ndarray, grid: CameraGrid, z_mm: float, *, cfa: str | None = None, subpixel: int = 1
) -> dict[tuple[int, int, int], list[float]]:
    """The samples that meet at each (row, column, colour) of views (K, L, H, W, C)."""
    K, L, H, W, C = images.shape
    d_x, d_y = (grid.focal_mm * pitch / (z_mm * grid.pixel_mm) for pitch in grid.pitch_mm)
    meeting: dict[tuple[int, int, int], list[float]] = {}
    for k, l, i, j in np.ndindex(K, L, H, W):
        row, col = voxel_of(i, k, K, d_y, subpixel), voxel_of(j, l, L, d_x, subpixel)
        if 0 <= row < H * subpixel and 0 <= col < W * subpixel:
            for channel in range(C):
                colour = channel if cfa is None else colour_of(i, j, cfa)
                meeting.setdefault((row, col, colour), []).append(images[k, l, i, j, channel].item())
    return meeting


def variance_of(samples: Sequence[float]) -> float:
    """Unbiased variance by fractions, rounded once; 0 below two samples."""
    if len(samples) < 2:
        return 0.0
    exact = [*map(Fraction, samples)]
    mean = sum(exact, Fraction(0)) / len(exact)
    return float(sum(((sample - mean) ** 2 for sample in exact), Fraction(0)) / (len(exact) - 1))


def section_twin(
    counts_KLHW: np.ndarray, grid: CameraGrid, cfa: str | None, z_mm: list[float], subpixel: int
) -> tuple[np.ndarray, np.ndarray]:
    """Eq. 3 as it reads, before its division: counts and coverage (Z, H M, W M, C)."""
    shape = (len(z_mm), grid.height * subpixel, grid.width * subpixel, 1 if cfa is None else 3)
    total, coverage = np.zeros(shape, dtype=np.int64), np.zeros(shape, dtype=np.uint32)
    for plane, z in enumerate(z_mm):
        meeting = samples_of(counts_KLHW[..., None], grid, z, cfa=cfa, subpixel=subpixel)
        for voxel, samples in meeting.items():
            total[plane, *voxel], coverage[plane, *voxel] = sum(samples), len(samples)
    return total, coverage


def reflected(index: int, size: int) -> int:
    """The index inside 0 .. size-1 that stands for `index` under reflection about the border pixel."""
    while not 0 <= index < size:
        index = -index if index < 0 else 2 * (size - 1) - index
    return index


def demosaic_twin(raw: np.ndarray, cfa: str) -> np.ndarray:
    """Eqs. 4, 5 and 6 with their misprints put right, one pixel at a time."""
    H, W = raw.shape

    def value(i: int, j: int) -> float:
        return float(raw[reflected(i, H), reflected(j, W)])

    def green(i: int, j: int) -> float:
        i, j = reflected(i, H), reflected(j, W)
        if colour_of(i, j, cfa) == 1:
            return value(i, j)
        alpha = abs((value(i, j - 2) + value(i, j + 2)) / 2 - value(i, j))
        beta = abs((value(i - 2, j) + value(i + 2, j)) / 2 - value(i, j))
        if alpha < beta:
            return (value(i, j - 1) + value(i, j + 1)) / 2
        if alpha > beta:
            return (value(i - 1, j) + value(i + 1, j)) / 2
        return (value(i - 1, j) + value(i, j - 1) + value(i, j + 1) + value(i + 1, j)) / 4

    def chroma(i: int, j: int, colour: int) -> float:
        around = [(di, dj) for di in (-1, 0, 1) for dj in (-1, 0, 1)]
        sites = [(di, dj) for di, dj in around if colour_of((i + di) % 2, (j + dj) % 2, cfa) == colour]
        if (0, 0) in sites:
            return value(i, j)
        differences = [value(i + di, j + dj) - green(i + di, j + dj) for di, dj in sites]
        return sum(differences) / len(differences) + green(i, j)

    rgb = np.empty((H, W, 3))
    for i in range(H):
        for j in range(W):
            rgb[i, j] = chroma(i, j, 0), green(i, j), chroma(i, j, 2)
    return rgb


def blocky_texture(rng: np.random.Generator, height: int, width: int, block_px: int = 3) -> np.ndarray:
    """Colour texture (height, width, 3), each block 0.1 or 1: strong, and without a period."""
    blocks = rng.choice([0.1, 1.0], size=(-(-height // block_px), -(-width // block_px), 3))
    return blocks.repeat(block_px, axis=0).repeat(block_px, axis=1)[:height, :width]


def patch_views(patch: np.ndarray, top: int, left: int, disparity_px: int, grid: CameraGrid) -> np.ndarray:
    """Views (K, L, H, W, C) of a patch whose upper left pixel is (top, left) of the virtual centre.

    `disparity_px` must give whole shifts; what falls outside a view is cut off, the rest is dark.
    """
    K, L, H, W = grid.shape_KLHW
    views = np.zeros((K, L, H, W, patch.shape[2]))
    for k in range(K):
        for l in range(L):
            # A camera further right (lower) sees the patch further left (higher).
            first_row = top - (2 * k - (K - 1)) * disparity_px / 2
            first_col = left - (2 * l - (L - 1)) * disparity_px / 2
            assert first_row.is_integer()
            assert first_col.is_integer()
            rows = int(first_row) + np.arange(patch.shape[0])
            cols = int(first_col) + np.arange(patch.shape[1])
            i, j = (rows >= 0) & (rows < H), (cols >= 0) & (cols < W)
            views[k, l][np.ix_(rows[i], cols[j])] = patch[np.ix_(i, j)]
    return views


def opaque_views(surfaces: Sequence[tuple[np.ndarray, int, int, int]], grid: CameraGrid) -> np.ndarray:
    """Views (K, L, H, W, 3) of (patch, top, left, disparity in px) from far to near: each hides those before.

    Where a patch is 0 in all colours it is not there.
    """
    views = np.zeros((*grid.shape_KLHW, 3))
    for patch, top, left, disparity_px in surfaces:
        surface = patch_views(patch, top, left, disparity_px, grid)
        views = np.where(surface.any(axis=-1, keepdims=True), surface, views)
    return views


def even_light(grid: CameraGrid, rate: float, seed: int, cfa: str | None = None) -> PhotonCounts:
    """So many photons per pixel of every view, and nothing to see."""
    film = np.random.default_rng(seed).poisson(rate, grid.shape_KLHW)
    return PhotonCounts.from_dense(film, grid, cfa=cfa)


def bayer_photons(rates: np.ndarray, cfa: str, seed: int) -> np.ndarray:
    """Poisson counts (K, L, H, W) of colour rates (K, L, H, W, 3) behind a Bayer pattern."""
    mosaic = np.empty(rates.shape[:-1])
    for a, b in np.ndindex(2, 2):
        mosaic[..., a::2, b::2] = rates[..., a::2, b::2, colour_of(a, b, cfa)]
    return np.random.default_rng(seed).poisson(mosaic)


def square_mask(grid: CameraGrid, top: int, left: int, size: int) -> np.ndarray:
    mask = np.zeros((grid.height, grid.width), dtype=bool)
    mask[top : top + size, left : left + size] = True
    return mask


def intersection_over_union(a: np.ndarray, b: np.ndarray) -> float:
    return float((a & b).sum() / (a | b).sum())


class Reader:
    """Views that are read one by one, as from disk."""

    def __init__(self, images: np.ndarray) -> None:
        self.images, self.shape, self.dtype = images, images.shape, images.dtype

    def __getitem__(self, index: tuple[int, int]) -> np.ndarray:
        return self.images[index]
