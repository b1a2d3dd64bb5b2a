"""What the commands do, as functions: scenes by name, datasets, and photons and views without a file."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base import THIS_PROCESS, Executor, InputError, Report, silent
from pcii.store import Collection, DatasetManifest, open_collection, write_card
from pcii.types import CameraGrid, PhotonCounts, PhotonTruth, Truth, Views, sense
from simgen.base import validate
from simgen.cameras import centre_camera
from simgen.dataset import (
    Prepared,
    available_bytes,
    check_resources,
    draw_from_views,
    exact_view,
    generation,
    halved_view,
    in_bytes,
    prepare_scene,
)
from simgen.dataset import dataset_collection as collections
from simgen.photons import thin_photons
from simgen.sensor import counts_of, detect, read_out
from simgen.spec import (
    CalibrationErrors,
    Lens,
    Recipe,
    RecipeFile,
    Scene,
    Sensor,
    Sweep,
    load_sweep,
    scene_lookup,
    scene_of,
)
from simgen.truth import coverage, first_hits_at_centre

Values = Mapping[str, Any]
"""A table of a recipe as a dict."""


def load_scene(
    scene: str | Path | dict[str, Any], number: int | None = None, *, folder: str | Path | None = None
) -> Scene:
    """A scene by the name of one that ships, by the path of its folder or scene.toml, or by its values.

    Values are a dict with the fields of a scene.toml; files that they name are in `folder`. Of a scene that a
    Python function draws, by its registered name or as "module:function" or "file.py:function", `number` says
    which one. Raises `pcii.InputError` for a scene that is missing or wrong, with the field at fault.

    >>> load_scene("two_objects").title
    'Tricoloured ball and toy bird'
    >>> len(load_scene("drawn_room", 17).objects)
    5
    >>> load_scene({"title": "Fog", "lights": [{"type": "uniform", "luminance_cd_m2": 100}]}).title
    'Fog'
    """
    if isinstance(scene, dict):
        return scene_of(scene, None if folder is None else Path(folder), "scene")
    return scene_lookup.load_scene(str(scene), number=number)


def generate(recipe: RecipeFile | str | Path, out: str | Path, report: Report = silent) -> DatasetManifest:
    """Make the dataset of a recipe in the folder `out`, or go on with it; its manifest.

    What `simgen generate` does: `recipe` is one that was loaded, a path, the name of one that ships, or that
    of a scene, which the paper's cameras then see. An unfinished dataset of the same recipe is resumed, a
    finished one is checked and left alone. `report(stage, done, total)` is called as the work goes on.

    Raises `pcii.InputError` for a recipe that is missing or wrong, whose fields have several values, or that
    this machine cannot hold, and for a folder that holds something else.
    """
    if not isinstance(recipe, RecipeFile):
        sweep = load_sweep(str(recipe))
        if sweep.axes:
            fields = ", ".join(sweep.fields)
            raise InputError(f"{sweep.source}: {fields}: several values; use simgen.generate_collection")
        recipe = RecipeFile(sweep.recipe(0), sweep.recipe_folder)
    manifest = generation.generate(recipe.recipe, recipe.folder, Path(out), report)
    write_card(Path(out), recipe.recipe.publication.terms())
    return manifest


def generate_collection(
    name_or_path: str | Path,
    out: str | Path,
    overrides: Sequence[str] = (),
    *,
    seeds: int | None = None,
    scenes: int | None = None,
    trust_python: bool = False,
    executor: Executor = THIS_PROCESS,
    report: Report = silent,
) -> Collection:
    """Make all datasets of a recipe whose fields have several values in the folder `out`, and open them.

    What `simgen generate` does of such a recipe, with its options; `executor` does the work. Raises
    `pcii.InputError` for a recipe that is wrong or has one value for each field, for a folder that holds
    something else, and, once all others are made, for a dataset that could not be made.

    >>> collection = generate_collection("paper", "out/dimmer", ["photons.budget=[100,300]"], seeds=5,
    ...                                  executor=Executor(workers=2))                      # doctest: +SKIP
    >>> [dataset.counts.total for dataset in collection]                                 # doctest: +SKIP
    """
    sweep = load_sweep(str(name_or_path), overrides, seeds=seeds, scenes=scenes, trust_python=trust_python)
    if not sweep.axes:
        raise InputError(f"{sweep.source}: no field has several values; use simgen.generate for one dataset")
    faults = generate_sweep(sweep, Path(out), executor, report)
    if faults:
        raise InputError(
            f"{len(faults)} of {len(sweep)} datasets were not made, the first because {faults[0]}"
        )
    return open_collection(out)


def generate_sweep(sweep: Sweep, out: Path, executor: Executor, report: Report) -> list[str]:
    """Make all datasets of a sweep and their card; a sentence for each that could not be made."""
    faults = collections.generate_collection(sweep, out, executor, report)
    write_card(out, sweep.recipe(0).publication.terms())
    return faults


def draw_photons(
    scene: Scene,
    grid: CameraGrid,
    *,
    budget: float = 1000.0,
    cfa: str | None = "GRBG",
    seed: int = 0,
    lens: Lens | Values | None = None,
    errors: CalibrationErrors | Values | None = None,
    sensor: Sensor | Values | None = None,
    max_depth: int = 3,
    report: Report = silent,
) -> tuple[PhotonCounts, Truth]:
    """Photon counts of a scene as `grid` sees it, and its truth, without a file.

    `budget` photons are expected in each view, behind the Bayer pattern `cfa` (None: monochrome). `lens`,
    `errors` of the cameras and `sensor` are tables of a recipe, as models or dicts, and `max_depth` its
    longest light path in segments. If the `sensor` names a pattern, that one counts; a file that it names is
    looked for in the working directory. The counts are those of a dataset with the same scene, cameras,
    sensor, budget and seed. The truth has depth in mm and object of every pixel of the virtual centre (H, W),
    and where each photon came from if there are few enough to be drawn one by one; then the counts know their
    frames too. Raises `pcii.InputError` for a value that is out of its range.

    >>> grid = pcii.CameraGrid(rows=10, cols=10, pitch_mm=(5, 5), focal_mm=50, pixel_mm=0.0352,
    ...                        height=1024, width=1024)                             # doctest: +SKIP
    >>> counts, truth = draw_photons(load_scene("two_objects"), grid, seed=1,
    ...                              sensor={"dark_counts": 1e-4})                  # doctest: +SKIP
    """
    settings = sensor.model_dump(exclude_unset=True) if isinstance(sensor, Sensor) else dict(sensor or {})
    values = {
        "sensor": {"cfa": "none" if cfa is None else cfa} | settings,
        "photons": {"budget": budget},
        "render": {"max_depth": max_depth},
    }
    prepared = _prepare("draw_photons", scene, grid, lens, errors, {"seed": seed, **values})
    recipe, render_scene = prepared.recipe, prepared.render_scene()
    capture = prepared.capture(render_scene)
    counting = prepared.plan(capture)
    check_resources(recipe, counting, Path(), prepared.map_counts)

    @cache
    def view_of(k: int, l: int) -> tuple[np.ndarray, np.ndarray]:
        image, variance = halved_view(capture, k, l, counting.samples)
        return sense(image, capture.cfa), variance

    if counting.thins:
        arrivals, _ = thin_photons(capture, counting, report)
    else:
        arrivals, _ = draw_from_views(capture, view_of, counting, report)
    detected = detect(arrivals, grid, recipe.cfa, recipe.sensor, capture.seed, capture.dark_map)
    is_single = detected.object_id is not None
    counted = read_out(detected, grid, recipe.sensor, capture.seed, keeps_frames=is_single)
    counts = counts_of(counted, grid, recipe.cfa, recipe.sensor, keeps_frames=is_single)
    photons = None
    if is_single:
        origins = counted.one_by_one().columns()
        photons = PhotonTruth(**{name: origins[name] for name in (*"klij", "object_id", "z_mm")})
    centre = first_hits_at_centre(render_scene, grid)
    covered = coverage(render_scene, centre_camera(grid), centre.object_id)
    maps, names, unscored = (centre.z_mm, centre.object_id), render_scene.names, render_scene.unscored
    return counts, Truth(*maps, names, photons, centre.normal, covered, unscored=unscored)


def render(
    scene: Scene,
    grid: CameraGrid,
    *,
    samples_per_pixel: int = 16,
    seed: int = 0,
    lens: Lens | Values | None = None,
    errors: CalibrationErrors | Values | None = None,
    max_depth: int = 3,
    report: Report = silent,
) -> Views:
    """Linear radiance (K, L, H, W, 3), float32, of a scene as every camera of `grid` sees it.

    sRGB primaries, luminance in cd/m^2, the mean of `samples_per_pixel` light paths of at most `max_depth`
    segments. `lens` and `errors` are those of `draw_photons`. The views are the radiance "rgb" of a dataset
    with the same scene, cameras, samples and seed, whose recipe says nothing of sensor and photons. Raises
    `pcii.InputError` for a value that is out of its range, and for views that memory cannot hold.

    >>> views = render(load_scene("two_objects"), grid, samples_per_pixel=64)       # doctest: +SKIP
    """
    values = {
        "render": {"samples_per_pixel": samples_per_pixel, "max_depth": max_depth},
        "products": {"counts": False, "truth": False},
    }
    prepared = _prepare("render", scene, grid, lens, errors, {"seed": seed, **values})
    needed, room = 4.0 * 3 * np.prod(grid.shape_KLHW, dtype=float), available_bytes()
    if needed > room:
        raise InputError(
            f"grid: radiance of all views takes {in_bytes(needed)} of memory, and this machine has "
            f"{in_bytes(room)} available; take fewer or smaller views"
        )
    check_resources(prepared.recipe, None, Path())
    capture = prepared.capture(prepared.render_scene())
    radiance = np.empty((*grid.shape_KLHW, 3), np.float32)
    for done, (k, l) in enumerate(np.ndindex(grid.rows, grid.cols), start=1):
        radiance[k, l] = exact_view(capture, k, l, samples_per_pixel)
        report("views", done, grid.view_count)
    return Views(radiance, grid)


def _prepare(
    what: str,
    scene: Scene,
    grid: CameraGrid,
    lens: Lens | Values | None,
    errors: CalibrationErrors | Values | None,
    values: Values,
) -> Prepared:
    """A scene with the recipe that the arguments of the function `what` make."""
    for name, value, kind in (("scene", scene, Scene), ("grid", grid, CameraGrid)):
        if not isinstance(value, kind):
            raise InputError(f"{name}: expected a {kind.__name__}, got {type(value).__name__}")
    cameras = asdict(grid) | {"lens": lens, "errors": errors}
    return prepare_scene(validate(Recipe, {"scene": "as given", "grid": cameras, **values}, what), scene)
