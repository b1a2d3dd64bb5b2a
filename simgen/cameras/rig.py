"""Where cameras really stand and which way their pixels look, from first principles.

This is written without `pcii.types.focal_planes` on purpose: simulation and reconstruction must not be able
to share a sign mistake. A test renders a dot and finds it where `pcii.types.focal_planes` says.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pcii.types import CameraGrid
from simgen.base import random_streams as seeds
from simgen.spec import Grid, Lens


def _film_slopes(grid: CameraGrid, row_px: Any, col_px: Any, axis_px: tuple[Any, Any]) -> tuple[Any, Any]:
    """Slopes (x, y) of chief rays through points of the film, in mm to the right and down per mm ahead.

    The camera's axis meets the film at `axis_px`, (column, row). All are numbers or arrays of one kind.
    """
    per_px = grid.pixel_mm / grid.focal_mm
    return (col_px - axis_px[0]) * per_px, (row_px - axis_px[1]) * per_px


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
        grid, (right, down) = self.grid, self.shift_px
        axis_px = (grid.width - 1) / 2 + right, (grid.height - 1) / 2 + down
        row_px, col_px = (np.asarray(px, dtype=np.float64) for px in (row_px, col_px))
        x, y = _film_slopes(grid, row_px, col_px, axis_px)
        return np.stack(np.broadcast_arrays(x, y, 1.0), axis=-1) @ self.rotation.T

    def on_film(self, point_mm: np.ndarray) -> np.ndarray:
        """Whether the chief rays of points (N, 3) fall on the film, (N,) bool."""
        grid = self.grid
        x, y, z = ((point_mm - self.position_mm) @ self.rotation).T
        scale_px = grid.focal_mm / grid.pixel_mm
        is_on_film = z > 0
        for offset, shift, size in ((x, self.shift_px[0], grid.width), (y, self.shift_px[1], grid.height)):
            is_on_film &= np.abs(offset * scale_px + shift * z) < z * (size / 2)
        return is_on_film

    def film_px(self, point_mm: np.ndarray) -> np.ndarray:
        """Columns and rows (N, 2), in px from the film's middle, of points (N, 3) before the camera."""
        x, y, z = ((point_mm - self.position_mm) @ self.rotation).T
        scale_px = self.grid.focal_mm / self.grid.pixel_mm
        return np.stack([x / z * scale_px + self.shift_px[0], y / z * scale_px + self.shift_px[1]], axis=1)

    def of_window(self, rows: slice, cols: slice) -> "Camera":
        """The same camera with these rows and columns of its film only."""
        grid, (right, down) = self.grid, self.shift_px
        right += (grid.width - cols.stop - cols.start) / 2
        down += (grid.height - rows.stop - rows.start) / 2
        window = replace(grid, height=rows.stop - rows.start, width=cols.stop - cols.start)
        return replace(self, grid=window, shift_px=(right, down))


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

    @property
    def axis_px(self) -> np.ndarray:
        """Column and row of each film where the camera's axis meets it, (K, L, 2)."""
        return np.array([(self.grid.width - 1) / 2, (self.grid.height - 1) / 2]) + self.shift_px

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

    def slopes(self, row_px: Any, col_px: Any, axis_px: tuple[Any, Any], lens_point: Any) -> tuple[Any, Any]:
        """Slopes (x, y), as of `_film_slopes`, of rays through points of films and points (x, y) of the lens.

        All rays of a film point meet where the chief ray, through the lens's centre, is in focus. Pinholes do
        not use `lens_point`, in mm.
        """
        x, y = _film_slopes(self.grid, row_px, col_px, axis_px)
        if self.lens is None:
            return x, y
        return x - lens_point[0] / self.lens.focus_mm, y - lens_point[1] / self.lens.focus_mm

    def film_px(
        self, view: np.ndarray, away_mm: np.ndarray, lens_point: np.ndarray | float = 0.0
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Row and column on the films of `view` (N,), and planar depth in mm, of what a lens's point sees.

        `away_mm` (N, 3) is where that is from the point of the lens, (2, N). NaN behind the camera.
        """
        k, l = np.divmod(view, self.grid.cols)
        x, y, z_mm = np.einsum("nba,nb->an", self.rotation[k, l], away_mm)
        z_mm = np.where(z_mm > 0, z_mm, np.nan)
        if self.lens is not None:
            x, y = np.stack([x, y]) + lens_point * z_mm / self.lens.focus_mm
        scale_px, axis_px = self.grid.focal_mm / self.grid.pixel_mm, self.axis_px[k, l]
        return y / z_mm * scale_px + axis_px[:, 1], x / z_mm * scale_px + axis_px[:, 0], z_mm

    def image_px_per_mm2(self, normal: np.ndarray, away_mm: np.ndarray, z_mm: np.ndarray) -> np.ndarray:
        """Area (N,) of the image, in px^2, of each mm^2 of a surface of this unit `normal` (N, 3).

        It is `away_mm` (N, 3) from the camera, at the planar depth `z_mm` (N,); 0 if it faces away, or if the
        depth is NaN.
        """
        scale_px = self.grid.focal_mm / self.grid.pixel_mm
        return np.nan_to_num(scale_px**2 * np.maximum(-(normal * away_mm).sum(axis=1), 0) / z_mm**3)

    def rays(
        self, k: np.ndarray, l: np.ndarray, row_px: np.ndarray, col_px: np.ndarray, lens_point: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Origins and unit directions (N, 3) of rays through points of films and of the lens (2, N) in mm.

        `path_tracing.film_rays` makes the same on the renderer's side.
        """
        axis_px = self.axis_px[k, l]
        x, y = self.slopes(row_px, col_px, (axis_px[:, 0], axis_px[:, 1]), lens_point)
        origin, rotation = self.position_mm[k, l], self.rotation[k, l]
        if self.lens is not None:
            origin = origin + np.einsum("nab,bn->na", rotation[..., :2], lens_point)
        ahead = 1 / np.sqrt(1 + x * x + y * y)
        direction = np.stack([x * ahead, y * ahead, ahead], axis=1)
        return origin, np.einsum("nab,nb->na", rotation, direction)


Cameras = CameraGrid | Rig
"""A bare grid stands for pinholes exactly where they ought to be."""


def as_rig(cameras: Cameras) -> Rig:
    """The rig that these cameras are."""
    if isinstance(cameras, Rig):
        return cameras
    counts = cameras.cols, cameras.rows
    spans_mm = [pitch * (count - 1) for pitch, count in zip(cameras.pitch_mm, counts, strict=True)]
    x_mm, y_mm = (np.linspace(-mm / 2, mm / 2, n) for mm, n in zip(spans_mm, counts, strict=True))
    across, down = np.meshgrid(x_mm, y_mm)
    position_mm = np.stack([across, down, np.zeros_like(across)], axis=-1)
    return Rig(cameras, position_mm, np.tile(np.eye(3), (*across.shape, 1, 1)))


def corners(grid: CameraGrid) -> list[tuple[int, int]]:
    """The cameras (k, l) at the corners of a grid: four, or fewer of a single row or column."""
    return [(k, l) for k in sorted({0, grid.rows - 1}) for l in sorted({0, grid.cols - 1})]


def coarser(grid: CameraGrid, side_px: int, *, least_px: int = 1, may_be_finer: bool = False) -> CameraGrid:
    """The same cameras with the same field of view on at most `side_px` pixels to a side, and `least_px`.

    Pixels become smaller only if it `may_be_finer`.
    """
    scale = max(grid.shape_HW) / side_px
    scale = scale if may_be_finer else max(1.0, scale)
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


def rig_of(grid: Grid, seed: int) -> Rig:
    """The cameras of a recipe's grid, with their lens and errors of calibration, by a random stream each."""
    rig, errors = replace(as_rig(grid.camera_grid()), lens=grid.lens), grid.errors
    if errors is None:
        return rig
    rows, cols, _ = rig.position_mm.shape
    streams = (seeds.generator(seed, view=view, stage="camera errors") for view in range(rows * cols))
    normal = np.stack([stream.standard_normal(6) for stream in streams]).reshape(rows, cols, 6)
    off_mm, angles_deg = normal[..., :3] * errors.position_sd_mm, normal[..., 3:] * errors.rotation_sd_deg
    rotation = np.stack([[turn(angles) for angles in row] for row in angles_deg])
    return replace(rig, position_mm=rig.position_mm * (1 + errors.pitch_error) + off_mm, rotation=rotation)


def turn(angles_deg: np.ndarray) -> np.ndarray:
    """Rotation (3, 3) about the fixed axes X, then Y, then Z by these angles, right-handed.

    Turned about X by a positive angle a camera looks further up, about Y further right, and about Z its
    right side goes down.
    """
    total = np.eye(3)
    for axis, angle in enumerate(np.radians(angles_deg)):
        first, second = (axis + 1) % 3, (axis + 2) % 3
        about_axis = np.eye(3)
        about_axis[first, first] = about_axis[second, second] = math.cos(angle)
        about_axis[second, first], about_axis[first, second] = math.sin(angle), -math.sin(angle)
        total = about_axis @ total
    return total
