"""First hits of pixels: depth, object, normal, coverage of the pixel, cameras that see them.

Planar depth, object ids and normals are those of the ray through the pixel's centre, nothing filtered.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pcii.base import Report, silent
from pcii.types import CameraGrid
from simgen.cameras import Camera, Cameras, Rig, as_rig, centre_camera
from simgen.renderer import RenderScene, sensor_plugin

BESIDE_EDGE_PX = 0.01
"""Rays so far from a pixel's centre pass beside an edge between triangles that the centre meets exactly: much
farther than float32 rounds, and less than anything that is worth a pixel."""
LEAST_STEP = 1e-3
"""Share of the depth by which a pixel is behind its neighbours before it is looked at again."""
IN_FOCUS_PX = 1.0
"""A point is in focus where its blur half-extent is at most this."""
COVERAGE_SAMPLES = 233
"""Rays through a pixel, on a Fibonacci lattice. An edge along one of its lines is worst: half of the some
15 points of a line may be on the wrong side, 3 % of the pixel; most edges are known to 1 %."""
LATTICE_GENERATOR = 144
PIXELS_AT_ONCE = 1 << 13
OFF_SURFACE = 1e-5
"""Rays start so far off their surface, in units of 1 mm + the point's largest coordinate (float32 rays)."""
BOX_MARGIN = 1e-6
"""Boxes around shapes are grown by this share of their coordinates, more than rounding may be off."""


@dataclass(frozen=True)
class FirstHits:
    """`z_mm` (H, W) float32, +inf where nothing is hit; `object_id` (H, W) int16, 0 for backdrop.

    `normal` (H, W, 3) float32: unit normal of the surface itself (not of its smoothed shading, so that it
    is the slope of `z_mm`) in world axes, on the side that the camera sees; 0 where nothing is hit.
    """

    z_mm: np.ndarray
    object_id: np.ndarray
    normal: np.ndarray


def first_hits_at_centre(render_scene: RenderScene, grid: CameraGrid) -> FirstHits:
    """First hits of the virtual centre camera, at X = Y = 0 between the cameras of an even grid."""
    return _first_hits(render_scene, centre_camera(grid))


def first_hits_of_view(render_scene: RenderScene, cameras: Cameras, k: int, l: int) -> FirstHits:
    """First hits of camera (k, l) where it really is; with a lens, those of the rays through its centre."""
    return _first_hits(render_scene, as_rig(cameras).pinhole(k, l))


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


def _first_hits(render_scene: RenderScene, camera: Camera) -> FirstHits:
    # Mitsuba's own depth output is ray length from the near clip plane, averaged at edges. Here one
    # ray goes through each pixel's centre (stratified without jitter) and gives the hit's position.
    mi = render_scene.mi
    centre_ray = {"type": "stratified", "sample_count": 1, "jitter": False}
    sensor = mi.load_dict(sensor_plugin(mi, camera, centre_ray, render_scene.frame))
    aovs = "hit:position,normal:geo_normal,shape:shape_index"
    integrator = mi.load_dict({"type": "aov", "aovs": aovs})
    passes = np.array(mi.render(render_scene.scene, sensor=sensor, integrator=integrator, spp=1, seed=0))
    point, normal, shape = passes[..., -7:-4], passes[..., -4:-1], passes[..., -1].astype(np.int64)
    point, normal = render_scene.frame.points_mm(point), render_scene.frame.world_directions(normal)
    hit = np.logical_or.reduce([normal[..., axis] != 0 for axis in range(3)])
    along = sum((point[..., axis] - camera.position_mm[axis]) * normal[..., axis] for axis in range(3))
    facing = normal * np.where(hit, -np.sign(along), 0)[..., None]
    z_mm = np.where(hit, point[..., 2], np.inf)
    if render_scene.has_instances:  # the renderer's output has the shape within the instance
        towards = camera.towards(*np.indices(hit.shape).reshape(2, -1))
        object_id = render_scene.first_objects(camera.position_mm, towards).reshape(hit.shape)
    else:
        object_id = render_scene.object_of_shape[shape]
    hits = FirstHits(z_mm.astype(np.float32), object_id.astype(np.int16), facing.astype(np.float32))
    _mend_edges(render_scene, camera, hits)
    return hits


