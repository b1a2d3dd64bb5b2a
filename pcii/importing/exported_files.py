"""Files that `simgen export` writes and that say themselves which cameras saw them: events.npz, views.exr."""

import json
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base.errors import InputError
from pcii.base.plain_text import visible
from pcii.core.arrays import check_z_mm
from pcii.core.camera_grid import CameraGrid
from pcii.core.images import Views
from pcii.core.photon_counts import PhotonCounts
from pcii.core.truth import OPTIONAL_MAPS, PhotonTruth, Truth
from pcii.exchange.export_photons import ARCHIVE as EVENTS
from pcii.importing.array_files import check_archive, opened_array
from pcii.io.dataset_writer import check_budget, check_depth_range
from pcii.pictures.exr_files import exr_channels, exr_headers, window_size
from pcii.pictures.picture_files import check_unpacked

PARTS, CENTRE = "views.exr", "virtual_centre"
GRID = tuple(field.name for field in fields(CameraGrid))


@dataclass(frozen=True, eq=False)
class Exported:
    """Photon counts, radiance or both, and the truth if the file has it.

    `z_mm` (empty if it names none) and `z_range_mm` are the depths that the dataset suggested,
    `photon_budget` that of its counts.
    """

    images: tuple[PhotonCounts | Views, ...]
    truth: Truth | None
    z_mm: tuple[float, ...] = ()
    z_range_mm: tuple[float, float] | None = None
    photon_budget: float | None = None


def exported_file(source: Path) -> Path | None:
    """The file to read if `source` is one of these files or a folder of one, else None."""
    for file in (source / EVENTS, source / PARTS):
        if file.is_file():
            return file
    if source.suffix == ".exr" and source.is_file():
        return source
    if source.is_file() and zipfile.is_zipfile(source):
        with zipfile.ZipFile(source) as archive:
            if {f"{name}.npy" for name in ("k", "l", "i", "j", "n", *GRID)} <= set(archive.namelist()):
                return source
    return None


def import_exported(source: str | Path) -> Exported:
    """Read the events.npz or views.exr of `simgen export`; raises `InputError` for any other file."""
    path = exported_file(Path(source))
    if path is None:
        raise InputError(f"{source}: neither {EVENTS} nor {PARTS} of `simgen export`")
    try:
        return _events(path) if path.suffix != ".exr" else _parts(path)
    except (InputError, MemoryError):
        raise
    except Exception as fault:  # readers raise various exceptions for damaged content
        raise InputError(f"{path}: cannot be read ({visible(str(fault))})") from None


def _events(path: Path) -> Exported:
    with zipfile.ZipFile(path) as archive:
        names = {name.removesuffix(".npy") for name in archive.namelist()}

    def read(name: str) -> np.ndarray:
        if name not in names:
            raise InputError(f"{path}: {name}: missing")
        return opened_array(path, name)[0]

    def optional(name: str) -> np.ndarray | None:
        return read(name) if name in names else None

    grid = _grid(path, {name: read(name).tolist() for name in GRID})
    one_view = 8 * grid.height * grid.width  # as whoever looks at the photons makes it
    with zipfile.ZipFile(path) as archive:
        check_archive(path, archive, [name for name in archive.namelist() if name.endswith(".npy")], one_view)
    try:
        cfa, frames, bits = str(read("cfa")) or None, optional("frames"), optional("bits")
        counts = PhotonCounts.from_events(
            *map(read, "klijn"),
            grid=grid,
            cfa=cfa,
            frames=1 if frames is None else frames.item(),
            bits=None if bits is None else bits.item(),
            frame=optional("frame"),
        )
        truth = None
        if "truth_z_mm" in names:
            keys, titles = read("object_keys").tolist(), read("object_names").tolist()
            photons = None
            if "photon_z_mm" in names:
                events = counts.events
                if read("photon_z_mm").shape != (counts.total,):
                    raise InputError("photon_z_mm: expected as many depths as photons")
                at = {name: getattr(events, name).repeat(events.n) for name in "klij"}
                photons = PhotonTruth(**at, object_id=read("photon_object_id"), z_mm=read("photon_z_mm"))
            maps = {name: optional(f"truth_{name}") for name in OPTIONAL_MAPS}
            named = dict(zip(keys, titles, strict=True))
            truth = Truth(read("truth_z_mm"), read("truth_object_id"), named, photons, **maps)
        told = {name: optional(name) for name in ("analysis_z_mm", "analysis_z_range_mm", "photon_budget")}
        suggested = _suggested(*(None if value is None else value.tolist() for value in told.values()))
    except InputError as fault:
        raise fault if str(fault).startswith(str(path)) else InputError(f"{path}: {fault}") from None
    return Exported((counts,), truth, *suggested)


