"""What a recipe takes of the machine, estimated before any work, and refused where it cannot fit.

Bytes per item were measured, as the growth of the process with the number of items.
"""

import math
import os
import shutil
from pathlib import Path

import numpy as np

from pcii.base import InputError
from simgen.photons import MAX_RAYS, Plan, layers_for, tile_px_for
from simgen.spec import Recipe

BASE_BYTES = 4e8
"""The renderer and its libraries."""
PIXEL_BYTES, VIEW_BYTES, PLANE_BYTES = 165.0, 400.0, 2.0
"""A pixel while the first hits of its view are sought, a camera, and a pixel of the truth for each plane."""
PHOTON_BYTES, ORIGIN_BYTES, SUM_BYTES = 200.0, 30.0, 8.0
"""A photon that is kept, or a pixel that counts without any; the origin of each of several counts of a pixel;
a pixel of any view where photons are too many to be kept."""
TILE_BYTES = 110.0
"""A tile of the majorant."""
EVENT_BYTES, FRAME_BYTES, TRUTH_BYTES = 16.0, 2.0, 6.0
"""On disk before compression: a pixel that caught photons, the frame of each, its depth and object."""
EXR_SHARE = 0.5
"""Noise of rendered views keeps their files larger than this share of what they are before compression."""


def bytes_of_steps(recipe: Recipe, plan: Plan | None, map_counts: float = 0.0) -> dict[str, float]:
    """Memory of each step of the work by the fields that it grows with; without a plan of the first ones.

    `map_counts` is the mean number of counts that the map `sensor.hot_pixels` adds to all views.
    """
    grid, sensor, products = recipe.grid, recipe.sensor, recipe.products
    pixels, views = float(grid.height * grid.width), float(grid.rows * grid.cols)
    each = PHOTON_BYTES if sensor.bits is not None or products.frames else ORIGIN_BYTES
    hot = sensor.hot_pixel_share * (PHOTON_BYTES + each * sensor.hot_pixel_counts)
    steps = {
        "grid.height, grid.width": PIXEL_BYTES * pixels,
        "grid.rows, grid.cols": VIEW_BYTES * views,
        "analysis.z_mm": PLANE_BYTES * pixels * len(recipe.analysis.z_mm) * products.truth,
        "sensor.dark_counts": PHOTON_BYTES * sensor.dark_counts * pixels * views * products.counts,
        "sensor.hot_pixels": PHOTON_BYTES * map_counts * products.counts,
        "sensor.hot_pixel_share, sensor.hot_pixel_counts": hot * pixels * views * products.counts,
    }
    if plan is None:
        return steps
    photon_bytes = PHOTON_BYTES * plan.photons_per_view * views
    if not (plan.thins and plan.keeps_origins):
        sums = SUM_BYTES * pixels * views if plan.thins else 0.0
        photon_bytes = min(photon_bytes, PHOTON_BYTES * pixels * views) + sums
    steps["exposure" if recipe.photons.scope == "exposure" else "photons.budget"] = photon_bytes
    if plan.thins:
        cameras, z_mm = grid.camera_grid(), np.array(plan.depths_mm or (math.inf,))
        tiles = layers_for(cameras, tile_px_for(cameras, MAX_RAYS), z_mm).tiles
        steps["grid.pixel_mm, grid.focal_mm, grid.pitch_mm, grid.shear_px"] = TILE_BYTES * tiles
    return steps


def peak_bytes(recipe: Recipe, plan: Plan | None, map_counts: float = 0.0) -> float:
    """Memory at the peak: of the libraries and of the largest step."""
    return BASE_BYTES + max(bytes_of_steps(recipe, plan, map_counts).values())


def shortage(recipe: Recipe, plan: Plan | None, room: float, map_counts: float = 0.0) -> str | None:
    """A sentence on the largest step, if memory of `room` bytes cannot hold it; None if it can."""
    field, most = max(bytes_of_steps(recipe, plan, map_counts).items(), key=lambda step: step[1])
    if most <= room:
        return None
    return f"{field}: takes some {in_bytes(most)} of memory, and this machine has {in_bytes(room)} available"


def check_resources(recipe: Recipe, plan: Plan | None, out: Path, map_counts: float = 0.0) -> None:
    """Raise `InputError` if memory cannot hold a step, or the disk of `out` the rendered views."""
    sentence = shortage(recipe, plan, available_bytes(), map_counts)
    if sentence is not None:
        raise InputError(sentence)
    place = next(folder for folder in (out, *out.absolute().parents) if folder.exists())
    needed = least_rendered_bytes(recipe, plan)
    free = shutil.disk_usage(place).free + sum(file.stat().st_size for file in out.glob("*/view_*.exr"))
    if needed > free:
        field = "products.radiance" if recipe.products.radiance != "none" else "photons, drawn from such"
        raise InputError(
            f"{field}: rendered views of all cameras take {in_bytes(needed)} or more on disk, and {out} has "
            f"{in_bytes(free)} left"
        )


def product_bytes(recipe: Recipe, plan: Plan | None) -> dict[str, float]:
    """Bytes of each product that the recipe asks for, before compression."""
    grid, products = recipe.grid, recipe.products
    pixels, views = float(grid.height * grid.width), grid.rows * grid.cols
    sizes: dict[str, float] = {}
    if plan is not None:
        photons = plan.photons_per_view * views
        frames = FRAME_BYTES * photons * (products.frames and recipe.sensor.frames > 1)
        sizes["counts"] = EVENT_BYTES * min(photons, pixels * views) + frames
    if products.radiance != "none":
        sizes["radiance"] = least_rendered_bytes(recipe, None) / EXR_SHARE
    if products.truth or products.view_truth:
        sizes["truth"] = TRUTH_BYTES * pixels * (products.truth + views * bool(products.view_truth))
    return sizes


def least_rendered_bytes(recipe: Recipe, plan: Plan | None) -> float:
    """What the files of rendered views take at least: of products, or for dense counts to be drawn from."""
    if recipe.products.radiance == "none" and (plan is None or plan.thins):
        return 0.0
    pixels = float(recipe.grid.height * recipe.grid.width * recipe.grid.rows * recipe.grid.cols)
    return EXR_SHARE * 4.0 * pixels * (3 if recipe.products.radiance == "rgb" else 1)


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
    unit = int(math.log10(min(max(size, 1.0), 1e12)) / 3)
    return f"{float(f'{size / 1000**unit:.2g}'):g} {('B', 'kB', 'MB', 'GB', 'TB')[unit]}"
