"""Poses and intrinsics of a dataset's cameras as transforms.json has them, and depths ahead of them.

A point (X, Y, Z) mm of a dataset is (X, -Y, -Z) / 1000 in the world of the file, which is right-handed too.
"""

from dataclasses import asdict
from typing import Any

import numpy as np

from pcii.io.dataset import Dataset

UP_AND_BACK = np.diag([1.0, -1.0, -1.0])
"""Turns Y down, Z forward into Y up, Z backward; its own inverse, of determinant 1."""
MM_PER_M = 1000.0
TRANSFORMS = "transforms.json"
DEPTH_UNIT = "depth_unit_scale_factor"
"""Member with the unit, in metres, of the numbers in files of depth; named as nerfstudio's option."""
DEPTH_UNIT_M = 1e-3
"""That unit where there is no such member; nerfstudio's default."""
MOST_POSES = 1 << 16
"""Frames of a file: a photon cube of visionsim has a pose for each of its frames, a thousand or more."""
OWN_GRID = "camera_grid"
"""Member of the file with the camera grid in mm, which poses and pixels alone do not tell."""


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
    if has_errors(dataset):
        named = ("camera_position_mm", "camera_rotation")
        position_mm, rotation = (dataset.truth_array(name).astype(np.float64) for name in named)
        return position_mm, rotation
    position_mm = np.zeros((grid.rows, grid.cols, 3))
    position_mm[..., 0] = (np.arange(grid.cols) - (grid.cols - 1) / 2) * grid.pitch_mm[0]
    position_mm[..., 1] = ((np.arange(grid.rows) - (grid.rows - 1) / 2) * grid.pitch_mm[1])[:, None]
    return position_mm, np.broadcast_to(np.eye(3), (grid.rows, grid.cols, 3, 3))


def has_errors(dataset: Dataset) -> bool:
    """Whether the cameras are known not to be quite where the grid puts them."""
    return dataset.has_truth_array("camera_position_mm")


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
    if not has_errors(dataset):
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

    In a sheared grid each camera has a centre of its own, which its frame tells: nerfstudio would take one at
    the top for all. The grid in mm is written too, unless the cameras have errors of calibration.
    """
    grid = dataset.grid
    focal_px = grid.focal_mm / grid.pixel_mm
    members: dict[str, Any] = {"fl_x": focal_px, "fl_y": focal_px}
    if not any(grid.shear_px):
        members |= {"cx": grid.width / 2, "cy": grid.height / 2}
    members |= {"w": grid.width, "h": grid.height}
    return members if has_errors(dataset) else members | {OWN_GRID: asdict(grid)}


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
