"""What sections and demosaicing cost: ours against SciPy, OpenCV and NumPy as a good user would write it.

100 views of 1024 x 1024 pixels behind a Bayer pattern. The peers get what suits them: single precision
images in memory, one channel, mean alone; ours keeps colours apart with their coverage.
"""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.timing import timed
from pcii.core.camera_grid import CameraGrid
from pcii.core.focal_planes import FocalPlanes
from pcii.core.geometry import disparity_px
from pcii.core.images import Views
from pcii.core.photon_counts import PhotonCounts
from pcii.sections.demosaicing import demosaic
from pcii.sections.reconstruction import reconstruct, reconstruct_each

Z_MM = 540.0
PLANES = 64
PHOTONS = 100_000


def paper_grid(rows: int = 10, cols: int = 10) -> CameraGrid:
    """The grid of the paper's recipe, or one of other size."""
    return CameraGrid(
        rows=rows,
        cols=cols,
        pitch_mm=(5.0, 5.0),
        focal_mm=50.0,
        pixel_mm=0.0352,
        height=1024,
        width=1024,
    )


def photons(grid: CameraGrid) -> PhotonCounts:
    """A thousand photons for each view, anywhere."""
    rng = np.random.default_rng(1)
    k, l, i, j = np.unravel_index(rng.integers(0, np.prod(grid.shape_KLHW), PHOTONS), grid.shape_KLHW)
    counts = PhotonCounts.from_events(k, l, i, j, np.ones(PHOTONS, dtype=np.int64), grid, cfa="GRBG")
    assert counts.event_colours.size
    return counts


def by_scipy(images: np.ndarray, grid: CameraGrid) -> np.ndarray:
    """Mean of bilinearly shifted views."""
    from scipy.ndimage import shift

    mean = np.zeros(images.shape[2:4], dtype=np.float32)
    for (k, l), (down, right) in _moves(grid):
        mean += shift(images[k, l], (down, right), order=1)
    return mean / grid.view_count


def by_opencv(images: np.ndarray, grid: CameraGrid) -> np.ndarray:
    """The same with OpenCV."""
    import cv2  # pyright: ignore[reportMissingImports]

    mean = np.zeros(images.shape[2:4], dtype=np.float32)
    size = images.shape[3], images.shape[2]
    for (k, l), (down, right) in _moves(grid):
        move = np.array([[1, 0, right], [0, 1, down]], dtype=np.float32)
        cv2.accumulate(cv2.warpAffine(images[k, l], move, size, flags=cv2.INTER_LINEAR), mean)
    return mean / grid.view_count


def by_slices(images: np.ndarray, grid: CameraGrid) -> np.ndarray:
    """Mean of views shifted by whole pixels, as slices."""
    H, W = images.shape[2:4]
    mean = np.zeros((H, W), dtype=np.float32)
    rows, cols = (shifts[0] for shifts in FocalPlanes.at_depths(grid, Z_MM).whole_shifts_px)
    for k, l in np.ndindex(grid.rows, grid.cols):
        r, c = int(rows[k]), int(cols[l])
        target = mean[max(r, 0) : H + min(r, 0), max(c, 0) : W + min(c, 0)]
        target += images[k, l, max(-r, 0) : H - max(r, 0), max(-c, 0) : W - max(c, 0)]
    return mean / grid.view_count


def _moves(grid: CameraGrid) -> Iterator[tuple[tuple[int, int], tuple[float, float]]]:
    """Each camera, and how far down and right its view moves."""
    d_x, d_y = (float(d) for d in disparity_px(grid, Z_MM))
    for k, l in np.ndindex(grid.rows, grid.cols):
        yield (k, l), ((k - (grid.rows - 1) / 2) * d_y, (l - (grid.cols - 1) / 2) * d_x)


