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
from pcii.exchange.image_folders import Optics, Tell, import_images, listed_names, warn
from pcii.exchange.pixel_files import Encoding, decode, picture_of
from pcii.store.folders import read_small
from pcii.types.images import Views
from pcii.types.truth import Truth

PARAMETERS = "parameters.cfg"
PATTERN = "input_Cam{index:03d}.png"
DEPTH, DISPARITY = "gt_depth_lowres.pfm", "gt_disp_lowres.pfm"
LARGEST_PARAMETERS_BYTES = 1 << 16
INFINITY_M = 1e9
"""A focus distance from which on the cameras are not sheared; other tools divide by it."""
LEAST_MM = 1e-6
"""Of lengths that divide others."""
PLAUSIBLE_M = (1e-4, 1e5)
"""Depths beyond are of a map whose byte order is wrong."""


@dataclass(frozen=True, eq=False)
class HciScene:
    """A scene of the benchmark: its views, the true depth of an odd grid's virtual centre, and its range."""

    views: Views
    truth: Truth | None
    z_range_mm: tuple[float, float] | None


def import_hci(
    folder: str | Path,
    *,
    encoding: Encoding | None = None,
    cfa: str | None = None,
    report: Report = silent,
    tell: Tell = warn,
) -> HciScene:
    """Views, cameras and true depth of a folder of the HCI 4D light field benchmark.

    The folder has parameters.cfg, input_Cam000.png and so on row by row, and maybe gt_depth_lowres.pfm (m)
    or gt_disp_lowres.pfm (px). These maps are of the middle view, which is the virtual centre of an odd grid
    only: of an even grid there is no truth. For `encoding` and `cfa` see `pcii.import_images`; `tell` takes
    the names of files and parameters that are not used. Raises `InputError` for what is missing or wrong.
    """
    root = Path(folder)
    known = _Parameters(root / PARAMETERS)
    rows, cols = known.count("num_cams_y"), known.count("num_cams_x")
    height, width = known.count("image_resolution_y_px"), known.count("image_resolution_x_px")
    focal_mm, baseline_mm = (known.number(name, LEAST_MM) for name in ("focal_length_mm", "baseline_mm"))
    pixel_mm = known.number("sensor_size_mm", LEAST_MM) / max(width, height)
    focus_m = known.number("focus_distance_m")
    # A missing end, or nan as exports have it where no depths are known, says nothing.
    disparities = [
        math.nan if known.texts.get(name, "nan").lower() == "nan" else known.number(name, -math.inf)
        for name in ("disp_min", "disp_max")
    ]
    parallax_px_mm = focal_mm * baseline_mm / pixel_mm
    shear = parallax_px_mm / (1000 * focus_m) if 0 < focus_m < INFINITY_M else 0.0
    optics = Optics(
        pitch_mm=(baseline_mm, baseline_mm), focal_mm=focal_mm, pixel_mm=pixel_mm, shear_px=(shear, shear)
    )
    views = import_images(
        root, PATTERN, optics, grid=(rows, cols), encoding=encoding, cfa=cfa, report=report, tell=_ignore
    )
    if views.grid.shape_HW != (height, width):
        raise InputError(
            f"{root / PARAMETERS}: image_resolution is {height} x {width} px, and the views are "
            f"{views.grid.height} x {views.grid.width}, rows x columns"
        )

    def depth_mm(disparity_px: np.ndarray) -> np.ndarray:
        with np.errstate(divide="ignore"):
            return parallax_px_mm / (np.asarray(disparity_px, np.float64) + shear)

    far, near = (float(depth_mm(np.array(d))) for d in disparities)
    z_range = (near, far) if 0 < near < far < math.inf else None
    maps = [name for name in (DEPTH, DISPARITY) if (root / name).is_file()]
    truth = None
    if maps and (rows % 2 == 0 or cols % 2 == 0):
        tell(f"not used: {maps[0]}, of a view beside the centre of an even grid, {rows} x {cols}")
    elif maps:
        numbers = _map(root / maps[0], (height, width))
        z_mm = 1000 * numbers if maps[0] == DEPTH else depth_mm(numbers)
        least, most = (1000 * end for end in PLAUSIBLE_M)
        if not (((z_mm >= least) & (z_mm <= most)) | np.isposinf(z_mm)).all():
            raise InputError(
                f"{root / maps[0]}: depths are not between {PLAUSIBLE_M[0]:g} and {PLAUSIBLE_M[1]:g} m; the "
                "sign of the scale in its header, which tells the byte order, may be wrong"
            )
        truth = Truth(z_mm.astype(np.float32), np.zeros(z_mm.shape, np.int16), {})
        tell(f"with the true depth of the virtual centre, {maps[0]}")
    files = {path.name for path in root.iterdir() if path.is_file() and not path.match("input_Cam*.png")}
    unused = sorted(files - {PARAMETERS, *maps[:1]})
    if unused:
        tell(f"not used: {listed_names(unused)}")
    names = [name for name in known.texts if name not in ("disp_min", "disp_max")]
    if names:
        tell(f"not used of {PARAMETERS}: {listed_names(names)}")
    return HciScene(views, truth, z_range)


def _ignore(sentence: str) -> None:
    """Files that are no views are named with those of the benchmark."""


def _map(path: Path, shape: tuple[int, int]) -> np.ndarray:
    """Numbers (H, W) of a map of the middle view; `InputError` for another size, NaN or infinity."""
    picture = picture_of(path, ["PFM"])
    if picture.shape[:2] != shape:
        raise InputError(
            f"{path}: is {' x '.join(map(str, picture.shape[:2]))} px, where the views are "
            f"{shape[0]} x {shape[1]}"
        )
    numbers = next(decode(picture))[..., 0].astype(np.float64)
    if np.isnan(numbers).any():
        raise InputError(f"{path}: holds NaN")
    return numbers


class _Parameters:
    """The numbers of a parameters.cfg; `texts` are those by name that were not read."""

    def __init__(self, path: Path) -> None:
        content = read_small(path, LARGEST_PARAMETERS_BYTES, "the benchmark's folders have it")
        parser = configparser.ConfigParser(interpolation=None, strict=False)
        try:
            parser.read_string(content.decode("utf-8-sig"))
        except (configparser.Error, UnicodeDecodeError) as fault:
            sentence = visible(" ".join(str(fault).split()))
            raise InputError(f"{path}: not a file of parameters ({sentence})") from None
        self.path = path
        self.texts = {name: text for section in parser.sections() for name, text in parser[section].items()}

    def number(self, name: str, least: float = 0.0, *, is_whole: bool = False) -> float:
        """A number of at least `least`."""
        text = self.texts.pop(name, "nothing")
        try:
            number = float(text)
        except ValueError:
            number = math.nan
        if not least <= number < math.inf or (is_whole and number != int(number)):
            kind = "whole number" if is_whole else "number"
            raise InputError(
                f"{self.path}: {name}: expected a {kind} of at least {least:g}, got {visible(text)}"
            )
        return number

    def count(self, name: str) -> int:
        """A whole number of at least 1."""
        return int(self.number(name, 1, is_whole=True))
