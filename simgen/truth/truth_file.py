"""The truth of a dataset on disk: every pass at the virtual centre, and of every view on request.

Beside first hits: which pixels are in focus, and how many cameras see each point.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base import Report, silent
from pcii.store import TRUTH, TRUTH_LABELS, new_array, new_group_safely
from pcii.types import CameraGrid
from simgen.cameras import Cameras, Rig, as_rig, centre_camera
from simgen.renderer import RenderScene
from simgen.spec import Products, ViewPass
from simgen.truth.first_hits import FirstHits, coverage, first_hits_at_centre, first_hits_of_view

RAYS = "visibility_rays"
IN_FOCUS_PX = 1.0
"""A point is in focus where its blur half-extent is at most this."""
OFF_SURFACE = 1e-5
"""Rays start so far off their surface, in units of 1 mm + the point's largest coordinate (float32 rays)."""
BOX_MARGIN = 1e-6
"""Boxes around shapes are grown by this share of their coordinates, more than rounding may be off."""


def write_truth(
    products: Products,
    planes_mm: tuple[float, ...],
    with_poses: bool,
    render_scene: RenderScene,
    rig: Rig,
    out: Path,
    report: Report,
) -> None:
    """Write these products, what is in focus at these planes, and poses of cameras; one view at a time."""
    grid = rig.grid
    with new_group_safely(out / TRUTH, {}) as group:
        if products.truth:
            centre = first_hits_at_centre(render_scene, grid)
            is_full = products.profile == "full"
            for name in ("z_mm", "object_id", *(("normal",) if is_full else ())):
                _store(group, name, getattr(centre, name))
            if is_full:
                _store(group, "coverage", coverage(render_scene, centre_camera(grid), centre.object_id))
            if planes_mm:
                _store(group, "in_focus", in_focus(grid, centre.z_mm, planes_mm))
                group.attrs["in_focus_z_mm"] = list(planes_mm)
            if with_poses:
                _store(group, "camera_position_mm", rig.position_mm)
                _store(group, "camera_rotation", rig.rotation)
            if products.visibility:
                views, rays = visible_views(render_scene, rig, centre, report)
                _store(group, "visible_views", views)
                group.attrs[RAYS] = rays
        if products.view_truth:
            _write_views(group, render_scene, rig, products.view_truth, report)


def traced_for_visibility(out: Path) -> int | None:
    """How many rays were traced to count views, None if they were not counted."""
    import zarr

    if not (out / TRUTH).is_dir():
        return None
    rays = zarr.open_group(out / TRUTH, mode="r", zarr_format=3).attrs.get(RAYS)
    return None if rays is None else int(str(rays))


def in_focus(grid: CameraGrid, z_mm: np.ndarray, planes_mm: Sequence[float]) -> np.ndarray:
    """Which pixels are in focus at each plane, (Z, H, W) bool: their blur half-extent is at most 1 px.

    The outermost camera, at distance A from the centre of the grid along an axis, sees a point at depth z
    displaced by f A / z on its film, and a section at z0 takes f A / z0 back. What is left over is the
    half-extent; cameras are taken to stand where they ought to.
    """
    farthest_mm = np.abs(as_rig(grid).position_mm).max()
    seen_px = grid.focal_mm * farthest_mm / (np.asarray(z_mm, dtype=np.float64) * grid.pixel_mm)
    back_px = [grid.focal_mm * farthest_mm / (plane * grid.pixel_mm) for plane in planes_mm]
    masks = [np.abs(seen_px - shift_px) <= IN_FOCUS_PX for shift_px in back_px]
    return np.array(masks, dtype=bool).reshape(len(masks), *seen_px.shape)


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
    may_be_blocked = _can_be_blocked(render_scene, rig, start)
    facing = (normal * point).sum(axis=1)
    count, traced = np.zeros(row.size, dtype=np.uint16), 0
    for done, (k, l) in enumerate(np.ndindex(grid.rows, grid.cols), start=1):
        camera = rig.pinhole(k, l)
        # It faces a point if normal . (camera - point) > 0.
        is_visible = camera.on_film(point) & (normal @ camera.position_mm > facing)
        tested = np.flatnonzero(is_visible & may_be_blocked)
        if tested.size:
            is_visible[tested] = ~render_scene.blocked(start[tested], camera.position_mm)
        count += is_visible
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
    may_be_blocked, z = np.zeros(len(start), dtype=bool), start[:, 2]
    limits_mm = [(x_mm.min(), x_mm.max()), (y_mm.min(), y_mm.max())]
    for corners_mm in render_scene.corners_mm:
        low, high = corners_mm.min(axis=0), corners_mm.max(axis=0)
        margin = BOX_MARGIN * np.maximum(np.abs(low), np.abs(high))
        low, high = low - margin, high + margin
        reaches = (low[2] <= z) & (high[2] >= 0)
        ends = [np.clip(side[2], 0, z) / z for side in (low, high)]
        for axis, (first, last) in enumerate(limits_mm):
            least = np.minimum(*(start[:, axis] * s + first * (1 - s) for s in ends))
            most = np.maximum(*(start[:, axis] * s + last * (1 - s) for s in ends))
            reaches &= (least <= high[axis]) & (most >= low[axis])
        may_be_blocked |= reaches
    return may_be_blocked


def _write_views(
    group: Any, render_scene: RenderScene, rig: Rig, passes: tuple[ViewPass, ...], report: Report
) -> None:
    grid, arrays = rig.grid, dict[str, Any]()
    for done, (k, l) in enumerate(np.ndindex(grid.rows, grid.cols), start=1):
        hits = first_hits_of_view(render_scene, rig, k, l)
        for name in passes:
            if name == "coverage":
                image = coverage(render_scene, rig.pinhole(k, l), hits.object_id)
            else:
                image = getattr(hits, name)
            if name not in arrays:
                shape, label = (grid.rows, grid.cols, *image.shape), TRUTH_LABELS[f"view_{name}"]
                arrays[name] = new_array(group, f"view_{name}", shape, image.dtype, label)
            arrays[name][k, l] = image
        report("truth of views", done, grid.view_count)


def _store(group: Any, name: str, array: np.ndarray) -> None:
    new_array(group, name, array.shape, array.dtype, TRUTH_LABELS[name])[...] = array
