"""The layout of the 4D Light Field Benchmark of Konstanz and Heidelberg (Honauer et al., ACCV 2016).

    input_Cam000.png ...        8-bit RGB of every camera, row by row from the top left
    parameters.cfg              cameras and range of disparities
    gt_disp_lowres.pfm          disparity in px of the middle camera, gt_depth_lowres.pfm depth in metres
    gt_disp_lowres_Cam000.pfm   the same of every camera, and gt_depth_..., if the dataset has view_z_mm
    README.txt                  what the pixels are

Cameras are parallel and their sensors shifted, so that the disparity between neighbours is 0 at the focus
distance F: d = (f b / p) (1 / z - 1 / F) px, of focal length f, baseline b, and pixels of the side
p = sensor size / longer side of the image. The views of a grid with the shear s have F = f b / (s p).
"""

import configparser
import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from pcii.base import InputError, Report, silent, visible
from pcii.exchange.depth_files import FARTHEST_MM, NEAREST_MM
from pcii.exchange.elemental_images import Encoding, KnownViews, import_images
from pcii.exchange.number_files import decode, listed_names, picture_of
from pcii.exchange.stated_images import Note, Optics, warn
from pcii.figures import to_srgb8
from pcii.sections import demosaic
from pcii.store import Dataset, first_fault
from pcii.types import Truth

PARAMETERS = "parameters.cfg"
PATTERN = "input_Cam{index:03d}.png"
VIEW = re.compile(r"input_cam.*\.png", re.IGNORECASE)
DEPTH, DISPARITY = "gt_depth_lowres.pfm", "gt_disp_lowres.pfm"
README = "README.txt"
WHITE_QUANTILE = 0.999
"""Share of the values of the middle view that are at most white. A larger one makes pictures darker."""
INFINITY_M = 1e9
"""Focus distance of a grid without shear. The benchmark's own tools divide by the focus distance and multiply
with it: infinity or 0 would make NaN of all disparities; this changes none by more than 1e-8 of itself."""
Count = Annotated[int, Field(ge=1)]
Length = Annotated[float, Field(ge=1e-6)]
Disparity = Annotated[float, Field(allow_inf_nan=True)]


class _Parameters(BaseModel):
    """What parameters.cfg says of the cameras; a range of nan says nothing, by which exports say so."""

    model_config = ConfigDict(extra="allow", allow_inf_nan=False)
    num_cams_x: Count
    num_cams_y: Count
    image_resolution_x_px: Count
    image_resolution_y_px: Count
    focal_length_mm: Length
    baseline_mm: Length
    sensor_size_mm: Length
    focus_distance_m: Annotated[float, Field(ge=0)]
    disp_min: Disparity = math.nan
    disp_max: Disparity = math.nan


def import_hci(
    folder: str | Path,
    *,
    encoding: Encoding | None = None,
    cfa: str | None = None,
    report: Report = silent,
    note: Note = warn,
) -> KnownViews:
    """Views, cameras and true depth of a folder of the HCI 4D light field benchmark.

    The folder has parameters.cfg, input_Cam000.png and so on row by row, and maybe gt_depth_lowres.pfm (m)
    or gt_disp_lowres.pfm (px). These maps are of the middle view, which is the virtual centre of an odd grid
    only: of an even grid there is no truth. For `encoding` and `cfa` see `pcii.import_images`; `note` takes
    the names of files and parameters that are not used. Raises `InputError` for what is missing or wrong.
    """
    root = Path(folder)
    stated = _read_parameters(root / PARAMETERS)
    rows, cols = stated.num_cams_y, stated.num_cams_x
    shape_HW = stated.image_resolution_y_px, stated.image_resolution_x_px
    pixel_mm = stated.sensor_size_mm / max(shape_HW)
    parallax_px_mm = stated.focal_length_mm * stated.baseline_mm / pixel_mm
    focus_m = stated.focus_distance_m
    shear_px = parallax_px_mm / (1000 * focus_m) if 0 < focus_m < INFINITY_M else 0.0
    optics = Optics(
        pitch_mm=(stated.baseline_mm, stated.baseline_mm),
        focal_mm=stated.focal_length_mm,
        pixel_mm=pixel_mm,
        shear_px=(shear_px, shear_px),
    )

    def depth_mm(disparity_px: np.ndarray) -> np.ndarray:
        with np.errstate(divide="ignore"):
            return parallax_px_mm / (disparity_px.astype(np.float64) + shear_px)

    others: list[str] = []  # files that are no views are named with those of the benchmark
    options = {"encoding": encoding, "cfa": cfa, "report": report, "note": others.append}
    views = import_images(root, PATTERN, optics, grid=(rows, cols), **options)
    if views.grid.shape_HW != shape_HW:
        raise InputError(
            f"{root / PARAMETERS}: image_resolution is {shape_HW[0]} x {shape_HW[1]} px, and the views are "
            f"{views.grid.height} x {views.grid.width}, rows x columns"
        )
    near, far = depth_mm(np.array([stated.disp_max, stated.disp_min])).tolist()
    maps = [name for name in (DEPTH, DISPARITY) if (root / name).is_file()]
    truth = None
    if maps and (rows % 2 == 0 or cols % 2 == 0):
        note(f"not used: {maps[0]}, of a view beside the centre of an even grid, {rows} x {cols}")
    elif maps:
        truth = _true_depth(root / maps[0], shape_HW, depth_mm)
        note(f"with the true depth of the virtual centre, {maps[0]}")
    files = {path.name for path in root.iterdir() if path.is_file()}
    unused = sorted(files - {PARAMETERS, *maps[:1]} - {*filter(VIEW.fullmatch, files)})
    if unused:
        note(f"not used: {listed_names(unused)}")
    if stated.model_extra:
        note(f"not used of {PARAMETERS}: {listed_names([*stated.model_extra])}")
    return KnownViews(views, truth, (near, far) if 0 < near < far < math.inf else None)


