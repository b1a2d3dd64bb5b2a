"""Radiance images of views; on disk as products of a dataset, or as what its photon counts are drawn from."""

import json
import math
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from pcii.base import Report, write_json_safely
from pcii.store import RADIANCE, radiance_name, read_exr, write_exr_safely
from pcii.types import channel_count, colour_index, sense
from simgen.base import random_streams as seeds
from simgen.photons import Capture
from simgen.renderer import render_view, windows_of_objects
from simgen.sensor import full_light_image, photons_per_radiance
from simgen.spec import Exposure, Render, Sensor

RENDERED = ".rendered"
"""Folder of exact views that are no product in themselves; gone when the dataset is finished."""


def exact_view(
    capture: Capture,
    k: int,
    l: int,
    samples_per_pixel: int,
    background_samples: int | None = None,
    *,
    part: int = 0,
) -> np.ndarray:
    """Radiance (H, W, C), float32, of camera (k, l), with noise of its own and of this `part`."""
    seed = seeds.integer(capture.seed, view=k * capture.grid.cols + l, stage="radiance", part=part)
    samples = {"samples_per_pixel": samples_per_pixel, "background_samples": background_samples}
    return render_view(capture.render_scene, capture.rig, k, l, seed=seed, **samples)


def halved_view(capture: Capture, k: int, l: int, samples_per_pixel: int) -> tuple[np.ndarray, np.ndarray]:
    """Radiance (H, W, C), float32, of camera (k, l) as the mean of two halves of its samples, and its noise.

    It has as many samples per pixel, or one more. The noise (C,), which follows from the difference of the
    halves, is the variance of the mean in the sensor's colours, summed over the pixels of each.
    """
    samples = math.ceil(samples_per_pixel / 2)
    halves = (exact_view(capture, k, l, samples, part=part) for part in (0, 1))
    one, other = (half.astype(np.float64) for half in halves)
    apart = sense(one - other, capture.cfa)
    colours = colour_index(apart.shape[0], apart.shape[1], capture.cfa).ravel()
    variance = np.bincount(colours, (apart**2).ravel() / 4, minlength=channel_count(capture.cfa))
    return ((one + other) / 2).astype(np.float32), variance


def background_paths_saved(capture: Capture, render: Render) -> int:
    """Light paths that all views take less than with `render.samples_per_pixel` everywhere."""
    samples, fewer = render.samples_per_pixel, render.background_samples_per_pixel
    if fewer is None:
        return 0
    cameras = (capture.rig.camera(k, l) for k, l in np.ndindex(capture.grid.rows, capture.grid.cols))
    return sum(max(windows_of_objects(capture.render_scene, each, samples, fewer)[1], 0) for each in cameras)


@dataclass(frozen=True, eq=False)
class RenderedViews:
    """The rendered views of the dataset in the folder `out`.

    `radiance` is the product: "rgb" is all colours, "mosaic" the pixel's own. With `sensor.full_light` it is
    what a camera with this `exposure` reads, else exact radiance. A view has as many samples as `settings`
    say or, if counts are drawn from it, `samples_for_counts` in two halves, so that its noise is known.
    """

    capture: Capture
    sensor: Sensor
    exposure: Exposure | None
    radiance: Literal["none", "mosaic", "rgb"]
    settings: Render
    samples_for_counts: int | None
    out: Path

    def render(self, report: Report) -> None:
        """Write every view that is not on disk yet; the next one is rendered while one is compressed."""
        grid, stage = self.capture.grid, "views"
        if self.samples_for_counts is not None:
            stage = f"views of {self.samples_for_counts} samples per pixel, for the counts"
        with ThreadPoolExecutor(1, "views") as writer:
            writes: list[Future[None]] = []
            for k, l in np.ndindex(grid.rows, grid.cols):
                view = self._rendered(k, l)
                for write in writes[-1:]:
                    write.result()
                writes.append(writer.submit(self._write, k, l, view))
                report(stage, len(writes), grid.view_count)
            writes[-1].result()

    def mosaic(self, k: int, l: int) -> np.ndarray:
        """Radiance that each of the sensor's pixels gets in a view that is on disk, (H, W)."""
        image = read_exr(self._exact_file(k, l))
        return sense(image, self.capture.cfa) if image.shape[2] == 3 else image[..., 0]

    def variance(self, k: int, l: int) -> np.ndarray:
        """Noise (C,) of a view that is on disk, as of `halved_view`."""
        return np.array(json.loads(self._noise_file(k, l).read_bytes()))

    def _rendered(self, k: int, l: int) -> tuple[np.ndarray, np.ndarray | None] | None:
        """Radiance of a view and, if counts are drawn from it, its noise; None if they are on disk."""
        samples, settings = self.samples_for_counts, self.settings
        if self._exact_file(k, l).is_file() and (samples is None or self._noise_file(k, l).is_file()):
            return None
        if samples is not None:
            return halved_view(self.capture, k, l, samples)
        both = settings.samples_per_pixel, settings.background_samples_per_pixel
        return exact_view(self.capture, k, l, *both), None

    def _write(self, k: int, l: int, view: tuple[np.ndarray, np.ndarray | None] | None) -> None:
        """Write the exact radiance of a view, unless it is there, and what a camera reads, if asked for."""
        capture, exact = self.capture, self._exact_file(k, l)
        if view is not None:
            image, variance = view
            write_exr_safely(exact, image if self.radiance == "rgb" else sense(image, capture.cfa)[..., None])
            if variance is not None:
                write_json_safely(self._noise_file(k, l), variance.tolist())
        if self.sensor.full_light is not None and self.radiance != "none":
            assert self.exposure is not None
            gain = photons_per_radiance(self.exposure, capture.grid.pixel_mm)
            rng = seeds.generator(capture.seed, view=k * capture.grid.cols + l, stage="full light")
            dark_map = capture.dark_map
            if dark_map is not None:
                dark_map = np.broadcast_to(dark_map, capture.grid.shape_KLHW)[k, l]
            measured = full_light_image(read_exr(exact), capture.cfa, gain, self.sensor, rng, dark_map)
            write_exr_safely(self.out / radiance_name(k, l), measured)

    def _noise_file(self, k: int, l: int) -> Path:
        return self.out / radiance_name(k, l).replace(RADIANCE, RENDERED, 1).replace(".exr", ".json")

    def _exact_file(self, k: int, l: int) -> Path:
        """Where a view's exact radiance is kept while the dataset is made; in the end, if it is a product."""
        name = radiance_name(k, l)
        is_product = self.radiance != "none" and self.sensor.full_light is None
        return self.out / (name if is_product else name.replace(RADIANCE, RENDERED, 1))
