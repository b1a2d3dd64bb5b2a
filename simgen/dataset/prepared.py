"""A recipe with all that it names, what each stage of the work takes of it, and what it takes of the machine.

That is estimated before any work, and refused where it cannot fit.
"""

import math
import os
import shutil
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base import InputError
from pcii.exchange import open_array
from pcii.store import DATASET_FOLDER, PACKAGE, hash_file, hash_json, provenance
from pcii.types import CameraGrid, read_only
from simgen.assets import read_assets
from simgen.base import asset
from simgen.base import random_streams as seeds
from simgen.cameras import rig_of
from simgen.photons import MAX_RAYS, Capture, Plan, layers_for, plan_counts, tile_px_for
from simgen.renderer import RenderScene, backend, build
from simgen.sensor import photons_per_radiance
from simgen.spec import Analysis, Recipe, Scene, Sensor, checked_folder, load_scene, scene_files
from simgen.spectral import sensitivity

DECISIVE = (PACKAGE, "mitsuba")
"""Packages whose versions are part of what identifies a dataset, with its recipe and scene."""
AROUND_PLANES_MM = 60.0
"""Before and behind the planes of a scene depth maps look so much further, if the recipe doesn't say."""

# Bytes per item were measured, as the growth of the process with the number of items.
BASE_BYTES = 4e8
"""The renderer and its libraries."""
PIXEL_BYTES, VIEW_BYTES, PLANE_BYTES = 165.0, 400.0, 2.0
"""A pixel while the first hits of its view are sought, a camera, and a pixel of the truth for each plane."""
PHOTON_BYTES, ORIGIN_BYTES, SUM_BYTES = 200.0, 30.0, 8.0
"""A photon that is kept, or a pixel that counts without any; the origin of each of several counts of a pixel;
a pixel of any view where photons are too many to be kept."""
TILE_BYTES = 110.0
"""A tile of the majorant."""
EVENT_BYTES, FRAME_BYTES, TRUTH_BYTES = 16.0, 2.0, 6.0
"""On disk before compression: a pixel that caught photons, the frame of each, its depth and object."""
MIN_COMPRESSED_SHARE = 0.5
"""Noise of rendered views keeps their files larger than this share of what they are before compression."""


