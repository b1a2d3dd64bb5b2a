"""Cameras as Mitsuba's: its sensors, and rays through points of their films."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from simgen.cameras.rig import Camera, Rig, film_slopes, slopes_behind_lens
from simgen.renderer.backend import floats, load_drjit
from simgen.renderer.mitsuba_scene import RenderScene
from simgen.renderer.mitsuba_shapes import WorldFrame

# The pinhole is the origin of every ray, so nothing nearer than this is ever cut away in practice.
NEAR_CLIP_MM = 0.01
FAR_CLIP_MM = 1e7


def sensor_plugin(mi: Any, camera: Camera, sampler: dict[str, Any], frame: WorldFrame) -> dict[str, Any]:
    """A camera as Mitsuba's sensor, whose own axes point left, up and forward."""
    grid, pose = camera.grid, np.eye(4)
    pose[:3, :3], pose[:3, 3] = camera.rotation * (-1.0, -1.0, 1.0), camera.position_mm
    plugin = {
        "type": "perspective",
        "fov": 2 * math.degrees(math.atan(grid.width * grid.pixel_mm / (2 * grid.focal_mm))),
        "fov_axis": "x",
        "near_clip": NEAR_CLIP_MM * frame.unit,
        "far_clip": FAR_CLIP_MM * frame.unit,
        "to_world": mi.ScalarTransform4f(frame.rigid_pose(pose) + 0.0),  # adding 0 turns -0 into 0
        "film": {
            "type": "hdrfilm",
            "width": grid.width,
            "height": grid.height,
            "pixel_format": "rgb",
            "component_format": "float32",  # the default, float16, turns 1e6 into infinity
            "rfilter": {"type": "box"},  # the only filter whose sums repeat bit for bit
        },
        "sampler": sampler,
    }
    if camera.lens is not None:
        return plugin | {
            "type": "thinlens",
            "aperture_radius": camera.lens.aperture_mm / 2 * frame.unit,
            "focus_distance": camera.lens.focus_mm * frame.unit,
        }
    # In shares of the film, and positive where the axis is left of (above) the film's centre.
    return plugin | {
        "principal_point_offset_x": -camera.shift_px[0] / grid.width,
        "principal_point_offset_y": -camera.shift_px[1] / grid.height,
    }


def film_rays(
    render_scene: RenderScene, rig: Rig, k: Any, l: Any, row_px: Any, col_px: Any, lens_point: Any = None
) -> Any:
    """Rays through points of the film, and of the lens (in mm) if there is one; see `Rig.rays`.

    All are the renderer's arrays, an element for each ray.
    """
    mi, dr, frame = render_scene.mi, load_drjit(), render_scene.frame
    camera = k * rig.grid.cols + l
    rotation, position = frame.rotation @ rig.rotation, frame.points(rig.position_mm)

    def of_camera(values: np.ndarray) -> Any:
        if (values == values.flat[0]).all():
            return float(values.flat[0])  # what all cameras share needs no look-up
        return dr.gather(mi.Float, floats(mi, values), camera)

    def rotate(*vector: Any, factor: float = 1.0) -> list[Any]:
        rows = factor * np.moveaxis(rotation, (-2, -1), (0, 1))
        return [_dot([of_camera(row[col]) for col in range(len(vector))], vector) for row in rows]

    axis_px = of_camera(rig.axis_px[..., 0]), of_camera(rig.axis_px[..., 1])
    x, y = film_slopes(rig.grid, row_px, col_px, axis_px)
    origin = mi.Point3f(*(of_camera(position[..., axis]) for axis in range(3)))
    if rig.lens is not None:
        x, y = slopes_behind_lens((x, y), rig.lens, (lens_point.x, lens_point.y))
        origin += mi.Vector3f(*rotate(lens_point.x, lens_point.y, factor=frame.unit))
    direction = dr.normalize(mi.Vector3f(*rotate(x, y, mi.Float(1))))
    return mi.RayDifferential3f(mi.Ray3f(origin, direction))


def _dot(row: Sequence[Any], vector: Sequence[Any]) -> Any:
    """Sum of products, without those of a plain 0, nor a factor that is a plain 1."""
    terms = [
        part if isinstance(factor, float) and factor == 1 else factor * part
        for factor, part in zip(row, vector, strict=True)
        if not (isinstance(factor, float) and factor == 0)
    ]
    return sum(terms[1:], terms[0]) if terms else 0
