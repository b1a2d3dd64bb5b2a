"""From a recipe to a dataset folder: the order of the work, resuming, and the manifest."""

import hashlib
import json
import os
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from pcii.core.console import Report, silent
from pcii.core.errors import InputError
from pcii.core.safe_files import locked, sweep_temporaries
from pcii.io.dataset_layout import (
    COUNTS,
    FORMAT_VERSION,
    MANIFEST,
    MARKER,
    PHOTON_TRUTH,
    RADIANCE,
    REMEDY,
    TRUTH,
    nested_name,
    radiance_name,
    read_exr,
    read_manifest,
    write_exr_safely,
    write_manifest,
)
from pcii.io.sealed_json import check_file, hash_file, list_files
from simgen.base import random_streams as seeds
from simgen.base.asset_names import asset
from simgen.cameras.rig import rig_of
from simgen.dataset.prepared import Prepared, prepare
from simgen.dataset.resources import check_resources
from simgen.photons.photon_counting import Plan, draw_from_views, plan, thin, write_counts
from simgen.renderer import backend
from simgen.renderer.mitsuba_scene import RenderScene
from simgen.renderer.radiance import render_view
from simgen.sensor.detector import full_light_image
from simgen.sensor.exposure import photons_per_radiance
from simgen.sensor.mosaic import sense
from simgen.spec.recipe import Recipe
from simgen.spec.scene import Scene, scene_files
from simgen.truth.truth_file import traced_for_visibility, write_truth

RGB_UNIT = "linear sRGB whose luminance is in cd/m^2"
SPECTRAL_UNIT = "cd/m^2 of light of 555 nm that gives as many photons to a pixel that detects them all"
RENDERED = ".rendered"
"""Exact views that are no product in themselves; gone when the dataset is finished."""


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


def generate(recipe: Recipe, near: Path, out: Path, report: Report = silent) -> dict[str, Any]:
    """Make the dataset of `recipe` in the folder `out`; return its manifest.

    `near` is the recipe's folder, beside which scenes are looked up. An unfinished dataset of the
    same recipe is resumed, a finished one is checked and left alone; a folder that holds anything
    else is refused with `InputError`.
    """
    prepared = prepare(recipe, near)
    scene, identity = prepared.scene, _identity(prepared)
    finished = _finished(out, identity)
    if finished is not None:
        return finished
    check_resources(recipe, None, out)
    engine = backend.describe(spectral=recipe.is_spectral)
    clock, made = _Clock(), None
    with clock.stage("load"):  # before the folder is made: a bad scene shows here
        render_scene = prepared.render_scene()
    if recipe.products.counts:  # likewise: too much light
        with clock.stage("plan"):
            made = plan(recipe, render_scene, engine["kind"])
            check_resources(recipe, made, out)
    with _claimed(out, identity, engine) as marker:
        if (out / MANIFEST).is_file():  # another run has finished it since
            marker.unlink()
            return _whole(out, identity)
        sweep_temporaries(out)
        products, photons = recipe.products, None
        if products.truth or products.view_truth:
            with clock.stage("truth"):
                write_truth(recipe, render_scene, out, report)
        if made is not None and made.thins:
            with clock.stage("photons"):
                arrivals, photons = thin(recipe, render_scene, made, report)
                photons |= write_counts(recipe, arrivals, out)
        if products.radiance != "none" or (made is not None and not made.thins):
            with clock.stage("radiance"):
                _render_views(recipe, render_scene, made, out, report)
        if made is not None and not made.thins:
            with clock.stage("counts"):
                arrivals, photons = draw_from_views(recipe, _stored_mosaic(recipe, out), made, report)
                photons |= write_counts(recipe, arrivals, out)
        shutil.rmtree(out / RENDERED, ignore_errors=True)
        with clock.stage("hash"):
            budgets = (None, *recipe.photons.nested)
            parts = [nested_name(part, budget) for part in (COUNTS, PHOTON_TRUTH) for budget in budgets]
            files = list_files(out, [TRUTH, *parts, RADIANCE])
        manifest = _manifest(recipe, scene, render_scene, engine, identity) | {
            "photons": photons,
            "skipped": _skipped(recipe, made, photons, traced_for_visibility(out)),
            "timings_s": clock.seconds,
            "files": files,
        }
        write_manifest(out, manifest)
        marker.unlink()
    return read_manifest(out)


