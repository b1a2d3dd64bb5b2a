"""What sections cost at the paper's size, beside other packages, and how that grows.

100 views of 1024 x 1024 pixels behind a Bayer pattern, and from there on more or fewer photons, views, pixels
and planes: time grows as their power, whose exponent is the slope of logarithms.
"""

import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.figures import curve, frame
from benchmarks.machine import has
from benchmarks.peers.shifted_means import by_opencv, by_scipy, by_slices
from benchmarks.results import Measured, Ratio, Row, Size, Study, Value
from benchmarks.timing import median_of, ratio_of, side_by_side
from pcii.sections.reconstruction import reconstruct
from pcii.types.camera_grid import CameraGrid
from pcii.types.images import Views
from pcii.types.photon_counts import PhotonCounts

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Z_MM = 540.0
PLANES = 64
PAPER = "Sections at the paper's size"
GROWTH = "Growth: exponent of time"
POINTS = "Time against size"
MEMORY = "Peak memory of mean and variance of views that are read one by one"
ASKED = {"events": 100.0}
"""What the ratio to OpenCV is to be."""


def paper_grid(rows: int = 10, cols: int = 10, side_px: int = 1024) -> CameraGrid:
    """The grid of the paper's recipe, or one of other size."""
    film = {"pixel_mm": 36.0448 / side_px, "height": side_px, "width": side_px}
    return CameraGrid(rows=rows, cols=cols, pitch_mm=(5.0, 5.0), focal_mm=50.0, **film)


def photons(grid: CameraGrid, number: int) -> PhotonCounts:
    """So many photons in all, anywhere."""
    rng = np.random.default_rng(1)
    k, l, i, j = np.unravel_index(rng.integers(0, np.prod(grid.shape_KLHW), number), grid.shape_KLHW)
    counts = PhotonCounts.from_events(k, l, i, j, np.ones(number, dtype=np.int64), grid, cfa="GRBG")
    assert counts.event_colours.size  # found once, before anything is timed
    return counts


SIZES: Mapping[Size, Mapping[str, Any]] = {
    "quick": {"side_px": 1024, "repeats": 6, "most_photons": 3_000_000, "stacks": ((2, 5), (10, 10))},
    "full": {"side_px": 1024, "repeats": 12, "most_photons": 10_000_000, "stacks": ((2, 5), (20, 20))},
}


def measure(side_px: int, repeats: int, most_photons: int, stacks: Sequence[tuple[int, int]]) -> Measured:
    """Beside the others, then growth, then memory of `stacks` of so many cameras down and across."""
    rows, ratios = _beside_others(side_px, repeats)
    rows += _growth(side_px, repeats, most_photons)
    rows += [
        Row(MEMORY, f"{rows_ * cols} views", {}, {"peak_mb": Value(_peak_in_new_process(rows_, cols))})
        for rows_, cols in stacks
    ]
    return Measured(rows, ratios, [1])


def _beside_others(side_px: int, repeats: int) -> tuple[list[Row], list[Ratio]]:
    grid = paper_grid(side_px=side_px)
    images = np.random.default_rng(0).random(grid.shape_KLHW, dtype=np.float32)
    counts, views = photons(grid, 100_000), Views(images[..., None], grid, "GRBG")
    depths = np.linspace(450, 750, PLANES)
    ways: dict[str, Callable[[int], object]] = {
        "events": lambda _: reconstruct(counts, Z_MM),
        "events, with coverage": lambda _: reconstruct(counts, Z_MM).coverage,
        f"events, {PLANES} planes": lambda _: [reconstruct(counts, z).z_mm for z in depths],
        "dense, mean": lambda _: reconstruct(views, Z_MM),
        "dense, mean and variance": lambda _: reconstruct(views, Z_MM, variance=True),
        "reading all views once": lambda _: images.reshape(-1).max(),
        "NumPy slices": lambda _: by_slices(images, grid, Z_MM),
        "SciPy, bilinear": lambda _: by_scipy(images, grid, Z_MM),
    }
    peers = ["SciPy, bilinear", "NumPy slices"]
    if has("opencv-python-headless"):
        ways["OpenCV, bilinear"] = lambda _: by_opencv(images, grid, Z_MM)
        peers.insert(0, "OpenCV, bilinear")
    seconds = side_by_side(ways, repeats)
    rows = [Row(PAPER, name, {}, {"time_ms": median_of(taken, 1e3)}) for name, taken in seconds.items()]
    ratios = [
        ratio_of(
            f"{way} against {peer}",
            seconds[peer],
            seconds[way],
            ASKED.get(way) if peer.startswith("OpenCV") else None,
            scale=PLANES if way.endswith("planes") else 1,
        )
        for way in list(ways)[:5]
        for peer in peers
    ]
    return rows, ratios


