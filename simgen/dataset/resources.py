"""What a recipe takes of the machine, estimated before any work: memory of each step, bytes of each product.

`simgen check` reports it and `simgen generate` refuses what does not fit, both by this one estimate. Bytes
per item were measured, as the growth of the process with the number of items.
"""

import math
import os
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pcii.base.errors import InputError
from pcii.core.camera_grid import CameraGrid
from simgen.base.round_numbers import ROUNDING, two_digits
from simgen.photons.counting_plan import Plan
from simgen.photons.disparity_layers import LAYER_BLUR_TILES, MOST_LAYERS, tile_px_for
from simgen.photons.pilot import MOST_RAYS
from simgen.spec.camera_grid import Grid
from simgen.spec.recipe import Exposure, Photons, Products, Sensor

BASE_BYTES = 4e8
"""What the renderer and its libraries take, whatever the needs."""
PIXEL_BYTES = 165.0
"""Of a pixel while the first hits of its view are found; rendering takes less."""
PLANE_BYTES = 2.0
"""Of a pixel of the centre for each plane at which it is in focus or not."""
VIEW_BYTES = 400.0
"""Of a camera: where it stands, and what is added up for its view."""
PHOTON_BYTES = 200.0
"""Of a photon, or a pixel that counts without any, while the counts are made: 135 where the sensor has no
faults, up to 260 where counters stop and budgets are nested."""
SUM_BYTES = 8.0
"""Of a pixel of any view while photons that are too many to be kept are counted."""
ORIGIN_BYTES = 30.0
"""Of each of several counts of one pixel while their origins are written."""
TILE_BYTES = 110.0
"""Of a tile of the majorant."""
EVENT_BYTES, FRAME_BYTES = 16, 2
"""Of a pixel that caught photons, on disk before compression: four indices and a count; and of its frame."""
TRUTH_BYTES = 6
"""Depth (float32) and object (int16) of a pixel."""
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


@dataclass(frozen=True)
class Step:
    """A step of the work: its memory in bytes, the field that this follows, and what of it would fit."""

    bytes: float
    field: str
    value: str
    right: str

    def sentence(self, room: float) -> str:
        """That it does not fit, and what would."""
        return (
            f"{self.field}: {self.value} takes some {in_bytes(self.bytes)} of memory, and this machine has "
            f"{in_bytes(room)} available; {self.right} would fit"
        )


def steps(needs: Needs, plan: Plan | None, room: float) -> Iterator[Step]:
    """Each step's need of memory; `room` is what is available. Without `plan` those that need none."""
    grid, sensor, products = needs.grid, needs.sensor, needs.products
    pixels, views = float(grid.height * grid.width), float(grid.rows * grid.cols)
    yield _linear(PIXEL_BYTES * pixels, room, *_longer("height", grid.height, "width", grid.width))
    yield _linear(VIEW_BYTES * views, room, *_longer("rows", grid.rows, "cols", grid.cols))
    if products.truth and needs.planes:
        needed = PLANE_BYTES * pixels * needs.planes
        yield _linear(needed, room, "analysis.z_mm", needs.planes, " planes")
    if products.counts:
        counted = PHOTON_BYTES * pixels * views
        yield _linear(counted * sensor.dark_counts, room, "sensor.dark_counts", sensor.dark_counts)
        hot = counted * sensor.hot_pixel_share
        yield _linear(hot, room, "sensor.hot_pixel_share", sensor.hot_pixel_share)
        if plan is None or plan.thins:
            many = hot * sensor.hot_pixel_counts
            if sensor.bits is None and not products.frames:
                many *= ORIGIN_BYTES / PHOTON_BYTES
            yield _linear(many, room, "sensor.hot_pixel_counts", sensor.hot_pixel_counts)
    if plan is not None:
        yield _of_photons(needs, plan, room)
        if plan.thins:
            yield _of_tiles(grid, plan, room)


def peak_bytes(needs: Needs, plan: Plan | None) -> float:
    """Memory at the peak: of the libraries and of the largest step."""
    return BASE_BYTES + max(step.bytes for step in steps(needs, plan, math.inf))


def shortage(needs: Needs, plan: Plan | None, room: float) -> Step | None:
    """The step that is largest beyond the room, None if all fit."""
    most = max(steps(needs, plan, room), key=lambda step: step.bytes)
    return most if most.bytes > room else None


def fits(needs: Needs) -> Callable[[Plan], bool]:
    """Whether memory, as it is now, holds all steps of a plan."""
    room = available_bytes()
    return lambda made: shortage(needs, made, room) is None


def check_resources(needs: Needs, plan: Plan | None, out: Path) -> None:
    """Raise `InputError` if memory cannot hold a step, or the disk of `out` the full-light images."""
    room = available_bytes()
    lacking = shortage(needs, plan, room)
    if lacking is not None:
        raise InputError(lacking.sentence(room))
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
        sizes["radiance"] = _rendered_bytes(needs, None)
    truth = pixels * products.truth + pixels * views * bool(products.view_truth)
    if truth:
        sizes["truth"] = float(TRUTH_BYTES * truth)
    return sizes


def least_rendered_bytes(needs: Needs, plan: Plan | None) -> float:
    """What the files of rendered views take at least: of products, or for dense counts to be drawn from."""
    return EXR_SHARE * _rendered_bytes(needs, plan)


def _rendered_bytes(needs: Needs, plan: Plan | None) -> float:
    dense = plan is not None and not plan.thins
    if needs.products.radiance == "none" and not dense:
        return 0.0
    pixels = float(needs.grid.height * needs.grid.width * needs.grid.rows * needs.grid.cols)
    return 4.0 * pixels * (3 if needs.products.radiance == "rgb" else 1)


