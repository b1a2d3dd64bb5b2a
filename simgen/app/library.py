"""What the commands do, as functions: scenes and recipes by name, photons without a file, datasets."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from pcii.core.camera_grid import CameraGrid
from pcii.core.console import Report, silent
from pcii.core.errors import InputError
from pcii.core.photon_counts import PhotonCounts
from pcii.core.truth import PhotonTruth, Truth
from simgen.base import random_streams
from simgen.base.strict_models import validate
from simgen.cameras.rig import centre_camera
from simgen.dataset import generation
from simgen.dataset.prepared import Prepared, capture_of, needs_of
from simgen.dataset.resources import check_resources
from simgen.figures.preview_picture import write_preview
from simgen.photons.counting_plan import plan
from simgen.photons.photon_counting import draw_from_views, thin
from simgen.renderer import backend
from simgen.renderer.radiance import render_view
from simgen.sensor.detector import detect
from simgen.sensor.mosaic import sense
from simgen.spec import recipe as recipes
from simgen.spec import scene as scenes
from simgen.spec.recipe import Recipe
from simgen.spec.scene import Scene
from simgen.truth.first_hits import first_hits_at_centre
from simgen.truth.pixel_coverage import coverage


@dataclass(frozen=True)
class SceneFile:
    """A scene as its TOML file says, and the folder that its assets are in."""

    scene: Scene
    folder: Path


@dataclass(frozen=True)
class RecipeFile:
    """A recipe as its TOML file and overrides say, and the folder beside which its scene is looked up."""

    recipe: Recipe
    folder: Path


def load_scene(name_or_path: str | Path) -> SceneFile:
    """A scene by the name of one that ships, or by the path of its folder or scene.toml.

    Raises `pcii.InputError` for a scene that is missing or wrong, with the field at fault.

    >>> load_scene("two_objects").scene.title
    'Tricoloured ball and toy bird'
    """
    return SceneFile(*scenes.load_scene(str(name_or_path)))


def load_recipe(name_or_path: str | Path, overrides: Sequence[str] = ()) -> RecipeFile:
    """A recipe by the name of one that ships or by path; `overrides` such as "photons.budget=300".

    Raises `pcii.InputError` for a recipe that is missing or wrong, with the field at fault.

    >>> load_recipe("paper", ["photons.budget=300"]).recipe.photons.budget
    300.0
    """
    return RecipeFile(*recipes.load_recipe(str(name_or_path), overrides))


def generate(recipe: RecipeFile, out: str | Path, report: Report = silent) -> dict[str, Any]:
    """Make the dataset of a recipe in the folder `out`, or go on with it; its manifest.

    What `simgen generate` does: an unfinished dataset of the same recipe is resumed, a finished one is
    checked and left alone. `report(stage, done, total)` is called as the work goes on.

    Raises `pcii.InputError` for a folder that holds something else, and for a recipe that this machine cannot
    hold.
    """
    return generation.generate(recipe.recipe, recipe.folder, Path(out), report)


def preview(name_or_path: str | Path, out: str | Path, samples_per_pixel: int = 32) -> None:
    """Write a picture (PNG or JPEG) of a scene or recipe from the virtual centre, with depth and objects.

    Raises `pcii.InputError` for a bad scene or recipe, or a picture that cannot be written.
    """
    write_preview(str(name_or_path), Path(out), samples_per_pixel)


def draw_photons(
    scene: SceneFile,
    grid: CameraGrid,
    *,
    budget: float = 1000.0,
    cfa: str | None = "GRBG",
    seed: int = 0,
    report: Report = silent,
) -> tuple[PhotonCounts, Truth]:
    """Photon counts of a scene as `grid` sees it, and its truth, without a file.

    `budget` photons are expected in each view, behind the Bayer pattern `cfa` (None: monochrome). The counts
    are those of a dataset with the same scene, grid, budget, pattern and seed. The truth has depth in mm and
    object of every pixel of the virtual centre (H, W), and where each photon came from if there are
    few enough to be drawn one by one. Raises `pcii.InputError` for a value that is out of its range.

    >>> grid = pcii.CameraGrid(rows=10, cols=10, pitch_mm=(5, 5), focal_mm=50, pixel_mm=0.0352,
    ...                        height=1024, width=1024)                             # doctest: +SKIP
    >>> counts, truth = draw_photons(load_scene("two_objects"), grid, seed=1)       # doctest: +SKIP
    """
    if not isinstance(scene, SceneFile):
        raise InputError(f"scene: expected what simgen.load_scene gives, got {type(scene).__name__}")
    if not isinstance(grid, CameraGrid):
        raise InputError(f"grid: expected a pcii.CameraGrid, got {type(grid).__name__}")
    values = {
        "scene": str(scene.folder),
        "seed": seed,
        "grid": asdict(grid),
        "sensor": {"cfa": "none" if cfa is None else cfa},
        "photons": {"budget": budget},
    }
    recipe = validate(Recipe, values, "draw_photons")
    render_scene = Prepared(recipe, scene.scene, scene.folder, None).render_scene()
    capture = capture_of(recipe)
    made = plan(capture, render_scene, backend.choose().kind)
    check_resources(needs_of(recipe), made, Path())

    @cache
    def mosaic_of(k: int, l: int) -> np.ndarray:
        own = random_streams.integer(recipe.seed, view=k * grid.cols + l, stage="radiance")
        image = render_view(render_scene, capture.rig, k, l, samples_per_pixel=made.samples, seed=own)
        return sense(image, recipe.cfa)

    if made.thins:
        arrivals, _ = thin(capture, render_scene, recipe.render.max_depth, made, report)
    else:
        arrivals, _ = draw_from_views(capture, mosaic_of, made, report)
    counted = detect(arrivals, grid, recipe.cfa, recipe.sensor, recipe.seed).by_pixel(grid)
    counts = PhotonCounts.from_events(
        counted.k, counted.l, counted.i, counted.j, counted.n, grid, cfa=recipe.cfa
    )
    centre = first_hits_at_centre(render_scene, grid)
    photons = None
    if counted.object_id is not None and counted.z_mm is not None:
        origins = counted.one_by_one().columns()
        photons = PhotonTruth(**{name: origins[name] for name in (*"klij", "object_id", "z_mm")})
    truth = Truth(
        z_mm=centre.z_mm,
        object_id=centre.object_id,
        names=render_scene.names,
        photons=photons,
        normal=centre.normal,
        coverage=coverage(render_scene, centre_camera(grid), centre.object_id),
    )
    return counts, truth
