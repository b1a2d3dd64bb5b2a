"""Photon counts of a scene and its truth without a file."""

from dataclasses import asdict
from functools import cache
from pathlib import Path

import numpy as np

from pcii.base.errors import InputError
from pcii.base.progress import Report, silent
from pcii.core.camera_grid import CameraGrid
from pcii.core.photon_counts import PhotonCounts
from pcii.core.photon_limit import sense
from pcii.core.truth import PhotonTruth, Truth
from simgen.app.library import SceneFile
from simgen.base import random_streams
from simgen.base.strict_models import validate
from simgen.cameras.rig import centre_camera
from simgen.dataset.prepared import Prepared, capture_of, needs_of
from simgen.dataset.resources import check_resources, fits
from simgen.photons.candidates import Setup
from simgen.photons.counting_plan import plan, render_instead
from simgen.photons.photon_counting import draw_from_views, thin
from simgen.renderer import backend
from simgen.renderer.mitsuba_scene import RenderScene
from simgen.renderer.radiance import render_view
from simgen.sensor.detector import detect
from simgen.sensor.photon_table import PhotonTable
from simgen.spec.recipe import Recipe
from simgen.truth.first_hits import first_hits_at_centre
from simgen.truth.pixel_coverage import coverage


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
    prepared = Prepared(recipe, scene.scene, scene.folder, None)
    render_scene = prepared.render_scene()
    capture, needs, kind = capture_of(recipe, prepared.seed), needs_of(recipe), backend.choose().kind
    setup = Setup(render_scene, capture.rig, recipe.cfa, recipe.render.max_depth)
    made = plan(capture, setup, kind, may_explore=fits(needs))
    check_resources(needs, made, Path())
    drawn = thin(capture, setup, made, report) if made.thins else None
    if drawn is None and made.thins:
        made = render_instead(capture, setup, kind)
        check_resources(needs, made, Path())

    @cache
    def mosaic_of(k: int, l: int) -> np.ndarray:
        path_seed = random_streams.integer(capture.seed, view=k * grid.cols + l, stage="radiance")
        image = render_view(render_scene, capture.rig, k, l, samples_per_pixel=made.samples, seed=path_seed)
        return sense(image, recipe.cfa)

    arrivals, _ = drawn or draw_from_views(capture, mosaic_of, made, report)
    counted = detect(arrivals, grid, recipe.cfa, recipe.sensor, capture.seed).by_pixel(grid)
    counts = PhotonCounts.from_events(
        counted.k, counted.l, counted.i, counted.j, counted.n, grid, cfa=recipe.cfa
    )
    return counts, _truth(render_scene, grid, counted)


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
