"""From a recipe to a dataset folder: whose it is, the order of the work, and what datasets have in common."""

import json
import math
import os
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeVar

from pcii.base import (
    InputError,
    Report,
    locked,
    named_in_errors,
    new_folder_safely,
    silent,
    sweep_temporaries,
)
from pcii.store import (
    ARRAYS,
    COUNTS,
    DATASET_FOLDER,
    MANIFEST,
    MARKER,
    PHOTON_TRUTH,
    RADIANCE,
    TRUTH,
    DatasetManifest,
    check_size,
    list_files,
    nested_name,
    pack_arrays,
    read_listed,
)
from simgen.dataset.prepared import DECISIVE, Prepared, check_resources, other_dataset, prepare, versions
from simgen.dataset.rendered_views import (
    RENDERED,
    RenderedViews,
    background_paths_saved,
    draw_from_views,
    write_counts,
)
from simgen.photons import Capture, Plan, thin_photons
from simgen.renderer import RenderScene, backend
from simgen.sensor import PhotonTable
from simgen.spec import Recipe
from simgen.truth import traced_for_visibility, write_truth

Made = TypeVar("Made")

RGB_UNIT = "linear sRGB whose luminance is in cd/m^2"
SPECTRAL_UNIT = "cd/m^2 of light of 555 nm that gives as many photons to a pixel that detects them all"
MAX_REUSED_BYTES = 1 << 26
"""Larger folders are made anew rather than held in memory."""


class Reuse:
    """What datasets that are made one after another have in common, made once.

    The scene in the renderer, the truth, and the plan of the counts, the last of each kind, with the key of
    what it was made from (`Prepared`). None of it depends on which dataset is made first.
    """

    def __init__(self) -> None:
        self._last: dict[str, tuple[str, Any]] = {}

    def once(self, kind: str, key: str, make: Callable[[], Made]) -> Made:
        """The last thing of this kind if it has this key, else what `make` gives."""
        if self._last.get(kind, ("", None))[0] != key:
            self._last.pop(kind, None)  # before another as large is made
            self._last[kind] = key, make()
        return self._last[kind][1]

    def folder(self, key: str, folder: Path, make: Callable[[], None]) -> None:
        """See that `folder` exists: left as it is, or a copy of the last one of this key, or by `make`."""
        if folder.is_dir():
            return
        known, contents = self._last.get("folder", ("", {}))
        if known == key:
            with new_folder_safely(folder) as temporary:
                for name, content in contents.items():
                    (temporary / name).parent.mkdir(parents=True, exist_ok=True)
                    (temporary / name).write_bytes(content)
            return
        self._last.pop("folder", None)
        make()
        files = [file for file in folder.rglob("*") if file.is_file()]
        if sum(file.stat().st_size for file in files) <= MAX_REUSED_BYTES:
            self._last["folder"] = key, {str(file.relative_to(folder)): file.read_bytes() for file in files}


@contextmanager
def _timed(timings_s: dict[str, float], stage: str) -> Iterator[None]:
    """Add the wall seconds of the block to those of a stage."""
    start = time.perf_counter()
    yield
    timings_s[stage] = round(timings_s.get(stage, 0.0) + time.perf_counter() - start, 3)


def generate(recipe: Recipe, recipe_folder: Path, out: Path, report: Report = silent) -> DatasetManifest:
    """Make the dataset of `recipe` in the folder `out`; return its manifest.

    Scenes are looked up in `recipe_folder`. An unfinished dataset of the same recipe is resumed, a finished
    one is checked and left alone; a folder that holds anything else is refused with `InputError`.
    """
    prepared = prepare(recipe, recipe_folder)
    return find_finished(out, prepared.identity) or make(prepared, out, report, Reuse())


