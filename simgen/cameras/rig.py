"""Where the cameras stand and which way pixels look, from first principles.

This is written without `pcii.core.geometry` on purpose: simulation and reconstruction must not be able to
share a sign mistake. A test renders a dot and finds it where `pcii.core.geometry` says.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pcii.core.camera_grid import CameraGrid
from simgen.base import random_streams as seeds
from simgen.spec.camera_grid import CalibrationErrors, Grid, Lens

# The pinhole is the origin of every ray, so nothing nearer than this is ever cut away in practice.
NEAR_CLIP_MM = 0.01
FAR_CLIP_MM = 1e7


@dataclass(frozen=True, eq=False)
class Camera:
    """One camera as it really is.

    `position_mm` (3,); the columns of `rotation` (3, 3) are its right, down and forward directions;
    its axis meets the film `shift_px` (x, y) off the film's centre; without `lens` it is a pinhole.
    """

    grid: CameraGrid
    position_mm: np.ndarray
    rotation: np.ndarray
    shift_px: tuple[float, float]
    lens: Lens | None

    def towards(self, row_px: np.ndarray, col_px: np.ndarray) -> np.ndarray:
        """Directions (..., 3) of the chief rays through points of the film, of length 1 along the axis."""
        grid = self.grid
        per_px = grid.pixel_mm / grid.focal_mm
        x = (np.asarray(col_px, dtype=np.float64) - (grid.width - 1) / 2 - self.shift_px[0]) * per_px
        y = (np.asarray(row_px, dtype=np.float64) - (grid.height - 1) / 2 - self.shift_px[1]) * per_px
        return self._turned(np.stack(np.broadcast_arrays(x, y, 1.0), axis=-1), self.rotation.T)

    def on_film(self, point_mm: np.ndarray) -> np.ndarray:
        """Whether the chief rays of points (N, 3) fall on the film, (N,) bool."""
        grid = self.grid
        x, y, z = self._turned(point_mm - self.position_mm, self.rotation).T
        scale_px = grid.focal_mm / grid.pixel_mm
        fits = z > 0
        for offset, shift, size in ((x, self.shift_px[0], grid.width), (y, self.shift_px[1], grid.height)):
            fits &= np.abs(offset * scale_px + shift * z) < z * (size / 2)
        return fits

    def _turned(self, rows: np.ndarray, by: np.ndarray) -> np.ndarray:
        return rows if np.array_equal(by, np.eye(3)) else rows @ by


@dataclass(frozen=True, eq=False)
class Rig:
    """All cameras as they really are; `grid` is what they ought to be.

    `position_mm` (K, L, 3) and `rotation` (K, L, 3, 3), float64, as of `Camera`.
    """

    grid: CameraGrid
    position_mm: np.ndarray
    rotation: np.ndarray
    lens: Lens | None = None

    @property
    def shift_px(self) -> np.ndarray:
        """How far right of and below its film's centre each camera's axis is, (K, L, 2)."""
        right = (np.arange(self.grid.cols) - (self.grid.cols - 1) / 2) * self.grid.shear_px[0]
        down = (np.arange(self.grid.rows) - (self.grid.rows - 1) / 2) * self.grid.shear_px[1]
        return np.stack(np.meshgrid(right, down), axis=-1)

    def camera(self, k: int, l: int) -> Camera:
        """Camera (k, l)."""
        right, down = self.shift_px[k, l].tolist()
        return Camera(self.grid, self.position_mm[k, l], self.rotation[k, l], (right, down), self.lens)

    def pinhole(self, k: int, l: int) -> Camera:
        """Camera (k, l) without its lens: what the chief ray of each pixel sees."""
        return replace(self.camera(k, l), lens=None)

    def lens_points(self, numbers: np.ndarray) -> np.ndarray:
        """Points (2, N) on the lens in mm, evenly spread for evenly spread `numbers` (2, N) in [0, 1)."""
        assert self.lens is not None
        radius, turn = self.lens.aperture_mm / 2 * np.sqrt(numbers[0]), 2 * np.pi * numbers[1]
        return radius * np.stack([np.cos(turn), np.sin(turn)])

    def rays(
        self, k: np.ndarray, l: np.ndarray, row_px: np.ndarray, col_px: np.ndarray, lens_point: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Origins and unit directions (N, 3) of rays through points of films and of the lens (2, N).

        `paths.film_rays` does the same on the renderer's side. `lens_point` in mm is not used for pinholes.
        """
        grid = self.grid
        per_px, shift_px = grid.pixel_mm / grid.focal_mm, self.shift_px[k, l]
        x = (col_px - ((grid.width - 1) / 2 + shift_px[:, 0])) * per_px
        y = (row_px - ((grid.height - 1) / 2 + shift_px[:, 1])) * per_px
        origin, rotation = self.position_mm[k, l], self.rotation[k, l]
        if self.lens is not None:
            # All rays of a film point meet where the one through the lens's centre is in focus.
            x, y = x - lens_point[0] / self.lens.focus_mm, y - lens_point[1] / self.lens.focus_mm
            origin = origin + np.einsum("nab,bn->na", rotation[..., :2], lens_point)
        ahead = 1 / np.sqrt(1 + x * x + y * y)
        direction = np.stack([x * ahead, y * ahead, ahead], axis=1)
        return origin, np.einsum("nab,nb->na", rotation, direction)


