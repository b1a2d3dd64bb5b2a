"""Pictures and photon cubes with the poses of their cameras, which have to be of one plane grid.

The frames of a transforms.json may be in any order and the rig anywhere in the world: right and down are
those of the pictures.
"""

from dataclasses import replace

import numpy as np

from pcii.base import InputError, Report, silent
from pcii.exchange.count_arrays import import_counts
from pcii.exchange.elemental_images import Encoding, import_images
from pcii.exchange.frame_files import AS_COUNTED, FrameFormat
from pcii.exchange.number_files import open_array
from pcii.exchange.stated_images import Note, Optics, warn
from pcii.exchange.transforms_file import MM_PER_M, MOST_PX, ROUNDING, TransformsFile
from pcii.types import CameraGrid, PhotonCounts, Views

NEAREST_SHARE = 1 / 4
"""Share of the picture's longer side by which the nearest points that matter move from camera to neighbour:
what is nearer is seen by at most four cameras of a row. Their depth is focal length in px x pitch /
(share x side), and a camera that is off by d in its plane moves them by d / pitch x share x side, in px. One
that is off by d along its axis moves a point r px beside the axis by r d / depth. So a camera may be off by
so much that this is MOST_PX. One that is turned by an angle moves points at the corners of the picture, r px
from the axis, by up to angle x (focal length + r^2 / focal length), at any depth."""
DIGITS = 9
"""Of lengths that follow from poses: doubles leave more exact, so decimals come back as they were written."""
USUAL_PIXEL_MM = 0.005
"""Taken where nothing is known: in the middle of what sensors have, and no depth depends on it."""


def import_posed_pictures(
    file: TransformsFile,
    *,
    focal_mm: float | None = None,
    pixel_mm: float | None = None,
    sensor_mm: float | None = None,
    encoding: Encoding | None = None,
    cfa: str | None = None,
    report: Report = silent,
    note: Note = warn,
) -> Views:
    """Views and cameras of the pictures of a file, whose poses are of one plane grid of parallel cameras.

    The lengths of the film are as in `find_grid`, `encoding` and `cfa` as in `import_images`.
    """
    grid, files = find_grid(file, focal_mm, pixel_mm, sensor_mm, note)
    return import_images(files, None, grid, encoding=encoding, cfa=cfa, report=report, note=note)


def import_posed_cubes(
    file: TransformsFile,
    *,
    focal_mm: float | None = None,
    pixel_mm: float | None = None,
    sensor_mm: float | None = None,
    cfa: str | None = None,
    frames: tuple[int, int] | None = None,
    stored: FrameFormat = AS_COUNTED,
    report: Report = silent,
    note: Note = warn,
) -> PhotonCounts:
    """Photon counts of the photon cubes of a file, whose cameras are those of pictures.

    A cube is (T, H, W) or, if the file or `stored` says so, packed, uint8 (T, H, W / 8); an axis of one
    channel may follow, or of three of which `cfa` says the one that each pixel keeps. `frames` are the first
    and the last to add up; `cfa` is the Bayer pattern where the file has none. Raises `InputError`, naming
    the file, for cubes that differ from what it says.
    """
    if file.cfa is not None and cfa not in (None, file.cfa):
        raise InputError(f"{file.path}: cfa: is {file.cfa}; leave out --cfa")
    grid, files = find_grid(file, focal_mm, pixel_mm, sensor_mm, note)
    first = open_array(files[0, 0])
    channels = first.shape[3] if first.ndim == 4 else 1
    if file.channels not in (None, channels):
        raise InputError(f"{file.path}: c: is {file.channels}, and {files[0, 0]} has {channels} channels")
    if stored.bitpack or file.is_bitpacked:
        stored = replace(stored, bitpack=True, width=grid.width)
    options = {"cfa": file.cfa or cfa, "frames": frames, "report": report, "note": note}
    return import_counts(files, grid, stored=stored, **options)