@dataclass(frozen=True, eq=False)
class Prepared:
    """What a dataset is made from; the recipe with depths to look at, if the scene names them.

    `curves` (C, N) are the sensor's sensitivities by wavelength, None in RGB mode, and `dark_map` its mean
    counts without light, (H, W) or (K, L, H, W), None without a file of them.
    """

    recipe: Recipe
    scene: Scene
    folder: Path
    curves: np.ndarray | None
    dark_map: np.ndarray | None = None

    @cached_property
    def scene_content(self) -> dict[str, Any]:
        """All that decides what the sensor sees of the scene: its values, hashes of its files, curves, and
        the hash of the map of dark counts if there is one."""
        assets = {str(name): asset(self.folder, name, where) for where, name in scene_files(self.scene)}
        dark_map = self.dark_map
        dark = {} if dark_map is None else {"dark_map": sha256(dark_map.tobytes()).hexdigest()}
        return dark | {
            "scene": self.scene.model_dump(mode="json"),
            "assets": {name: hash_file(path) for name, path in sorted(assets.items())},
            "sensitivities": None if self.curves is None else self.curves.tolist(),
        }

    @cached_property
    def seed(self) -> int:
        """The seed of this draw: no two scenes, cameras, sensors or amounts of light have one in common.

        So one seed in a recipe gives unrelated photons in each dataset of a sweep. Products, smaller budgets
        of the same photons, how they are read out (in frames of so many bits) and words about the scene make
        no other draw, nor does what is scored.
        """
        unseen = dict.fromkeys(("title", "description", "planes_mm"), True)
        unseen |= {"objects": {"__all__": {"scored"}}, "mitsuba": {"unscored"}}
        decisive = self.recipe.model_dump(mode="json", include={"grid", "sensor", "photons", "exposure"})
        del decisive["photons"]["nested"]
        del decisive["sensor"]["frames"], decisive["sensor"]["bits"]
        drawn = self.scene_content | {"scene": self.scene.model_dump(mode="json", exclude=unseen)}
        return seeds.seed_of_draw(self.recipe.seed, [drawn, decisive, self.recipe.render.max_depth])

    @cached_property
    def recipe_of_data(self) -> dict[str, Any]:
        """All of the recipe that the data depend on, as plain values: terms of publication are left out."""
        return self.recipe.model_dump(mode="json", exclude={"publication"})

    @cached_property
    def identity(self) -> str:
        """Hash of all that decides the dataset's content, but for the machine: what a cache goes by.

        Recipe and scene as they are resolved, every byte of the files that they name, versions of software.
        """
        content = self.scene_content | {
            "recipe": self.recipe_of_data,
            "format_version": DATASET_FOLDER.version,
            "software": provenance.versions(*DECISIVE),
        }
        return hash_json(content)

    @cached_property
    def scene_key(self) -> str:
        """Hash of what the scene in the renderer depends on."""
        return hash_json([self.scene_content, self.recipe.render.max_depth])

    @property
    def truth_key(self) -> str:
        """Hash of what the truth on disk depends on."""
        recipe = self.recipe_of_data
        return hash_json([self._camera_key, recipe["products"], recipe["analysis"]["z_mm"]])

    @property
    def light_key(self) -> str:
        """Hash of what the plan of the counts depends on: not the seed, unless cameras have errors."""
        light = [self.recipe_of_data[part] for part in ("sensor", "photons", "exposure")]
        return hash_json([self._camera_key, light, least_samples(self.recipe)])

    @property
    def _camera_key(self) -> str:
        grid = self.recipe.grid
        seed_of_errors = None if grid.errors is None else self.recipe.seed
        return hash_json([self.scene_key, grid.model_dump(mode="json"), seed_of_errors])

    @property
    def map_counts(self) -> float:
        """Mean number of counts that the map of dark counts adds to all views."""
        shape = self.recipe.grid.camera_grid().shape_KLHW
        return 0.0 if self.dark_map is None else float(self.dark_map.mean() * np.prod(shape, dtype=float))

    def render_scene(self) -> RenderScene:
        """The scene in the renderer, in the variant that the recipe needs."""
        with ThreadPoolExecutor(1) as reader:  # the files are read while the renderer loads
            assets = reader.submit(read_assets, self.scene, self.folder)
            mi = backend.load(spectral=self.recipe.is_spectral)
            described = self.scene, self.folder, self.recipe.render.max_depth, self.curves
            return build(mi, *described, assets.result())

    def capture(self, render_scene: RenderScene) -> Capture:
        """The scene as the recipe's cameras and sensor see it."""
        return capture_of(self.recipe, render_scene, self.seed, self.dark_map)

    def plan(self, capture: Capture) -> Plan:
        """How the photon counts will be made, as memory is now; raises `InputError` for too many photons."""
        kind, room = backend.choose().kind, available_bytes()

        def may_explore(counting: Plan) -> bool:
            return shortage(self.recipe, counting, room, self.map_counts) is None

        return plan_counts(capture, kind, least_samples(self.recipe), may_explore=may_explore)


def prepare(recipe: Recipe, recipe_folder: Path | None) -> Prepared:
    """Look up what a recipe in `recipe_folder` names; `InputError` if it is missing or wrong."""
    scene = load_scene(recipe.scene, recipe_folder, recipe.scene_number)
    return prepare_scene(recipe, scene, recipe_folder)


def prepare_scene(recipe: Recipe, scene: Scene, recipe_folder: Path | None = None) -> Prepared:
    """A recipe with this scene, whatever scene it names; `InputError` for a file that is missing or wrong."""
    folder = checked_folder(scene)
    analysis, planes_mm = recipe.analysis, scene.planes_mm
    if planes_mm and not analysis.z_mm:
        near, far = min(planes_mm), max(planes_mm)
        around = max(near - AROUND_PLANES_MM, near / 2), far + AROUND_PLANES_MM
        analysis = Analysis(z_mm=planes_mm, z_range_mm=analysis.z_range_mm or around)
    resolved = recipe.model_copy(update={"analysis": analysis})
    files, grid = recipe_folder or Path(), recipe.grid.camera_grid()
    curves = sensitivities(recipe.sensor, files)
    return Prepared(resolved, scene, folder, curves, dark_map(recipe.sensor, grid, files))


