"""From a recipe to a dataset folder: the order of the work."""

import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from pcii.base.progress import Report, silent
from pcii.io.dataset_layout import (
    COUNTS,
    MANIFEST,
    PHOTON_TRUTH,
    RADIANCE,
    TRUTH,
    nested_name,
    read_written_manifest,
    write_manifest,
)
from pcii.store.file_list import list_files
from pcii.store.safe_files import named_in_errors, sweep_temporaries
from simgen.cameras.rig import Rig
from simgen.dataset.dataset_folder import claimed, finished, versions, whole
from simgen.dataset.prepared import Prepared, capture_of, least_samples, needs_of, prepare
from simgen.dataset.rendered_views import RENDERED, RenderedViews, background_paths_saved
from simgen.dataset.resources import check_resources, fits
from simgen.dataset.reuse import InCommon, Reuse, in_common
from simgen.photons.candidates import Setup
from simgen.photons.counting_plan import Capture, Plan, plan
from simgen.photons.photon_counting import draw_from_views, thin, write_counts
from simgen.renderer import backend
from simgen.renderer.mitsuba_scene import RenderScene
from simgen.sensor.photon_table import PhotonTable
from simgen.spec.recipe import Recipe
from simgen.truth.truth_file import TruthRequest, traced_for_visibility, write_truth

RGB_UNIT = "linear sRGB whose luminance is in cd/m^2"
SPECTRAL_UNIT = "cd/m^2 of light of 555 nm that gives as many photons to a pixel that detects them all"


def description(prepared: Prepared, render_scene: RenderScene) -> dict[str, Any]:
    """What a dataset is made from and with."""
    recipe, scene = prepared.recipe, prepared.scene
    channels = 3 if render_scene.filters is None else len(render_scene.filters.sensitivity)
    return {
        "title": recipe.title or scene.title,
        "grid": asdict(recipe.grid.camera_grid()),
        "cfa": recipe.cfa,
        "frames": recipe.sensor.frames,
        "bits": recipe.sensor.bits,
        "radiance_channels": {"none": None, "mosaic": 1, "rgb": channels}[recipe.products.radiance],
        "radiance_unit": SPECTRAL_UNIT if recipe.is_spectral else RGB_UNIT,
        "objects": {str(number): name for number, name in render_scene.names.items()},
        "analysis": recipe.analysis.model_dump(mode="json"),
        "recipe": prepared.recipe_of_data,
        "scene": scene.model_dump(mode="json"),
        "versions": versions(),
    }


def skipped(
    prepared: Prepared,
    photons: dict[str, Any] | None,
    shadow_rays: int | None,
    render_scene: RenderScene,
    rig: Rig,
) -> list[dict[str, Any]]:
    """What was not done: what, why, and how much work that saved, and its unit.

    `photons` is what the manifest says of them, `shadow_rays` how many were traced to count the cameras that
    see a point; both None if there was no such work.
    """
    recipe, products = prepared.recipe, prepared.recipe.products
    grid = recipe.grid.camera_grid()
    pixels = grid.view_count * grid.height * grid.width
    found: list[dict[str, Any]] = []

    def add(what: str, why: str, saved: int, unit: str) -> None:
        found.append({"what": what, "why": why, "saved": saved, "unit": unit})

    if photons is not None and photons.get("paths", 0) < photons.get("dense_paths_instead", 0):
        saved = photons["dense_paths_instead"] - photons["paths"]
        add("rendering for the photon counts", "photons are drawn one by one", saved, "light paths")
    if products.radiance == "none" and (photons is None or photons["method"] == "thinning"):
        paths = pixels * recipe.render.samples_per_pixel
        add("radiance images", "the recipe does not ask for them", paths, "light paths")
    elif products.radiance == "mosaic" and recipe.cfa is not None:
        what = "two of three colours of the radiance images"
        add(what, "the Bayer pattern hides them", 8 * pixels, "bytes before compression")
    renders_for_photons = photons is not None and photons["method"] == "dense"
    if products.radiance != "none" and not renders_for_photons:
        saved = background_paths_saved(render_scene, rig, recipe.render)
        if saved:
            why = f"the recipe asks for {recipe.render.background_samples_per_pixel} per pixel there"
            add("samples where no object can be seen", why, saved, "light paths")
    if shadow_rays is not None:
        what = "visibility of some points"
        add(what, "no shape can stand in the way", pixels - shadow_rays, "rays")
    elif products.truth:
        add("visibility", "the recipe does not ask for it", pixels, "rays at most")
    if not products.view_truth:
        add("truth of every view", "the recipe does not ask for it", pixels, "first hits")
    return found