def make(prepared: Prepared, out: Path, report: Report, reuse: Reuse) -> DatasetManifest:
    """Make a dataset that is not finished yet; its manifest. See `generate` for what is refused.

    What it has in common with those made before with the same `reuse` is not made again. Raises
    `InputError` if another process is at it.
    """
    recipe, identity, timings_s = prepared.recipe, prepared.identity, dict[str, float]()
    engine, counting = backend.describe(spectral=recipe.is_spectral), None
    with named_in_errors(out), _claim(out, identity, engine) as marker:
        if (out / MANIFEST).is_file():  # another run has finished it since
            marker.unlink()
            return _read_whole(out, identity, content=True)
        check_resources(recipe, None, out, prepared.map_counts)
        with _timed(timings_s, "load"):  # before anything is written: a bad scene shows here
            capture = prepared.capture(reuse.once("scene", prepared.scene_key, prepared.render_scene))
        if recipe.products.counts:  # likewise: too much light
            with _timed(timings_s, "plan"):
                counting = reuse.once("plan", prepared.light_key, lambda: prepared.plan(capture))
                check_resources(recipe, counting, out, prepared.map_counts)
        sweep_temporaries(out)
        photons = _write_products(prepared, capture, counting, reuse, out, timings_s, report)
        shutil.rmtree(out / RENDERED, ignore_errors=True)
        with _timed(timings_s, "hash"):
            budgets = (None, *recipe.photons.nested)
            parts = [nested_name(part, budget) for part in (COUNTS, PHOTON_TRUTH) for budget in budgets]
            packed = [] if recipe.products.profile == "full" else pack_arrays(out, [TRUTH, *parts])
            files = list_files(out, [ARRAYS, TRUTH, *parts, RADIANCE])
        manifest = _description(prepared, capture.render_scene) | {
            "identity": identity,
            "backend": engine,
            "photons": photons,
            "skipped": _skipped(prepared, capture, photons, traced_for_visibility(out)),
            "timings_s": timings_s,
            "files": files,
        }
        if packed:
            manifest["packed"] = packed
        DATASET_FOLDER.write(out, manifest)
        marker.unlink()
    return DATASET_FOLDER.read(out)


def _write_products(
    prepared: Prepared,
    capture: Capture,
    counting: Plan | None,
    reuse: Reuse,
    out: Path,
    timings_s: dict[str, float],
    report: Report,
) -> dict[str, Any] | None:
    """Write all products; what the manifest says of the photons, None without counts."""
    recipe, photons = prepared.recipe, None
    products, sensor = recipe.products, recipe.sensor

    def write(arrivals: PhotonTable, log: dict[str, Any]) -> dict[str, Any]:
        options = {"with_origins": products.origins, "keeps_frames": products.frames}
        return log | write_counts(capture, sensor, arrivals, out, **options)

    def make_truth() -> None:
        planes_mm, has_errors = recipe.analysis.z_mm, recipe.grid.errors is not None
        write_truth(products, planes_mm, has_errors, capture.render_scene, capture.rig, out, report)

    if products.truth or products.view_truth:
        with _timed(timings_s, "truth"):
            reuse.folder(prepared.truth_key, out / TRUTH, make_truth)
    if counting is not None and counting.thins:
        with _timed(timings_s, "photons"):
            photons = write(*thin_photons(capture, counting, report))
    dense = None if counting is None or counting.thins else counting
    samples = None if dense is None else dense.samples
    views = RenderedViews(capture, sensor, recipe.exposure, products.radiance, recipe.render, samples, out)
    if products.radiance != "none" or dense is not None:
        with _timed(timings_s, "radiance"):
            views.render(report)
    if dense is not None:
        with _timed(timings_s, "counts"):
            photons = write(*draw_from_views(capture, views.view, dense, report))
    return photons


def _description(prepared: Prepared, render_scene: RenderScene) -> dict[str, Any]:
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
        "unscored": sorted(render_scene.unscored),
        "analysis": recipe.analysis.model_dump(mode="json"),
        "recipe": prepared.recipe_of_data,
        "scene": scene.model_dump(mode="json"),
        "versions": versions(),
    }


