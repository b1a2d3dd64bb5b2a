"""From a recipe to a dataset folder: the order of the work, resuming, and the manifest."""

import fcntl
import hashlib
import json
import os
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from pcii.console import Report, silent
from pcii.errors import InputError
from pcii.store import (
    COUNTS,
    FORMAT,
    FORMAT_VERSION,
    MANIFEST,
    PHOTON_TRUTH,
    RADIANCE,
    TRUTH,
    check_file,
    hash_file,
    list_files,
    radiance_name,
    read_exr,
    read_manifest,
    sweep_temporaries,
    write_arrays_safely,
    write_exr_safely,
    write_json_safely,
)
from pcii.types import PhotonCounts
from simgen import backend, seeds
from simgen.build import Built, build
from simgen.candidates import Setup
from simgen.photons import draw_photons
from simgen.recipe import Recipe
from simgen.render import render_view
from simgen.scene import Scene, load_scene
from simgen.sensor import draw_counts, fixed_totals, photon_rates, scope_energies, sense
from simgen.truth import first_hits_at_centre, first_hits_of_view

MARKER = ".unfinished.json"
CROSSOVER_PHOTONS_PER_PIXEL = 0.5
"""With more light than this a dense render costs less than a path or three for every photon."""


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
    scene, folder = load_scene(recipe.scene, near)
    identity = _identity(recipe, scene, folder)
    finished = _finished(out, identity)
    if finished is not None:
        return finished
    engine = backend.describe()
    clock = _Clock()
    with clock.stage("load"):  # before the folder is made: a bad scene shows here
        built = build(backend.load(), scene, folder, recipe.render.max_depth)
    with _claimed(out, identity, engine):
        sweep_temporaries(out)
        if recipe.products.truth or recipe.products.view_truth:
            with clock.stage("truth"):
                _write_truth(recipe, built, out, report)
        thins = recipe.products.counts and thinning_pays(recipe, engine["kind"])
        photons = None
        if thins:
            with clock.stage("photons"):
                photons = _write_thinned(recipe, built, out)
        if recipe.products.radiance != "none" or (recipe.products.counts and not thins):
            with clock.stage("radiance"):
                _render_views(recipe, built, out, report)
        if recipe.products.counts and not thins:
            with clock.stage("counts"):
                photons = _write_counts(recipe, out, report)
        manifest = _manifest(recipe, scene, built, engine, identity, clock, photons)
        if recipe.products.radiance == "none":
            shutil.rmtree(out / RADIANCE, ignore_errors=True)
        with clock.stage("hash"):
            manifest["files"] = list_files(out, [TRUTH, PHOTON_TRUTH, COUNTS, RADIANCE])
        manifest["timings_s"] = clock.seconds
        write_json_safely(out / MANIFEST, manifest)
        (out / MARKER).unlink()
    return manifest


def verify(path: Path, report: Report = silent) -> int:
    """Compare every file of a dataset with its manifest; the number of files. Raises `InputError`."""
    files = read_manifest(path)["files"]
    for done, (name, entry) in enumerate(files.items(), start=1):
        check_file(path, name, entry, content=True)
        report("verify", done, len(files))
    return len(files)


