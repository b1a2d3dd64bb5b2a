"""What a recipe takes of the machine, estimated before any work: memory of each step, bytes of each product.

`simgen check` reports it and `simgen generate` refuses what does not fit. Bytes per item were measured, as
the growth of the process with the number of items.
"""

import math
import os
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pcii.base.errors import InputError
from pcii.core.camera_grid import CameraGrid
from simgen.photons.counting_plan import Plan
from simgen.photons.disparity_layers import LAYER_BLUR_TILES, MOST_LAYERS, tile_px_for
from simgen.photons.pilot import MOST_RAYS
from simgen.spec.recipe import Exposure, Grid, Photons, Products, Sensor

BASE_BYTES = 4e8
"""What the renderer and its libraries take, whatever the needs."""
PIXEL_BYTES = 165.0
"""Of a pixel while the first hits of its view are found; rendering takes less."""
VIEW_BYTES = 400.0
"""Of a camera: where it stands, and what is added up for its view."""
PLANE_BYTES = 2.0
"""Of a pixel of the centre for each plane at which it is in focus or not."""
PHOTON_BYTES = 200.0
"""Of a photon, or a pixel that counts without any, while the counts are made."""
ORIGIN_BYTES = 30.0
"""Of each of several counts of one pixel while their origins are written."""
SUM_BYTES = 8.0
"""Of a pixel of any view while photons that are too many to be kept are counted."""
TILE_BYTES = 110.0
"""Of a tile of the majorant."""
EVENT_BYTES, FRAME_BYTES, TRUTH_BYTES = 16, 2, 6
"""On disk before compression: of a pixel that caught photons, of its frame, of its depth and object."""
EXR_SHARE = 0.5
"""Noise of rendered views keeps their files larger than this share of what they are before compression."""


@dataclass(frozen=True)
class Needs:
    """What of a recipe takes memory and disk; `planes` is for how many the truth says what is in focus."""

    grid: Grid
    sensor: Sensor
    photons: Photons
    exposure: Exposure | None
    products: Products
    planes: int


def bytes_of_steps(needs: Needs, plan: Plan | None) -> dict[str, float]:
    """Memory that each step of the work takes, by the fields that it grows with; without `plan` those that
    need none."""
    grid, sensor, products = needs.grid, needs.sensor, needs.products
    pixels, views = float(grid.height * grid.width), float(grid.rows * grid.cols)
    steps = {
        "grid.height, grid.width": PIXEL_BYTES * pixels,
        "grid.rows, grid.cols": VIEW_BYTES * views,
        "analysis.z_mm": PLANE_BYTES * pixels * needs.planes * products.truth,
    }
    if products.counts:
        counted = PHOTON_BYTES * pixels * views
        steps["sensor.dark_counts"] = counted * sensor.dark_counts
        keeps_each = sensor.bits is not None or products.frames
        each = sensor.hot_pixel_counts * (1 if keeps_each else ORIGIN_BYTES / PHOTON_BYTES)
        hot = sensor.hot_pixel_share * (max(1, each) if plan is None or plan.thins else 1)
        steps["sensor.hot_pixel_share, sensor.hot_pixel_counts"] = counted * hot
    if plan is not None:
        photons, all_pixels = plan.photons_per_view * views, pixels * views
        keeps_all = plan.thins and plan.keeps_origins
        sums = SUM_BYTES * all_pixels if plan.thins and not keeps_all else 0.0
        field = "exposure" if needs.photons.scope == "exposure" else "photons.budget"
        steps[field] = PHOTON_BYTES * (photons if keeps_all else min(photons, all_pixels)) + sums
        if plan.thins:
            z_mm = np.array(plan.depths_mm or (math.inf,))
            tiles = tile_count(grid.camera_grid(), z_mm)
            steps["grid.pixel_mm, grid.focal_mm, grid.pitch_mm, grid.shear_px"] = TILE_BYTES * tiles
    return steps


def peak_bytes(needs: Needs, plan: Plan | None) -> float:
    """Memory at the peak: of the libraries and of the largest step."""
    return BASE_BYTES + max(bytes_of_steps(needs, plan).values())


def shortage(needs: Needs, plan: Plan | None, room: float) -> str | None:
    """A sentence on the largest step, if memory of `room` bytes cannot hold it; None if it can."""
    field, most = max(bytes_of_steps(needs, plan).items(), key=lambda step: step[1])
    if most <= room:
        return None
    return (
        f"{field}: takes some {in_bytes(most)} of memory, and this machine has {in_bytes(room)} available; "
        f"with {room / most:.2g} of that it would fit"
    )


def fits(needs: Needs) -> Callable[[Plan], bool]:
    """Whether memory, as it is now, holds all steps of a plan."""
    room = available_bytes()
    return lambda made: shortage(needs, made, room) is None