def _parts(path: Path) -> Exported:
    headers = exr_headers(path)
    told = json.loads(headers[0].get("comments", "null"))
    if not isinstance(told, Mapping) or not isinstance(told.get("grid"), Mapping):
        raise InputError(f"{path}: its comments do not say which cameras saw it; not of `simgen export`")
    grid, cfa = _grid(path, told["grid"]), told.get("cfa")
    _check_parts(path, headers, grid)
    parts = exr_channels(path)
    views = {place: channels for name, channels in parts.items() if (place := _place(name)) is not None}
    missing = next((place for place in np.ndindex(grid.rows, grid.cols) if place not in views), None)
    if views and missing is not None:
        raise InputError(f"{path}: the view of camera {missing} is missing")
    images: list[PhotonCounts | Views] = []
    try:
        for names in (("R", "G", "B"), ("Y",)):
            if views and all(set(names) <= set(channels) for channels in views.values()):
                radiance = _stacked(views, names, grid)
                images.append(Views(radiance, grid, cfa if names == ("Y",) else None))
        if views and all("photons" in channels for channels in views.values()):
            dense = _stacked(views, ("photons",), grid)[..., 0]
            counted = {name: told[name] for name in ("frames", "bits") if name in told}
            images.append(PhotonCounts.from_dense(dense, grid, cfa=cfa, **counted))
        truth = None
        if CENTRE in parts:
            z_mm, object_id = (parts[CENTRE][name] for name in ("Z", "objectId"))
            named = {int(key): str(name) for key, name in told.get("objects", {}).items()}
            truth = Truth(z_mm, object_id.astype(np.int32), named)
        analysis = told.get("analysis") or {}
        suggested = _suggested(analysis.get("z_mm"), analysis.get("z_range_mm"), told.get("photon_budget"))
    except InputError as fault:
        raise InputError(f"{path}: {fault}") from None
    if not images:
        raise InputError(f"{path}: has neither radiance nor photons of the views")
    return Exported(tuple(images), truth, *suggested)


def _suggested(
    z_mm: object, z_range_mm: object, photon_budget: object
) -> tuple[tuple[float, ...], tuple[float, float] | None, float | None]:
    """What a file says of depths and budget, None or nothing where it does not; `InputError` for nonsense."""
    near_far = check_depth_range(z_range_mm) if z_range_mm else None
    return (
        tuple(check_z_mm(z_mm).tolist()) if z_mm else (),
        None if near_far is None else (near_far[0], near_far[1]),
        None if photon_budget is None else check_budget(photon_budget),
    )


def _check_parts(path: Path, headers: Sequence[Mapping[str, Any]], grid: CameraGrid) -> None:
    """Raise `InputError`, before pixels are decoded, for parts of another size, or of too many pixels."""
    size, channels = grid.shape_HW, 0
    for header in headers:
        if (found := window_size(header)) != size:
            raise InputError(f"{path}: part {header['name']}: expected {size} pixels, got {found}")
        channels += len(header["channels"])
    unpacked = 4 * channels * grid.height * grid.width
    check_unpacked(path, unpacked, path.stat().st_size, "export events, or fewer or smaller views")


def _place(part: str) -> tuple[int, int] | None:
    """Camera (k, l) of a part named k03_l04, None for other parts."""
    row, _, col = part.partition("_")
    if row[:1] != "k" or col[:1] != "l" or not (row[1:] + col[1:]).isdecimal():
        return None
    return int(row[1:]), int(col[1:])


def _stacked(
    views: Mapping[tuple[int, int], Mapping[str, np.ndarray]], names: tuple[str, ...], grid: CameraGrid
) -> np.ndarray:
    """Channels of all views, (K, L, H, W, C)."""
    dtype = next(iter(views.values()))[names[0]].dtype
    stacked = np.empty((*grid.shape_KLHW, len(names)), dtype)
    for place in np.ndindex(grid.rows, grid.cols):
        for channel, name in enumerate(names):
            stacked[(*place, ..., channel)] = views[place][name]
    return stacked


def _grid(path: Path, told: Mapping[str, Any]) -> CameraGrid:
    try:
        return CameraGrid(**{name: told[name] for name in GRID})
    except KeyError as fault:
        raise InputError(f"{path}: the camera grid has no {fault.args[0]}") from None
    except InputError as fault:
        raise InputError(f"{path}: {fault}") from None
