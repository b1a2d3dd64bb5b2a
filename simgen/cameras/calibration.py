"""How far the cameras of a recipe are off their places, and how they are turned: errors of calibration."""

import math

import numpy as np

from simgen.base import random_streams as seeds
from simgen.cameras.rig import Rig, as_rig
from simgen.spec.recipe import CalibrationErrors, Grid


def rig_of(grid: Grid, seed: int) -> Rig:
    """The cameras that a recipe's grid describes, with their errors and lens; the same for the same seed."""
    perfect = as_rig(grid.camera_grid())
    position_mm, rotation = perfect.position_mm, perfect.rotation
    if grid.errors is not None:
        position_mm, rotation = _with_errors(position_mm, grid.errors, seed)
    return Rig(perfect.grid, position_mm, rotation, grid.lens)


def turn(angles_deg: np.ndarray) -> np.ndarray:
    """Rotation (3, 3) about the fixed axes X, then Y, then Z by these angles, right-handed.

    Turned about X by a positive angle a camera looks further up, about Y further right, and about Z its
    right side goes down.
    """
    total = np.eye(3)
    for axis, angle in enumerate(np.radians(angles_deg)):
        first, second = (axis + 1) % 3, (axis + 2) % 3
        one = np.eye(3)
        one[first, first] = one[second, second] = math.cos(angle)
        one[second, first], one[first, second] = math.sin(angle), -math.sin(angle)
        total = one @ total
    return total


def _with_errors(
    position_mm: np.ndarray, errors: CalibrationErrors, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Where cameras of these places really are and how they are turned; each has a stream of its own."""
    rows, cols, _ = position_mm.shape
    streams = (seeds.generator(seed, view=view, stage="camera errors") for view in range(rows * cols))
    normal = np.stack([stream.standard_normal(6) for stream in streams]).reshape(rows, cols, 6)
    off_mm, angles_deg = normal[..., :3] * errors.position_sd_mm, normal[..., 3:] * errors.rotation_sd_deg
    rotation = np.stack([[turn(angles) for angles in row] for row in angles_deg])
    return position_mm * (1 + errors.pitch_error) + off_mm, rotation
