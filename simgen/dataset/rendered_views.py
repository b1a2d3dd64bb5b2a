"""Radiance images of views; on disk as products of a dataset, or as what its photon counts are drawn from."""

import json
import math
from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from pcii.base.progress import Report
from pcii.core.bayer import channel_count, colour_index
from pcii.core.photon_limit import sense
from pcii.io.dataset_layout import RADIANCE, radiance_name, read_exr, write_exr_safely
from pcii.store.safe_files import write_json_safely
from simgen.base import random_streams as seeds
from simgen.cameras.rig import Rig
from simgen.renderer.mitsuba_scene import RenderScene
from simgen.renderer.radiance import render_view, windows_of_objects
from simgen.sensor.detector import full_light_image, photons_per_radiance
from simgen.spec.recipe import Exposure, Render, Sensor

RENDERED = ".rendered"
"""Folder of exact views that are no product in themselves; gone when the dataset is finished."""


def exact_view(
    render_scene: RenderScene,
    rig: Rig,
    k: int,
    l: int,
    samples_per_pixel: int,
    seed: int,
    background_samples: int | None = None,
) -> np.ndarray:
    """Radiance (H, W, C), float32, of camera (k, l), with noise of its own; `seed` is that of the draw."""
    return render_view(
        render_scene,
        rig,
        k,
        l,
        samples_per_pixel=samples_per_pixel,
        background_samples=background_samples,
        seed=seeds.integer(seed, view=k * rig.grid.cols + l, stage="radiance"),
    )


@dataclass(frozen=True, eq=False)
class HalvedView:
    """A view (H, W, C) as the mean of two halves of its samples, and the noise that their difference tells.

    `variance` (C,) is that of the mean, in the sensor's colours, summed over the pixels of each.
    """

    image: np.ndarray
    variance: np.ndarray


def halved_view(
    render_scene: RenderScene, rig: Rig, k: int, l: int, samples_per_pixel: int, seed: int, cfa: str | None
) -> HalvedView:
    """Radiance of camera (k, l) with as many samples per pixel, or one more; `seed` is that of the draw."""
    number, samples = k * rig.grid.cols + l, math.ceil(samples_per_pixel / 2)
    one, other = (
        render_view(
            render_scene,
            rig,
            k,
            l,
            samples_per_pixel=samples,
            seed=seeds.integer(seed, view=number, stage="radiance", part=part),
        ).astype(np.float64)
        for part in (0, 1)
    )
    apart = sense(one - other, cfa)
    colours = colour_index(apart.shape[0], apart.shape[1], cfa).ravel()
    variance = np.bincount(colours, (apart**2).ravel() / 4, minlength=channel_count(cfa))
    return HalvedView(((one + other) / 2).astype(np.float32), variance)


def background_paths_saved(render_scene: RenderScene, rig: Rig, render: Render) -> int:
    """Light paths that all views take less than with `render.samples_per_pixel` everywhere."""
    fewer = render.background_samples_per_pixel
    if fewer is None:
        return 0
    cameras = (rig.camera(k, l) for k, l in np.ndindex(rig.grid.rows, rig.grid.cols))
    saved = (windows_of_objects(render_scene, each, render.samples_per_pixel, fewer)[1] for each in cameras)
    return sum(max(paths, 0) for paths in saved)


@dataclass(frozen=True, eq=False)
class RenderedViews:
    """The rendered views of the dataset in the folder `out`: of which cameras, and what is kept of them.

    `radiance` is the product: "rgb" is all colours, "mosaic" the pixel's own. With `sensor.full_light` it is
    what a camera with this `exposure` reads, else exact radiance.
    """

    rig: Rig
    sensor: Sensor
    exposure: Exposure | None
    radiance: Literal["none", "mosaic", "rgb"]
    samples_per_pixel: int
    background_samples: int | None
    seed: int
    out: Path
    are_for_counts: bool = False
    """Whether counts are drawn from them: then each is rendered in two halves, and its noise is known."""

    def render(self, render_scene: RenderScene, report: Report) -> None:
        """Write every view that is not on disk yet; the next one is rendered while one is compressed."""
        grid, written, stage = self.rig.grid, 0, "views"
        if self.are_for_counts:
            stage = f"views of {self.samples_per_pixel} samples per pixel, for the counts"
        with ThreadPoolExecutor(1, "views") as writer:
            writing: deque[Future[None]] = deque()
            for k, l in np.ndindex(grid.rows, grid.cols):
                view = None
                if not self._exact_file(k, l).is_file() or (
                    self.are_for_counts and not self._noise_file(k, l).is_file()
                ):
                    view = self._exact(render_scene, k, l)
                writing.append(writer.submit(self._write, k, l, view))
                while writing and (len(writing) > 1 or k * grid.cols + l == grid.view_count - 1):
                    writing.popleft().result()
                    written += 1
                    report(stage, written, grid.view_count)

    def _exact(self, render_scene: RenderScene, k: int, l: int) -> HalvedView:
        samples, seed = self.samples_per_pixel, self.seed
        if self.are_for_counts:
            return halved_view(render_scene, self.rig, k, l, samples, seed, self.sensor.bayer)
        image = exact_view(render_scene, self.rig, k, l, samples, seed, self.background_samples)
        return HalvedView(image, np.zeros(0))

    def _write(self, k: int, l: int, view: HalvedView | None) -> None:
        """Write the exact radiance of a view, unless it is there, and what a camera reads, if asked for."""
        cfa, exact = self.sensor.bayer, self._exact_file(k, l)
        if view is not None:
            image = view.image if self.radiance == "rgb" else sense(view.image, cfa)[..., None]
            write_exr_safely(exact, image)
            if self.are_for_counts:
                write_json_safely(self._noise_file(k, l), view.variance.tolist())
        if self.sensor.full_light is not None and self.radiance != "none":
            assert self.exposure is not None
            measured = full_light_image(
                read_exr(exact),
                cfa,
                photons_per_radiance(self.exposure, self.rig.grid.pixel_mm),
                self.sensor,
                seeds.generator(self.seed, view=k * self.rig.grid.cols + l, stage="full light"),
            )
            write_exr_safely(self.out / radiance_name(k, l), measured)

    def mosaic(self, k: int, l: int) -> np.ndarray:
        """Radiance that each of the sensor's pixels gets in a view that is on disk, (H, W)."""
        image = read_exr(self._exact_file(k, l))
        return sense(image, self.sensor.bayer) if image.shape[2] == 3 else image[..., 0]

    def variance(self, k: int, l: int) -> np.ndarray:
        """Noise of a view that is on disk, as of `HalvedView`."""
        return np.array(json.loads(self._noise_file(k, l).read_bytes()))

    def _noise_file(self, k: int, l: int) -> Path:
        return self.out / radiance_name(k, l).replace(RADIANCE, RENDERED, 1).replace(".exr", ".json")

    def _exact_file(self, k: int, l: int) -> Path:
        """Where a view's exact radiance is kept while the dataset is made; in the end, if it is a product."""
        name = radiance_name(k, l)
        is_product = self.radiance != "none" and self.sensor.full_light is None
        return self.out / (name if is_product else name.replace(RADIANCE, RENDERED, 1))
