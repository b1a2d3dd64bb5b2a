"""How many cameras see each point that the virtual centre sees."""

import numpy as np

from pcii.console import Report, silent
from pcii.types import CameraGrid
from simgen.build import Built
from simgen.cameras import camera_x_mm, camera_y_mm
from simgen.rays import blocked
from simgen.truth import FirstHits, towards_film

OFF_SURFACE = 1e-5
"""Rays start so far off their surface, in units of 1 mm + the point's largest coordinate (float32 rays)."""
ROUNDING = 1e-6
"""Boxes around shapes are grown by this share of their coordinates."""


def visible_views(
    built: Built, grid: CameraGrid, hits: FirstHits, report: Report = silent
) -> tuple[np.ndarray, int]:
    """Number (H, W) uint16 of cameras that see each first hit of the virtual centre, and rays traced.

    A camera sees a point that faces it, that falls on its film, and from which nothing stands in the way;
    0 for a miss. Rays start 0.006 mm (at 600 mm) off the surface, more than float32 rounds: what stands
    nearer is no obstacle, and where two surfaces meet, a point that near to the other is lost.

    Skipped exactly: if no shape's box reaches into the pyramid between a point and the rectangle of all
    cameras, nothing stands in any camera's way, and no ray is traced.
    """
    H, W = hits.z_mm.shape
    row, col = np.nonzero(np.isfinite(hits.z_mm))
    normal = hits.normal[row, col].astype(np.float64)
    point = towards_film(grid, row, col) * hits.z_mm[row, col, None].astype(np.float64)
    start = point + normal * (OFF_SURFACE * (1 + np.abs(point).max(axis=1, initial=0)))[:, None]
    doubtful = _can_be_blocked(built, grid, start)
    # A camera faces a point if normal . (camera - point) > 0; with its Z = 0 that is linear in X and Y.
    own, across, down = (normal * point).sum(axis=1), normal[:, 0].copy(), normal[:, 1].copy()
    in_rows = [_on_film(grid.height, grid, point[:, 1] - y, point[:, 2]) for y in camera_y_mm(grid)]
    in_cols = [_on_film(grid.width, grid, point[:, 0] - x, point[:, 2]) for x in camera_x_mm(grid)]
    count, traced = np.zeros(row.size, dtype=np.uint16), 0
    for done, (k, l) in enumerate(np.ndindex(grid.rows, grid.cols), start=1):
        x_mm, y_mm = camera_x_mm(grid)[l], camera_y_mm(grid)[k]
        seen = in_rows[k] & in_cols[l] & (across * x_mm + down * y_mm > own)
        asked = np.flatnonzero(seen & doubtful)
        if asked.size:
            seen[asked] = ~blocked(built, start[asked], np.array([x_mm, y_mm, 0.0]))
        count += seen
        traced += asked.size
        report("visibility", done, grid.view_count)
    result = np.zeros((H, W), dtype=np.uint16)
    result[row, col] = count
    return result, traced


def _on_film(size_px: int, grid: CameraGrid, offset_mm: np.ndarray, z_mm: np.ndarray) -> np.ndarray:
    """Whether points so far from a camera's axis fall on its film, in one of the film's two directions."""
    return np.abs(offset_mm) * grid.focal_mm < z_mm * (size_px * grid.pixel_mm / 2)


def _can_be_blocked(built: Built, grid: CameraGrid, start: np.ndarray) -> np.ndarray:
    """Whether a shape's box may reach between points (N, 3) and any camera; never False by mistake.

    At depth s the pyramid from a point at depth z to the cameras is a rectangle, whose sides move linearly
    with s: over the depths of a box each is farthest out at one of the two ends.
    """
    doubtful = np.zeros(len(start), dtype=bool)
    z = start[:, 2]
    reach = [(camera_x_mm(grid)[0], camera_x_mm(grid)[-1]), (camera_y_mm(grid)[0], camera_y_mm(grid)[-1])]
    for shape in built.scene.shapes():
        box = shape.bbox()
        low, high = np.array(box.min, dtype=np.float64), np.array(box.max, dtype=np.float64)
        margin = ROUNDING * np.maximum(np.abs(low), np.abs(high))
        low, high = low - margin, high + margin
        touches = (low[2] <= z) & (high[2] >= 0)
        ends = [np.clip(side[2], 0, z) / z for side in (low, high)]
        for axis, (first, last) in enumerate(reach):
            least = np.minimum(*(start[:, axis] * s + first * (1 - s) for s in ends))
            most = np.maximum(*(start[:, axis] * s + last * (1 - s) for s in ends))
            touches &= (least <= high[axis]) & (most >= low[axis])
        doubtful |= touches
    return doubtful
