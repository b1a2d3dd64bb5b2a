"""The command `export`, and the formats that it writes: pictures and photon cubes with poses, and events.

    images/03_04.png   8-bit RGB of the camera of row 3, column 4
    depth/03_04.npy    its planar depth in mm, float32, 0 where nothing is hit; if the dataset has view_z_mm
    transforms.json    intrinsics and poses of all cameras, and the grid

nerfstudio multiplies depths by 0.001, leaves out those that are 0, and takes them along the camera's axis
(nerfstudio_dataparser.py, data_utils.py and losses.py of release 1.1). PNG would hold whole mm.

    03_04/frames.npy        uint8 (T, H, ceil(W / 8)) of the camera of row 3, column 4
    03_04/transforms.json   the same as a dataset of visionsim (NPY): a pose for each of the T frames
    transforms.json         as above, with cubes in place of pictures

Bits of a photon cube are packed along the width, the first pixel in the highest bit, as numpy.packbits does;
bits beyond the last pixel are 0. Blocks of a file without a set bit are not written: they are holes, which
read as zeros and take no room on the disk.

    train-000000.tar    of a collection: 000017.npz, the events of its dataset 17, and 000017.json, its row
                        of the index; shards of a split, or "all", in an order that is drawn once for all

A point (X, Y, Z) mm of a dataset is (X, -Y, -Z) / 1000 in the world of transforms.json, which is right-handed
too.
"""

import io
import json
import tarfile
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import numpy as np
from cyclopts import Parameter

from pcii.base import InputError, Report, Stages, json_bytes, named_in_errors, new_folder_safely, say, silent
from pcii.exchange.hci_scenes import pictures_of, write_hci, write_png
from pcii.exchange.transforms_file import MM_PER_M, TRANSFORMS
from pcii.store import COLUMNS, Collection, Dataset, check_free, is_collection, open_collection, open_dataset
from pcii.types import OPTIONAL_MAPS, CameraGrid, Light

Format = Literal["hci", "nerfstudio", "photoncube", "events", "webdataset"]
SHARD_BYTES = 1 << 28
"""A shard is full from here on: large enough to stream, small enough that several processes have some."""
FRAMES = "frames.npy"
UP_AND_BACK = np.diag([1.0, -1.0, -1.0])
"""Turns Y down, Z forward into Y up, Z backward; its own inverse, of determinant 1."""
DEPTH_UNIT_M = 1e-3
"""Unit of the numbers in files of depth without a `depth_unit_scale_factor`; nerfstudio's default."""


def export_dataset(
    dataset: Dataset | Collection | str | Path,
    format: Format,
    out: str | Path,
    *,
    budget: float | None = None,
    report: Report = silent,
) -> Path:
    """Write a dataset to the new or empty folder `out` for other tools, and return the folder.

    Each dataset of a collection, or of a part of one, is written to a folder in `out` that has its name.
    `budget` is a nested photon budget, whose photons are written instead of all. `format` is "hci" (the
    layout of the HCI 4D light field benchmark), "nerfstudio" (pictures and their poses, transforms.json),
    "photoncube" (binary frames as packed bits, and poses), "events" (one NumPy archive) or, of a collection,
    "webdataset" (tar files of such archives); docs/exchange.md describes them. The folder is there as a whole
    or not at all. Raises `InputError` for another format, a folder that holds something or is part of the
    dataset, and a dataset that lacks what the format needs.
    """
    if format not in get_args(Format):
        raise InputError(f"format: there is no {format!r}; use one of {', '.join(get_args(Format))}")
    if isinstance(dataset, str | Path):
        dataset = open_collection(dataset) if is_collection(Path(dataset)) else open_dataset(dataset)
    folder = Path(out)
    check_free(folder, "export")
    if folder.resolve().is_relative_to(dataset.path.resolve()):
        raise InputError(
            f"{folder}: is in {dataset.path}, which lists all its files; name a folder elsewhere"
        )
    if isinstance(dataset, Collection) and not dataset:
        raise InputError(f"{dataset.path}: the collection has no finished dataset to export")
    folder.parent.mkdir(parents=True, exist_ok=True)

    def in_light(one: Dataset) -> Dataset:
        return one if budget is None else one.at_light(Light(budget))

    with named_in_errors(folder), new_folder_safely(folder) as temporary:
        if isinstance(dataset, Dataset):
            if format == "webdataset":
                raise InputError(
                    f"{dataset.path}: webdataset is for a collection of datasets; events for one"
                )
            WRITERS[format](in_light(dataset), temporary)
        elif format == "webdataset":
            _write_shards(dataset, temporary, in_light, report)
        else:
            for number, one in enumerate(dataset, start=1):
                place = temporary / one.path.name
                place.mkdir()
                WRITERS[format](in_light(one), place)
                report("datasets", number, len(dataset))
    return folder


