"""The layout of the 4D Light Field Benchmark of Konstanz and Heidelberg (Honauer et al., ACCV 2016).

    input_Cam000.png ...        8-bit RGB of every camera, row by row from the top left
    parameters.cfg              cameras and range of disparities
    gt_disp_lowres.pfm          disparity in px of the middle camera, gt_depth_lowres.pfm depth in metres
    gt_disp_lowres_Cam000.pfm   the same of every camera, and gt_depth_..., if the dataset has view_z_mm
    README.txt                  what the pixels are, and which maps are left out

Disparity is relative to the focus plane at F: baseline focal (1 / z - 1 / F) / pixel, in px per camera step,
positive for what is nearer than F. The views of a grid with the shear s have F = baseline focal / (s pixel).
"""

import configparser
import io
import math
import re
from collections.abc import Callable
from pathlib import Path
from textwrap import fill

import numpy as np

from pcii.base.errors import InputError
from pcii.base.plain_text import visible
from pcii.exchange.export_pictures import pictures_of, write_pfm, write_png
from pcii.store.dataset import Dataset

PARAMETERS = "parameters.cfg"
README = "README.txt"
INFINITY_M = 1e9
"""Focus distance of a grid without shear. The benchmark's own tools divide by the focus distance and multiply
with it: infinity or 0 would make NaN of all disparities; this changes none by more than 1e-8 of itself."""


def write_hci(dataset: Dataset, folder: Path) -> None:
    """Write the images, the parameters, the maps that have a camera to belong to, and a README.

    Raises `InputError` for a grid whose pitch or shear differs between the axes, or whose shear is negative.
    """
    grid = dataset.grid
    baseline_mm = _of_both_axes(dataset, "pitch_mm", grid.pitch_mm)
    shear_px = _of_both_axes(dataset, "shear_px", grid.shear_px)
    if shear_px < 0:
        raise InputError(
            f"{dataset.path}: shear_px: the HCI layout has a focus distance, and views sheared by "
            f"{shear_px:g} px have none; export nerfstudio or events"
        )
    pictures = pictures_of(dataset)
    digits = max(3, len(str(grid.view_count - 1)))
    names = {(k, l): f"Cam{k * grid.cols + l:0{digits}d}" for k, l in np.ndindex(grid.rows, grid.cols)}
    for (k, l), name in names.items():
        write_png(folder / f"input_{name}.png", pictures.view(k, l))

    def disparity_px(z_mm: np.ndarray) -> np.ndarray:
        return baseline_mm * grid.focal_mm / (z_mm.astype(np.float64) * grid.pixel_mm) - shear_px

    for suffix, z_mm in _depth_maps_mm(dataset, names).items():
        write_pfm(folder / f"gt_depth_lowres{suffix}.pfm", z_mm / 1000)
        write_pfm(folder / f"gt_disp_lowres{suffix}.pfm", disparity_px(z_mm))
    (folder / PARAMETERS).write_text(_parameters(dataset, baseline_mm, shear_px, disparity_px))
    (folder / README).write_text(_readme(dataset, pictures.meaning))


def _of_both_axes(dataset: Dataset, name: str, pair: tuple[float, float]) -> float:
    """The value that both axes have in common; that of an axis with one camera does not matter."""
    grid = dataset.grid
    values = [value for value, cameras in zip(pair, (grid.cols, grid.rows), strict=True) if cameras > 1]
    if len(values) == 2 and not math.isclose(*values, rel_tol=1e-9):
        raise InputError(
            f"{dataset.path}: {name}: the HCI layout has one value for both axes, and this grid has "
            f"{pair[0]:g} across and {pair[1]:g} down; export nerfstudio or events"
        )
    return (values or pair)[0]


def _depth_maps_mm(dataset: Dataset, names: dict[tuple[int, int], str]) -> dict[str, np.ndarray]:
    """Maps of depth (H, W) by the suffix of their files; none of cameras that have errors of calibration."""
    maps: dict[str, np.ndarray] = {}
    if dataset.has_truth_array("camera_position_mm"):
        return maps
    if dataset.has_truth_array("view_z_mm"):
        z_mm = dataset.truth_array("view_z_mm")
        maps = {f"_{name}": z_mm[camera] for camera, name in names.items()}
    if dataset.truth is not None and dataset.grid.rows % 2 and dataset.grid.cols % 2:
        maps[""] = dataset.truth.z_mm
    return maps


