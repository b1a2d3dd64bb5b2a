"""Pictures of 8 bits of all views, and the folder of pictures and poses for nerfstudio and its kin.

    images/03_04.png   8-bit RGB of the camera of row 3, column 4
    depth/03_04.npy    its planar depth in mm, float32, 0 where nothing is hit; if the dataset has view_z_mm
    transforms.json    intrinsics and poses: see `export_pictures`

nerfstudio multiplies depths by 0.001, leaves out those that are 0, and takes them along the camera's axis
(nerfstudio_dataparser.py, data_utils.py and losses.py of release 1.1). PNG would hold whole mm.

Other formats and readers share its files of pixels and its poses of cameras: a point (X, Y, Z) mm of a
dataset is (X, -Y, -Z) / 1000 in the world of transforms.json, which is right-handed too.
"""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from pcii.base import json_bytes, visible
from pcii.figures import to_srgb8
from pcii.sections import demosaic
from pcii.store import Dataset
from pcii.types import CameraGrid, Views

UP_AND_BACK = np.diag([1.0, -1.0, -1.0])
"""Turns Y down, Z forward into Y up, Z backward; its own inverse, of determinant 1."""
MM_PER_M = 1000.0
TRANSFORMS = "transforms.json"
DEPTH_UNIT_M = 1e-3
"""Unit of the numbers in files of depth without a `depth_unit_scale_factor`; nerfstudio's default."""
MOST_POSES = 1 << 16
"""Frames of a file: a photon cube of visionsim has a pose for each of its frames, a thousand or more."""
WHITE_QUANTILE = 0.999
"""Share of the values of the middle view that are at most white. A larger one makes pictures darker."""


@dataclass(frozen=True)
class ViewPictures:
    """The pictures of all views, with one white, and what their numbers are."""

    view: Callable[[int, int], np.ndarray]
    """The picture of camera (k, l), uint8 (H, W, 3)."""
    quantity: Literal["radiance", "photons"]
    """Radiance is encoded as sRGB; photons are proportional to the numbers."""
    white: float
    """Radiance or photons of the number 255; of radiance it is a value of the middle view, float32."""
    unit: str
    meaning: str
    """What the numbers are, as the end of a sentence."""


def pictures_of(dataset: Dataset) -> ViewPictures:
    """Pictures of a dataset's radiance, whose mosaics are demosaiced, or else of its photons, in grey.

    Raises `InputError` for a dataset with neither.
    """
    if dataset.views is not None:
        return _radiance_pictures(dataset, dataset.views)
    counts = dataset.counts
    white = max(int(counts.events.n.max(initial=0)), 1)

    def grey(k: int, l: int) -> np.ndarray:
        return np.repeat(np.round(255 / white * counts.view(k, l)).astype(np.uint8)[..., None], 3, axis=2)

    return ViewPictures(
        grey,
        quantity="photons",
        white=float(white),
        unit="photons",
        meaning=f"photon counts in grey, not gamma-encoded: 255 is {white} photons in the pixel",
    )