Cameras = CameraGrid | Rig
"""A bare grid stands for pinholes exactly where they ought to be."""


def rig_of(grid: Grid, seed: int) -> Rig:
    """The cameras that a recipe's grid describes, with their errors and lens; the same for the same seed."""
    perfect = as_rig(grid.camera_grid())
    position_mm, rotation = perfect.position_mm, perfect.rotation
    if grid.errors is not None:
        position_mm, rotation = _put_wrong(position_mm, grid.errors, seed)
    return Rig(perfect.grid, position_mm, rotation, grid.lens)


def as_rig(cameras: Cameras) -> Rig:
    """The rig that these cameras are."""
    if isinstance(cameras, Rig):
        return cameras
    x_mm, y_mm = _evenly(cameras.pitch_mm[0], cameras.cols), _evenly(cameras.pitch_mm[1], cameras.rows)
    across, down = np.meshgrid(x_mm, y_mm)
    position_mm = np.stack([across, down, np.zeros_like(across)], axis=-1)
    return Rig(cameras, position_mm, np.tile(np.eye(3), (*across.shape, 1, 1)))


def with_larger_pixels(grid: CameraGrid, scale: float, *, least_px: int) -> CameraGrid:
    """The same field of view on pixels `scale` times as large, at least `least_px` of them to a side."""
    return replace(
        grid,
        height=max(least_px, round(grid.height / scale)),
        width=max(least_px, round(grid.width / scale)),
        pixel_mm=grid.pixel_mm * scale,
        shear_px=(grid.shear_px[0] / scale, grid.shear_px[1] / scale),
    )


def centre_camera(grid: CameraGrid) -> Camera:
    """The virtual centre, at X = Y = 0 between the cameras of an even grid: no errors, a pinhole."""
    return Camera(grid, np.zeros(3), np.eye(3), (0.0, 0.0), None)


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


def _evenly(pitch_mm: float, count: int) -> np.ndarray:
    """Places evenly spaced, symmetric about 0, growing to the right or downwards."""
    span = pitch_mm * (count - 1)
    return np.linspace(-span / 2, span / 2, count)


def _put_wrong(
    position_mm: np.ndarray, errors: CalibrationErrors, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Where cameras of these places really are and how they are turned; each has a stream of its own."""
    rows, cols, _ = position_mm.shape
    streams = (seeds.generator(seed, view=view, stage="camera errors") for view in range(rows * cols))
    normal = np.stack([stream.standard_normal(6) for stream in streams]).reshape(rows, cols, 6)
    off_mm, angles_deg = normal[..., :3] * errors.position_sd_mm, normal[..., 3:] * errors.rotation_sd_deg
    rotation = np.stack([[turn(angles) for angles in row] for row in angles_deg])
    return position_mm * (1 + errors.pitch_error) + off_mm, rotation


def sensor_plugin(mi: Any, camera: Camera, sampler: dict[str, Any]) -> dict[str, Any]:
    """A camera as Mitsuba's sensor, whose own axes point left, up and forward."""
    grid, to_world = camera.grid, np.eye(4)
    to_world[:3, :3] = camera.rotation * (-1.0, -1.0, 1.0)
    to_world[:3, 3] = camera.position_mm
    plugin = {
        "type": "perspective",
        "fov": 2 * math.degrees(math.atan(grid.width * grid.pixel_mm / (2 * grid.focal_mm))),
        "fov_axis": "x",
        "near_clip": NEAR_CLIP_MM,
        "far_clip": FAR_CLIP_MM,
        "to_world": mi.ScalarTransform4f(to_world + 0.0),  # adding 0 turns -0 into 0
        "film": {
            "type": "hdrfilm",
            "width": grid.width,
            "height": grid.height,
            "pixel_format": "rgb",
            "component_format": "float32",  # the default, float16, turns 1e6 into infinity
            "rfilter": {"type": "box"},  # the only filter whose sums repeat bit for bit
        },
        "sampler": sampler,
    }
    if camera.lens is not None:
        radius_mm = camera.lens.aperture_mm / 2
        return plugin | {
            "type": "thinlens",
            "aperture_radius": radius_mm,
            "focus_distance": camera.lens.focus_mm,
        }
    # In shares of the film, and positive where the axis is left of (above) the film's centre.
    return plugin | {
        "principal_point_offset_x": -camera.shift_px[0] / grid.width,
        "principal_point_offset_y": -camera.shift_px[1] / grid.height,
    }
