"""The plane grid of parallel cameras that poses are of, whichever way it stands in the world."""

import itertools
from dataclasses import dataclass

import numpy as np

from pcii.base.errors import InputError
from pcii.transforms.camera_poses import MM_PER_M
from pcii.transforms.lattice_fit import Lattice, lattice_of, line_through
from pcii.transforms.transforms_file import MOST_PX, TransformsFile

MOST_CAMERAS = 1000
"""All pairs of rows, and of columns, are compared: half a million of a single row."""
NEAREST_SHARE = 1 / 4
"""Share of the picture's longer side by which the nearest points that matter move from camera to neighbour:
what is nearer is seen by at most four cameras of a row. Their depth is focal length in px x pitch /
(share x side), and a camera that is off by d in its plane moves them by d / pitch x share x side, in px. One
that is off by d along its axis moves a point r px beside the axis by r d / depth. So a camera may be off by
so much that this is MOST_PX. One that is turned by an angle moves points at the corners of the picture, r px
from the axis, by up to angle x (focal length + r^2 / focal length), at any depth."""
DIGITS = 9
"""Of lengths found from poses: doubles leave more exact, so decimals come back as they were written."""


@dataclass(frozen=True, eq=False)
class PoseGrid:
    """Which frame is which camera, and what poses and principal points tell of the grid.

    An axis with one camera has the pitch of the other; a single camera has 1 mm.
    """

    numbers: np.ndarray
    """Number of the frame that is camera (k, l), (K, L) int: rows from the top, columns from the left."""
    pitch_mm: tuple[float, float]
    shear_px: tuple[float, float]
    offset_px: tuple[float, float]
    """By how much further right and down than the film's middle the axes meet it, of all cameras alike."""

    @property
    def rows(self) -> int:
        """Number of rows of cameras."""
        return self.numbers.shape[0]

    @property
    def cols(self) -> int:
        """Number of columns of cameras."""
        return self.numbers.shape[1]


def find_grid(file: TransformsFile) -> PoseGrid:
    """The grid of the frames of a file, in whichever order they are.

    Raises `InputError` with the frame and by how much it is off: a camera that is turned, or not in its
    place; a place without a camera, or with two; a principal point that is not linear in the camera's place.
    """
    count = len(file.poses)
    if count > MOST_CAMERAS:
        raise InputError(f"{file.path}: frames: {count} cameras, and a grid has at most {MOST_CAMERAS}")
    x_mm, y_mm, z_mm = _in_common_frame(file)
    apart_mm = _usual_distance(file, np.stack([x_mm, y_mm], axis=1)) / 4
    across, down = lattice_of(x_mm, apart_mm), lattice_of(y_mm, apart_mm)
    pitch = _pitch(across, down)
    _check_places(file, np.stack([across.off(x_mm), down.off(y_mm), z_mm]), (across, down), min(pitch))
    rows, cols = down.places(y_mm), across.places(x_mm)
    numbers = _numbers(file, rows, cols, (down.count, across.count))
    (shear_x, offset_x), (shear_y, offset_y) = _centres(file, rows, cols, (down.count, across.count))
    return PoseGrid(
        numbers,
        pitch_mm=(_digits(pitch[0]), _digits(pitch[1])),
        shear_px=(shear_x, shear_y),
        offset_px=(offset_x, offset_y),
    )


def _in_common_frame(file: TransformsFile) -> np.ndarray:
    """Places (3, N) in mm to the right, down and forward in the common orientation of the cameras.

    That is the rotation nearest to the median of all matrices, element by element: a few cameras that are
    turned do not move it, so that the angle told of them is their own.
    """
    turns = file.poses[:, :3, :3]
    left, _, right = np.linalg.svd(np.median(turns, axis=0))
    common = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
    # |A - B| of two rotations is 2 sqrt(2) sin(angle / 2), exact for small angles too.
    chord = np.linalg.norm(turns - common, axis=(1, 2)) / np.sqrt(8)
    angle = 2 * np.arcsin(np.minimum(chord, 1))
    corner_px = np.hypot(file.width, file.height) / 2
    moved_px = angle * (file.focal_px + corner_px**2 / file.focal_px)
    worst = int(np.argmax(moved_px))
    if moved_px[worst] > MOST_PX:
        limit = np.degrees(angle[worst] * MOST_PX / moved_px[worst])
        raise InputError(
            f"{file.path}: {file.frame_name(worst)} is turned by {np.degrees(angle[worst]):.3g} degrees "
            f"from the common orientation; cameras of a grid are parallel, to {limit:.2g} degrees here"
        )
    place_mm = MM_PER_M * (file.poses[:, :3, 3] - np.median(file.poses[:, :3, 3], axis=0))
    place_mm = (place_mm @ common).T * np.array([[1.0], [-1.0], [-1.0]])
    place_mm[2] -= np.median(place_mm[2])
    return place_mm