def _parameters(
    dataset: Dataset, baseline_mm: float, shear_px: float, disparity_px: Callable[[np.ndarray], np.ndarray]
) -> str:
    """The text of parameters.cfg: sections and keys as the benchmark's tools read and write them."""
    grid, recipe = dataset.grid, dataset.manifest.recipe
    focus_m = grid.focal_mm * baseline_mm / (shear_px * grid.pixel_mm) / 1000 if shear_px else INFINITY_M
    lens = recipe.get("grid", {}).get("lens")
    lowest, highest = _range_px(dataset, disparity_px)
    values = {
        "intrinsics": {
            "focal_length_mm": grid.focal_mm,
            "image_resolution_x_px": grid.width,
            "image_resolution_y_px": grid.height,
            "sensor_size_mm": grid.pixel_mm * max(grid.width, grid.height),
            "fstop": grid.focal_mm / lens["aperture_mm"] if lens else math.inf,
        },
        "extrinsics": {
            "num_cams_x": grid.cols,
            "num_cams_y": grid.rows,
            "baseline_mm": baseline_mm,
            "focus_distance_m": focus_m,
            "center_cam_x_m": 0.0,
            "center_cam_y_m": 0.0,
            "center_cam_z_m": 0.0,
            # A camera of Blender's looks along -Z with Y up; these look along +Z with Y down.
            "center_cam_rx_rad": math.pi,
            "center_cam_ry_rad": 0.0,
            "center_cam_rz_rad": 0.0,
            "offset": shear_px,
        },
        "meta": {
            "scene": re.sub(r"[^A-Za-z0-9._-]", "_", dataset.name),
            "category": "additional",
            "date": "",
            "version": "",
            "authors": "",
            "contact": "",
            "cycles_seed": recipe.get("seed") or 0,
            "disp_min": lowest,
            "disp_max": highest,
            "frustum_disp_min": lowest,
            "frustum_disp_max": highest,
            "depth_map_scale": 1.0,
        },
    }
    parser = configparser.ConfigParser(delimiters="=", interpolation=None)
    parser.read_dict(values)
    text = io.StringIO()
    parser.write(text)
    return text.getvalue()


def _range_px(dataset: Dataset, disparity_px: Callable[[np.ndarray], np.ndarray]) -> tuple[float, float]:
    """Least and largest disparity, outwards to a tenth of a pixel: of the truth, else of the recipe's range.

    NaN if nothing is known of the depths.
    """
    depths_mm = dataset.analysis.get("z_range_mm") if dataset.truth is None else dataset.truth.z_mm
    if depths_mm is None:
        return math.nan, math.nan
    disparities = disparity_px(np.asarray(depths_mm))
    return math.floor(10 * disparities.min()) / 10, math.ceil(10 * disparities.max()) / 10


def _readme(dataset: Dataset, meaning_of_pixels: str) -> str:
    paragraphs = [
        f"{visible(dataset.name)}: integral images in the layout of the HCI 4D light field benchmark.",
        f"Images. Pixels are {meaning_of_pixels}. input_Cam000.png is the camera at the top left, the next "
        f"one is to its right; the grid has {dataset.grid.rows} rows and {dataset.grid.cols} columns.",
        "Maps. gt_depth_lowres.pfm and gt_disp_lowres.pfm are of the middle camera, those with the name of a "
        "camera are of that camera. A grid with an even number of rows or columns has no middle camera: its "
        "centre is between cameras. Cameras with errors of calibration have no maps, and neither has a "
        "dataset without truth. Disparity is in px per camera step, relative to the focus plane: positive is "
        "nearer. gt_depth is planar, in m, and infinite where nothing is hit. Rows of a PFM file run from "
        "the bottom to the top.",
        f"{PARAMETERS}. A focus_distance_m of {INFINITY_M:g} stands for infinity: parallel views that are "
        "not shifted. offset is the shift in px per camera that makes views converge at focus_distance_m. "
        "center_cam is the middle of the grid, in the world of the dataset: X right, Y down, Z forward. An "
        "fstop of inf is a pinhole. disp_min and disp_max are nan where no depths are known. Date, version, "
        "authors and contact are left empty.",
    ]
    return "\n\n".join(fill(paragraph, 100) for paragraph in paragraphs) + "\n"