def _growth(side_px: int, repeats: int, most_photons: int) -> list[Row]:
    """Times along each axis, the others as in the paper's recipe, and the slopes of their logarithms."""
    images = np.random.default_rng(0).random(paper_grid(side_px=side_px).shape_KLHW, dtype=np.float32)

    def dense(rows: int, side: int) -> Callable[[int], object]:
        views = Views(images[:rows, :rows, :side, :side, None], paper_grid(rows, rows, side), "GRBG")
        return lambda _: reconstruct(views, Z_MM)

    def events(number: int, rows: int = 10, side: int = side_px, planes: int = 1) -> Callable[[int], object]:
        counts, z_mm = photons(paper_grid(rows, rows, side), number), np.linspace(450, 750, planes)
        return lambda _: [reconstruct(counts, z).z_mm for z in z_mm]

    axes: dict[tuple[str, str], dict[int, Callable[[int], object]]] = {
        ("events", "photons"): {n: events(n) for n in (10**4, 10**5, 10**6, most_photons)},
        ("events", "views"): {rows**2: events(100_000, rows) for rows in (2, 5, 10, 20)},
        ("events", "pixels"): {
            s**2: events(100_000, side=s) for s in (side_px // 4, side_px // 2, side_px, 2 * side_px)
        },
        ("events", "planes"): {planes: events(100_000, planes=planes) for planes in (1, 4, 16)},
        ("dense", "views"): {rows**2: dense(rows, side_px) for rows in (2, 5, 10)},
        ("dense", "pixels"): {
            s**2: dense(10, s) for s in (side_px // 8, side_px // 4, side_px // 2, side_px)
        },
    }
    rows: list[Row] = []
    for (way, axis), works in axes.items():
        seconds = side_by_side({str(number): work for number, work in works.items()}, repeats)
        for number in works:
            values = {"time_ms": median_of(seconds[str(number)], 1e3)}
            rows.append(Row(POINTS, way, {"axis": axis, "number": number}, values))
        rows.append(
            Row(GROWTH, way, {"axis": axis}, {"exponent": _slope(list(works), list(seconds.values()))})
        )
    return rows


def _slope(numbers: Sequence[int], seconds: Sequence[Sequence[float]]) -> Value:
    """Least-squares slope of log time by log number; one for each round of times, of which the median."""
    x = np.log(numbers)
    slopes = [float(np.polyfit(x, np.log(taken), 1)[0]) for taken in zip(*seconds, strict=True)]
    return median_of(slopes)


class _FromDisk:
    """Views that are read one at a time."""

    def __init__(self, grid: CameraGrid) -> None:
        self.shape, self.dtype = (*grid.shape_KLHW, 1), np.dtype(np.float32)

    def __getitem__(self, index: tuple[int, int]) -> np.ndarray:
        return np.full(self.shape[2:], sum(index), dtype=np.float32)


def _peak_in_new_process(rows: int, cols: int) -> int:
    code = f"from benchmarks.studies.section_growth import peak_mb; print(peak_mb({rows}, {cols}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return int(done.stdout)


def peak_mb(rows: int, cols: int) -> int:
    """Peak memory of this process after a dense section of so many views."""
    grid = paper_grid(rows, cols)
    reconstruct(Views(_FromDisk(grid), grid, "GRBG"), Z_MM, variance=True)
    # Not getrusage, whose peak is handed on from the process that started this one.
    status = Path("/proc/self/status").read_text()
    return next(int(line.split()[1]) // 1024 for line in status.splitlines() if line.startswith("VmHWM"))


def draw(figure: "Figure", measured: Measured) -> None:
    """A panel for each axis."""
    names = ("photons", "views", "pixels", "planes")
    for axes, axis in zip(figure.subplots(1, 4, sharey=True), names, strict=True):
        for number, way in enumerate(("events", "dense")):
            rows = [row for row in measured.of(POINTS, axis=axis) if row.name == way]
            if rows:
                exponent = measured.one(GROWTH, way, axis=axis).values["exponent"].value
                curve(axes, rows, "number", "time_ms", f"{way}, exponent {exponent:.2f}", number)
        frame(axes, axis, "time_ms")
    figure.suptitle("Time of a section as one size grows, the others as in the paper", fontsize=10)


def reading(measured: Measured) -> str:
    """How to read it, with the ratio to the fastest peer and two exponents."""
    fastest, with_coverage = (
        next(ratio for ratio in measured.ratios if ratio.name.startswith(f"{way} against"))
        for way in ("events", "events, with coverage")
    )
    photons_, pixels = (
        measured.one(GROWTH, "events", axis=axis).values["exponent"].value for axis in ("photons", "pixels")
    )
    dense = measured.one(GROWTH, "dense", axis="views").values["exponent"].value
    return (
        "What does a section cost at the paper's size, and what makes it cost more? A ratio says how often"
        f" ours could be made while the other makes one: photons of three colours {fastest.ratio.value:.0f}"
        f" times for {fastest.name}, which makes one channel's mean, and {with_coverage.ratio.value:.0f}"
        " times if their coverage is asked for. An exponent"
        f" of 1 is time in proportion: sections from events grow with the power {photons_:.2f} of the"
        f" photons and {pixels:.2f} of the pixels, dense ones with the power {dense:.2f} of the views."
    )


STUDY = Study("section-growth", "Sections: time", SIZES, measure, draw, reading, width_in=12.0, height_in=3.6)