def find_grid(
    file: TransformsFile,
    focal_mm: float | None = None,
    pixel_mm: float | None = None,
    sensor_mm: float | None = None,
    note: Note = warn,
) -> tuple[CameraGrid, np.ndarray]:
    """The grid of the frames of a file, in whichever order they are, and the file of each camera, (K, L).

    Pitch and shear are fitted by least squares; an axis with one camera has the pitch of the other, a single
    camera has 1 mm. The file has the ratio of focal length and pixel size: one length of the film gives the
    others. Raises `InputError` for more than one, and for cameras that are no such grid, with the frame that
    is off most.
    """
    from scipy.spatial import KDTree

    place_mm = _places_in_common_frame(file)
    distances, _ = KDTree(place_mm[:2].T).query(place_mm[:2].T, k=2)  # the nearest is the camera itself
    nearest_mm = np.median(np.asarray(distances)[:, 1])  # infinite for a single camera
    col, row = (_groups_of(values, nearest_mm / 4) for values in place_mm[:2])
    count, cols, rows = len(file.poses), col.max() + 1, row.max() + 1
    numbers = np.full((rows, cols), -1)
    numbers[row, col] = np.arange(count)
    if count != numbers.size or numbers.min() < 0:
        loneliest = np.argmin(np.bincount(col)[col] * np.bincount(row)[row])
        raise InputError(
            f"{file.path}: frames: {count} cameras do not stand one at each place of a plane grid, here of "
            f"{rows} x {cols}; {file.frame_name(int(loneliest))} has the fewest in line with it"
        )
    right, down = col - (cols - 1) / 2, row - (rows - 1) / 2
    steps = np.stack([right, down, np.zeros(count), right, down])
    from_middle_px = file.centres_px - np.array([file.width, file.height]) / 2
    values = np.vstack([place_mm, from_middle_px.T])
    means, slopes = values.mean(axis=1), (steps * values).sum(axis=1)
    slopes /= np.maximum((steps**2).sum(axis=1), 0.5)  # of two cameras it is 0.5, of one 0
    off = values - means[:, None] - slopes[:, None] * steps
    pitch = slopes[0] or slopes[1] or 1.0, slopes[1] or slopes[0] or 1.0
    side_px = max(file.width, file.height)
    nearest_z_mm = file.focal_px * min(pitch) / (NEAREST_SHARE * side_px)
    moved_px = (file.focal_px * np.hypot(off[0], off[1]) + side_px / 2 * np.abs(off[2])) / nearest_z_mm
    _check_moved(file, moved_px, np.linalg.norm(off[:3], axis=0), "mm from its place in a plane grid")
    off_px = np.hypot(off[3], off[4])
    _check_moved(file, off_px, off_px, "px from where cx and cy of a grid with one shear would be")
    focal_mm, pixel_mm = _film_mm(file, focal_mm, pixel_mm, sensor_mm, note)
    x, y = _digits(means[3]), _digits(means[4])
    if x or y:
        note(
            f"the axes of the cameras meet the pictures {x:g} px to the right of their middle and {y:g} px "
            "below it, alike in all: sections and depth are in the frame of the pictures"
        )
    pitch_mm, shear_px = (_digits(pitch[0]), _digits(pitch[1])), (_digits(slopes[3]), _digits(slopes[4]))
    optics = Optics(pitch_mm=pitch_mm, focal_mm=focal_mm, pixel_mm=pixel_mm, shear_px=shear_px)
    grid = optics.grid((rows, cols, file.height, file.width))
    return grid, np.array(file.file_paths, object)[numbers]


def _film_mm(
    file: TransformsFile, focal_mm: float | None, pixel_mm: float | None, sensor_mm: float | None, note: Note
) -> tuple[float, float]:
    """Focal length and side of a pixel, of which the file has the ratio, from one length of the film."""
    missing = (focal_mm, pixel_mm, sensor_mm).count(None)
    if missing < 2:
        raise InputError("focal_mm, pixel_mm, sensor_mm: give one of them; the file has their ratio")
    if focal_mm is not None:
        pixel_mm = focal_mm / file.focal_px
    else:
        pixel_mm = sensor_mm / file.width if sensor_mm is not None else pixel_mm or USUAL_PIXEL_MM
        focal_mm = _digits(file.focal_px * pixel_mm)
    if missing == 3:
        note(
            f"focal length and pixel size are not in {file.path.name}: {focal_mm:g} and {pixel_mm:g} mm have "
            "its ratio, and nothing else of them matters"
        )
    return focal_mm, pixel_mm


def _places_in_common_frame(file: TransformsFile) -> np.ndarray:
    """Places (3, N) in mm to the right, down and forward in the mean orientation of the cameras."""
    from scipy.spatial.transform import Rotation

    turns = Rotation.from_matrix(file.poses[:, :3, :3])
    common = turns.mean().inv()
    angle = (common * turns).magnitude()
    corner_px = np.hypot(file.width, file.height) / 2
    moved_px = angle * (file.focal_px + corner_px**2 / file.focal_px)
    _check_moved(file, moved_px, np.degrees(angle), "degrees turned from the mean orientation")
    place_mm = MM_PER_M * (file.poses[:, :3, 3] - file.poses[:, :3, 3].mean(axis=0))
    return common.apply(place_mm).T * np.array([[1.0], [-1.0], [-1.0]])


def _check_moved(file: TransformsFile, moved_px: np.ndarray, off: np.ndarray, what: str) -> None:
    """Refuse the camera that moves points most, if that is more than `MOST_PX`."""
    worst = int(np.argmax(moved_px))
    if moved_px[worst] > MOST_PX:
        raise InputError(
            f"{file.path}: {file.frame_name(worst)} is {off[worst]:.3g} {what}; that moves points by "
            f"{moved_px[worst]:.2g} px, and {MOST_PX:g} is allowed"
        )


def _groups_of(values: np.ndarray, apart: float) -> np.ndarray:
    """Number (N,) of the group of each value; groups have gaps of more than `apart` between them."""
    order = np.argsort(values)
    groups = np.empty(values.size, np.int64)
    groups[order] = np.cumsum(np.diff(values[order], prepend=values.min()) > apart)
    return groups


def _digits(value: float) -> float:
    return float(f"{value:.{DIGITS}g}") if abs(value) > ROUNDING else 0.0
