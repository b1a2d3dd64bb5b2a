"""A dataset of two textured planes, one above the other, rendered with NumPy from the pinhole's equation."""

from pathlib import Path
from typing import Any

import numpy as np

from pcii.store import save_dataset
from pcii.types import CameraGrid, Truth, Views, mosaic

ABOVE_MM, BELOW_MM = 500.0, 800.0


def plane_z_mm(grid: CameraGrid, k: float, l: float) -> np.ndarray:
    """Depth (H, W) that camera (k, l) sees: the near plane is at Y < 0, above."""
    return np.where(_position_mm(grid, k, l, ABOVE_MM)[1] < 0, ABOVE_MM, BELOW_MM)


def _position_mm(grid: CameraGrid, k: float, l: float, z_mm: Any) -> tuple[np.ndarray, np.ndarray]:
    """Where in the world (X, Y) the camera's pixels see a plane at z."""
    i, j = np.mgrid[: grid.height, : grid.width]
    right, down = l - (grid.cols - 1) / 2, k - (grid.rows - 1) / 2
    per_px = z_mm * grid.pixel_mm / grid.focal_mm
    x = right * grid.pitch_mm[0] + per_px * (j - (grid.width - 1) / 2 - right * grid.shear_px[0])
    y = down * grid.pitch_mm[1] + per_px * (i - (grid.height - 1) / 2 - down * grid.shear_px[1])
    return x, y


def view(grid: CameraGrid, k: int, l: int) -> np.ndarray:
    """Radiance (H, W, 3) of camera (k, l): waves 9 px and longer on the middle plane, in colours."""
    x, y = _position_mm(grid, k, l, plane_z_mm(grid, k, l))
    px_mm = 650 * grid.pixel_mm / grid.focal_mm
    rng = np.random.default_rng(5)
    image = np.ones((grid.height, grid.width, 3))
    for _ in range(12):
        angle, wavelength, phase = rng.uniform(0, np.pi), rng.uniform(9, 30), rng.uniform(0, 2 * np.pi, 3)
        along = (x * np.cos(angle) + y * np.sin(angle)) / (wavelength * px_mm)
        image += 0.08 * np.sin(2 * np.pi * along[..., None] + phase)
    return image


def srgb(radiance: np.ndarray) -> np.ndarray:
    """Radiance, of which 1 is white, as sRGB (IEC 61966-2-1)."""
    share = np.clip(radiance, 0, 1)
    return np.where(share <= 0.0031308, 12.92 * share, 1.055 * share ** (1 / 2.4) - 0.055)


def write_planes(root: Path, grid: CameraGrid, cfa: str | None = None, *, view_truth: bool = False) -> Path:
    """A dataset of radiance, a mosaic if there is a pattern, and truth, with `view_truth` of every view."""
    images = np.array([[view(grid, k, l) for l in range(grid.cols)] for k in range(grid.rows)])
    views = Views(images if cfa is None else mosaic(images, cfa)[..., None], grid, cfa)
    z_mm = plane_z_mm(grid, (grid.rows - 1) / 2, (grid.cols - 1) / 2)
    truth = Truth(z_mm, np.where(z_mm == ABOVE_MM, 1, 2), {1: "above", 2: "below"})
    every = [[plane_z_mm(grid, k, l) for l in range(grid.cols)] for k in range(grid.rows)]
    return save_dataset(root, views, truth, view_z_mm=np.array(every) if view_truth else None).path