@dataclass
class _Clock:
    """Wall seconds by stage."""

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        start = time.perf_counter()
        yield
        spent = time.perf_counter() - start
        self.seconds[name] = round(self.seconds.get(name, 0.0) + spent, 3)


def generate(recipe: Recipe, recipe_folder: Path, out: Path, report: Report = silent) -> dict[str, Any]:
    """Make the dataset of `recipe` in the folder `out`; return its manifest.

    Scenes are looked up in `recipe_folder`. An unfinished dataset of the same recipe is resumed, a finished
    one is checked and left alone; a folder that holds anything else is refused with `InputError`.
    """
    prepared = prepare(recipe, recipe_folder)
    return finished(out, prepared.identity) or make(prepared, out, report, Reuse())


def make(prepared: Prepared, out: Path, report: Report, reuse: Reuse) -> dict[str, Any]:
    """Make a dataset that is not finished yet; its manifest. See `generate` for what is refused.

    What it has in common with those made before with the same `reuse` is not made again. Raises
    `BusyError` if another process is at it.
    """
    recipe, identity = prepared.recipe, prepared.identity
    needs = needs_of(recipe)
    engine = backend.describe(spectral=recipe.is_spectral)
    clock, made, capture = _Clock(), None, capture_of(recipe, prepared.seed)
    common = in_common(reuse, prepared, engine)
    with named_in_errors(out), claimed(out, identity, engine) as marker:
        if (out / MANIFEST).is_file():  # another run has finished it since
            marker.unlink()
            return whole(out, identity, content=True)
        check_resources(needs, None, out)
        with clock.stage("load"):  # before anything is written: a bad scene shows here
            render_scene = common.scene(prepared.render_scene)
        setup = Setup(render_scene, capture.rig, capture.cfa, recipe.render.max_depth)
        if recipe.products.counts:  # likewise: too much light
            planning = partial(
                plan,
                capture,
                setup,
                engine["kind"],
                least_samples(recipe),
                may_explore=fits(needs),
            )
            with clock.stage("plan"):
                made = common.plan(planning)
                check_resources(needs, made, out)
        sweep_temporaries(out)
        photons = _work(prepared, capture, setup, made, common, out, clock, report)
        shutil.rmtree(out / RENDERED, ignore_errors=True)
        with clock.stage("hash"):
            budgets = (None, *recipe.photons.nested)
            parts = [nested_name(part, budget) for part in (COUNTS, PHOTON_TRUTH) for budget in budgets]
            files = list_files(out, [TRUTH, *parts, RADIANCE])
        manifest = description(prepared, render_scene) | {
            "identity": identity,
            "backend": engine,
            "photons": photons,
            "skipped": skipped(prepared, photons, traced_for_visibility(out), render_scene, capture.rig),
            "timings_s": clock.seconds,
            "files": files,
        }
        write_manifest(out, manifest)
        marker.unlink()
    return read_written_manifest(out)


def _work(
    prepared: Prepared,
    capture: Capture,
    setup: Setup,
    made: Plan | None,
    common: InCommon,
    out: Path,
    clock: _Clock,
    report: Report,
) -> dict[str, Any] | None:
    """Write all products; what the manifest says of the photons, None without counts."""
    recipe, products, photons = prepared.recipe, prepared.recipe.products, None

    def write(arrivals: PhotonTable, log: dict[str, Any]) -> dict[str, Any]:
        kept = {"with_origins": products.truth, "keeps_frames": products.frames}
        return log | write_counts(capture, recipe.sensor, arrivals, out, **kept)

    if products.truth or products.view_truth:
        request = TruthRequest(products, recipe.analysis.z_mm, recipe.grid.errors is not None)
        with clock.stage("truth"):
            common.truth(
                out / TRUTH, lambda: write_truth(request, setup.render_scene, capture.rig, out, report)
            )
    if made is not None and made.thins:
        with clock.stage("photons"):
            photons = write(*thin(capture, setup, made, report))
    renders = made is not None and photons is None
    views = RenderedViews(
        capture.rig,
        recipe.sensor,
        recipe.exposure,
        products.radiance,
        made.samples if made is not None and renders else recipe.render.samples_per_pixel,
        None if renders else recipe.render.background_samples_per_pixel,
        capture.seed,
        out,
        are_for_counts=renders,
    )
    if products.radiance != "none" or renders:
        with clock.stage("radiance"):
            views.render(setup.render_scene, report)
    if made is not None and renders:
        with clock.stage("counts"):
            photons = write(*draw_from_views(capture, views.mosaic, views.variance, made, report))
    return photons