def available_bytes() -> float:
    """Memory that a new process may take without others being pushed out, and that its group is allowed."""
    room = float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    try:
        lines = Path("/proc/meminfo").read_text().splitlines()
        room = min(
            room, next(float(line.split()[1]) * 1024 for line in lines if line.startswith("MemAvailable"))
        )
        group = Path("/sys/fs/cgroup")
        room = min(
            room, float((group / "memory.max").read_text()) - float((group / "memory.current").read_text())
        )
    except (OSError, StopIteration, ValueError):  # not known here, or no limit
        pass
    return room


def in_bytes(size: float) -> str:
    """A size in the unit that suits it, with two digits."""
    unit = min(max(0, math.floor(math.log10(min(max(size, 1), 1e30)) / 3)), 4)
    return f"{rounded(size / 1000**unit, 2)} {('B', 'kB', 'MB', 'GB', 'TB')[unit]}"


def rounded(value: float, digits: int) -> str:
    """A number with so many digits and no needless zeros."""
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


def _of_photons(needs: Needs, plan: Plan, room: float) -> Step:
    grid = needs.grid
    photons = plan.photons_per_view * grid.rows * grid.cols
    pixels = float(grid.height * grid.width * grid.rows * grid.cols)
    keeps_all = plan.thins and plan.keeps_origins
    rows = photons if keeps_all else min(photons, pixels)
    sums = SUM_BYTES * pixels if plan.thins and not keeps_all else 0.0
    absolute = needs.exposure if needs.photons.scope == "exposure" else None
    field, value = ("photons.budget", needs.photons.budget)
    if absolute is not None:
        field, value = "exposure.time_s", absolute.time_s
    fits = value * (room / (PHOTON_BYTES * photons)) / ROUNDING if photons > 0 else value
    return Step(PHOTON_BYTES * rows + sums, field, f"{value:g}", f"at most {two_digits(fits)}")


def _of_tiles(grid: Grid, plan: Plan, room: float) -> Step:
    """The need of the majorant, which grows with disparities and with the number of cameras.

    It names the field that is farthest from the paper's camera grid.
    """
    cameras, usual, z_mm = grid.camera_grid(), Grid(), np.array(plan.depths_mm or (math.inf,))
    pitch, shear = max(grid.pitch_mm), max(grid.shear_px, key=abs)
    # Of each field: how many times it is what it usually is, its value, and the grid with that share of it.
    ways: dict[str, tuple[float, float, Callable[[float], CameraGrid]]] = {
        "grid.pixel_mm": (
            usual.pixel_mm / grid.pixel_mm,
            grid.pixel_mm,
            lambda share: replace(cameras, pixel_mm=grid.pixel_mm / share),
        ),
        "grid.focal_mm": (
            grid.focal_mm / usual.focal_mm,
            grid.focal_mm,
            lambda share: replace(cameras, focal_mm=grid.focal_mm * share),
        ),
        "grid.pitch_mm": (
            pitch / max(usual.pitch_mm),
            pitch,
            lambda share: replace(cameras, pitch_mm=_scaled(grid.pitch_mm, pitch, share)),
        ),
        "grid.shear_px": (
            abs(shear) / max(grid.height, grid.width),
            shear,
            lambda share: replace(cameras, shear_px=_scaled(grid.shear_px, shear, share)),
        ),
        "grid.rows": (
            grid.rows / usual.rows,
            grid.rows,
            lambda share: replace(cameras, rows=math.ceil(grid.rows * share)),
        ),
        "grid.cols": (
            grid.cols / usual.cols,
            grid.cols,
            lambda share: replace(cameras, cols=math.ceil(grid.cols * share)),
        ),
    }
    field, (_, value, changed) = max(ways.items(), key=lambda way: way[1][0])
    low, high = -300.0, 0.0  # powers of ten of the share that fits
    for _ in range(60):
        middle = (low + high) / 2
        fits = TILE_BYTES * tile_count(changed(10**middle), z_mm) <= room
        low, high = (middle, high) if fits else (low, middle)
    right = f"at least {two_digits(value / 10**low * ROUNDING)}" if field == "grid.pixel_mm" else ""
    right = right or f"at most {two_digits(value * 10**low / ROUNDING)}"
    if not math.isinf(z_mm.min()):
        right += f", with what is seen at {z_mm.min():.0f} mm,"
    return Step(TILE_BYTES * tile_count(cameras, z_mm), field, f"{value:g}", right)


def _scaled(pair: tuple[float, float], which: float, share: float) -> tuple[float, float]:
    """The pair with `which` of it made smaller."""
    first, second = (value * share if value == which else value for value in pair)
    return first, second


def _longer(one: str, size: int, other: str, other_size: int) -> tuple[str, int]:
    return (f"grid.{one}", size) if size >= other_size else (f"grid.{other}", other_size)


def _linear(needed: float, room: float, field: str, value: float, unit: str = "") -> Step:
    """A step whose need grows in proportion to the value of a field."""
    fits = value * (room / needed) / ROUNDING if needed > 0 else math.inf
    right = str(math.floor(fits)) if isinstance(value, int) and math.isfinite(fits) else two_digits(fits)
    return Step(needed, field, f"{value:g}{unit}", f"at most {right}{unit}")


def _free_bytes(out: Path) -> float:
    """What the disk of a folder has left, with what an unfinished dataset there has rendered already."""
    there = next(folder for folder in (out, *out.absolute().parents) if folder.exists())
    written = sum(file.stat().st_size for file in out.glob("*/view_*.exr"))
    return float(shutil.disk_usage(there).free + written)
