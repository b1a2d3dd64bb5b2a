"""A recipe with all that it names, and what each stage of the work takes of it."""

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
from simgen.dataset.resources import available_bytes, shortage
from simgen.photons import Capture, Plan, plan_counts
from simgen.renderer import RenderScene, backend, build
from simgen.sensor import photons_per_radiance
from simgen.spec import Analysis, Recipe, Scene, Sensor, checked_folder, load_scene, scene_files
from simgen.spectral import sensitivity

DECISIVE = (PACKAGE, "mitsuba")
"""Packages whose versions are part of what identifies a dataset, with its recipe and scene."""
AROUND_PLANES_MM = 60.0
"""Before and behind the planes of a scene depth maps look so much further, if the recipe doesn't say."""


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
