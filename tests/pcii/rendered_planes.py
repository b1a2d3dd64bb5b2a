"""A dataset of two textured planes, one above the other, rendered with NumPy from the pinhole's equation."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from pcii.store import (
    RADIANCE,
    TRUTH,
    list_files,
    radiance_name,
    write_arrays_safely,
    write_exr_safely,
    write_manifest,
)
from pcii.types import TRUTH_LABELS, CameraGrid, mosaic

ABOVE_MM, BELOW_MM = 500.0, 800.0


def plane_z_mm(grid: CameraGrid, k: float, l: float, below_mm: float = BELOW_MM) -> np.ndarray:
    """Depth (H, W) that camera (k, l) sees: the near plane is at Y < 0, above."""
    return np.where(_position_mm(grid, k, l, ABOVE_MM)[1] < 0, ABOVE_MM, below_mm)


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


def write_planes(
    root: Path,
    grid: CameraGrid,
    cfa: str | None = None,
    *,
    below_mm: float = BELOW_MM,
    view_truth: bool = False,
    **members: Any,
) -> Path:
    """A dataset of radiance, a mosaic if there is a pattern, and truth; `members` are of its manifest.

    With `below_mm` = infinity the truth says that there is no plane below.
    """
    root.mkdir()
    for k, l in np.ndindex(grid.rows, grid.cols):
        image = view(grid, k, l)
        stored = image if cfa is None else mosaic(image, cfa)[..., None]
        write_exr_safely(root / radiance_name(k, l), stored)
    z_mm = plane_z_mm(grid, (grid.rows - 1) / 2, (grid.cols - 1) / 2, below_mm)
    arrays = {"z_mm": z_mm, "object_id": np.where(z_mm == ABOVE_MM, 1, 2).astype(np.int16)}
    if view_truth:
        every = [[plane_z_mm(grid, k, l) for l in range(grid.cols)] for k in range(grid.rows)]
        arrays["view_z_mm"] = np.array(every)
    write_arrays_safely(root / TRUTH, arrays, TRUTH_LABELS)
    manifest = {
        "grid": asdict(grid),
        "cfa": cfa,
        "objects": {"1": "above", "2": "below"},
        "radiance_channels": 3 if cfa is None else 1,
        "files": list_files(root, [TRUTH, RADIANCE]),
    }
    write_manifest(root, manifest | members)
    return root
