"""Exports with the poses of cameras: pictures for nerfstudio and its kin, and photon cubes.

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

A point (X, Y, Z) mm of a dataset is (X, -Y, -Z) / 1000 in the world of transforms.json, which is right-handed
too. Other formats share the pictures.
"""

import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base import InputError, json_bytes, visible
from pcii.figures import to_srgb8
from pcii.sections import demosaic
from pcii.store import Dataset
from pcii.types import CameraGrid

FRAMES = "frames.npy"
UP_AND_BACK = np.diag([1.0, -1.0, -1.0])
"""Turns Y down, Z forward into Y up, Z backward; its own inverse, of determinant 1."""
MM_PER_M = 1000.0
TRANSFORMS = "transforms.json"
DEPTH_UNIT_M = 1e-3
"""Unit of the numbers in files of depth without a `depth_unit_scale_factor`; nerfstudio's default."""
WHITE_QUANTILE = 0.999
"""Share of the values of the middle view that are at most white. A larger one makes pictures darker."""


def pictures_of(dataset: Dataset) -> tuple[Callable[[int, int], np.ndarray], dict[str, Any], str]:
    """Pictures of a dataset's radiance, whose mosaics are demosaiced, or else of its photons, in grey.

    Returns a function of the picture of camera (k, l), uint8 (H, W, 3), with one white for all, which of
    radiance is a value of the middle view; what its numbers are, as members of transforms.json; and the same
    as the end of a sentence. Raises `InputError` for a dataset with neither.
    """
    views = dataset.views
    if views is None:
        counts = dataset.counts
        photons = max(int(counts.events.n.max(initial=0)), 1)

        def grey(k: int, l: int) -> np.ndarray:
            levels = np.round(255 / photons * counts.view(k, l)).astype(np.uint8)
            return np.repeat(levels[..., None], 3, axis=2)

        meaning = f"photon counts in grey, not gamma-encoded: 255 is {photons} photons in the pixel"
        members = {"quantity": "photons", "unit": "photons", "white": float(photons), "cfa": dataset.cfa}
        return grey, members, meaning

    def colours(k: int, l: int) -> np.ndarray:
        image = views.view(k, l)
        return image if views.cfa is None else demosaic(image[..., 0], cfa=views.cfa)

    unit = visible(str(dataset.manifest.radiance_unit or "radiance"))
    middle = colours(views.grid.rows // 2, views.grid.cols // 2)
    white = float(np.float32(np.quantile(middle, WHITE_QUANTILE, method="lower")))
    white = white if white > 0 else 1.0
    meaning = f"radiance, encoded as sRGB: 255 is {white:.6g} ({unit}) or more; mosaics are demosaiced"
    members = {"quantity": "radiance", "unit": unit, "white": white}
    return lambda k, l: to_srgb8(colours(k, l), white), members, meaning


def write_nerfstudio(dataset: Dataset, folder: Path) -> None:
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


def write_photon_cubes(dataset: Dataset, folder: Path) -> None:
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
    z_mm = dataset.truth_array("view_z_mm")
    depths = z_mm.astype(np.float32)
    if not dataset.has_truth_array("camera_position_mm"):
        return depths
    grid = dataset.grid
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


def write_png(path: Path, image: np.ndarray) -> None:
    """Write an image (H, W) or (H, W, 3), uint8 or uint16, as PNG.

    Pillow, which draws the other pictures, has no colour images of 16 bits.
    """
    import imagecodecs

    path.write_bytes(imagecodecs.png_encode(np.ascontiguousarray(image)))
