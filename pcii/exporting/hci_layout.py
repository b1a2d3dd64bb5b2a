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
from collections.abc import Callable, Mapping
from pathlib import Path
from textwrap import fill

import numpy as np

from pcii.base.errors import InputError
from pcii.base.plain_text import visible
from pcii.core.camera_grid import CameraGrid
from pcii.exchange.written_pixels import write_pfm, write_png
from pcii.exporting.view_names import number_width
from pcii.exporting.view_pictures import pictures_of
from pcii.io.dataset import Dataset

PARAMETERS = "parameters.cfg"
README = "README.txt"
INFINITY_M = 1e9
"""Focus distance of a grid without shear. The benchmark's own tools divide by the focus distance and multiply
with it: infinity or 0 would make NaN of all disparities; this changes none by more than 1e-8 of itself."""


def write_hci(dataset: Dataset, folder: Path) -> None:
    """Write the images, the parameters, the maps that have a camera to belong to, and a README."""
    grid = dataset.grid
    baseline_mm = _of_both_axes(dataset, "pitch_mm", grid.pitch_mm)
    shear_px = _of_both_axes(dataset, "shear_px", grid.shear_px)
    if shear_px < 0:
        raise InputError(
            f"{dataset.path}: shear_px: the HCI layout has a focus distance, and views sheared by "
            f"{shear_px:g} px have none; export saii, events or exr"
        )
    focus_m = grid.focal_mm * baseline_mm / (shear_px * grid.pixel_mm) / 1000 if shear_px else INFINITY_M
    pictures = pictures_of(dataset)
    names = _camera_names(grid)
    for (k, l), name in names.items():
        write_png(folder / f"input_{name}.png", pictures.view(k, l))

    def disparity_px(z_mm: np.ndarray | float) -> np.ndarray:
        return baseline_mm * grid.focal_mm / (np.asarray(z_mm, np.float64) * grid.pixel_mm) - shear_px

    maps, maps_are = _depth_maps(dataset, names)
    for suffix, z_mm in maps.items():
        write_pfm(folder / f"gt_depth_lowres{suffix}.pfm", z_mm / 1000)
        write_pfm(folder / f"gt_disp_lowres{suffix}.pfm", disparity_px(z_mm))
    parameters = _parameters(dataset, baseline_mm, shear_px, focus_m, disparity_px)
    (folder / PARAMETERS).write_text(parameters)
    (folder / README).write_text(_readme(dataset, pictures.meaning, maps_are))


def _of_both_axes(dataset: Dataset, name: str, pair: tuple[float, float]) -> float:
    """The value that both axes have in common; of an axis with one camera it does not matter."""
    grid = dataset.grid
    used = [value for value, cameras in zip(pair, (grid.cols, grid.rows), strict=True) if cameras > 1]
    if len(used) == 2 and not math.isclose(*used, rel_tol=1e-9):
        raise InputError(
            f"{dataset.path}: {name}: the HCI layout has one for both axes, and this grid has {pair[0]:g} "
            f"across and {pair[1]:g} down; export saii, events or exr"
        )
    return (used or pair)[0]


def _camera_names(grid: CameraGrid) -> dict[tuple[int, int], str]:
    width = number_width(grid.view_count, 3)
    return {(k, l): f"Cam{k * grid.cols + l:0{width}d}" for k, l in np.ndindex(grid.rows, grid.cols)}


