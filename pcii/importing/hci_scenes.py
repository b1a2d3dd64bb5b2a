"""Scenes of the HCI 4D light field benchmark (Honauer et al. 2016): views, cameras and true depth.

Cameras are parallel and their sensors shifted, so that the disparity between neighbours is 0 at the focus
distance: d = (f b / p) (1 / z - 1 / z_focus) px, of focal length f, baseline b, and pixels of the side
p = sensor size / longer side of the image.
"""

import configparser
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pcii.base.errors import InputError
from pcii.base.plain_text import visible
from pcii.base.progress import Report, silent
from pcii.core.images import Views
from pcii.core.truth import Truth
from pcii.exchange.export_hci import INFINITY_M
from pcii.importing.camera_order import Optics
from pcii.importing.image_folders import import_images
from pcii.importing.light_encoding import Encoding
from pcii.pictures.picture_files import decode, picture_of
from pcii.store.sealed_json import read_small

PARAMETERS = "parameters.cfg"
PATTERN = "input_Cam{index:03d}.png"
DEPTH, DISPARITY = "gt_depth_lowres.pfm", "gt_disp_lowres.pfm"
LARGEST_PARAMETERS_BYTES = 1 << 16
MOST_CAMERAS = 1000
PLAUSIBLE_M = (1e-4, 1e5)


@dataclass(frozen=True, eq=False)
class HciScene:
    """A scene of the benchmark: its views, and what is known of them."""

    views: Views
    truth: Truth | None
    """True depth of the virtual centre; None if the folder has none of it."""
    without_truth: str | None
    """Why there is no truth although the folder has a map."""
    z_range_mm: tuple[float, float] | None
    """Nearest and farthest depth of the scene, if the parameters say so."""


@dataclass(frozen=True)
class _Parameters:
    rows: int
    cols: int
    height: int
    width: int
    focal_mm: float
    baseline_mm: float
    pixel_mm: float
    focus_mm: float
    """Infinite for cameras whose sensors are not shifted."""
    disparities_px: tuple[float, float] | None

    @property
    def optics(self) -> Optics:
        shear = self.parallax_px_mm / self.focus_mm
        return Optics(
            pitch_mm=(self.baseline_mm, self.baseline_mm),
            focal_mm=self.focal_mm,
            pixel_mm=self.pixel_mm,
            shear_px=(shear, shear),
        )

    @property
    def parallax_px_mm(self) -> float:
        return self.focal_mm * self.baseline_mm / self.pixel_mm

    def depth_mm(self, disparity_px: np.ndarray) -> np.ndarray:
        """Depth of signed disparities; infinite or below 0 where there is none."""
        with np.errstate(divide="ignore"):
            return 1 / (np.asarray(disparity_px, np.float64) / self.parallax_px_mm + 1 / self.focus_mm)


def import_hci(folder: str | Path, *, encoding: Encoding | None = None, report: Report = silent) -> HciScene:
    """Views, cameras and true depth of a folder of the HCI 4D light field benchmark.

    The folder has parameters.cfg, input_Cam000.png and so on row by row, and maybe gt_depth_lowres.pfm (m)
    or gt_disp_lowres.pfm (px). These maps are of the middle view, which is the virtual centre of an odd grid
    only: of an even grid there is no truth. Raises `InputError` for what is missing or wrong, naming it.
    """
    root = Path(folder)
    known = _read_parameters(root / PARAMETERS)
    views = import_images(
        root, PATTERN, known.optics, grid=(known.rows, known.cols), encoding=encoding, report=report
    )
    if views.grid.shape_KLHW[2:] != (known.height, known.width):
        raise InputError(
            f"{root / PARAMETERS}: image_resolution is {known.height} x {known.width} px, and the views are "
            f"{views.grid.height} x {views.grid.width}, rows x columns"
        )
    z_range = None
    if known.disparities_px is not None:
        far, near = (float(known.depth_mm(np.array(d))) for d in known.disparities_px)
        z_range = (near, far) if 0 < near < far < math.inf else None
    found = [name for name in (DEPTH, DISPARITY) if (root / name).is_file()]
    if not found:
        return HciScene(views, None, None, z_range)
    if known.rows % 2 == 0 or known.cols % 2 == 0:
        why = f"{found[0]} is of a view beside the centre of an even grid, {known.rows} x {known.cols}"
        return HciScene(views, None, why, z_range)
    z_mm = _true_depth(root / found[0], known)
    return HciScene(views, Truth(z_mm, np.zeros(z_mm.shape, np.int16), {}), None, z_range)