def check_resources(needs: Needs, plan: Plan | None, out: Path) -> None:
    """Raise `InputError` if memory cannot hold a step, or the disk of `out` the rendered views."""
    lacking = shortage(needs, plan, available_bytes())
    if lacking is not None:
        raise InputError(lacking)
    needed, free = least_rendered_bytes(needs, plan), _free_bytes(out)
    if needed > free:
        what = "products.radiance" if needs.products.radiance != "none" else "photons, drawn from such"
        raise InputError(
            f"{what}: rendered views of all cameras take {in_bytes(needed)} or more on disk, and {out} has "
            f"{in_bytes(free)} left; take fewer or smaller views, or another disk"
        )


def product_bytes(needs: Needs, plan: Plan | None) -> dict[str, float]:
    """Bytes of each product that the recipe asks for, before compression."""
    grid, products = needs.grid, needs.products
    pixels, views = grid.height * grid.width, grid.rows * grid.cols
    sizes: dict[str, float] = {}
    if plan is not None:
        photons = plan.photons_per_view * views
        each = FRAME_BYTES * photons if products.frames and needs.sensor.frames > 1 else 0.0
        sizes["counts"] = EVENT_BYTES * min(photons, float(pixels * views)) + each
    if products.radiance != "none":
        sizes["radiance"] = least_rendered_bytes(needs, None) / EXR_SHARE
    truth = pixels * products.truth + pixels * views * bool(products.view_truth)
    if truth:
        sizes["truth"] = float(TRUTH_BYTES * truth)
    return sizes


def least_rendered_bytes(needs: Needs, plan: Plan | None) -> float:
    """What the files of rendered views take at least: of products, or for dense counts to be drawn from."""
    if needs.products.radiance == "none" and (plan is None or plan.thins):
        return 0.0
    pixels = float(needs.grid.height * needs.grid.width * needs.grid.rows * needs.grid.cols)
    return EXR_SHARE * 4.0 * pixels * (3 if needs.products.radiance == "rgb" else 1)


def available_bytes() -> float:
    """Memory that a new process may take without others being pushed out, and that its group is allowed."""
    room = float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    try:
        lines = Path("/proc/meminfo").read_text().splitlines()
        free = next(float(line.split()[1]) * 1024 for line in lines if line.startswith("MemAvailable"))
        room, group = min(room, free), Path("/sys/fs/cgroup")
        limit, used = (float((group / f"memory.{name}").read_text()) for name in ("max", "current"))
        room = min(room, limit - used)
    except (OSError, StopIteration, ValueError):  # not known here, or no limit
        pass
    return room


def in_bytes(size: float) -> str:
    """A size in the unit that suits it, with two digits."""
    unit = min(max(0, math.floor(math.log10(min(max(size, 1), 1e30)) / 3)), 4)
    return f"{rounded(size / 1000**unit, 2)} {('B', 'kB', 'MB', 'GB', 'TB')[unit]}"


def rounded(value: float, digits: int) -> str:
    """A number with this many digits and no needless zeros."""
    places = digits - 1 - math.floor(math.log10(value)) if 0 < value < math.inf else 0
    return f"{round(value, places):.{max(places, 0)}f}".removesuffix(".0")


def tile_count(grid: CameraGrid, z_mm: np.ndarray) -> float:
    """Tiles of the majorant for first hits at these depths, as of `disparity_layers.layers_for`; or inf."""
    tile_px, longer = tile_px_for(grid, MOST_RAYS), max(grid.pitch_mm)
    with np.errstate(over="ignore", divide="ignore"):
        disparity_px = np.float64(grid.focal_mm) * longer / grid.pixel_mm / z_mm
    if not np.isfinite(disparity_px).all():
        return math.inf
    thin = 4 * LAYER_BLUR_TILES * tile_px / max(max(grid.rows, grid.cols) - 1, 1)
    step_px = max(thin, float(disparity_px.max()) / MOST_LAYERS)
    count = float(np.unique(np.rint(disparity_px / step_px)).size)
    for axis, (size, number) in enumerate(((grid.width, grid.cols), (grid.height, grid.rows))):
        moved = disparity_px * (grid.pitch_mm[axis] / longer) - grid.shear_px[axis]
        count *= math.ceil((size + float(np.abs(moved).max()) * (number - 1)) / tile_px)
    return count


def _free_bytes(out: Path) -> float:
    """What the disk of a folder has left, with what an unfinished dataset there has rendered already."""
    there = next(folder for folder in (out, *out.absolute().parents) if folder.exists())
    written = sum(file.stat().st_size for file in out.glob("*/view_*.exr"))
    return float(shutil.disk_usage(there).free + written)
