"""How many cameras see each point that the virtual centre sees."""

import numpy as np

from pcii.base.progress import Report, silent
from simgen.cameras.rig import Cameras, Rig, as_rig, centre_camera
from simgen.renderer.intersection import blocked
from simgen.renderer.mitsuba_scene import RenderScene
from simgen.truth.first_hits import FirstHits

OFF_SURFACE = 1e-5
"""Rays start so far off their surface, in units of 1 mm + the point's largest coordinate (float32 rays)."""
ROUNDING = 1e-6
"""Boxes around shapes are grown by this share of their coordinates."""


def visible_views(
    render_scene: RenderScene, cameras: Cameras, hits: FirstHits, report: Report = silent
) -> tuple[np.ndarray, int]:
    """Number (H, W) uint16 of cameras that see each first hit of the virtual centre, and rays traced.

    A camera sees a point that faces it, that falls on its film, and from which nothing stands in the way;
    0 for a miss. Rays start 0.006 mm (at 600 mm) off the surface, more than float32 rounds: what stands
    nearer is no obstacle, and where two surfaces meet, a point that near to the other is lost.

    Skipped exactly: if no shape's box reaches into the pyramid between a point and the rectangle of all
    cameras, nothing stands in any camera's way, and no ray is traced.
    """
    H, W = hits.z_mm.shape
    rig = as_rig(cameras)
    grid = rig.grid
    row, col = np.nonzero(np.isfinite(hits.z_mm))
    normal = hits.normal[row, col].astype(np.float64)
    point = centre_camera(grid).towards(row, col) * hits.z_mm[row, col, None].astype(np.float64)
    start = point + normal * (OFF_SURFACE * (1 + np.abs(point).max(axis=1, initial=0)))[:, None]
    doubtful = _can_be_blocked(render_scene, rig, start)
    facing = (normal * point).sum(axis=1)
    count, traced = np.zeros(row.size, dtype=np.uint16), 0
    for done, (k, l) in enumerate(np.ndindex(grid.rows, grid.cols), start=1):
        camera = rig.pinhole(k, l)
        # It faces a point if normal . (camera - point) > 0.
        seen = camera.on_film(point) & (normal @ camera.position_mm > facing)
        tested = np.flatnonzero(seen & doubtful)
        if tested.size:
            seen[tested] = ~blocked(render_scene, start[tested], camera.position_mm)
        count += seen
        traced += tested.size
        report("visibility", done, grid.view_count)
    result = np.zeros((H, W), dtype=np.uint16)
    result[row, col] = count
    return result, traced


def _can_be_blocked(render_scene: RenderScene, rig: Rig, start: np.ndarray) -> np.ndarray:
    """Whether a shape's box may reach between points (N, 3) and any camera; never False by mistake.

    At depth s the pyramid from a point at depth z to the cameras is a rectangle, whose sides move linearly
    with s: over the depths of a box each is farthest out at one of the two ends.
    """
    x_mm, y_mm, z_mm = np.moveaxis(rig.position_mm, -1, 0)
    if z_mm.any():  # cameras that are not in one plane make no such pyramid
        return np.ones(len(start), dtype=bool)
    doubtful = np.zeros(len(start), dtype=bool)
    z = start[:, 2]
    reach = [(x_mm.min(), x_mm.max()), (y_mm.min(), y_mm.max())]
    for shape in render_scene.scene.shapes():
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
