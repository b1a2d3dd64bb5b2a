"""The camera grid of a file: poses give pitch and shear, one length of the film all the others."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields

from pcii.base.errors import InputError
from pcii.core.camera_grid import CameraGrid
from pcii.transforms.grid_of_poses import DIGITS, PoseGrid
from pcii.transforms.transforms_file import TransformsFile
from pcii.transforms.written_members import OWN_GRID

USUAL_PIXEL_MM = 0.005
"""Taken where nothing is known: in the middle of what sensors have, and no depth depends on it."""
AGREEMENT = 1e-6
"""Relative, of a stated grid with poses and pixels: written decimals are far closer."""


@dataclass(frozen=True, kw_only=True)
class FilmSize:
    """The one length in mm that says how large the film behind the pixels is.

    Raises `InputError` for more than one, none, or a length that is not above 0.
    """

    focal_mm: float | None = None
    pixel_mm: float | None = None
    sensor_mm: float | None = None

    def __post_init__(self) -> None:
        given = {field.name: getattr(self, field.name) for field in fields(self)}
        given = {name: value for name, value in given.items() if value is not None}
        if len(given) != 1:
            raise InputError("focal_mm, pixel_mm, sensor_mm: give one of them; the file tells their ratio")
        for name, value in given.items():
            if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value < math.inf:
                raise InputError(f"{name}: expected a finite length above 0 mm, got {value!r}")

    def lengths_mm(self, focal_px: float, width: int) -> tuple[float, float]:
        """Focal length and side of a pixel in mm, of which the file tells the ratio."""
        if self.focal_mm is not None:
            return self.focal_mm, self.focal_mm / focal_px
        pixel_mm = self.pixel_mm if self.sensor_mm is None else self.sensor_mm / width
        assert pixel_mm is not None
        return float(f"{focal_px * pixel_mm:.{DIGITS}g}"), pixel_mm


def camera_grid_of(
    file: TransformsFile, found: PoseGrid, film: FilmSize | None = None
) -> tuple[CameraGrid, list[str]]:
    """The camera grid in mm, and what is to be said of it.

    A grid that the file itself states, as `simgen export` writes it, is taken as it is. Raises `InputError`
    if that disagrees with poses and pixels, or if there is a `film` beside it.
    """
    stated = file.document.get(OWN_GRID)
    if stated is not None:
        if film is not None:
            raise InputError(
                f"{file.path}: {OWN_GRID}: tells focal length and pixels; leave out their options"
            )
        return _checked(file, found, stated), []
    focal_mm, pixel_mm = (film or FilmSize(pixel_mm=USUAL_PIXEL_MM)).lengths_mm(file.focal_px, file.width)
    try:
        grid = CameraGrid(
            rows=found.rows,
            cols=found.cols,
            pitch_mm=found.pitch_mm,
            focal_mm=focal_mm,
            pixel_mm=pixel_mm,
            height=file.height,
            width=file.width,
            shear_px=found.shear_px,
        )
    except InputError as fault:
        raise InputError(f"{file.path}: {fault}") from None
    notes = []
    if film is None:
        notes.append(
            f"focal length and pixel size are not in {file.path.name}: {focal_mm:g} and {pixel_mm:g} mm have "
            "its ratio, and nothing else of them matters"
        )
    if any(found.offset_px):
        x, y = found.offset_px
        notes.append(
            f"the axes of the cameras meet the pictures {x:g} px to the right of their middle and {y:g} px "
            "below it, alike in all: sections and depth are in the frame of the pictures"
        )
    return grid, notes


def _checked(file: TransformsFile, found: PoseGrid, stated: object) -> CameraGrid:
    """The grid that the file states; `InputError` if it is none, or not that of the poses."""
    names = {field.name for field in fields(CameraGrid)}
    if not isinstance(stated, Mapping) or set(stated) != names:
        raise InputError(f"{file.path}: {OWN_GRID}: expected an object with {', '.join(sorted(names))}")
    try:
        grid = CameraGrid(**stated)
        fault = _disagreement(file, found, grid)
    except (InputError, OverflowError) as wrong:
        raise InputError(f"{file.path}: {OWN_GRID}: {wrong}") from None
    if fault is not None:
        raise InputError(f"{file.path}: {OWN_GRID}: {fault}")
    return grid


def _disagreement(file: TransformsFile, found: PoseGrid, grid: CameraGrid) -> str | None:
    """In what a grid is not that of poses and pixels; None if it is."""
    pairs: dict[str, tuple[float, float]] = {
        "rows": (grid.rows, found.rows),
        "cols": (grid.cols, found.cols),
        "height": (grid.height, file.height),
        "width": (grid.width, file.width),
        "focal_mm / pixel_mm": (grid.focal_mm / grid.pixel_mm, file.focal_px),
    }
    for axis, count, side in ((0, found.cols, file.width), (1, found.rows, file.height)):
        name = "xy"[axis]
        if count > 1:
            pairs[f"pitch_mm {name}"] = (grid.pitch_mm[axis], found.pitch_mm[axis])
            # Compared on the scale of the picture, since a shear may be 0.
            pairs[f"shear_px {name}"] = (side + grid.shear_px[axis], side + found.shear_px[axis])
        pairs[f"principal point {name}"] = (side, side + found.offset_px[axis])
    for name, (said, measured) in pairs.items():
        if not math.isclose(said, measured, rel_tol=AGREEMENT):
            return f"{name} is {said:.9g}, where poses and pixels say {measured:.9g}"
    return None