def _radiance_pictures(dataset: Dataset, views: Views) -> ViewPictures:
    unit = visible(str(dataset.manifest.radiance_unit or "radiance"))

    def colours(k: int, l: int) -> np.ndarray:
        image = views.view(k, l)
        return image if views.cfa is None else demosaic(image[..., 0], cfa=views.cfa)

    middle = colours(views.grid.rows // 2, views.grid.cols // 2)
    white = float(np.float32(np.quantile(middle, WHITE_QUANTILE, method="lower")))
    white = white if white > 0 else 1.0
    return ViewPictures(
        lambda k, l: to_srgb8(colours(k, l), white),
        quantity="radiance",
        white=white,
        unit=unit,
        meaning=f"radiance, encoded as sRGB: 255 is {white:.6g} ({unit}) or more; mosaics are demosaiced",
    )


def view_name(grid: CameraGrid, k: int, l: int) -> str:
    """Row and column of a camera, "03_04", with as many digits as make the names sort."""
    digits = max(2, len(str(max(grid.rows, grid.cols) - 1)))
    return f"{k:0{digits}d}_{l:0{digits}d}"


def write_nerfstudio(dataset: Dataset, folder: Path) -> None:
    """Write pictures, poses and, where the dataset has them, the depths of all views."""
    grid = dataset.grid
    pictures = pictures_of(dataset)
    depths_mm = depths_ahead_mm(dataset)
    frames = []
    (folder / "images").mkdir()
    if depths_mm is not None:
        (folder / "depth").mkdir()
    for (k, l), pose in zip(np.ndindex(grid.rows, grid.cols), frames_of(dataset), strict=True):
        name = view_name(grid, k, l)
        frame = {"file_path": f"images/{name}.png"}
        write_png(folder / frame["file_path"], pictures.view(k, l))
        if depths_mm is not None:
            frame["depth_file_path"] = f"depth/{name}.npy"
            depth_mm = np.where(np.isfinite(depths_mm[k, l]), depths_mm[k, l], np.float32(0))
            np.save(folder / frame["depth_file_path"], depth_mm)
        frames.append(frame | pose)
    pixels = {"c": 3, "quantity": pictures.quantity, "unit": pictures.unit, "white": pictures.white}
    if pictures.quantity == "photons":
        pixels["cfa"] = dataset.cfa
    if depths_mm is not None:
        pixels["depth_unit_scale_factor"] = DEPTH_UNIT_M
    document = intrinsics_of(dataset) | pixels | {"frames": frames}
    (folder / TRANSFORMS).write_bytes(json_bytes(document))


def poses_of(dataset: Dataset) -> np.ndarray:
    """Camera-to-world matrices (K, L, 4, 4), float64, of a dataset: axes of OpenGL, metres.

    The columns are the camera's right, up and backward directions, and its place, in the world in which a
    point (X, Y, Z) mm of the dataset is (X, -Y, -Z) / 1000. They are where the cameras really are, also of a
    dataset with errors of calibration.
    """
    position_mm, rotation = true_cameras(dataset)
    poses = np.zeros((*position_mm.shape[:2], 4, 4))
    poses[..., :3, :3] = UP_AND_BACK @ rotation @ UP_AND_BACK
    poses[..., :3, 3] = position_mm @ UP_AND_BACK / MM_PER_M
    poses[..., 3, 3] = 1
    return poses + 0.0  # no -0.0


def true_cameras(dataset: Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Places (K, L, 3) in mm and rotations (K, L, 3, 3), whose columns are right, down and forward."""
    grid = dataset.grid
    if dataset.has_truth_array("camera_position_mm"):
        named = ("camera_position_mm", "camera_rotation")
        position_mm, rotation = (dataset.truth_array(name).astype(np.float64) for name in named)
        return position_mm, rotation
    position_mm = np.zeros((grid.rows, grid.cols, 3))
    position_mm[..., 0] = (np.arange(grid.cols) - (grid.cols - 1) / 2) * grid.pitch_mm[0]
    position_mm[..., 1] = ((np.arange(grid.rows) - (grid.rows - 1) / 2) * grid.pitch_mm[1])[:, None]
    return position_mm, np.broadcast_to(np.eye(3), (grid.rows, grid.cols, 3, 3))


def principal_points_px(dataset: Dataset) -> np.ndarray:
    """Where each camera's axis meets its image, (K, L, 2) as (x, y), the first pixel's centre at 0.5."""
    grid = dataset.grid
    points = np.empty((grid.rows, grid.cols, 2))
    points[..., 0] = grid.width / 2 + (np.arange(grid.cols) - (grid.cols - 1) / 2) * grid.shear_px[0]
    down = (np.arange(grid.rows) - (grid.rows - 1) / 2) * grid.shear_px[1]
    points[..., 1] = grid.height / 2 + down[:, None]
    return points


def depths_ahead_mm(dataset: Dataset) -> np.ndarray | None:
    """Depth along each camera's own axis, (K, L, H, W) float32 in mm, +inf for no hit; None if not known.

    The truth of a view is the world's Z. Of a camera at p that is turned by R, the point at Z on the ray of
    the slopes s = (x, y, 1) is p + t R s, where t, its depth along the axis, is (Z - p_z) / (R s)_z.
    """
    if not dataset.has_truth_array("view_z_mm"):
        return None
    z_mm = dataset.truth_array("view_z_mm")
    if not dataset.has_truth_array("camera_position_mm"):
        return z_mm.astype(np.float32)
    grid = dataset.grid
    position_mm, rotation = true_cameras(dataset)
    axes = principal_points_px(dataset)
    depths = np.empty(grid.shape_KLHW, np.float32)
    for camera in np.ndindex(grid.rows, grid.cols):
        x, y = axes[camera]
        right = (np.arange(grid.width) + 0.5 - x) * grid.pixel_mm / grid.focal_mm
        down = (np.arange(grid.height) + 0.5 - y)[:, None] * grid.pixel_mm / grid.focal_mm
        toward = rotation[camera][2]
        slope_z = toward[0] * right + toward[1] * down + toward[2]
        depths[camera] = (z_mm[camera].astype(np.float64) - position_mm[camera][2]) / slope_z
    return depths


def intrinsics_of(dataset: Dataset) -> dict[str, Any]:
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


def frames_of(dataset: Dataset) -> list[dict[str, Any]]:
    """A frame for each camera, row by row from the top left: its pose and, in a sheared grid, its centre."""
    grid = dataset.grid
    poses = poses_of(dataset).reshape(-1, 4, 4).tolist()
    frames: list[dict[str, Any]] = [{"transform_matrix": pose} for pose in poses]
    if any(grid.shear_px):
        points = principal_points_px(dataset).reshape(-1, 2).tolist()
        for frame, (x, y) in zip(frames, points, strict=True):
            frame |= {"cx": x, "cy": y}
    return frames


def write_png(path: Path, image: np.ndarray) -> None:
    """Write an image (H, W) or (H, W, 3), uint8 or uint16, as PNG.

    Pillow, which draws the other pictures, has no colour images of 16 bits.
    """
    import imagecodecs

    path.write_bytes(imagecodecs.png_encode(np.ascontiguousarray(image)))