def _read_parameters(path: Path) -> _Parameters:
    if not path.is_file():
        raise InputError(f"{path}: missing; the benchmark's folders have it")
    parser = configparser.ConfigParser(interpolation=None, strict=False, inline_comment_prefixes=("#", ";"))
    try:
        parser.read_string(path.read_bytes().decode("utf-8-sig", "replace"))
        values = {name: text for section in parser.sections() for name, text in parser[section].items()}
        return _Parameters.model_validate(values)
    except configparser.Error as fault:
        sentence = visible(" ".join(str(fault).split()))
        raise InputError(f"{path}: not a file of parameters ({sentence})") from None
    except ValidationError as fault:
        raise InputError(f"{path}: {first_fault(fault)}") from None


def _true_depth(path: Path, shape_HW: tuple[int, int], depth_mm: Callable[[np.ndarray], np.ndarray]) -> Truth:
    """The truth of a map of depth or disparity; `InputError`, naming it, for another size or wrong depths."""
    picture = picture_of(path, ["PFM"])
    if picture.shape[:2] != shape_HW:
        raise InputError(f"{path}: is {picture.layout()}, and the views {shape_HW[0]} x {shape_HW[1]} px")
    numbers = decode(picture)[0, ..., 0].astype(np.float64)
    z_mm = 1000 * numbers if path.name == DEPTH else depth_mm(numbers)
    is_depth = (z_mm >= NEAREST_MM) & (z_mm <= FARTHEST_MM)
    if not (is_depth | np.isposinf(z_mm)).all():  # NaN, or bytes in wrong order
        raise InputError(f"{path}: holds depths that are not between 0.1 mm and 100 km")
    return Truth(z_mm.astype(np.float32), np.zeros(z_mm.shape, np.int16), {}, are_objects_known=False)


def write_hci(dataset: Dataset, folder: Path) -> None:
    """Write the images, the parameters, the maps that have a camera to belong to, and a README.

    Raises `InputError` for a grid whose pitch or shear differs between the axes, or whose shear is negative.
    """
    grid = dataset.grid
    baseline_mm = _of_both_axes(dataset, "pitch_mm")
    shear_px = _of_both_axes(dataset, "shear_px")
    if shear_px < 0:
        raise InputError(
            f"{dataset.path}: shear_px: the HCI layout has a focus distance, and views sheared by "
            f"{shear_px:g} px have none; export nerfstudio or events"
        )
    picture, _, meaning = pictures_of(dataset)
    digits = max(3, len(str(grid.view_count - 1)))
    names = {(k, l): f"Cam{k * grid.cols + l:0{digits}d}" for k, l in np.ndindex(grid.rows, grid.cols)}
    for (k, l), name in names.items():
        write_png(folder / f"input_{name}.png", picture(k, l))

    def disparity_px(z_mm: np.ndarray) -> np.ndarray:
        return baseline_mm * grid.focal_mm / (z_mm.astype(np.float64) * grid.pixel_mm) - shear_px

    maps: dict[str, np.ndarray] = {}
    if not dataset.has_truth_array("camera_position_mm"):  # errors of calibration, which the layout has not
        if dataset.has_truth_array("view_z_mm"):
            view_z_mm = dataset.truth_array("view_z_mm")
            maps = {f"_{name}": view_z_mm[camera] for camera, name in names.items()}
        if dataset.truth is not None and grid.rows % 2 and grid.cols % 2:
            maps[""] = dataset.truth.z_mm
    for suffix, z_mm in maps.items():
        for kind, values in (("depth", z_mm / 1000), ("disp", disparity_px(z_mm))):
            # Debevec's PFM: rows from the bottom to the top, the scale -1 for little endian.
            content = f"Pf\n{grid.width} {grid.height}\n-1\n".encode() + values[::-1].astype("<f4").tobytes()
            (folder / f"gt_{kind}_lowres{suffix}.pfm").write_bytes(content)
    (folder / PARAMETERS).write_text(_parameters(dataset, baseline_mm, shear_px, disparity_px))
    (folder / README).write_text(
        f"{visible(dataset.name)}: {grid.rows} x {grid.cols} integral images, row by row from the top left.\n"
        f"Pixels are {meaning}.\nDepth is planar, infinite where nothing is hit; X points right, Y "
        f"down, Z forward. A focus_distance_m of {INFINITY_M:g} stands for views that are not shifted.\n"
    )


