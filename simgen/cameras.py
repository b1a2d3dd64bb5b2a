"""Where the cameras stand and which way pixels look, from first principles.

This is written without `pcii.geometry` on purpose: simulation and reconstruction must not be able to
share a sign mistake. A test renders a dot and finds it where `pcii.geometry` says.
"""

import math
from typing import Any

import numpy as np

from pcii.types import CameraGrid

# The pinhole is the origin of every ray, so nothing nearer than this is ever cut away in practice.
NEAR_CLIP_MM = 0.01
FAR_CLIP_MM = 1e7


def camera_x_mm(grid: CameraGrid) -> np.ndarray:
    """X of each camera column (L,): evenly spaced, symmetric about 0, growing to the right."""
    span = grid.pitch_mm[0] * (grid.cols - 1)
    return np.linspace(-span / 2, span / 2, grid.cols)


def camera_y_mm(grid: CameraGrid) -> np.ndarray:
    """Y of each camera row (K,): evenly spaced, symmetric about 0, growing downwards."""
    span = grid.pitch_mm[1] * (grid.rows - 1)
    return np.linspace(-span / 2, span / 2, grid.rows)


def sensor_plugin(
    mi: Any, grid: CameraGrid, x_mm: float, y_mm: float, sampler: dict[str, Any]
) -> dict[str, Any]:
    """A pinhole camera at (x, y, 0) that looks along +Z, X to the right and Y down in its image."""
    to_world = mi.ScalarTransform4f().look_at(
        origin=[x_mm, y_mm, 0.0], target=[x_mm, y_mm, 1.0], up=[0.0, -1.0, 0.0]
    )
    return {
        "type": "perspective",
        "fov": 2 * math.degrees(math.atan(grid.width * grid.pixel_mm / (2 * grid.focal_mm))),
        "fov_axis": "x",
        "near_clip": NEAR_CLIP_MM,
        "far_clip": FAR_CLIP_MM,
        "to_world": to_world,
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
