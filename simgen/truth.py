"""Truth: what each pixel's centre hits first. Planar depth in mm and object ids, nothing filtered."""

from dataclasses import dataclass

import numpy as np

from pcii.types import CameraGrid
from simgen.build import Built
from simgen.cameras import camera_x_mm, camera_y_mm, sensor_plugin


@dataclass(frozen=True)
class FirstHits:
    """`z_mm` (H, W) float32, +inf where nothing is hit; `object_id` (H, W) int16, 0 for backdrop."""

    z_mm: np.ndarray
    object_id: np.ndarray


def first_hits_at_centre(built: Built, grid: CameraGrid) -> FirstHits:
    """First hits of the virtual centre camera, at X = Y = 0 between the cameras of an even grid."""
    return _first_hits(built, grid, 0.0, 0.0)


def first_hits_of_view(built: Built, grid: CameraGrid, k: int, l: int) -> FirstHits:
    """First hits of camera (k, l)."""
    return _first_hits(built, grid, float(camera_x_mm(grid)[l]), float(camera_y_mm(grid)[k]))


def _first_hits(built: Built, grid: CameraGrid, x_mm: float, y_mm: float) -> FirstHits:
    # Mitsuba's own depth output is ray length from the near clip plane, averaged at edges. Here one
    # ray goes through each pixel's centre (stratified without jitter) and gives the hit's position.
    mi = built.mi
    centre_ray = {"type": "stratified", "sample_count": 1, "jitter": False}
    sensor = mi.load_dict(sensor_plugin(mi, grid, x_mm, y_mm, centre_ray))
    integrator = mi.load_dict({"type": "aov", "aovs": "hit:position,shape:shape_index"})
    passes = np.array(mi.render(built.scene, sensor=sensor, integrator=integrator, spp=1, seed=0))
    z, shape = passes[..., -2], passes[..., -1].astype(np.int64)  # shape 0 is a miss
    return FirstHits(np.where(shape > 0, z, np.inf).astype(np.float32), built.object_of_shape[shape])
