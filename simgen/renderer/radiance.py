"""Dense radiance of one view: every pixel, by path tracing."""

from typing import Any

import numpy as np

from simgen.cameras.rig import Cameras, as_rig
from simgen.renderer.mitsuba_camera import sensor_plugin
from simgen.renderer.mitsuba_colours import spectrum_plugin
from simgen.renderer.mitsuba_scene import RenderScene
from simgen.spectral.filters import Filters

SEED_STEP = 0x9E3779B9
"""Between seeds of parts of one view: 2^32 over the golden ratio, whose multiples stay far apart (modulo
2^32), so that no part has the seed of another view's."""


def render_view(
    render_scene: RenderScene,
    cameras: Cameras,
    k: int,
    l: int,
    *,
    samples_per_pixel: int,
    seed: int,
) -> np.ndarray:
    """Linear radiance (H, W, C), float32, of camera (k, l): sRGB whose luminance is in cd/m^2.

    In spectral mode: what pixels of each of the camera's colours see, in the unit of `filters`.

    The mean of `samples_per_pixel` paths through each pixel's square; the same bytes for the same
    seed on the same backend. Views need different seeds: with one seed their noise is the same.
    """
    mi = render_scene.mi
    sampler = {"type": "independent"}
    camera = as_rig(cameras).camera(k, l)
    plugin = sensor_plugin(mi, camera, sampler)
    if render_scene.filters is not None:
        plugin["film"] = _film(plugin["film"], render_scene.filters)
    sensor = mi.load_dict(plugin)
    channels = 3 if render_scene.filters is None else len(render_scene.filters.sensitivity)
    total = np.zeros((camera.grid.height, camera.grid.width, channels))
    # By powers of two: other numbers of samples the renderer adds in an order that is left to chance.
    parts = [1 << bit for bit in range(samples_per_pixel.bit_length()) if samples_per_pixel >> bit & 1]
    for number, samples in enumerate(reversed(parts)):
        own_seed = (seed + number * SEED_STEP) % 2**32
        total += samples * np.array(mi.render(render_scene.scene, sensor=sensor, spp=samples, seed=own_seed))
    return (total / samples_per_pixel).astype(np.float32)


def _film(film: dict[str, Any], filters: Filters) -> dict[str, Any]:
    """The same film with a channel for each colour's sensitivity, instead of R, G, B."""
    same = {name: value for name, value in film.items() if name not in ("type", "pixel_format")}
    bands = {f"band{number}": spectrum_plugin(curve) for number, curve in enumerate(filters.sensitivity)}
    return {"type": "specfilm", **same, **bands}