def _write_nerfstudio(dataset: Dataset, folder: Path) -> None:
    """Write pictures, poses and, where the dataset has them, the depths of all views."""
    grid = dataset.grid
    picture, pixels, _ = pictures_of(dataset)
    depths_mm = _depths_ahead_mm(dataset)
    frames = []
    (folder / "images").mkdir()
    if depths_mm is not None:
        (folder / "depth").mkdir()
    for (k, l), pose in zip(np.ndindex(grid.rows, grid.cols), _frames_of(dataset), strict=True):
        name = _view_name(grid, k, l)
        frame = {"file_path": f"images/{name}.png"}
        write_png(folder / frame["file_path"], picture(k, l))
        if depths_mm is not None:
            frame["depth_file_path"] = f"depth/{name}.npy"
            depth_mm = np.where(np.isfinite(depths_mm[k, l]), depths_mm[k, l], np.float32(0))
            np.save(folder / frame["depth_file_path"], depth_mm)
        frames.append(frame | pose)
    if depths_mm is not None:
        pixels["depth_unit_scale_factor"] = DEPTH_UNIT_M
    document = _intrinsics_of(dataset) | {"c": 3} | pixels | {"frames": frames}
    (folder / TRANSFORMS).write_bytes(json_bytes(document))


def _write_photon_cubes(dataset: Dataset, folder: Path) -> None:
    """Write a folder for each view, and what all have in common; memory grows with the photons alone.

    Raises `InputError` for counts that are not of one bit, and for frames that the dataset did not keep.
    """
    grid, readout, events = dataset.grid, dataset.counts.readout, dataset.counts.frame_events
    if readout.bits != 1:
        limit = "no limit" if readout.bits is None else f"{readout.bits} bits a frame"
        raise InputError(f"{dataset.path}: its counts have {limit}, and a photon cube has frames of one bit")
    if events is None:
        raise InputError(
            f"{dataset.path}: has sums of {readout.frames} frames, which were not kept; generate it with "
            "products.frames = true"
        )
    intrinsics, poses = _intrinsics_of(dataset), _frames_of(dataset)
    principal_points = _principal_points_px(grid).reshape(-1, 2).tolist()
    lens = {name: intrinsics[name] for name in ("fl_x", "fl_y", "w", "h")}
    packing = {"c": 1, "cfa": dataset.cfa, "bitpack": True, "bitpack_dim": 2}
    shape = (readout.frames, grid.height, -(-grid.width // 8))
    camera = events.k.astype(np.int64) * grid.cols + events.l
    starts = np.searchsorted(camera, np.arange(grid.view_count + 1))
    frames = []
    for number, (k, l) in enumerate(np.ndindex(grid.rows, grid.cols)):
        view = folder / _view_name(grid, k, l)
        view.mkdir()
        photons = slice(starts[number], starts[number + 1])
        frame, i, j = events.frame[photons], events.i[photons], events.j[photons]
        cube = np.lib.format.open_memmap(view / FRAMES, "w+", np.uint8, shape)
        np.bitwise_or.at(cube, (frame, i, j // 8), (128 >> (j % 8)).astype(np.uint8))
        cube.flush()
        x, y = principal_points[number]
        pose = {"transform_matrix": poses[number]["transform_matrix"]}
        alone = lens | {"cx": x, "cy": y} | packing | {"file_path": FRAMES, "frames": [pose] * readout.frames}
        (view / TRANSFORMS).write_text(json.dumps(alone, allow_nan=False) + "\n")
        frames.append({"file_path": f"{view.name}/{FRAMES}"} | poses[number])
    document = intrinsics | packing | {"num_frames": readout.frames}
    if dataset.light.photons is not None:
        document["photon_budget"] = dataset.light.photons
    (folder / TRANSFORMS).write_bytes(json_bytes(document | {"frames": frames}))


def _view_name(grid: CameraGrid, k: int, l: int) -> str:
    """Row and column of a camera, "03_04", with as many digits as make the names sort."""
    digits = max(2, len(str(max(grid.rows, grid.cols) - 1)))
    return f"{k:0{digits}d}_{l:0{digits}d}"


def _intrinsics_of(dataset: Dataset) -> dict[str, Any]:
    """Members at the top of the file: focal length in px, size and, where all cameras share it, centre.

    In a sheared grid each camera has a centre of its own, which its frame has: nerfstudio would take one at
    the top for all. The grid in mm is written too, unless the cameras have errors of calibration.
    """
    grid = dataset.grid
    focal_px = grid.focal_mm / grid.pixel_mm
    members: dict[str, Any] = {"fl_x": focal_px, "fl_y": focal_px}
    if not any(grid.shear_px):
        members |= {"cx": grid.width / 2, "cy": grid.height / 2}
    members |= {"w": grid.width, "h": grid.height}
    has_errors = dataset.has_truth_array("camera_position_mm")
    return members if has_errors else members | {"camera_grid": asdict(grid)}


def _frames_of(dataset: Dataset) -> list[dict[str, Any]]:
    """A frame for each camera, row by row from the top left: its pose and, in a sheared grid, its centre.

    Poses are camera-to-world matrices (4, 4): axes of OpenGL, metres. They say where cameras really are, also
    of a dataset with errors of calibration.
    """
    grid = dataset.grid
    position_mm, rotation = _true_cameras(dataset)
    poses = np.zeros((grid.rows, grid.cols, 4, 4))
    poses[..., :3, :3] = UP_AND_BACK @ rotation @ UP_AND_BACK
    poses[..., :3, 3] = position_mm @ UP_AND_BACK / MM_PER_M
    poses[..., 3, 3] = 1
    poses += 0.0  # no -0.0
    frames: list[dict[str, Any]] = [{"transform_matrix": pose} for pose in poses.reshape(-1, 4, 4).tolist()]
    if any(grid.shear_px):
        points = _principal_points_px(grid).reshape(-1, 2).tolist()
        for frame, (x, y) in zip(frames, points, strict=True):
            frame |= {"cx": x, "cy": y}
    return frames


def _true_cameras(dataset: Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Places (K, L, 3) in mm and rotations (K, L, 3, 3), whose columns are right, down and forward."""
    grid = dataset.grid
    if dataset.has_truth_array("camera_position_mm"):
        named = ("camera_position_mm", "camera_rotation")
        position_mm, rotation = (dataset.truth_array(name).astype(np.float64) for name in named)
        return position_mm, rotation
    position_mm = np.zeros((grid.rows, grid.cols, 3))
    position_mm[..., :2] = _steps_from_middle(grid) * grid.pitch_mm
    return position_mm, np.broadcast_to(np.eye(3), (grid.rows, grid.cols, 3, 3))


def _principal_points_px(grid: CameraGrid) -> np.ndarray:
    """Where each camera's axis meets its image, (K, L, 2) as (x, y), the first pixel's centre at 0.5."""
    return np.array([grid.width / 2, grid.height / 2]) + _steps_from_middle(grid) * grid.shear_px


def _steps_from_middle(grid: CameraGrid) -> np.ndarray:
    """Steps (K, L, 2) from the virtual centre to each camera, to the right and down."""
    right, down = (np.arange(count) - (count - 1) / 2 for count in (grid.cols, grid.rows))
    return np.stack(np.meshgrid(right, down), axis=-1)


def _depths_ahead_mm(dataset: Dataset) -> np.ndarray | None:
    """Depth along each camera's own axis, (K, L, H, W) float32 in mm, +inf for no hit; None if not known.

    The truth of a view is the world's Z. Of a camera at p that is turned by R, the point at Z on the ray of
    the slopes s = (x, y, 1) is p + t R s, where t, its depth along the axis, is (Z - p_z) / (R s)_z.
    """
    if not dataset.has_truth_array("view_z_mm"):
        return None
    z_mm, grid = dataset.truth_array("view_z_mm"), dataset.grid
    depths = np.empty(z_mm.shape, np.float32)
    position_mm, rotation = _true_cameras(dataset)
    axes = _principal_points_px(grid)
    for camera in np.ndindex(grid.rows, grid.cols):
        x, y = axes[camera]
        right = (np.arange(grid.width) + 0.5 - x) * grid.pixel_mm / grid.focal_mm
        down = (np.arange(grid.height) + 0.5 - y)[:, None] * grid.pixel_mm / grid.focal_mm
        toward = rotation[camera][2]
        slope_z = toward[0] * right + toward[1] * down + toward[2]
        depths[camera] = (z_mm[camera].astype(np.float64) - position_mm[camera][2]) / slope_z
    return depths


def _events_of(dataset: Dataset) -> bytes:
    """Photons, cameras and truth as a NumPy archive, whose arrays need no pickle.

    `k`, `l`, `i`, `j`, `n` (events,); `frames`, `bits` and `frame` (photons,) of a camera that has frames, if
    they are known; each field of the `CameraGrid` by its name; `cfa`, "" for monochrome.
    Where known, `analysis_z_mm` (planes,), `analysis_z_range_mm` (near, far) and `photon_budget`; and
    `truth_...` (H, W) maps of the virtual centre with `object_keys` and `object_names`, and
    `photon_object_id`, `photon_z_mm` (photons,), photon by photon in the events' order.
    """
    counts = dataset.counts
    values = {name: getattr(counts.events, name) for name in "klijn"}
    values |= asdict(dataset.grid) | {"cfa": dataset.cfa or ""}
    if not counts.readout.is_plain:
        values |= asdict(counts.readout)
    values["frame"] = counts.frame
    for name in ("z_mm", "z_range_mm"):
        values[f"analysis_{name}"] = dataset.analysis.get(name) or None
    values["photon_budget"] = dataset.light.photons
    truth = dataset.truth
    if truth is not None:
        values |= {f"truth_{name}": getattr(truth, name) for name in ("z_mm", "object_id", *OPTIONAL_MAPS)}
        values["object_keys"] = np.array(list(truth.names), dtype=np.int64)
        values["object_names"] = np.array(list(truth.names.values()), dtype=np.str_)
        if truth.photons is not None:
            values["photon_object_id"] = truth.photons.object_id
            values["photon_z_mm"] = truth.photons.z_mm
    arrays: dict[str, Any] = {name: np.asarray(value) for name, value in values.items() if value is not None}
    content = io.BytesIO()
    np.savez_compressed(content, **arrays)
    return content.getvalue()


def _write_shards(
    collection: Collection, folder: Path, in_light: Callable[[Dataset], Dataset], report: Report
) -> None:
    """Write the tar files of a collection as WebDataset reads them, each split in shards of its own.

    Datasets that follow each other are alike, so they are in an order drawn at random, the same each time.
    """
    shards_by_split = dict[str, list[Path]]()
    order = np.random.default_rng(0).permutation(len(collection))
    for done, number in enumerate(order.tolist(), start=1):
        row = collection.rows[number]
        split = row["split"] or "all"
        shards = shards_by_split.setdefault(split, [])
        if not shards or shards[-1].stat().st_size >= SHARD_BYTES:
            shards.append(folder / f"{split}-{len(shards):06d}.tar")
        described = {name: row[name] for name in (*COLUMNS, "values")}
        parts = {"npz": _events_of(in_light(collection[number])), "json": json_bytes(described)}
        with tarfile.open(shards[-1], "a", format=tarfile.USTAR_FORMAT) as shard:
            for suffix, content in parts.items():
                member = tarfile.TarInfo(f"{number:06d}.{suffix}")
                member.size = len(content)
                shard.addfile(member, io.BytesIO(content))
        report("datasets", done, len(collection))


WRITERS: dict[Format, Callable[[Dataset, Path], object]] = {
    "hci": write_hci,
    "nerfstudio": _write_nerfstudio,
    "photoncube": _write_photon_cubes,
    "events": lambda dataset, folder: (folder / "events.npz").write_bytes(_events_of(dataset)),
}


def export(
    dataset: Path,
    *,
    format: Format,
    out: Annotated[Path, Parameter(name=("--out", "-o"))],
    budget: float | None = None,
) -> None:
    """Write a dataset in a format that other tools read: into a new folder, as a whole or not at all.

    hci: the layout of the HCI 4D light field benchmark. nerfstudio: a PNG for each view and transforms.json
    with the poses of the cameras, as neural reconstruction reads them. photoncube: the binary frames of each
    view as packed bits, with poses. events: a NumPy archive of photons, cameras and truth. Each dataset of a
    collection is written to a folder in the new one that has its name. webdataset: tar files of such
    archives, of a collection as a whole, to stream while training.

    Examples of use:

        pcii export out/paper --format events -o out/paper-events
        pcii export out/small --format nerfstudio -o out/small-poses
        simgen export out/spad --format photoncube -o out/spad-cubes

    Parameters
    ----------
    dataset
        Folder of a dataset or of a collection.
    out
        Folder for the files: new or empty.
    budget
        Export the photons of this smaller, nested budget of the recipe.
    """
    with Stages() as report:
        folder = export_dataset(dataset, format, out, budget=budget, report=report)
    files = [file for file in folder.rglob("*") if file.is_file()]
    say(f"{folder}: {len(files)} files, {sum(file.stat().st_size for file in files) / 1e6:.1f} MB")