def _skipped(
    prepared: Prepared, capture: Capture, photons: dict[str, Any] | None, shadow_rays: int | None
) -> list[dict[str, Any]]:
    """What was not done: what, why, and how much work that saved, and its unit.

    `photons` is what the manifest says of them, `shadow_rays` how many were traced to count the cameras that
    see a point; both None if there was no such work.
    """
    recipe, products, render = prepared.recipe, prepared.recipe.products, prepared.recipe.render
    pixels = math.prod(recipe.grid.camera_grid().shape_KLHW)
    entries: list[dict[str, Any]] = []

    def add(what: str, why: str, saved: int, unit: str) -> None:
        entries.append({"what": what, "why": why, "saved": saved, "unit": unit})

    if photons is not None and photons.get("paths", 0) < photons.get("dense_paths_instead", 0):
        saved = photons["dense_paths_instead"] - photons["paths"]
        add("rendering for the photon counts", "photons are drawn one by one", saved, "light paths")
    is_dense = photons is not None and photons["method"] == "dense"
    if products.radiance == "none" and not is_dense:
        paths = pixels * render.samples_per_pixel
        add("radiance images", "the recipe does not ask for them", paths, "light paths")
    elif products.radiance == "mosaic" and recipe.cfa is not None:
        what = "two of three colours of the radiance images"
        add(what, "the Bayer pattern hides them", 8 * pixels, "bytes before compression")
    has_images = products.radiance != "none" and not is_dense
    if has_images and (saved := background_paths_saved(capture, render)):
        why = f"the recipe asks for {render.background_samples_per_pixel} per pixel there"
        add("samples where no object can be seen", why, saved, "light paths")
    if shadow_rays is not None:
        add("visibility of some points", "no shape can stand in the way", pixels - shadow_rays, "rays")
    elif products.truth:
        add("visibility", "the recipe does not ask for it", pixels, "rays at most")
    if not products.view_truth:
        add("truth of every view", "the recipe does not ask for it", pixels, "first hits")
    return entries


def find_finished(out: Path, identity: str, *, content: bool = True) -> DatasetManifest | None:
    """The manifest if `out` is this very dataset, finished and whole; None if it is still to do.

    Files are compared by their hashes, without `content` by their sizes. `InputError` for a file, or for a
    folder that holds anything else.
    """
    # In this order, since another run may finish it meanwhile: the manifest is there before the mark is gone.
    if DATASET_FOLDER.guard(out) <= {MARKER} or (out / MARKER).is_file():
        return None
    return _read_whole(out, identity, content=content)


def _read_whole(out: Path, identity: str, *, content: bool) -> DatasetManifest:
    """The manifest of a finished dataset; `InputError` if it is another one or a file is damaged."""
    manifest = DATASET_FOLDER.read(out)
    if manifest.identity != identity:
        raise other_dataset(out, "dataset", manifest.versions)
    check = read_listed if content else check_size
    for name, entry in manifest.files.items():
        check(out, name, entry)
    return manifest


@contextmanager
def _claim(out: Path, identity: str, engine: dict[str, Any]) -> Iterator[Path]:
    """Mark the folder as this recipe's unfinished dataset, and keep other runs out of it; the mark.

    If nothing was put into the folder before the block raises, the mark is removed, and what folders were
    made for it. Raises `InputError` at once if another process is making the dataset.
    """
    new = [folder for folder in (out, *out.parents) if not folder.exists()]
    marker = out / MARKER
    with locked(marker, out) as file:
        text = file.read()
        if text:
            _check_mark(marker, text, identity, engine)
        else:
            mark = {"identity": identity, "versions": versions(), "backend": engine}
            file.write(json.dumps(mark).encode())
            file.flush()
            os.fsync(file.fileno())
        try:
            yield marker
        except BaseException:
            with suppress(OSError):
                if [entry.name for entry in out.iterdir()] == [MARKER]:
                    marker.unlink()
                    for folder in new:
                        folder.rmdir()
            raise


def _check_mark(marker: Path, text: bytes, identity: str, engine: dict[str, Any]) -> None:
    """Raise `InputError` unless the mark is of the same recipe on the same backend."""
    decisive = ("variant", "mitsuba", "drjit")
    out = marker.parent
    try:
        mark = json.loads(text)
        known, before = mark["identity"], {key: mark["backend"][key] for key in decisive}
        recorded = {name: mark["versions"][name] for name in DECISIVE}
    except (ValueError, KeyError, TypeError):
        raise InputError(f"{marker}: damaged; delete the folder {out} to start again") from None
    if known != identity:
        raise other_dataset(out, "unfinished dataset", recorded)
    if before != {key: engine[key] for key in decisive}:
        raise InputError(
            f"{out}: was begun with {before['variant']}, and this machine now runs {engine['variant']}, "
            f"whose pixels differ; delete the folder {out} to start again, or set SIMGEN_BACKEND"
        )