def _mend_edges(render_scene: RenderScene, camera: Camera, hits: FirstHits) -> None:
    """Put right what rays see that pass between two triangles by rounding, since they meet an edge exactly.

    Such a pixel is behind at least two of its four neighbours. If rays on at least three of four
    sides, close to its centre, hit something nearer, the centre's ray is taken to hit what is there.
    """
    z = np.pad(hits.z_mm, 1, constant_values=np.inf)
    nearer = hits.z_mm * np.float32(1 - LEAST_STEP)
    neighbours = z[1:-1, :-2], z[1:-1, 2:], z[:-2, 1:-1], z[2:, 1:-1]
    row, col = np.nonzero(np.sum([each < nearer for each in neighbours], axis=0, dtype=np.uint8) >= 2)
    if not row.size:
        return
    down, right = BESIDE_EDGE_PX * np.array([[-1, -1, 1, 1], [-1, 1, -1, 1]])
    rays = camera.towards(row[:, None] + down, col[:, None] + right)  # (N, 4, 3)
    points, normals, ids = render_scene.first_points(camera.position_mm, rays.reshape(-1, 3))
    depth = points[:, 2].reshape(-1, 4)
    number = np.argsort(depth, axis=1)[:, 1]  # the second nearest
    is_nearer = depth < nearer[row, col, None]
    some = np.flatnonzero(is_nearer.sum(axis=1) >= 3)
    row, col, second_nearest = row[some], col[some], 4 * some + number[some]
    point, normal = points[second_nearest], normals[second_nearest]
    away = point - camera.position_mm
    normal *= -np.sign((normal * away).sum(axis=1))[:, None]
    ray = camera.towards(row, col)  # on to the plane of the surface that is hit close by
    share = (normal * away).sum(axis=1) / (normal * ray).sum(axis=1)
    hits.z_mm[row, col] = camera.position_mm[2] + share * ray[:, 2]
    hits.object_id[row, col], hits.normal[row, col] = ids[second_nearest], normal


def coverage(render_scene: RenderScene, camera: Camera, object_id: np.ndarray) -> np.ndarray:
    """Share (H, W) float32 of each pixel's square in which rays hit the object that its centre hits first.

    `object_id` (H, W) is that of the camera, without its lens; what is no object (id 0) counts as one. A
    pixel is sampled if it lies at the frame or one of its eight neighbours has another id, else its share is
    1: what is lost is only what passes between the centres of pixels.
    """
    from scipy.ndimage import maximum_filter, minimum_filter

    share, number = np.ones(object_id.shape, dtype=np.float32), np.arange(COVERAGE_SAMPLES)
    down = (number + 0.5) / COVERAGE_SAMPLES - 0.5
    right = (number * LATTICE_GENERATOR % COVERAGE_SAMPLES + 0.5) / COVERAGE_SAMPLES - 0.5
    # No object has the id -1: what stands beyond the frame is another for all we know.
    most, least = (pick(object_id, 3, mode="constant", cval=-1) for pick in (maximum_filter, minimum_filter))
    row, col = np.nonzero(most != least)
    for start in range(0, row.size, PIXELS_AT_ONCE):
        i, j = row[start : start + PIXELS_AT_ONCE], col[start : start + PIXELS_AT_ONCE]
        rays = camera.towards(i[:, None] + down, j[:, None] + right).reshape(-1, 3)
        hit_id = render_scene.first_objects(camera.position_mm, rays).reshape(i.size, COVERAGE_SAMPLES)
        share[i, j] = (hit_id == object_id[i, j, None]).mean(axis=1)
    return share


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
    for low, high in shape_boxes_mm(render_scene):
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


def shape_boxes_mm(render_scene: RenderScene) -> np.ndarray:
    """Bounding boxes (N, 2, 3) of the renderer's shapes in the world: least and largest X, Y, Z."""
    corners_mm = render_scene.corners_mm
    return np.stack([corners_mm.min(axis=1), corners_mm.max(axis=1)], axis=1)
