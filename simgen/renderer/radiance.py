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
    independent: bool = False,
) -> np.ndarray:
    """Linear radiance (H, W, C), float32, of camera (k, l): sRGB whose luminance is in cd/m^2.

    In spectral mode: what pixels of each of the camera's colours see, in the unit of `filters`.

    The mean of `samples_per_pixel` paths through each pixel's square; the same bytes for the same
    seed on the same backend. Views need different seeds: with one seed their noise is the same. The paths of
    a pixel are spread evenly over it and over the lamps (correlated multi-jittered sampling, Kensler 2013),
    which at 4 or 8 paths has the error of four times as many `independent` ones.
    """
    mi = render_scene.mi
    sampler = {"type": "independent" if independent else "multijitter"}
    camera = as_rig(cameras).camera(k, l)
    plugin = sensor_plugin(mi, camera, sampler)
    if render_scene.filters is not None:
        plugin["film"] = _film(plugin["film"], render_scene.filters)
    sensor = mi.load_dict(plugin)
    channels = 3 if render_scene.filters is None else len(render_scene.filters.sensitivity)
    total = np.zeros((camera.grid.height, camera.grid.width, channels))
    for number, samples in enumerate(_parts(samples_per_pixel)):
        own_seed = (seed + number * SEED_STEP) % 2**32
        total += samples * np.array(mi.render(render_scene.scene, sensor=sensor, spp=samples, seed=own_seed))
    return (total / samples_per_pixel).astype(np.float32)


def _parts(samples: int) -> list[int]:
    """Numbers of samples to render at a time.

    They are powers of two, since others the renderer adds in an order that is left to chance, and such that
    the sampler divides a pixel into exactly so many cells: of 32 it makes 5 x 7, and 35 samples.
    """
    parts = []
    for part in (*(4**power for power in range(15, 1, -1)), 8, 4, 2, 1):
        parts += [part] * (samples // part)
        samples %= part
    return parts


def _film(film: dict[str, Any], filters: Filters) -> dict[str, Any]:
    """The same film with a channel for each colour's sensitivity, instead of R, G, B."""
    same = {name: value for name, value in film.items() if name not in ("type", "pixel_format")}
    bands = {f"band{number}": spectrum_plugin(curve) for number, curve in enumerate(filters.sensitivity)}
    return {"type": "specfilm", **same, **bands}
