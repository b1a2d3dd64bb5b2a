"""Datasets written from images and truth in memory: whole folders that `open_dataset` opens."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base import InputError, named_in_errors, new_folder_safely
from pcii.store.dataset import (
    COUNTS,
    FRAME,
    PHOTON_TRUTH,
    RADIANCE,
    TRUTH,
    Dataset,
    open_dataset,
    radiance_name,
)
from pcii.store.folders import DATASET_FOLDER, DatasetManifest, check_free, hash_json, list_files, validated
from pcii.store.provenance import PACKAGE, versions
from pcii.store.stored_arrays import (
    COUNTS_LABELS,
    DTYPES,
    PHOTON_TRUTH_LABELS,
    TRUTH_LABELS,
    write_arrays_safely,
    write_exr_safely,
)
from pcii.types import OPTIONAL_MAPS, PhotonCounts, PhotonTruth, Truth, Views, check_depth_range, check_z_mm

DENSE_SHARE = 1 / 16
"""Dense counts of a larger share of occupied pixels are written dense: events would take more bytes."""


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

    The folder, which must be new or empty, is complete or is not there. Its identity is a hash of the content
    of its files, the grid, and the objects' names and which of them count in no score. Raises `InputError`
    for parts that do not belong together.

    >>> from tempfile import TemporaryDirectory
    >>> from pcii.types import CameraGrid
    >>> grid = CameraGrid(rows=1, cols=2, pitch_mm=(5, 5), focal_mm=50, pixel_mm=0.05, height=4, width=6)
    >>> counts = PhotonCounts.from_dense(np.ones(grid.shape_KLHW, dtype=int), grid)
    >>> with TemporaryDirectory() as folder:
    ...     save_dataset(Path(folder) / "mine", counts, z_mm=500, title="Two views").counts.total
    48
    """
    counts, views = _counts_and_views(images)
    if photon_budget is not None and counts is None:
        raise InputError("photon_budget: is for images that are photon counts")
    stated: dict[str, Any] = {"title": title, "licence": licence, "citation": citation, "origin": origin}
    if radiance_unit is not None:
        stated["radiance_unit"] = radiance_unit
    maps = _stored_maps(truth, view_z_mm, counts or views)
    analysis: dict[str, Any] = {} if z_mm is None else {"z_mm": check_z_mm(z_mm).tolist()}
    if z_range_mm is not None:
        analysis["z_range_mm"] = list(check_depth_range(z_range_mm))
    out = Path(path).absolute()
    check_free(out, "dataset")
    with named_in_errors(out):
        out.parent.mkdir(parents=True, exist_ok=True)
        with new_folder_safely(out) as new:
            if counts is not None:
                write_counts(new / COUNTS, counts)
            if views is not None:
                _write_radiance(new, views)
            if maps:
                write_arrays_safely(new / TRUTH, maps, TRUTH_LABELS)
            if truth is not None and truth.photons is not None:
                _write_origins(new / PHOTON_TRUTH, truth.photons, counts)
            manifest = stated | _content(new, counts, views, truth)
            manifest |= {"analysis": analysis, "photon_budget": photon_budget and float(photon_budget)}
            manifest |= {"versions": versions(PACKAGE, "numpy", "zarr")}
            validated(DatasetManifest, manifest)
            DATASET_FOLDER.write(new, manifest)
    return open_dataset(path)


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


def _counts_and_views(images: object) -> tuple[PhotonCounts | None, Views | None]:
    """Counts and views among the images; `InputError` if there is neither, or they do not go together."""
    parts = images if isinstance(images, tuple | list) else [images]
    counts = next((part for part in parts if isinstance(part, PhotonCounts)), None)
    views = next((part for part in parts if isinstance(part, Views)), None)
    if not parts or (counts is not None) + (views is not None) != len(parts):
        kinds = ", ".join(type(part).__name__ for part in parts) or "nothing"
        raise InputError(f"images: expected PhotonCounts, Views, or one of each, got {kinds}")
    if counts is not None and views is not None:
        if counts.grid != views.grid:
            raise InputError("images: the photon counts and the views are of different camera grids")
        if views.radiance.shape[4] == 1 and counts.cfa != views.cfa:
            raise InputError(f"images: expected the same Bayer pattern, got {counts.cfa} and {views.cfa}")
    return counts, views


def _stored_maps(truth: Truth | None, view_z_mm: np.ndarray | None, images: Any) -> dict[str, np.ndarray]:
    """The maps as they are stored; `InputError` unless they are of the images' size."""
    maps = dict[str, np.ndarray]()
    if truth is not None:
        size = images.grid.shape_HW
        if not isinstance(truth, Truth) or truth.z_mm.shape != size or truth.object_id.dtype.kind not in "iu":
            raise InputError(f"truth: expected a Truth of depths and whole object ids of {size}")
        maps = {"z_mm": _as_stored(truth.z_mm), "object_id": truth.object_id.astype(np.int32)}
        optional = {name: getattr(truth, name) for name in OPTIONAL_MAPS}
        maps |= {name: array for name, array in optional.items() if array is not None}
    if view_z_mm is not None:
        shape, depths = images.grid.shape_KLHW, np.asarray(view_z_mm)
        if depths.shape != shape or depths.dtype.kind not in "fiu" or not (depths > 0).all():
            raise InputError(f"view_z_mm: expected depths of {shape}, above 0 mm, a miss being +inf")
        maps["view_z_mm"] = depths.astype(np.float32)
    return maps


def _as_stored(z_mm: np.ndarray) -> np.ndarray:
    """Depths as float32, if they are that already, else as float64."""
    return z_mm if z_mm.dtype == np.float32 else z_mm.astype(np.float64)


def _write_origins(folder: Path, photons: PhotonTruth, counts: PhotonCounts | None) -> None:
    """Write the origins of the counts' photons; `InputError` unless they are in the order of the events."""
    if counts is None:
        raise InputError("truth: photons: there are no photon counts that they belong to")
    events = counts.events
    for name in "klij":
        if not np.array_equal(getattr(photons, name), getattr(events, name).repeat(events.n)):
            raise InputError("truth: photons: not those of the counts, in the order of their events")
    arrays = {"object_id": photons.object_id.astype(np.int32), "z_mm": _as_stored(photons.z_mm)}
    write_arrays_safely(folder, arrays, PHOTON_TRUTH_LABELS)


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
    if truth is not None and truth.unscored:
        content["unscored"] = sorted(truth.unscored)
    if truth is not None and not truth.are_objects_known:
        content["are_objects_known"] = False
    return {"identity": hash_json(content), **content}