def _identity(prepared: Prepared) -> str:
    """Hash of all that decides the dataset's content, but for the machine."""
    scene, folder, curves = prepared.scene, prepared.folder, prepared.curves
    assets = {str(name): asset(folder, name, where) for where, name in scene_files(scene)}
    content = {
        "recipe": prepared.recipe.model_dump(mode="json"),
        "scene": scene.model_dump(mode="json"),
        "assets": {name: hash_file(path) for name, path in sorted(assets.items())},
        "sensitivities": None if curves is None else curves.tolist(),
        "format_version": FORMAT_VERSION,
    }
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _finished(out: Path, identity: str) -> dict[str, Any] | None:
    """The manifest if `out` is this very dataset, finished and whole; None if it is still to do."""
    if out.exists() and not out.is_dir():
        raise InputError(f"{out}: this is a file; name a folder for the dataset")
    if not out.is_dir() or not any(out.iterdir()) or (out / MARKER).is_file():
        return None
    if not (out / MANIFEST).is_file():
        raise InputError(f"{out}: holds something else; name a new or empty folder")
    return _whole(out, identity)


def _whole(out: Path, identity: str) -> dict[str, Any]:
    """The manifest of a finished dataset; `InputError` if it is another one or a file is damaged."""
    manifest = read_manifest(out)
    if manifest.get("identity") != identity:
        raise InputError(f"{out}: holds the dataset of another recipe or scene; name a new or empty folder")
    for name, entry in manifest["files"].items():
        check_file(out, name, entry, f"{REMEDY}, after deleting {out}", content=True)
    return manifest


@contextmanager
def _claimed(out: Path, identity: str, engine: dict[str, Any]) -> Iterator[Path]:
    """Mark the folder as this recipe's unfinished dataset, and keep other runs out of it; the mark."""
    out.mkdir(parents=True, exist_ok=True)
    marker = out / MARKER
    try:
        with locked(marker, wait=False) as file:
            text = file.read()
            if text:
                _check_begun(marker, text, identity, engine)
            else:
                file.write(json.dumps({"identity": identity, "backend": engine}).encode())
                file.flush()
                os.fsync(file.fileno())
            yield marker
    except BlockingIOError:
        raise InputError(f"{out}: another run is writing this dataset") from None


def _check_begun(marker: Path, text: bytes, identity: str, engine: dict[str, Any]) -> None:
    """Raise `InputError` unless the dataset was begun for the same recipe on the same backend."""
    decisive = ("variant", "mitsuba", "drjit")
    try:
        begun = json.loads(text)
        known, before = begun["identity"], {key: begun["backend"][key] for key in decisive}
    except (ValueError, KeyError, TypeError):
        raise InputError(f"{marker}: damaged; delete the folder {marker.parent} to start again") from None
    if known != identity:
        raise InputError(
            f"{marker.parent}: holds the unfinished dataset of another recipe or scene; "
            "name a new or empty folder"
        )
    if before != {key: engine[key] for key in decisive}:
        raise InputError(
            f"{marker.parent}: was begun with {before['variant']}, and this machine now runs "
            f"{engine['variant']}, whose pixels differ; delete the folder {marker.parent} to start again, "
            "or set SIMGEN_BACKEND"
        )


