"""Parts of the film: what of every view a part of the sections is made of."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pcii.core.focal_planes import FocalPlanes
from pcii.core.images import ArrayLike5D, Views


@dataclass(frozen=True)
class _Part:
    """Rows and columns of every view of some radiance, one view at a time."""

    radiance: ArrayLike5D
    rows: slice
    cols: slice

    @property
    def shape(self) -> tuple[int, ...]:
        K, L, *_, C = self.radiance.shape
        return K, L, self.rows.stop - self.rows.start, self.cols.stop - self.cols.start, C

    @property
    def dtype(self) -> np.dtype | None:
        return getattr(self.radiance, "dtype", None)

    def __getitem__(self, index: Any, /) -> np.ndarray:
        return np.asarray(self.radiance[index])[self.rows, self.cols]


def views_around(
    views: Views, planes: FocalPlanes, rows: slice, cols: slice
) -> tuple[Views, FocalPlanes, tuple[slice, slice]]:
    """Views of a smaller film, whose sections at these planes have the voxels `rows` and `cols` of all.

    Also the planes for these views, and where the rows and columns are in their sections: all samples of
    those voxels are there, and near the ends of the part some of the others are not.
    """
    reach_px = (int(np.abs(shifts_px).max()) for shifts_px in planes.whole_shifts_px)
    part_rows, part_cols = map(_with_margin, (rows, cols), reach_px, views.grid.shape_HW)
    radiance = _Part(views.radiance, part_rows, part_cols)
    grid = replace(views.grid, height=radiance.shape[2], width=radiance.shape[3])
    inside = (
        slice(rows.start - part_rows.start, rows.stop - part_rows.start),
        slice(cols.start - part_cols.start, cols.stop - part_cols.start),
    )
    return replace(views, radiance=radiance, grid=grid), replace(planes, grid=grid), inside


def _with_margin(side: slice, reach_px: int, size: int) -> slice:
    # From an even pixel on, so that a mosaic keeps its pattern.
    return slice(max(side.start - reach_px, 0) // 2 * 2, min(side.stop + reach_px, size))
