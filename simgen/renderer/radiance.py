"""Dense radiance of one view: every pixel, by path tracing."""

from collections.abc import Iterable, Iterator
from itertools import count
from typing import Any

import numpy as np

from pcii.base.errors import InputError
from simgen.cameras.rig import Camera, Cameras, as_rig
from simgen.renderer.backend import shape_numbers
from simgen.renderer.intersection import first_objects
from simgen.renderer.mitsuba_camera import sensor_plugin
from simgen.renderer.mitsuba_scene import RenderScene, not_finite
from simgen.renderer.mitsuba_surfaces import spectrum_plugin
from simgen.spectral.filters import Filters

LEAST_STEP_PX = 8
"""Sides of windows are multiples of this at least: smaller steps would save no time that can be measured."""
Window = tuple[slice, slice]
"""Rows and columns of a film."""
SEED_STEP = 0x9E3779B9
"""Between seeds of parts of one view: 2^32 over the golden ratio, whose multiples stay far apart (modulo
2^32), so that no part has the seed of another view's."""


def object_windows(camera: Camera, corners_mm: np.ndarray) -> list[Window]:
    """Windows that do not overlap, outside of which the camera sees none of the objects in boxes.

    `corners_mm` (N, 8, 3) are the corners of each object's bounding box. A window covers the projection of
    one box, or of several whose windows overlap. The whole film is the only window if a box reaches behind
    the camera, or if the camera has a lens, which blurs.
    """
    size = np.array([camera.grid.height, camera.grid.width])
    z_mm = ((corners_mm - camera.position_mm) @ camera.rotation)[..., 2]
    if len(corners_mm) and (camera.lens is not None or z_mm.min() <= 0):
        return [(slice(0, camera.grid.height), slice(0, camera.grid.width))]
    windows: list[Window] = []
    for corners in corners_mm:
        edges_px = np.clip(camera.film_px(corners)[:, ::-1] + size / 2, -size, 2 * size)
        first, stop = np.floor(edges_px.min(axis=0)), np.ceil(edges_px.max(axis=0))
        if (stop <= 0).any() or (first >= size).any():
            continue
        window = _of_few_sizes(first, stop, size)
        while met := [other for other in windows if _overlap(window, other)]:
            windows = [other for other in windows if other not in met]
            edges = np.array([[(side.start, side.stop) for side in each] for each in (window, *met)])
            window = _of_few_sizes(edges[..., 0].min(axis=0), edges[..., 1].max(axis=0), size)
        windows.append(window)
    return windows


def covered_px(windows: Iterable[Window]) -> int:
    """How many pixels windows cover that do not overlap."""
    return sum((rows.stop - rows.start) * (cols.stop - cols.start) for rows, cols in windows)