def _render_views(
    recipe: Recipe, render_scene: RenderScene, made: Plan | None, out: Path, report: Report
) -> None:
    """Radiance of every view that is not on disk yet."""
    rig, light = rig_of(recipe), recipe.sensor.full_light
    grid = rig.grid
    samples = recipe.render.samples_per_pixel if made is None or made.thins else made.samples
    for done, (k, l) in enumerate(np.ndindex(grid.rows, grid.cols), start=1):
        number, rendered = k * grid.cols + l, out / _rendered_name(recipe, k, l)
        if not rendered.is_file():
            image = render_view(
                render_scene,
                rig,
                k,
                l,
                samples_per_pixel=samples,
                seed=seeds.integer(recipe.seed, view=number, stage="radiance"),
            )
            whole = recipe.products.radiance == "rgb"
            write_exr_safely(rendered, image if whole else sense(image, recipe.cfa)[..., None])
        if light is not None and recipe.products.radiance != "none":
            assert recipe.exposure is not None
            told = full_light_image(
                read_exr(rendered),
                recipe.cfa,
                photons_per_radiance(recipe.exposure, grid.pixel_mm),
                recipe.sensor,
                seeds.generator(recipe.seed, view=number, stage="full light"),
            )
            write_exr_safely(out / radiance_name(k, l), told)
        report("views", done, grid.view_count)


def _rendered_name(recipe: Recipe, k: int, l: int) -> str:
    """Where a view's exact radiance is kept while the dataset is made; in the end, if it is a product."""
    exact = recipe.products.radiance != "none" and recipe.sensor.full_light is None
    return radiance_name(k, l) if exact else radiance_name(k, l).replace(RADIANCE, RENDERED, 1)


def _stored_mosaic(recipe: Recipe, out: Path) -> Callable[[int, int], np.ndarray]:
    """Reads what the sensor's pixels see of each rendered view, (H, W)."""

    def mosaic_of(k: int, l: int) -> np.ndarray:
        image = read_exr(out / _rendered_name(recipe, k, l))
        return sense(image, recipe.cfa) if image.shape[2] == 3 else image[..., 0]

    return mosaic_of


def _skipped(
    recipe: Recipe, made: Plan | None, photons: dict[str, Any] | None, shadow_rays: int | None
) -> list[str]:
    """What was not done, why, and what that saved."""
    grid = recipe.grid.camera_grid()
    pixels = grid.view_count * grid.height * grid.width
    skipped = []
    if photons is not None and photons.get("paths", 0) < photons.get("dense_paths_instead", 0):
        skipped.append(
            f"rendering for the photon counts: {photons['paths']} light paths instead of "
            f"{photons['dense_paths_instead']}"
        )
    if recipe.products.radiance == "none" and (made is None or made.thins):
        paths = pixels * recipe.render.samples_per_pixel
        skipped.append(f"radiance images: the recipe does not ask for them; saved {paths} light paths")
    elif recipe.products.radiance == "mosaic" and recipe.cfa is not None:
        skipped.append(
            "two of three colours of the radiance images: the Bayer pattern hides them; saved "
            f"{8 * pixels} bytes before compression"
        )
    if shadow_rays is not None:
        skipped.append(
            f"visibility where no shape can stand in the way: {shadow_rays} rays instead of {pixels}"
        )
    elif recipe.products.truth:
        skipped.append(f"visibility: the recipe does not ask for it; saved up to {pixels} rays")
    if not recipe.products.view_truth:
        skipped.append(f"truth of every view: the recipe does not ask for it; saved {pixels} first hits")
    return skipped


def _manifest(
    recipe: Recipe,
    scene: Scene,
    render_scene: RenderScene,
    engine: dict[str, Any],
    identity: str,
) -> dict[str, Any]:
    """What the manifest says of the recipe, the scene and the software."""
    channels = 3 if render_scene.filters is None else len(render_scene.filters.sensitivity)
    return {
        "identity": identity,
        "title": recipe.title or scene.title,
        "grid": asdict(recipe.grid.camera_grid()),
        "cfa": recipe.cfa,
        "radiance_channels": {"none": None, "mosaic": 1, "rgb": channels}[recipe.products.radiance],
        "radiance_unit": SPECTRAL_UNIT if recipe.is_spectral else RGB_UNIT,
        "objects": {str(number): name for number, name in render_scene.names.items()},
        "analysis": recipe.analysis.model_dump(mode="json"),
        "recipe": recipe.model_dump(mode="json"),
        "scene": scene.model_dump(mode="json"),
        "backend": engine,
        "versions": {name: version(name) for name in ("photon-integral-imaging", "numpy", "zarr")},
    }
