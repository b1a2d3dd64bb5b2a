"""What a dataset says in transforms.json: intrinsics, and a frame for each camera."""

from dataclasses import asdict
from typing import Any

from pcii.io.dataset import Dataset
from pcii.transforms.camera_poses import has_errors, poses_of, principal_points_px

OWN_GRID = "camera_grid"
"""Member of the file with the camera grid in mm, which poses and pixels alone do not tell."""


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