def _of_both_axes(dataset: Dataset, name: Literal["pitch_mm", "shear_px"]) -> float:
    """The value that both axes have in common; that of an axis with one camera does not matter."""
    grid, pair = dataset.grid, getattr(dataset.grid, name)
    values = [value for value, cameras in zip(pair, (grid.cols, grid.rows), strict=True) if cameras > 1]
    if len(values) == 2 and not math.isclose(*values, rel_tol=1e-9):
        raise InputError(
            f"{dataset.path}: {name}: the HCI layout has one value for both axes, and this grid has "
            f"{pair[0]:g} across and {pair[1]:g} down; export nerfstudio or events"
        )
    return (values or pair)[0]


def _parameters(
    dataset: Dataset, baseline_mm: float, shear_px: float, disparity_px: Callable[[np.ndarray], np.ndarray]
) -> str:
    """The text of parameters.cfg: sections and keys as the benchmark's tools read and write them."""
    grid, recipe = dataset.grid, dataset.manifest.recipe
    focus_m = grid.focal_mm * baseline_mm / (shear_px * grid.pixel_mm) / 1000 if shear_px else INFINITY_M
    lens = recipe.get("grid", {}).get("lens")
    depths_mm = dataset.analysis.get("z_range_mm") if dataset.truth is None else dataset.truth.z_mm
    lowest = highest = math.nan
    if depths_mm is not None:  # outwards to a tenth of a pixel
        disparities = disparity_px(np.asarray(depths_mm))
        lowest, highest = math.floor(10 * disparities.min()) / 10, math.ceil(10 * disparities.max()) / 10
    scene = re.sub(r"[^A-Za-z0-9._-]", "_", dataset.name)
    # A camera of Blender's looks along -Z with Y up; these look along +Z with Y down: turned by pi about X.
    return f"""[intrinsics]
focal_length_mm = {grid.focal_mm}
image_resolution_x_px = {grid.width}
image_resolution_y_px = {grid.height}
sensor_size_mm = {grid.pixel_mm * max(grid.width, grid.height)}
fstop = {grid.focal_mm / lens["aperture_mm"] if lens else math.inf}

[extrinsics]
num_cams_x = {grid.cols}
num_cams_y = {grid.rows}
baseline_mm = {baseline_mm}
focus_distance_m = {focus_m}
center_cam_x_m = 0.0
center_cam_y_m = 0.0
center_cam_z_m = 0.0
center_cam_rx_rad = {math.pi}
center_cam_ry_rad = 0.0
center_cam_rz_rad = 0.0
offset = {shear_px}

[meta]
scene = {scene}
category = additional
date = {""}
version = {""}
authors = {""}
contact = {""}
cycles_seed = {recipe.get("seed") or 0}
disp_min = {lowest}
disp_max = {highest}
frustum_disp_min = {lowest}
frustum_disp_max = {highest}
depth_map_scale = 1.0

"""


def pictures_of(dataset: Dataset) -> tuple[Callable[[int, int], np.ndarray], dict[str, Any], str]:
    """Pictures of a dataset's radiance, whose mosaics are demosaiced, or else of its photons, in grey.

    Returns a function of the picture of camera (k, l), uint8 (H, W, 3), with one white for all, which of
    radiance is a value of the middle view; what its numbers are, as members of transforms.json; and the same
    as the end of a sentence. Raises `InputError` for a dataset with neither.
    """
    views = dataset.views
    if views is None:
        counts = dataset.counts
        photons = max(int(counts.events.n.max(initial=0)), 1)

        def grey(k: int, l: int) -> np.ndarray:
            levels = np.round(255 / photons * counts.view(k, l)).astype(np.uint8)
            return np.repeat(levels[..., None], 3, axis=2)

        meaning = f"photon counts in grey, not gamma-encoded: 255 is {photons} photons in the pixel"
        members = {"quantity": "photons", "unit": "photons", "white": float(photons), "cfa": dataset.cfa}
        return grey, members, meaning

    def colours(k: int, l: int) -> np.ndarray:
        image = views.view(k, l)
        return image if views.cfa is None else demosaic(image[..., 0], cfa=views.cfa)

    unit = visible(str(dataset.manifest.radiance_unit or "radiance"))
    middle = colours(views.grid.rows // 2, views.grid.cols // 2)
    white = float(np.float32(np.quantile(middle, WHITE_QUANTILE, method="lower")))
    white = white if white > 0 else 1.0
    meaning = f"radiance, encoded as sRGB: 255 is {white:.6g} ({unit}) or more; mosaics are demosaiced"
    members = {"quantity": "radiance", "unit": unit, "white": white}
    return lambda k, l: to_srgb8(colours(k, l), white), members, meaning


def write_png(path: Path, image: np.ndarray) -> None:
    """Write an image (H, W) or (H, W, 3), uint8 or uint16, as PNG.

    Pillow, which draws the other pictures, has no colour images of 16 bits.
    """
    import imagecodecs

    path.write_bytes(imagecodecs.png_encode(np.ascontiguousarray(image)))
