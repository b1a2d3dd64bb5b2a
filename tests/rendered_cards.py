"""Views of textured rectangles at known depths, drawn with plain NumPy: the pictures of a stranger."""

from dataclasses import dataclass

import numpy as np

from pcii.types import CameraGrid


@dataclass(frozen=True)
class Card:
    """A rectangle at depth `z_mm`, from these shares (top, bottom, left, right) of the centre's image."""

    z_mm: float
    part: tuple[float, float, float, float] = (-1.0, 2.0, -1.0, 2.0)
    seed: int = 0


def texture(rng: np.random.Generator, size: int, cell: int) -> np.ndarray:
    """A random pattern (size, size, 3) in [0, 1], of coarse and of fine cells."""
    coarse = rng.random((size // cell + 2, size // cell + 2, 3)).repeat(cell, 0).repeat(cell, 1)
    fine = rng.random((size // 3 + 2, size // 3 + 2, 3)).repeat(3, 0).repeat(3, 1)
    return 0.7 * coarse[:size, :size] + 0.3 * fine[:size, :size]


def render(grid: CameraGrid, cards: list[Card], cell: int = 12) -> np.ndarray:
    """Linear radiance (K, L, H, W, 3): far cards first, near ones over them, at subpixel places.

    A camera at X sees a point of depth z further left by f X / (z p) px than the virtual centre does.
    """
    H, W = grid.height, grid.width
    views = np.zeros((*grid.shape_KLHW, 3))
    for card in sorted(cards, key=lambda card: -card.z_mm):
        size = 3 * max(H, W)
        pattern = texture(np.random.default_rng(card.seed), size, cell)
        per_mm = grid.focal_mm / (grid.pixel_mm * card.z_mm)
        top, bottom, left, right = card.part
        for k, l in np.ndindex(grid.rows, grid.cols):
            dy = (k - (grid.rows - 1) / 2) * (grid.pitch_mm[1] * per_mm - grid.shear_px[1])
            dx = (l - (grid.cols - 1) / 2) * (grid.pitch_mm[0] * per_mm - grid.shear_px[0])
            i, j = np.arange(H) + dy, np.arange(W) + dx  # of the centre's image
            inside = ((i >= top * H) & (i < bottom * H))[:, None] & ((j >= left * W) & (j < right * W))
            views[k, l][inside] = sampled(pattern, i + size // 3, j + size // 3)[inside]
    return views


def sampled(pattern: np.ndarray, i: np.ndarray, j: np.ndarray) -> np.ndarray:
    """A pattern at rows i and columns j, not whole in general, by linear interpolation along each axis."""
    for axis, at in enumerate((i, j)):
        floor = np.clip(np.floor(at).astype(int), 0, pattern.shape[axis] - 2)
        share = np.clip(at - floor, 0, 1).reshape([-1 if a == axis else 1 for a in range(3)])
        pattern = pattern.take(floor, axis) * (1 - share) + pattern.take(floor + 1, axis) * share
    return pattern