def table() -> Iterator[str]:
    """The tables, line by line as they are measured."""
    grid = paper_grid()
    images = np.random.default_rng(0).random(grid.shape_KLHW, dtype=np.float32)
    counts, views = photons(grid), Views(images[..., None], grid, "GRBG")
    depths = np.linspace(450, 750, PLANES)
    read, _ = timed(lambda _: images.reshape(-1).max())
    opencv, _ = timed(lambda _: by_opencv(images, grid))
    scipy, _ = timed(lambda _: by_scipy(images, grid), repeats=2)
    slices, _ = timed(lambda _: by_slices(images, grid))
    events, _ = timed(lambda _: reconstruct(counts, Z_MM), repeats=25)
    stack, _ = timed(lambda _: [section.z_mm for section in reconstruct_each(counts, depths)])
    mean, _ = timed(lambda _: reconstruct(views, Z_MM))
    spread, _ = timed(lambda _: reconstruct(views, Z_MM, variance=True))
    yield "sections, 100 views of 1024 x 1024"
    yield ""
    yield "| what | ms | OpenCV takes | SciPy takes | NumPy slices take |"
    yield "|---|---|---|---|---|"
    for name, seconds, planes in (
        ("from 100 000 photons: three colours and their coverage", events, 1),
        (f"{PLANES} planes of that", stack, PLANES),
        ("dense, single precision: mean of three colours", mean, 1),
        ("dense, single precision: mean and variance", spread, 1),
    ):
        times = " | ".join(f"{planes * peer / seconds:.1f} x" for peer in (opencv, scipy, slices))
        yield f"| {name} | {1e3 * seconds:.2f} | {times} |"
    yield f"| reading all views once | {1e3 * read:.1f} | | | |"
    yield ""
    yield f"mean and variance take {spread / read:.2f} x as long as reading all views once"
    yield ""
    yield from _demosaicing()
    yield ""
    yield from _memory()


def _demosaicing() -> Iterator[str]:
    import colour_demosaicing as peers

    raw = np.random.default_rng(0).random((1024, 1024))
    own, _ = timed(lambda _: demosaic(raw, cfa="GRBG"), repeats=15)
    yield "| demosaicing 1024 x 1024 | ms | against ours |"
    yield "|---|---|---|"
    yield f"| Laroche-Prescott (ours) | {1e3 * own:.2f} | 1 x |"
    for name, peer in (
        ("Malvar (colour-demosaicing)", peers.demosaicing_CFA_Bayer_Malvar2004),
        ("Menon (colour-demosaicing)", peers.demosaicing_CFA_Bayer_Menon2007),
    ):
        seconds, _ = timed(lambda _, peer=peer: peer(raw, "GRBG"))
        yield f"| {name} | {1e3 * seconds:.1f} | {seconds / own:.1f} x |"


class _FromDisk:
    """Views that are read one at a time."""

    def __init__(self, grid: CameraGrid) -> None:
        self.shape, self.dtype = (*grid.shape_KLHW, 1), np.dtype(np.float32)

    def __getitem__(self, index: tuple[int, int]) -> np.ndarray:
        return np.full(self.shape[2:], sum(index), dtype=np.float32)


def _memory() -> Iterator[str]:
    yield "| views, read one by one: mean and variance | peak memory in MB |"
    yield "|---|---|"
    for rows, cols in ((2, 5), (20, 20)):
        code = f"from benchmarks import sections; print(sections.peak_mb({rows}, {cols}))"
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        yield f"| {rows * cols} | {done.stdout.strip()} |"


def peak_mb(rows: int, cols: int) -> int:
    """Peak memory of this process after a dense section of so many views."""
    grid = paper_grid(rows, cols)
    reconstruct(Views(_FromDisk(grid), grid, "GRBG"), Z_MM, variance=True)
    # Not getrusage, whose peak is handed on from the process that started this one.
    status = Path("/proc/self/status").read_text()
    return next(int(line.split()[1]) // 1024 for line in status.splitlines() if line.startswith("VmHWM"))