def _identity(recipe: Recipe, scene: Scene, folder: Path) -> str:
    """Hash of all that decides the dataset's content, but for the machine."""
    assets = {thing.material.texture for thing in scene.objects}
    assets |= {getattr(thing.shape, "file", None) for thing in scene.objects}
    content = {
        "recipe": recipe.model_dump(mode="json"),
        "scene": scene.model_dump(mode="json"),
        "assets": {name: hash_file(folder / name) for name in sorted(filter(None, assets))},
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
    manifest = read_manifest(out)
    if manifest.get("identity") != identity:
        raise InputError(f"{out}: holds the dataset of another recipe or scene; name a new or empty folder")
    for name, entry in manifest["files"].items():
        try:
            check_file(out, name, entry, content=True)
        except InputError as fault:
            raise InputError(f"{fault}, after deleting {out}") from None
    return manifest


@contextmanager
def _claimed(out: Path, identity: str, engine: dict[str, Any]) -> Iterator[None]:
    """Mark the folder as this recipe's unfinished dataset, and keep other runs out of it."""
    out.mkdir(parents=True, exist_ok=True)
    marker = out / MARKER
    mine = {"identity": identity, "backend": engine}
    with (out / MARKER).open("a+", encoding="utf-8") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise InputError(f"{out}: another run is writing this dataset") from None
        file.seek(0)
        text = file.read()
        if text:
            try:
                begun = json.loads(text)
            except ValueError:
                raise InputError(f"{marker}: damaged; delete the folder to start again") from None
            if begun.get("identity") != identity:
                raise InputError(
                    f"{out}: holds the unfinished dataset of another recipe or scene; "
                    "name a new or empty folder"
                )
            decisive = ("variant", "mitsuba", "drjit")
            if any(begun["backend"][key] != engine[key] for key in decisive):
                raise InputError(
                    f"{out}: was begun with {begun['backend']['variant']}, and this machine now "
                    f"runs {engine['variant']}, whose pixels differ; delete {marker.name}'s folder "
                    "to start again, or set SIMGEN_BACKEND"
                )
        else:
            file.write(json.dumps(mine))
            file.flush()
            os.fsync(file.fileno())
        yield


def _write_truth(recipe: Recipe, built: Built, out: Path, report: Report) -> None:
    if (out / TRUTH).is_dir():
        return
    grid = recipe.grid.camera_grid()
    K, L, H, W = grid.shape_KLHW
    arrays: dict[str, np.ndarray] = {}
    if recipe.products.truth:
        centre = first_hits_at_centre(built, grid)
        arrays |= {"z_mm": centre.z_mm, "object_id": centre.object_id}
    if recipe.products.view_truth:
        z = arrays["view_z_mm"] = np.empty((K, L, H, W), np.float32)
        ids = arrays["view_object_id"] = np.empty((K, L, H, W), np.int16)
        for done, (k, l) in enumerate(np.ndindex(K, L), start=1):
            hits = first_hits_of_view(built, grid, k, l)
            z[k, l], ids[k, l] = hits.z_mm, hits.object_id
            report("truth of views", done, K * L)
    write_arrays_safely(out / TRUTH, arrays, {"z_mm": "planar depth in mm, +inf for a miss"})


def _render_views(recipe: Recipe, built: Built, out: Path, report: Report) -> None:
    """Radiance of every view that is not on disk yet."""
    grid = recipe.grid.camera_grid()
    colour = recipe.products.radiance == "rgb"
    for done, (k, l) in enumerate(np.ndindex(grid.rows, grid.cols), start=1):
        path = out / radiance_name(k, l)
        if not path.is_file():
            image = render_view(
                built,
                grid,
                k,
                l,
                samples_per_pixel=recipe.render.samples_per_pixel,
                seed=seeds.integer(recipe.seed, view=k * grid.cols + l, stage="radiance"),
            )
            kept = image if colour else sense(image, recipe.cfa)[..., None]
            write_exr_safely(path, kept)
        report("views", done, grid.view_count)


def thinning_pays(recipe: Recipe, kind: str) -> bool:
    """Whether photons are drawn one by one (see `photons`) rather than from rendered pixels."""
    grid, photons = recipe.grid, recipe.photons
    scopes = {"view": 1.0, "channel": 3.0 if recipe.cfa else 1.0, "scene": 1 / (grid.rows * grid.cols)}
    per_view = photons.budget * scopes[photons.scope]
    sparse = per_view <= CROSSOVER_PHOTONS_PER_PIXEL * grid.height * grid.width
    return kind != "scalar" and sparse


def _write_thinned(recipe: Recipe, built: Built, out: Path) -> dict[str, Any]:
    """Draw the photons of all views one by one and write them with where each came from."""
    grid, cfa = recipe.grid.camera_grid(), recipe.cfa
    setup = Setup(built, grid, cfa, recipe.render.max_depth)
    drawn = draw_photons(setup, recipe.photons, seed=recipe.seed)
    ones = np.ones(drawn.k.size, dtype=np.int64)
    counts = PhotonCounts.from_events(drawn.k, drawn.l, drawn.i, drawn.j, ones, grid, cfa=cfa)
    _save_events(out, counts)
    if recipe.products.truth:
        # Both lists are ordered by (k, l, i, j), so photon follows photon of the events.
        provenance = {"object_id": drawn.object_id, "z_mm": drawn.z_mm}
        write_arrays_safely(out / PHOTON_TRUTH, provenance, {"z_mm": "planar depth in mm"})
    dense = grid.view_count * grid.height * grid.width * recipe.render.samples_per_pixel
    return drawn.log | {
        "total": counts.total,
        "pixels_with_photons": int(counts.events.n.size),
        "normaliser_standard_error": 0.0,
        "dense_paths_instead": dense,
    }


def _save_events(out: Path, counts: PhotonCounts) -> None:
    index = np.uint16 if max(counts.grid.shape_KLHW) <= 1 << 16 else np.uint32
    small = {name: getattr(counts.events, name).astype(index) for name in "klij"}
    arrays = {**small, "n": counts.events.n}
    write_arrays_safely(out / COUNTS, arrays, {"layout": "events"})


def _write_counts(recipe: Recipe, out: Path, report: Report) -> dict[str, Any]:
    """Draw the photons of all views and write them; what the manifest says of them."""
    grid, cfa, photons = recipe.grid.camera_grid(), recipe.cfa, recipe.photons

    def raw(k: int, l: int) -> np.ndarray:
        image = read_exr(out / radiance_name(k, l))
        return sense(image, cfa) if image.shape[2] == 3 else image[..., 0]

    views = list(np.ndindex(grid.rows, grid.cols))
    energies = np.array([scope_energies(raw(k, l), cfa, photons.scope) for k, l in views])
    dark = int((energies <= 0).all(axis=1).sum())
    normalisers = np.tile(energies.sum(axis=0), (len(views), 1)) if photons.scope == "scene" else energies
    totals = fixed_totals(photons, energies, seeds.generator(recipe.seed, view=0, stage="totals"))
    columns: list[list[np.ndarray]] = []
    for done, (k, l) in enumerate(views, start=1):
        number = done - 1
        rates = photon_rates(raw(k, l), cfa, photons, normalisers[number])
        rng = seeds.generator(recipe.seed, view=number, stage="photons")
        counts = draw_counts(rates, cfa, rng, None if totals is None else totals[number])
        i, j = np.nonzero(counts)
        columns.append([np.full(i.size, k), np.full(i.size, l), i, j, counts[i, j]])
        report("counts", done, len(views))
    k, l, i, j, n = (np.concatenate(part) for part in zip(*columns, strict=True))
    made = PhotonCounts.from_events(k, l, i, j, n, grid, cfa=cfa)
    _save_events(out, made)
    return {
        "method": "dense",
        "total": made.total,
        "pixels_with_photons": int(made.events.n.size),
        "views_without_light": dark,
    }


def _manifest(
    recipe: Recipe,
    scene: Scene,
    built: Built,
    engine: dict[str, Any],
    identity: str,
    clock: _Clock,
    photons: dict[str, Any] | None,
) -> dict[str, Any]:
    skipped = []
    if photons is not None and photons["method"] == "thinning":
        skipped.append(
            f"rendering for the photon counts: {photons['paths']} paths instead of "
            f"{photons['dense_paths_instead']}"
        )
    if recipe.products.radiance == "none":
        skipped.append("radiance images: the recipe does not ask for them")
    if not recipe.products.view_truth:
        skipped.append("truth of every view: the recipe does not ask for it")
    if recipe.products.radiance != "rgb" and recipe.cfa is not None:
        skipped.append("two of three colours of every pixel: the Bayer pattern hides them")
    return {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "identity": identity,
        "title": recipe.title or scene.title,
        "grid": asdict(recipe.grid.camera_grid()),
        "cfa": recipe.cfa,
        "radiance_channels": {"none": None, "mosaic": 1, "rgb": 3}[recipe.products.radiance],
        "radiance_unit": "linear sRGB whose luminance is in cd/m^2",
        "objects": {str(number): name for number, name in built.names.items()},
        "analysis": recipe.analysis.model_dump(mode="json"),
        "recipe": recipe.model_dump(mode="json"),
        "scene": scene.model_dump(mode="json"),
        "backend": engine,
        "versions": {name: version(name) for name in ("photon-integral-imaging", "numpy", "zarr")},
        "photons": photons,
        "skipped": skipped,
        "timings_s": clock.seconds,
        "files": {},
    }