def _depth_maps(dataset: Dataset, names: dict[tuple[int, int], str]) -> tuple[dict[str, np.ndarray], str]:
    """Maps of depth (H, W) in mm by the suffix of their files, and a sentence about them."""
    grid = dataset.grid
    if dataset.has_truth_array("camera_position_mm"):
        return {}, (
            "None: the cameras are not quite where they ought to be, and the truth of the virtual centre "
            "belongs to none of them."
        )
    maps: dict[str, np.ndarray] = {}
    if dataset.has_truth_array("view_z_mm"):
        every = dataset.truth_array("view_z_mm")
        maps = {f"_{name}": every[k, l] for (k, l), name in names.items()}
    if dataset.truth is None:
        return maps, "Of every camera." if maps else "None: the dataset has no truth."
    if grid.rows % 2 and grid.cols % 2:
        return maps | {"": dataset.truth.z_mm}, (
            f"gt_depth_lowres.pfm and gt_disp_lowres.pfm are of the middle camera, "
            f"input_{names[grid.rows // 2, grid.cols // 2]}.png"
            + ("; those with the name of a camera are of that camera." if maps else ".")
        )
    return maps, (
        "gt_depth_lowres.pfm and gt_disp_lowres.pfm are left out: the grid has an even number of rows or "
        "columns, and the truth of its centre, between cameras, belongs to none of the images."
        + (" Those with the name of a camera are of that camera." if maps else "")
    )


def _parameters(
    dataset: Dataset,
    baseline_mm: float,
    shear_px: float,
    focus_m: float,
    disparity_px: Callable[[np.ndarray | float], np.ndarray],
) -> str:
    """The text of parameters.cfg: sections and keys as the benchmark's tools read and write them."""
    grid = dataset.grid
    lowest, highest = _range_px(dataset, disparity_px)
    values = {
        "intrinsics": {
            "focal_length_mm": grid.focal_mm,
            "image_resolution_x_px": grid.width,
            "image_resolution_y_px": grid.height,
            "sensor_size_mm": grid.pixel_mm * max(grid.width, grid.height),
            "fstop": _f_number(dataset),
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
            "cycles_seed": dataset.manifest.get("recipe", {}).get("seed") or 0,
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


def _f_number(dataset: Dataset) -> float:
    """Of the recipe's lens; infinity for pinholes."""
    grid = dataset.manifest.get("recipe", {}).get("grid")
    lens = grid.get("lens") if isinstance(grid, Mapping) else None
    aperture_mm = lens.get("aperture_mm") if isinstance(lens, Mapping) else None
    if not isinstance(aperture_mm, int | float) or aperture_mm <= 0:
        return math.inf
    return dataset.grid.focal_mm / aperture_mm


def _range_px(
    dataset: Dataset, disparity_px: Callable[[np.ndarray | float], np.ndarray]
) -> tuple[float, float]:
    """Least and largest disparity, outwards to a tenth of a pixel: of the truth, else of the recipe's range.

    NaN if nothing is known of the depths.
    """
    depths = dataset.analysis.get("z_range_mm") if dataset.truth is None else dataset.truth.z_mm
    if depths is None:
        return math.nan, math.nan
    disparities = disparity_px(np.asarray(depths))
    return math.floor(10 * disparities.min()) / 10, math.ceil(10 * disparities.max()) / 10


def _readme(dataset: Dataset, pixels_are: str, maps_are: str) -> str:
    grid = dataset.grid
    parts = [
        f"{visible(dataset.name)}: integral images in the layout of the HCI 4D light field benchmark.",
        f"Images. Pixels are {pixels_are}. input_Cam000.png is the camera at the top left, the next one is "
        f"to its right; the grid has {grid.rows} rows and {grid.cols} columns, and some readers expect as "
        "many rows as columns.",
        f"Maps. {maps_are} Disparity is in px per camera step, relative to the focus plane: positive is "
        "nearer. gt_depth is planar, in m; where nothing is hit it is infinity, and the disparity is that "
        "of infinitely far points. Rows of a PFM file run from the bottom to the top.",
        f"{PARAMETERS}. A focus_distance_m of {INFINITY_M:g} stands for infinity: parallel views that are "
        "not shifted. `offset` is the shift in px per camera that makes views converge at "
        "focus_distance_m. center_cam is the middle of the grid, in the world of the dataset: X right, Y "
        "down, Z forward. An fstop of inf is a pinhole. disp_min and disp_max are nan where nothing is "
        "known of the depths. Date, version, authors and contact are left empty.",
    ]
    return "\n\n".join(fill(part, 100) for part in parts) + "\n"
