"""Dense radiance of one view: every pixel, by path tracing."""

import math
from typing import Any

import numpy as np

from pcii.base import InputError
from simgen.cameras import Camera, Cameras, as_rig
from simgen.renderer.backend import load_drjit, shape_numbers
from simgen.renderer.mitsuba_objects import WorldFrame, spectrum_plugin
from simgen.renderer.mitsuba_scene import RenderScene

LEAST_STEP_PX = 8
"""Sides of windows are multiples of this at least: smaller steps would save no time that can be measured."""
Window = tuple[slice, slice]
"""Rows and columns of a film."""
PARTS = (*(4**power for power in range(15, 1, -1)), 8, 4, 2, 1)
"""Numbers of samples that are rendered at a time: powers of two, since others are added in an order that is
left to chance, and such that the sampler has exactly so many cells (of 32 it makes 5 x 7, and 35 samples)."""
NEAR_CLIP_MM, FAR_CLIP_MM = 0.01, 1e7
"""Nothing nearer or farther is seen in rendered views."""


def sensor_plugin(mi: Any, camera: Camera, sampler: dict[str, Any], frame: WorldFrame) -> dict[str, Any]:
    """A camera as Mitsuba's sensor, whose own axes point left, up and forward."""
    grid, pose = camera.grid, np.eye(4)
    pose[:3, :3], pose[:3, 3] = camera.rotation * (-1.0, -1.0, 1.0), camera.position_mm
    film = {"type": "hdrfilm", "width": grid.width, "height": grid.height, "pixel_format": "rgb"}
    film["component_format"] = "float32"  # the default, float16, turns 1e6 into infinity
    film["rfilter"] = {"type": "box"}  # the only filter whose sums repeat bit for bit
    plugin = {
        "type": "perspective",
        "fov": 2 * math.degrees(math.atan(grid.width * grid.pixel_mm / (2 * grid.focal_mm))),
        "fov_axis": "x",
        "near_clip": NEAR_CLIP_MM * frame.unit,
        "far_clip": FAR_CLIP_MM * frame.unit,
        "to_world": mi.ScalarTransform4f(frame.rigid_pose(pose) + 0.0),  # adding 0 turns -0 into 0
        "film": film,
        "sampler": sampler,
    }
    if camera.lens is not None:
        plugin["type"] = "thinlens"
        plugin["aperture_radius"] = camera.lens.aperture_mm / 2 * frame.unit
        plugin["focus_distance"] = camera.lens.focus_mm * frame.unit
    else:  # in shares of the film, and positive where the axis is left of (above) the film's centre
        plugin["principal_point_offset_x"] = -camera.shift_px[0] / grid.width
        plugin["principal_point_offset_y"] = -camera.shift_px[1] / grid.height
    return plugin


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

    In spectral mode: what pixels of each of the camera's colours see, in the unit of `filters`. It is the
    mean of `samples_per_pixel` paths through each pixel's square, or of `background_samples` outside the
    windows that objects are in. Views of one seed have the same noise. The paths of a pixel are spread evenly
    over it and over the lamps (correlated multi-jittered sampling, Kensler 2013), which at 4 or 8 paths has
    the error of four times as many `independent` ones. Raises `InputError` for radiance that is not finite.
    """
    camera = as_rig(cameras).camera(k, l)
    sampler = {"type": "independent" if independent else "multijitter"}
    # Mitsuba takes 32 bits, so each part of the samples has a seed of its own.
    rng = np.random.default_rng(seed)
    windows: list[Window] = []
    if background_samples is not None:
        windows, saved = windows_of_objects(render_scene, camera, samples_per_pixel, background_samples)
        if saved <= 0:
            windows, background_samples = [], None
    image = _mean_of_paths(render_scene, camera, sampler, background_samples or samples_per_pixel, rng)
    for rows, cols in windows:
        part = camera.of_window(rows, cols)
        image[rows, cols] = _mean_of_paths(render_scene, part, sampler, samples_per_pixel, rng)
    wrong = np.argwhere(~np.isfinite(image).all(axis=2))
    if wrong.size:
        row, col = wrong[0].tolist()
        number = int(render_scene.first_objects(camera.position_mm, camera.towards(*wrong[:1].T))[0])
        raise InputError(render_scene.not_finite(number, (k, l), (row, col), camera.grid))
    return image


def _mean_of_paths(
    render_scene: RenderScene, camera: Camera, sampler: dict[str, Any], samples: int, rng: np.random.Generator
) -> np.ndarray:
    """The film of a camera, (H, W, C) float32; each part of its samples has its own seed."""
    mi = render_scene.mi
    plugin = sensor_plugin(mi, camera, sampler, render_scene.frame)
    if render_scene.medium is not None:
        plugin["medium"] = render_scene.medium
    if render_scene.filters is not None:
        # A channel for each colour's sensitivity, instead of R, G, B.
        del plugin["film"]["pixel_format"]
        plugin["film"]["type"] = "specfilm"
        for number, curve in enumerate(render_scene.filters.sensitivity):
            plugin["film"][f"band{number}"] = spectrum_plugin(curve)
    sensor = mi.load_dict(plugin)
    hidden = _surroundings_integrator(mi) if render_scene.hides_surroundings else None
    total, rest = np.zeros(()), samples
    for part in PARTS:
        while rest >= part:
            # Dr.Jit takes what a single path carries for constants, and the integrator's loop then fails.
            paths = max(part, 2) if camera.grid.shape_HW == (1, 1) else part
            film = {"sensor": sensor, "spp": paths, "seed": int(rng.integers(1 << 32))}
            image = np.array(mi.render(render_scene.scene, **film))
            if hidden is not None:  # of the same rays, so that what is left has no noise of it
                surroundings = np.array(mi.render(render_scene.scene, integrator=hidden, **film))
                image = np.maximum(image - surroundings, 0)
            if part == samples:
                return image
            total = total + part * image.astype(np.float64)
            rest -= part
    return (total / samples).astype(np.float32)


def _surroundings_integrator(mi: Any) -> Any:
    """What rays of a camera see of what shines from all around, and nothing else."""

    class Surroundings(mi.SamplingIntegrator):
        def sample(
            self, scene: Any, sampler: Any, ray: Any, medium: Any = None, active: Any = True
        ) -> tuple[Any, Any, list[Any]]:
            hit = scene.ray_intersect(ray, active)
            missed = active & load_drjit().isinf(hit.t)
            if missed is False:  # in scalar mode, where nothing shines at such a hit
                return mi.Spectrum(0), missed, []
            return hit.emitter(scene, missed).eval(hit, missed), missed, []

    return Surroundings(mi.Properties())


def windows_of_objects(
    render_scene: RenderScene, camera: Camera, samples_per_pixel: int, background_samples: int
) -> tuple[list[Window], int]:
    """Windows that do not overlap, outside of which no object is, and paths that fewer samples there save.

    The whole film is the only one if an object's box reaches behind the camera, or if that has a lens.
    """
    is_object = render_scene.object_of_shape[shape_numbers(render_scene.scene)] > 0
    corners_mm, windows = render_scene.corners_mm[is_object], list[Window]()
    height, width = camera.grid.shape_HW
    size, z_mm = np.array([height, width]), ((corners_mm - camera.position_mm) @ camera.rotation)[..., 2]
    if len(corners_mm) and (camera.lens is not None or z_mm.min() <= 0):
        windows, corners_mm = [(slice(0, height), slice(0, width))], corners_mm[:0]
    for corners in corners_mm:
        edges_px = np.clip(camera.film_px(corners)[:, ::-1] + size / 2, -size, 2 * size)
        first, stop = np.floor(edges_px.min(axis=0)), np.ceil(edges_px.max(axis=0))
        if (stop <= 0).any() or (first >= size).any():
            continue
        window = _window_around(first, stop, size)
        while met := [other for other in windows if _overlap(window, other)]:
            windows = [other for other in windows if other not in met]
            edges = np.array([[(side.start, side.stop) for side in each] for each in (window, *met)])
            window = _window_around(edges[..., 0].min(axis=0), edges[..., 1].max(axis=0), size)
        windows.append(window)
    covered = sum((rows.stop - rows.start) * (cols.stop - cols.start) for rows, cols in windows)
    return windows, (samples_per_pixel - background_samples) * height * width - samples_per_pixel * covered


def _window_around(first: np.ndarray, stop: np.ndarray, size: np.ndarray) -> Window:
    """A window on a film of this `size` around pixels from `first` to before `stop`; each (2,).

    Its sides have few lengths, four to an octave: the renderer compiles its loops for each size of picture.
    """
    sides = []
    for begin, end, limit in np.stack([first, stop, size]).astype(int).T.tolist():
        step = max(1 << (end - begin).bit_length() >> 3, LEAST_STEP_PX)
        length = min(-(-(end - begin) // step) * step, limit)
        start = min(max(begin, 0), limit - length)
        sides.append(slice(start, start + length))
    return sides[0], sides[1]


def _overlap(one: Window, other: Window) -> bool:
    return all(a.start < b.stop and b.start < a.stop for a, b in zip(one, other, strict=True))
