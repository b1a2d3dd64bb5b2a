"""First hits of pixels: depth, object, normal, coverage of the pixel, cameras that see them.

Planar depth, object ids and normals are those of the ray through the pixel's centre, nothing filtered.
"""

from dataclasses import dataclass

import numpy as np

from pcii.types import CameraGrid
from simgen.cameras import Camera, Cameras, as_rig, centre_camera
from simgen.renderer import RenderScene, sensor_plugin

BESIDE_EDGE_PX = 0.01
"""Rays so far from a pixel's centre pass beside an edge between triangles that the centre meets exactly: much
farther than float32 rounds, and less than anything that is worth a pixel."""
LEAST_STEP = 1e-3
"""Share of the depth by which a pixel is behind its neighbours before it is looked at again."""
COVERAGE_SAMPLES = 233
"""Rays through a pixel, on a Fibonacci lattice. An edge along one of its lines is worst: half of the some
15 points of a line may be on the wrong side, 3 % of the pixel; most edges are known to 1 %."""
LATTICE_GENERATOR = 144
PIXELS_AT_ONCE = 1 << 13


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
