"""The depths that a dataset's recipe suggests to look at."""

from collections.abc import Sequence

from pcii.base.errors import InputError
from pcii.core.focal_planes import FocalPlanes
from pcii.io.dataset import Dataset


def planes_of(dataset: Dataset, z_mm: Sequence[float] | None) -> FocalPlanes:
    """The planes to reconstruct: those asked for, else those that the recipe names."""
    asked = z_mm or dataset.analysis.get("z_mm") or ()
    if not len(asked):
        raise InputError(f"{dataset.path}: its recipe names no depths; give them with --z-mm")
    return FocalPlanes.at_depths(dataset.grid, asked)


def depth_range_of(dataset: Dataset, z_mm: Sequence[float] | None = None) -> tuple[float, float]:
    """Nearest and farthest depth to consider: the recipe's, else 4/5 to 5/4 of the planes' depths."""
    named = dataset.analysis.get("z_range_mm")
    if named:
        return float(named[0]), float(named[1])
    z = planes_of(dataset, z_mm).z_mm
    return 0.8 * float(z.min()), 1.25 * float(z.max())
