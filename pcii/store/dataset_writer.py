"""Datasets written from images and truth in memory: whole folders that `open_dataset` opens."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base.errors import InputError
from pcii.base.safe_files import named_in_errors, replace_folder, temporary_folder
from pcii.store.dataset import Dataset, open_dataset
from pcii.store.dataset_layout import (
    COUNTS,
    DATASET_FOLDER,
    FRAME,
    PHOTON_TRUTH,
    RADIANCE,
    REMEDY,
    TRUTH,
    radiance_name,
    read_manifest,
    write_exr_safely,
    write_manifest,
)
from pcii.store.file_list import check_files, list_files
from pcii.store.given_truth import (
    as_stored,
    check_origins,
    check_texts,
    check_truth,
    checked_depths,
    stored_maps,
)
from pcii.store.hashes import hash_json
from pcii.store.software import PACKAGE, versions
from pcii.store.zarr_groups import DTYPES, write_arrays_safely
from pcii.types.array_labels import COUNTS_LABELS, PHOTON_TRUTH_LABELS, TRUTH_LABELS
from pcii.types.arrays import MOST_DEPTHS, check_z_mm
from pcii.types.images import Views
from pcii.types.photon_counts import PhotonCounts
from pcii.types.truth import Truth

DENSE_SHARE = 1 / 16
"""Dense counts of a larger share of occupied pixels are written dense: events would take more bytes."""
LARGEST_BUDGET = 1 << 53
"""Of larger whole numbers doubles, and so JSON, no longer hold every one."""


def save_dataset(
    path: str | Path,
    images: PhotonCounts | Views | Sequence[PhotonCounts | Views],
    truth: Truth | None = None,
    *,
    view_z_mm: np.ndarray | None = None,
    z_mm: object = None,
    z_range_mm: tuple[float, float] | None = None,
    photon_budget: float | None = None,
    radiance_unit: str | None = None,
    title: str | None = None,
    licence: str | None = None,
    citation: str | None = None,
    origin: str | None = None,
) -> Dataset:
    """Write a dataset folder of photon counts, of radiance, or of both, and return it opened.

    `images` is `PhotonCounts`, `Views`, or a pair of them of the same cameras and Bayer pattern; full-colour
    views go with mosaic counts. `truth` is of the virtual centre; its `photons`, if known, are in the order
    of the counts' events; `view_z_mm` (K, L, H, W) is the true planar depth of every view, +inf where nothing
    is hit, stored as float32. `z_mm` and `z_range_mm` (near, far) are depths to look at, suggested to
    `pcii run` and others. `photon_budget`, if it is known, is how many photons were expected in each view,
    and `radiance_unit` what numbers of radiance are. `title`, `licence`, `citation` and `origin` (where the
    images come from) are shown in reports.

    The folder is complete or is not there. Its identity is a hash of the content of its files, the grid and
    the objects' names; a folder that holds this very dataset keeps its files, and takes over a new budget,
    new suggested depths and texts. Raises `InputError` for a folder that holds anything else, before anything
    is written, and for parts that do not belong together.

    >>> from tempfile import TemporaryDirectory
    >>> from pcii.types.camera_grid import CameraGrid
    >>> grid = CameraGrid(rows=1, cols=2, pitch_mm=(5, 5), focal_mm=50, pixel_mm=0.05, height=4, width=6)
    >>> counts = PhotonCounts.from_dense(np.ones(grid.shape_KLHW, dtype=int), grid)
    >>> with TemporaryDirectory() as folder:
    ...     save_dataset(Path(folder) / "mine", counts, z_mm=500, title="Two views").counts.total
    48
    """
    counts, views = _counts_and_views(images)
    analysis = _analysis(z_mm, z_range_mm)
    if photon_budget is not None:
        photon_budget = check_budget(photon_budget)
        if counts is None:
            raise InputError("photon_budget: is of photon counts, and these images are radiance alone")
    texts = {"title": title, "licence": licence, "citation": citation, "origin": origin}
    if radiance_unit is not None:
        texts["radiance_unit"] = radiance_unit
    check_texts(texts)
    if truth is not None:
        check_truth(truth, counts or views)
    if view_z_mm is not None:
        view_z_mm = checked_depths(view_z_mm, counts or views)
    out = Path(path).absolute()
    with named_in_errors(out):
        held_dataset(out, None, content=False)
        out.parent.mkdir(parents=True, exist_ok=True)
        with temporary_folder(out) as new:
            _write_parts(new, counts, views, truth, view_z_mm)
            manifest = _content(new, counts, views, truth)
            software = versions(PACKAGE, "numpy", "zarr")
            told = {"analysis": analysis, "photon_budget": photon_budget, "versions": software}
            write_manifest(new, texts | manifest | told)
            held = held_dataset(out, manifest["identity"])
            if held is None:
                replace_folder(new, out)
            elif held != read_manifest(new):
                write_manifest(out, read_manifest(new))
    return open_dataset(path)


def _write_parts(
    folder: Path,
    counts: PhotonCounts | None,
    views: Views | None,
    truth: Truth | None,
    view_z_mm: np.ndarray | None,
) -> None:
    if counts is not None:
        write_counts(folder / COUNTS, counts)
    if views is not None:
        _write_radiance(folder, views)
    maps = {} if truth is None else stored_maps(truth)
    if view_z_mm is not None:
        maps["view_z_mm"] = view_z_mm
    if maps:
        write_arrays_safely(folder / TRUTH, maps, TRUTH_LABELS)
    if truth is not None and truth.photons is not None:
        check_origins(truth.photons, counts)
        ids = np.asarray(truth.photons.object_id).astype(np.int32)
        write_photon_truth(folder / PHOTON_TRUTH, ids, as_stored(truth.photons.z_mm))


def write_counts(folder: Path, counts: PhotonCounts) -> None:
    """Write photon counts as a group of arrays: as events, or dense where many pixels have photons."""
    if counts.frame is None and not counts.is_sparse and counts.occupied_share > DENSE_SHARE:
        dense = counts.dense
        dtype = np.min_scalar_type(dense.max(initial=0))
        small = dense.astype(dtype if dtype.name in DTYPES else np.int64)
        write_arrays_safely(folder, {"dense": small}, COUNTS_LABELS)
        return
    index = np.uint16 if max(counts.grid.shape_KLHW) <= 1 << 16 else np.uint32
    pixels = {name: getattr(counts.events, name).astype(index) for name in "klij"}
    if counts.frame is not None:
        number = np.uint16 if counts.readout.frames <= 1 << 16 else np.uint32
        pixels[FRAME] = counts.frame.astype(number)
    write_arrays_safely(folder, {**pixels, "n": counts.events.n}, COUNTS_LABELS)


def write_photon_truth(folder: Path, object_id: np.ndarray, z_mm: np.ndarray) -> None:
    """Write the origins (N,) of all photons, in the order of the events of their counts."""
    write_arrays_safely(folder, {"object_id": object_id, "z_mm": z_mm}, PHOTON_TRUTH_LABELS)


def held_dataset(out: Path, identity: str | None, *, content: bool = True) -> dict[str, Any] | None:
    """The manifest of the finished dataset in the folder `out`; None if there is no folder, or an empty one.

    Its files are compared by their hashes, without `content` by their sizes. Raises `InputError` for a file,
    a folder that holds anything else, a dataset of another `identity` (if that is given), or a damaged one.
    """
    if not DATASET_FOLDER.guard(out):
        return None
    manifest = read_manifest(out)
    if identity is not None and manifest.get("identity") != identity:
        found = "the dataset of other images, or of another recipe or scene"
        raise InputError(f"{out}: holds {found}; name a new or empty folder")
    check_held(out, manifest, content=content)
    return manifest


def check_held(out: Path, manifest: Mapping[str, Any], *, content: bool) -> None:
    """Raise `InputError` for a listed file that is missing or has another size, or, if `content`, hash.

    The folder has to be deleted, since what is in it is kept as long as it is there.
    """
    check_files(out, manifest["files"], f"{REMEDY}, after deleting {out}", content=content)


def _counts_and_views(images: object) -> tuple[PhotonCounts | None, Views | None]:
    """Counts and views among the images; `InputError` if there is neither, or they do not go together."""
    given = images if isinstance(images, tuple | list) else [images]
    counts = [one for one in given if isinstance(one, PhotonCounts)]
    views = [one for one in given if isinstance(one, Views)]
    if len(counts) + len(views) != len(given) or not given or len(counts) > 1 or len(views) > 1:
        kinds = ", ".join(type(one).__name__ for one in given) or "nothing"
        raise InputError(f"images: expected PhotonCounts, Views, or one of each, got {kinds}")
    if not counts:
        return None, views[0]
    if not views:
        return counts[0], None
    (seen,), (light,) = counts, views
    if seen.grid != light.grid:
        raise InputError("images: the photon counts and the views are of different camera grids")
    if light.radiance.shape[4] == 1 and light.cfa != seen.cfa:
        raise InputError(
            f"images: the views are of the Bayer pattern {light.cfa}, the counts of {seen.cfa}; "
            "give both the same cfa"
        )
    return seen, light


def _analysis(z_mm: object, z_range_mm: object) -> dict[str, Any]:
    """Suggested depths as the manifest has them; `InputError` for depths that cannot be."""
    found: dict[str, Any] = {}
    if z_mm is not None:
        found["z_mm"] = check_z_mm(z_mm).tolist()
        if len(found["z_mm"]) > MOST_DEPTHS:
            raise InputError(f"z_mm: expected at most {MOST_DEPTHS} depths, got {len(found['z_mm'])}")
    if z_range_mm is not None:
        found["z_range_mm"] = check_depth_range(z_range_mm)
    return found


def check_depth_range(z_range_mm: object) -> list[float]:
    """The nearest and farthest depth in mm; raises `InputError` for anything else."""
    try:
        near, far = check_z_mm(z_range_mm)
    except (InputError, ValueError):
        near, far = 1, 0
    if not near < far:
        raise InputError(f"z_range_mm: expected two depths in mm, near and far, got {z_range_mm!r}")
    return [float(near), float(far)]


def check_budget(photon_budget: object) -> float:
    """The expected photons of a view; raises `InputError` for what is no number from 0 to 2^53."""
    number = photon_budget if isinstance(photon_budget, int | float | np.integer | np.floating) else 0
    if not 0 < number <= LARGEST_BUDGET:
        raise InputError(f"photon_budget: expected photons, above 0 and up to 2^53, got {photon_budget!r}")
    return float(number)


def _write_radiance(root: Path, views: Views) -> None:
    for k, l in np.ndindex(views.grid.rows, views.grid.cols):
        with np.errstate(over="ignore"):
            image = views.view(k, l).astype(np.float32)
        if not np.isfinite(image).all():
            raise InputError(f"radiance: view ({k}, {l}) is too bright for float32")
        write_exr_safely(root / radiance_name(k, l), image)


def _content(
    root: Path, counts: PhotonCounts | None, views: Views | None, truth: Truth | None
) -> dict[str, Any]:
    """What the manifest says of the data, and the identity: a hash of all of that."""
    images = counts or views
    assert images is not None
    content: dict[str, Any] = {
        "grid": asdict(images.grid),
        "cfa": images.cfa,
        "radiance_channels": None if views is None else views.radiance.shape[4],
        "objects": {} if truth is None else {str(key): name for key, name in truth.names.items()},
        "files": list_files(root, [COUNTS, TRUTH, PHOTON_TRUTH, RADIANCE]),
    }
    if counts is not None and not counts.readout.is_plain:
        content |= asdict(counts.readout)
    return {"identity": hash_json(content), **content}