def sensitivities(sensor: Sensor, recipe_folder: Path) -> np.ndarray | None:
    """Relative sensitivities (C, N) of the sensor's camera by wavelength, None in RGB mode.

    A file of sensitivities is looked up in `recipe_folder`. A monochrome sensor takes G, or the one curve
    that there is. Raises `InputError` for a camera that is not known or has too few curves.
    """
    if sensor.camera is None:
        return None
    curves = sensitivity(sensor.camera, recipe_folder)
    if sensor.bayer is None:
        return curves[len(curves) // 2 :][:1]
    if len(curves) == 1:
        raise InputError(
            f"sensor.camera: {sensor.camera!r} has one curve, and a Bayer sensor needs three; "
            "set sensor.cfa to 'none'"
        )
    return curves


def dark_map(sensor: Sensor, grid: CameraGrid, recipe_folder: Path) -> np.ndarray | None:
    """Mean counts without light, (H, W) or (K, L, H, W) float64, of the file that `sensor.hot_pixels` names.

    None without one. Raises `InputError` for a file that is not in `recipe_folder` or no .npy file, for
    another shape, and for what are no finite numbers from 0.
    """
    if sensor.hot_pixels is None:
        return None
    path = asset(recipe_folder, sensor.hot_pixels, "sensor.hot_pixels")
    counts = open_array(path)
    if counts.shape not in (grid.shape_HW, grid.shape_KLHW):
        expected = f"(H, W) = {grid.shape_HW}, or (K, L, H, W) = {grid.shape_KLHW}"
        raise InputError(f"{path}: expected mean dark counts {expected}, got {counts.shape}")
    if counts.dtype.kind not in "fiu" or not ((counts >= 0) & (counts < np.inf)).all():
        raise InputError(f"{path}: expected mean dark counts that are finite numbers from 0")
    return read_only(np.array(counts, dtype=np.float64))


def capture_of(
    recipe: Recipe, render_scene: RenderScene, seed: int, dark_map: np.ndarray | None = None
) -> Capture:
    """A scene as the recipe's cameras and sensor see it; `seed` is that of the draw (`Prepared.seed`)."""
    gain = None
    if recipe.photons.scope == "exposure":
        assert recipe.exposure is not None
        gain = photons_per_radiance(recipe.exposure, recipe.grid.pixel_mm)
    rig = rig_of(recipe.grid, seed)
    return Capture(render_scene, rig, recipe.cfa, recipe.photons, gain, seed, dark_map)


def least_samples(recipe: Recipe) -> int:
    """Samples per pixel of the radiance images that a recipe asks for; 1 if it asks for none."""
    return 1 if recipe.products.radiance == "none" else recipe.render.samples_per_pixel


def versions() -> dict[str, str]:
    """Versions of the packages that make datasets."""
    return provenance.versions(*DECISIVE, "drjit", "numpy", "zarr")


def other_versions(recorded: Mapping[str, str]) -> str:
    """How the decisive versions recorded differ from those here, in words; empty if they are the same."""
    known = {name: number for name, number in recorded.items() if name in DECISIVE}
    return provenance.differences(known, provenance.versions(*DECISIVE))


def other_dataset(out: Path, what: str, recorded: Mapping[str, str]) -> InputError:
    """That a folder holds something of other software or, if its versions agree, of another recipe."""
    differences = other_versions(recorded)
    if not differences:
        text = f"{out}: holds the {what} of another recipe or scene, or of other files that they name"
        return InputError(f"{text}; name a new or empty folder")
    return InputError(
        f"{out}: holds the {what} of other software, whose photons may differ ({differences}); name a new or "
        "empty folder, or install that software"
    )


def bytes_of_steps(recipe: Recipe, plan: Plan | None, map_counts: float = 0.0) -> dict[str, float]:
    """Memory of each step of the work by the fields that it grows with; without a plan of the first ones.

    `map_counts` is the mean number of counts that the map `sensor.hot_pixels` adds to all views.
    """
    grid, sensor, products = recipe.grid, recipe.sensor, recipe.products
    pixels, views = float(grid.height * grid.width), float(grid.rows * grid.cols)
    each = PHOTON_BYTES if sensor.bits is not None or products.frames else ORIGIN_BYTES
    hot = sensor.hot_pixel_share * (PHOTON_BYTES + each * sensor.hot_pixel_counts)
    steps = {
        "grid.height, grid.width": PIXEL_BYTES * pixels,
        "grid.rows, grid.cols": VIEW_BYTES * views,
        "analysis.z_mm": PLANE_BYTES * pixels * len(recipe.analysis.z_mm) * products.truth,
        "sensor.dark_counts": PHOTON_BYTES * sensor.dark_counts * pixels * views * products.counts,
        "sensor.hot_pixels": PHOTON_BYTES * map_counts * products.counts,
        "sensor.hot_pixel_share, sensor.hot_pixel_counts": hot * pixels * views * products.counts,
    }
    if plan is None:
        return steps
    photon_bytes = PHOTON_BYTES * plan.photons_per_view * views
    if not (plan.thins and plan.keeps_origins):
        sums = SUM_BYTES * pixels * views if plan.thins else 0.0
        photon_bytes = min(photon_bytes, PHOTON_BYTES * pixels * views) + sums
    steps["exposure" if recipe.photons.scope == "exposure" else "photons.budget"] = photon_bytes
    if plan.thins:
        cameras, z_mm = grid.camera_grid(), np.array(plan.depths_mm or (math.inf,))
        tiles = layers_for(cameras, tile_px_for(cameras, MAX_RAYS), z_mm).tiles
        steps["grid.pixel_mm, grid.focal_mm, grid.pitch_mm, grid.shear_px"] = TILE_BYTES * tiles
    return steps


def peak_bytes(recipe: Recipe, plan: Plan | None, map_counts: float = 0.0) -> float:
    """Memory at the peak: of the libraries and of the largest step."""
    return BASE_BYTES + max(bytes_of_steps(recipe, plan, map_counts).values())


def shortage(recipe: Recipe, plan: Plan | None, room: float, map_counts: float = 0.0) -> str | None:
    """A sentence on the largest step, if memory of `room` bytes cannot hold it; None if it can."""
    field, most = max(bytes_of_steps(recipe, plan, map_counts).items(), key=lambda step: step[1])
    if most <= room:
        return None
    return f"{field}: takes some {in_bytes(most)} of memory, and this machine has {in_bytes(room)} available"


def check_resources(recipe: Recipe, plan: Plan | None, out: Path, map_counts: float = 0.0) -> None:
    """Raise `InputError` if memory cannot hold a step, or the disk of `out` the rendered views."""
    sentence = shortage(recipe, plan, available_bytes(), map_counts)
    if sentence is not None:
        raise InputError(sentence)
    place = next(folder for folder in (out, *out.absolute().parents) if folder.exists())
    needed = least_rendered_bytes(recipe, plan)
    free = shutil.disk_usage(place).free + sum(file.stat().st_size for file in out.glob("*/view_*.exr"))
    if needed > free:
        field = "products.radiance" if recipe.products.radiance != "none" else "photons, drawn from such"
        raise InputError(
            f"{field}: rendered views of all cameras take {in_bytes(needed)} or more on disk, and {out} has "
            f"{in_bytes(free)} left"
        )


def product_bytes(recipe: Recipe, plan: Plan | None) -> dict[str, float]:
    """Bytes of each product that the recipe asks for, before compression."""
    grid, products = recipe.grid, recipe.products
    pixels, views = float(grid.height * grid.width), grid.rows * grid.cols
    sizes: dict[str, float] = {}
    if plan is not None:
        photons = plan.photons_per_view * views
        frames = FRAME_BYTES * photons * (products.frames and recipe.sensor.frames > 1)
        sizes["counts"] = EVENT_BYTES * min(photons, pixels * views) + frames
    if products.radiance != "none":
        sizes["radiance"] = least_rendered_bytes(recipe, None) / MIN_COMPRESSED_SHARE
    if products.truth or products.view_truth:
        sizes["truth"] = TRUTH_BYTES * pixels * (products.truth + views * bool(products.view_truth))
    return sizes


def least_rendered_bytes(recipe: Recipe, plan: Plan | None) -> float:
    """What the files of rendered views take at least: of products, or for dense counts to be drawn from."""
    if recipe.products.radiance == "none" and (plan is None or plan.thins):
        return 0.0
    pixels = float(recipe.grid.height * recipe.grid.width * recipe.grid.rows * recipe.grid.cols)
    return MIN_COMPRESSED_SHARE * 4.0 * pixels * (3 if recipe.products.radiance == "rgb" else 1)


def available_bytes() -> float:
    """Memory that a new process may take without others being pushed out, and that its group is allowed."""
    room = float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    try:
        lines = Path("/proc/meminfo").read_text().splitlines()
        free = next(float(line.split()[1]) * 1024 for line in lines if line.startswith("MemAvailable"))
        room, group = min(room, free), Path("/sys/fs/cgroup")
        limit, used = (float((group / f"memory.{name}").read_text()) for name in ("max", "current"))
        room = min(room, limit - used)
    except (OSError, StopIteration, ValueError):  # not known here, or no limit
        pass
    return room


def in_bytes(size: float) -> str:
    """A size in the unit that suits it, with two digits."""
    unit = int(math.log10(min(max(size, 1.0), 1e12)) / 3)
    return f"{float(f'{size / 1000**unit:.2g}'):g} {('B', 'kB', 'MB', 'GB', 'TB')[unit]}"
