"""Photon counts of a scene with its truth, and its views, without a file."""

from collections.abc import Mapping
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base.errors import InputError
from pcii.base.progress import Report, silent
from pcii.core.camera_grid import CameraGrid
from pcii.core.images import Views
from pcii.core.photon_counts import PhotonCounts
from pcii.core.photon_limit import sense
from pcii.core.truth import PhotonTruth, Truth
from simgen.base.strict_models import validate
from simgen.cameras.rig import centre_camera
from simgen.dataset.prepared import Prepared, capture_of, needs_of, prepare_scene
from simgen.dataset.rendered_views import exact_view, halved_view
from simgen.dataset.resources import available_bytes, check_resources, fits, in_bytes
from simgen.photons.candidates import Setup
from simgen.photons.counting_plan import plan
from simgen.photons.photon_counting import draw_from_views, thin
from simgen.renderer import backend
from simgen.renderer.mitsuba_scene import RenderScene
from simgen.sensor.detector import detect
from simgen.sensor.frame_readout import counts_of, read_out
from simgen.sensor.photon_table import PhotonTable
from simgen.spec.recipe import CalibrationErrors, Lens, Recipe, Sensor
from simgen.spec.scene import Scene
from simgen.truth.first_hits import first_hits_at_centre
from simgen.truth.pixel_coverage import coverage

Values = Mapping[str, Any]
"""A table of a recipe as a dict."""


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
    longest light path in segments. A `sensor` may name the pattern instead of `cfa`; a file that it names is
    looked for in the working directory. The counts are those of a dataset with the same scene, cameras,
    sensor, budget and seed. The truth has depth in mm and object of every pixel of the virtual centre (H, W),
    and where each photon came from if there are few enough to be drawn one by one; then the counts know their
    frames too. Raises `pcii.InputError`
    for a value that is out of its range.

    >>> grid = pcii.CameraGrid(rows=10, cols=10, pitch_mm=(5, 5), focal_mm=50, pixel_mm=0.0352,
    ...                        height=1024, width=1024)                             # doctest: +SKIP
    >>> counts, truth = draw_photons(load_scene("two_objects"), grid, seed=1,
    ...                              sensor={"dark_counts": 1e-4})                  # doctest: +SKIP
    """
    values = {
        "sensor": _sensor_values(sensor, cfa),
        "photons": {"budget": budget},
        "render": {"max_depth": max_depth},
    }
    prepared = _prepared("draw_photons", scene, _grid_values(grid, lens, errors), seed, values)
    recipe, render_scene = prepared.recipe, prepared.render_scene()
    capture, needs, kind = capture_of(recipe, prepared.seed), needs_of(recipe), backend.choose().kind
    setup = Setup(render_scene, capture.rig, recipe.cfa, recipe.render.max_depth)
    made = plan(capture, setup, kind, may_explore=fits(needs))
    check_resources(needs, made, Path())
    drawn = thin(capture, setup, made, report) if made.thins else None

    @cache
    def view_of(k: int, l: int) -> tuple[np.ndarray, np.ndarray]:
        view = halved_view(render_scene, capture.rig, k, l, made.samples, capture.seed, recipe.cfa)
        return sense(view.image, recipe.cfa), view.variance

    arrivals, _ = drawn or draw_from_views(
        capture, lambda k, l: view_of(k, l)[0], lambda k, l: view_of(k, l)[1], made, report
    )
    detected = detect(arrivals, grid, recipe.cfa, recipe.sensor, capture.seed)
    is_single = detected.object_id is not None
    counted = read_out(detected, grid, recipe.sensor, capture.seed, keeps_frames=is_single)
    counts = counts_of(counted, grid, recipe.cfa, recipe.sensor, keeps_frames=is_single)
    return counts, _truth(render_scene, grid, counted)


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
    prepared = _prepared("render", scene, _grid_values(grid, lens, errors), seed, values)
    needed, room = 4.0 * 3 * np.prod(grid.shape_KLHW, dtype=float), available_bytes()
    if needed > room:
        raise InputError(
            f"grid: radiance of all views takes {in_bytes(needed)} of memory, and this machine has "
            f"{in_bytes(room)} available; take fewer or smaller views"
        )
    check_resources(needs_of(prepared.recipe), None, Path())
    render_scene, capture = prepared.render_scene(), capture_of(prepared.recipe, prepared.seed)
    radiance = np.empty((*grid.shape_KLHW, 3), np.float32)
    for done, (k, l) in enumerate(np.ndindex(grid.rows, grid.cols), start=1):
        radiance[k, l] = exact_view(render_scene, capture.rig, k, l, samples_per_pixel, capture.seed)
        report("views", done, grid.view_count)
    return Views(radiance, grid)


def _prepared(what: str, scene: Scene, grid: Values, seed: int, values: Values) -> Prepared:
    """A scene with the recipe that the arguments of the function `what` make."""
    if not isinstance(scene, Scene):
        raise InputError(
            f"scene: expected a simgen.Scene, such as simgen.load_scene gives, got {type(scene).__name__}"
        )
    recipe = validate(Recipe, {"scene": "as given", "seed": seed, "grid": grid, **values}, what)
    return prepare_scene(recipe, scene)


def _grid_values(
    grid: CameraGrid, lens: Lens | Values | None, errors: CalibrationErrors | Values | None
) -> dict[str, Any]:
    if not isinstance(grid, CameraGrid):
        raise InputError(f"grid: expected a pcii.CameraGrid, got {type(grid).__name__}")
    return asdict(grid) | {"lens": lens, "errors": errors}


def _sensor_values(sensor: Sensor | Values | None, cfa: str | None) -> dict[str, Any]:
    """The sensor, which may name its Bayer pattern, or else has that of `cfa`."""
    if sensor is not None and not isinstance(sensor, Sensor | Mapping):
        raise InputError(f"sensor: expected a simgen.Sensor or a dict, got {type(sensor).__name__}")
    given = sensor.model_dump(exclude_unset=True) if isinstance(sensor, Sensor) else dict(sensor or {})
    pattern = "none" if cfa is None else cfa
    if pattern not in (Sensor().cfa, given.get("cfa", pattern)):
        raise InputError(f"cfa: it is {pattern!r}, and the sensor's {given['cfa']!r}; give one of them")
    return {"cfa": pattern} | given


def _truth(render_scene: RenderScene, grid: CameraGrid, counted: PhotonTable) -> Truth:
    """What the virtual centre sees of a scene, and the origins of the photons where they are known."""
    centre = first_hits_at_centre(render_scene, grid)
    photons = None
    if counted.object_id is not None and counted.z_mm is not None:
        origins = counted.one_by_one().columns()
        photons = PhotonTruth(**{name: origins[name] for name in (*"klij", "object_id", "z_mm")})
    return Truth(
        z_mm=centre.z_mm,
        object_id=centre.object_id,
        names=render_scene.names,
        photons=photons,
        normal=centre.normal,
        coverage=coverage(render_scene, centre_camera(grid), centre.object_id),
    )
