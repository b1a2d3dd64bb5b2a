"""Dense radiance of one view: every pixel, by path tracing."""

import numpy as np

from pcii.types import CameraGrid
from simgen.build import Built
from simgen.cameras import camera_x_mm, camera_y_mm, sensor_plugin


def render_view(
    built: Built,
    grid: CameraGrid,
    k: int,
    l: int,
    *,
    samples_per_pixel: int,
    seed: int,
) -> np.ndarray:
    """Linear radiance (H, W, 3), float32, of camera (k, l); luminance in cd/m^2.

    The mean of `samples_per_pixel` paths through each pixel's square; the same bytes for the same
    seed on the same backend. Views need different seeds: with one seed their noise is the same.
    """
    mi = built.mi
    sampler = {"type": "independent", "sample_count": samples_per_pixel}
    x_mm, y_mm = camera_x_mm(grid)[l], camera_y_mm(grid)[k]
    sensor = mi.load_dict(sensor_plugin(mi, grid, float(x_mm), float(y_mm), sampler))
    image = mi.render(built.scene, sensor=sensor, spp=samples_per_pixel, seed=seed)
    return np.array(image, dtype=np.float32)