def _of_few_sizes(first: np.ndarray, stop: np.ndarray, size: np.ndarray) -> Window:
    """A window on a film of this `size` around pixels from `first` to before `stop`; each (2,).

    Its sides take few different lengths, four to an octave, since the renderer compiles its loops for each
    size of picture.
    """
    sides = []
    for one, end, most in zip(first.astype(int), stop.astype(int), size, strict=True):
        step = max(1 << int(end - one).bit_length() >> 3, LEAST_STEP_PX)
        length = min(-(-(end - one) // step) * step, most)
        start = int(np.clip(one, 0, most - length))
        sides.append(slice(start, start + int(length)))
    return sides[0], sides[1]


def _overlap(one: Window, other: Window) -> bool:
    return all(a.start < b.stop and b.start < a.stop for a, b in zip(one, other, strict=True))


def render_view(
    render_scene: RenderScene,
    cameras: Cameras,
    k: int,
    l: int,
    *,
    samples_per_pixel: int,
    seed: int,
    background_samples: int | None = None,
    independent: bool = False,
) -> np.ndarray:
    """Linear radiance (H, W, C), float32, of camera (k, l): sRGB whose luminance is in cd/m^2.

    In spectral mode: what pixels of each of the camera's colours see, in the unit of `filters`.

    The mean of `samples_per_pixel` paths through each pixel's square, or of `background_samples` outside the
    windows that objects are in; the same bytes for the same seed on the same backend. Views need different
    seeds: with one seed their noise is the same. The paths of a pixel are spread evenly over it and over the
    lamps (correlated multi-jittered sampling, Kensler 2013), which at 4 or 8 paths has the error of four
    times as many `independent` ones. Raises `InputError` for radiance that is not finite.
    """
    camera = as_rig(cameras).camera(k, l)
    sampler = {"type": "independent" if independent else "multijitter"}
    own_seeds = ((seed + number * SEED_STEP) % 2**32 for number in count())

    def mean_of_paths(camera: Camera, samples: int) -> np.ndarray:
        return _mean_of_paths(render_scene, camera, sampler, samples, own_seeds)

    if background_samples is None:
        return mean_of_paths(camera, samples_per_pixel)
    windows, saved = windows_of_objects(render_scene, camera, samples_per_pixel, background_samples)
    if saved <= 0:
        return mean_of_paths(camera, samples_per_pixel)
    image = mean_of_paths(camera, background_samples)
    for rows, cols in windows:
        image[rows, cols] = mean_of_paths(camera.of_window(rows, cols), samples_per_pixel)
    return image


def windows_of_objects(
    render_scene: RenderScene, camera: Camera, samples_per_pixel: int, background_samples: int
) -> tuple[list[Window], int]:
    """Where objects can be seen, and how many light paths fewer samples elsewhere save."""
    windows = object_windows(camera, _object_boxes_mm(render_scene))
    pixels = camera.grid.height * camera.grid.width
    paths = background_samples * pixels + samples_per_pixel * covered_px(windows)
    return windows, samples_per_pixel * pixels - paths


def _mean_of_paths(
    render_scene: RenderScene,
    camera: Camera,
    sampler: dict[str, Any],
    samples_per_pixel: int,
    own_seeds: Iterator[int],
) -> np.ndarray:
    """The film of a camera, (H, W, C) float32; each part of its samples takes the next seed."""
    mi = render_scene.mi
    plugin = sensor_plugin(mi, camera, sampler, render_scene.frame)
    if render_scene.filters is not None:
        plugin["film"] = _film(plugin["film"], render_scene.filters)
    sensor = mi.load_dict(plugin)
    total = np.zeros(())
    for samples in _parts(samples_per_pixel):
        image = np.array(mi.render(render_scene.scene, sensor=sensor, spp=samples, seed=next(own_seeds)))
        _require_finite(render_scene, camera, image)
        if samples == samples_per_pixel:
            return image
        total = total + samples * image.astype(np.float64)
    return (total / samples_per_pixel).astype(np.float32)


def _require_finite(render_scene: RenderScene, camera: Camera, image: np.ndarray) -> None:
    """`InputError` that names the object in a pixel whose radiance is no finite number."""
    if np.isfinite(image).all():
        return
    row, col = np.argwhere(~np.isfinite(image).all(axis=2))[0]
    towards = camera.towards(np.array([row]), np.array([col]))
    raise InputError(
        not_finite(render_scene, int(first_objects(render_scene, camera.position_mm, towards)[0]))
    )


def _object_boxes_mm(render_scene: RenderScene) -> np.ndarray:
    """Corners (N, 8, 3) of the bounding boxes of the scene's objects."""
    scene = render_scene.scene
    objects = render_scene.object_of_shape[shape_numbers(scene)] > 0
    boxes = [shape.bbox() for shape, is_object in zip(scene.shapes(), objects, strict=True) if is_object]
    corners = [[box.corner(number) for number in range(8)] for box in boxes]
    return render_scene.frame.points_mm(np.array(corners, dtype=np.float64).reshape(-1, 8, 3))


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