def _usual_distance(file: TransformsFile, place_mm: np.ndarray) -> float:
    """Median distance from a camera to the nearest other one; infinite for a single camera."""
    from scipy.spatial import KDTree

    if len(place_mm) == 1:
        return np.inf
    nearest_mm, _ = KDTree(place_mm).query(place_mm, k=2)  # the nearest one is the camera itself
    usual = float(np.median(np.asarray(nearest_mm)[:, 1]))
    if usual == 0:
        raise InputError(f"{file.path}: frames: most cameras are at the same place as another one")
    return usual


def _pitch(across: Lattice, down: Lattice) -> tuple[float, float]:
    other = across.step or down.step or 1.0
    return across.step or other, down.step or other


def _check_places(
    file: TransformsFile, off_mm: np.ndarray, axes: tuple[Lattice, Lattice], pitch_mm: float
) -> None:
    """Refuse the camera that is farthest off its place, (3, N) in mm, if that moves points visibly."""
    side_px = max(file.width, file.height)
    nearest_mm = file.focal_px * pitch_mm / (NEAREST_SHARE * side_px)
    moved_px = (file.focal_px * np.hypot(*off_mm[:2]) + side_px / 2 * np.abs(off_mm[2])) / nearest_mm
    worst = int(np.argmax(moved_px))
    if len(moved_px) == 1 or moved_px[worst] <= MOST_PX:
        return
    right, down, forward = np.round(off_mm[:, worst], 9) + 0.0  # no -0
    off = float(np.linalg.norm(off_mm[:, worst]))
    across, along = axes
    told = (
        f"its place in a plane grid of {along.count} x {across.count} cameras, {right:.3g} to the right, "
        f"{down:.3g} down, {forward:.3g} forward"
    )
    raise InputError(
        f"{file.path}: {file.frame_name(worst)} is {off:.3g} mm from {told}; that moves near points by "
        f"{moved_px[worst]:.2g} px, and {MOST_PX:g} is allowed"
    )


def _numbers(file: TransformsFile, rows: np.ndarray, cols: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """The number of each camera's frame, (K, L); refuses places with two cameras and without one."""
    frames: dict[tuple[int, int], int] = {}
    for number, camera in enumerate(zip(rows.tolist(), cols.tolist(), strict=True)):
        if camera in frames:
            first, second = file.frame_name(frames[camera]), file.frame_name(number)
            raise InputError(f"{file.path}: {first} and {second} are at the same place of the grid")
        frames[camera] = number
    lacking = shape[0] * shape[1] - len(frames)
    if lacking:
        places = itertools.product(range(shape[0]), range(shape[1]))
        first = next(camera for camera in places if camera not in frames)
        more = f" and at {lacking - 1} more places" if lacking > 1 else ""
        raise InputError(
            f"{file.path}: frames: no camera at {first}{more} (row from the top, column from the left) of a "
            f"grid of {shape[0]} x {shape[1]}; every place of the grid needs a picture"
        )
    numbers = np.empty(shape, np.int64)
    numbers[rows, cols] = np.arange(len(rows))
    return numbers


def _centres(
    file: TransformsFile, rows: np.ndarray, cols: np.ndarray, shape: tuple[int, int]
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Shear and offset in px, each of x and of y; refuses what is not linear in the camera's place."""
    found, off = [], np.zeros((2, len(rows)))
    for axis, (index, count, side) in enumerate(
        ((cols, shape[1], file.width), (rows, shape[0], file.height))
    ):
        from_middle = file.centres_px[:, axis] - side / 2
        typical = np.array([np.median(from_middle[index == number]) for number in range(count)])
        steps = np.arange(count) - (count - 1) / 2
        offset, shear = line_through(steps, typical) if count > 1 else (float(typical[0]), 0.0)
        off[axis] = from_middle - (offset + shear * steps[index])
        rounding = 1e-12 * side
        found.append(tuple(0.0 if abs(value) < rounding else _digits(value) for value in (shear, offset)))
    off_px = np.hypot(*off)
    worst = int(np.argmax(off_px))
    if off_px[worst] > MOST_PX:
        raise InputError(
            f"{file.path}: {file.frame_name(worst)}: its principal point (cx, cy) is {off_px[worst]:.3g} px "
            "from where those of the others put it; from camera to camera it moves by one shear"
        )
    return found[0], found[1]


def _digits(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")
