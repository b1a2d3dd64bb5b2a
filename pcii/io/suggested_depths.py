"""Depths to reconstruct: those given, or those that the recipe of a dataset suggests."""

from collections.abc import Sequence

from pcii.base.errors import InputError
from pcii.core.focal_planes import FocalPlanes
from pcii.io.dataset import Dataset


def planes_of(dataset: Dataset, z_mm: Sequence[float] | None) -> FocalPlanes:
    """Focal planes at `z_mm`, else at the depths of the recipe; raises `InputError` if there are none."""
    depths = z_mm or dataset.analysis.get("z_mm") or ()
    if not len(depths):
        raise InputError(f"{dataset.path}: its recipe names no depths; give them with --z-mm")
    return FocalPlanes.at_depths(dataset.grid, depths)


def depth_range_of(dataset: Dataset, z_mm: Sequence[float] | None = None) -> tuple[float, float]:
    """Nearest and farthest depth in mm to search: the recipe's, else 4/5 to 5/4 of the planes' depths."""
    suggested = dataset.analysis.get("z_range_mm")
    if suggested:
        return float(suggested[0]), float(suggested[1])
    z = planes_of(dataset, z_mm).z_mm
    return 0.8 * float(z.min()), 1.25 * float(z.max())