def _true_depth(path: Path, known: _Parameters) -> np.ndarray:
    """Planar depth (H, W) in mm, float32; `InputError` for depths that cannot be."""
    picture = picture_of(path, ["PFM"])
    height, width, _ = picture.shape
    if (height, width) != (known.height, known.width):
        raise InputError(
            f"{path}: is {height} x {width} px, where the views are {known.height} x {known.width}"
        )
    numbers = next(decode(picture))[..., 0].astype(np.float64)
    if path.name == DEPTH:
        z_mm = 1000 * numbers
    elif np.isfinite(numbers).all():
        z_mm = known.depth_mm(numbers)
    else:
        raise InputError(f"{path}: holds NaN or infinity")
    near, far = (1000 * end for end in PLAUSIBLE_M)
    if not (((z_mm >= near) & (z_mm <= far)) | np.isposinf(z_mm)).all():
        raise InputError(
            f"{path}: depths are not between {PLAUSIBLE_M[0]:g} and {PLAUSIBLE_M[1]:g} m; the sign of the "
            "scale in its header, which tells the byte order, may be wrong"
        )
    return z_mm.astype(np.float32)


def _read_parameters(path: Path) -> _Parameters:
    text = read_small(path, LARGEST_PARAMETERS_BYTES, "the benchmark's folders have it")
    parser = configparser.ConfigParser(interpolation=None, strict=False)
    try:
        parser.read_string(text.decode())
    except (configparser.Error, UnicodeDecodeError) as fault:
        sentence = visible(" ".join(str(fault).split()))
        raise InputError(f"{path}: not a file of parameters ({sentence})") from None

    def number(section: str, name: str) -> float:
        value = parser.get(section, name, fallback=None)
        if value is None:
            raise InputError(f"{path}: [{section}] lacks {name}")
        try:
            found = float(value)
        except ValueError:
            found = math.nan
        if not math.isfinite(found):
            raise InputError(f"{path}: [{section}] {name}: expected a number, got {visible(value)!r}")
        return found

    def above(section: str, name: str, least: float = 0.0) -> float:
        found = number(section, name)
        if found <= least:
            raise InputError(f"{path}: [{section}] {name}: expected a number above {least:g}, got {found:g}")
        return found

    def whole(section: str, name: str, most: int) -> int:
        found = above(section, name)
        if found != int(found) or found > most:
            raise InputError(
                f"{path}: [{section}] {name}: expected a whole number up to {most}, got {found:g}"
            )
        return int(found)

    width = whole("intrinsics", "image_resolution_x_px", 1 << 20)
    height = whole("intrinsics", "image_resolution_y_px", 1 << 20)
    focus_m = number("extrinsics", "focus_distance_m")
    if focus_m < 0:
        raise InputError(f"{path}: [extrinsics] focus_distance_m: expected 0 or more, got {focus_m:g}")
    # A missing end, or nan as `simgen export` writes it where it knows no depths, says nothing.
    said = [parser.get("meta", name, fallback="nan").strip().lower() for name in ("disp_min", "disp_max")]
    ends = None if "nan" in said else (number("meta", "disp_min"), number("meta", "disp_max"))
    return _Parameters(
        rows=whole("extrinsics", "num_cams_y", MOST_CAMERAS),
        cols=whole("extrinsics", "num_cams_x", MOST_CAMERAS),
        height=height,
        width=width,
        focal_mm=above("intrinsics", "focal_length_mm"),
        baseline_mm=above("extrinsics", "baseline_mm"),
        pixel_mm=above("intrinsics", "sensor_size_mm") / max(width, height),
        focus_mm=1000 * focus_m if 0 < focus_m < INFINITY_M else math.inf,
        disparities_px=ends,
    )
