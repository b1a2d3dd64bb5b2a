"""Truth: what each pixel's centre hits first. Planar depth, object ids and normals, nothing filtered."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pcii.core.camera_grid import CameraGrid
from simgen.cameras.rig import Camera, Cameras, as_rig, centre_camera
from simgen.renderer.intersection import first_objects
from simgen.renderer.mitsuba_camera import sensor_plugin
from simgen.renderer.mitsuba_scene import RenderScene

IN_FOCUS_PX = 1.0
"""A point is in focus where its blur half-extent is at most this."""


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
    hit = (normal != 0).any(axis=-1)
    along = ((point - camera.position_mm) * normal).sum(axis=-1)
    facing = normal * np.where(hit, -np.sign(along), 0)[..., None]
    z_mm = np.where(hit, point[..., 2], np.inf)
    if render_scene.has_instances:  # the renderer's output has the shape within the instance
        towards = camera.towards(*np.indices(hit.shape).reshape(2, -1))
        object_id = first_objects(render_scene, camera.position_mm, towards).reshape(hit.shape)
    else:
        object_id = render_scene.object_of_shape[shape]
    return FirstHits(z_mm.astype(np.float32), object_id, facing.astype(np.float32))
