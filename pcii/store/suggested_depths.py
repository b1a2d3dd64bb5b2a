"""Depths to reconstruct: those given, or those that the recipe of a dataset suggests."""

from collections.abc import Sequence

import numpy as np

from pcii.base import InputError
from pcii.store.dataset import Dataset
from pcii.types import CameraGrid, FocalPlanes, disparity_px


def has_depths(dataset: Dataset, z_mm: Sequence[float] | None = None) -> bool:
    """Whether depths are given, or suggested by the recipe."""
    return bool(z_mm or dataset.analysis.get("z_mm"))


def planes_of(dataset: Dataset, z_mm: Sequence[float] | None = None) -> FocalPlanes:
    """Focal planes at the depths `z_mm`, else at those that the recipe suggests.

    Raises `InputError` if there are none, or if no views overlap at one.
    """
    if not has_depths(dataset, z_mm):
        advice = "name depths with --z-mm, or a range with --z-range-mm"
        raise InputError(f"{dataset.path}: suggests no depths; {advice}")
    planes = FocalPlanes.at_depths(dataset.grid, z_mm or dataset.analysis["z_mm"])
    _check_overlap(dataset.grid, planes.z_mm, "z_mm")
    return planes


def depth_range_of(dataset: Dataset, z_mm: Sequence[float] | None = None) -> tuple[float, float]:
    """Nearest and farthest depth in mm to search: the recipe's, else 4/5 to 5/4 of those of `planes_of`."""
    suggested = dataset.analysis.get("z_range_mm")
    if not suggested:
        z = planes_of(dataset, z_mm).z_mm
        return 0.8 * float(z.min()), 1.25 * float(z.max())
    near, far = map(float, suggested)
    _check_overlap(dataset.grid, np.array([far]), "z_range_mm")
    return near, far


def _check_overlap(grid: CameraGrid, depths_mm: np.ndarray, name: str) -> None:
    """Raise `InputError` if no neighbouring views overlap at one of the depths: nothing is in focus there."""
    across, down = (np.abs(px) for px in disparity_px(grid, depths_mm))
    overlap = ((across < grid.width) & (grid.cols > 1)) | ((down < grid.height) & (grid.rows > 1))
    if grid.view_count > 1 and not overlap.all():
        z = depths_mm[~overlap][0]
        raise InputError(f"{name}: {z:g} mm is so near that no views overlap; depths are in mm")
