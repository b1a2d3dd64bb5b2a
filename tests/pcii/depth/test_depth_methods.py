from importlib.metadata import EntryPoint
from typing import Any

import numpy as np
import pytest
from twins import unit_grid

import pcii
from pcii.depth import depth_methods, estimate_depth
from pcii.types import CameraGrid, PhotonCounts, Views

RANGE_MM = (1 / 5.9, 1 / 3.1)
TRUE_PX = 4.3
"""Disparity of the wall per px of pitch, between the planes of every method."""
METHODS = [
    ("posterior", "counts", 0.35),
    ("sweep-17", "counts", 0.35),
    ("variance-sweep", "counts", 0.35),
    # Whole shifts of radiance are up to half a pixel off.
    ("posterior", "views", 0.5),
    ("variance-sweep", "views", 0.35),
    # Bilinear shifts change the slope of a line by some percent of a pixel per camera.
    ("structure-tensor", "views", 0.35),
]


def wall_views(grid: CameraGrid, disparity_px: tuple[float, float]) -> np.ndarray:
    """Radiance (K, L, H, W, 1) of a wall of fine waves, which are known between the pixels too."""
    rng = np.random.default_rng(3)
    frequency = rng.uniform(0.05, 0.9, 40)
    angle, phase = rng.uniform(0, 2 * np.pi, (2, 40))
    i, j = np.indices((grid.height, grid.width)).astype(float)
    views = np.empty((*grid.shape_KLHW, 1))
    for k, l in np.ndindex(grid.rows, grid.cols):
        down = i + (k - (grid.rows - 1) / 2) * disparity_px[1]
        right = j + (l - (grid.cols - 1) / 2) * disparity_px[0]
        waves = np.cos(
            frequency * (np.cos(angle) * right[..., None] + np.sin(angle) * down[..., None]) + phase
        )
        views[k, l, ..., 0] = 1 + waves.mean(axis=-1) * 2
    return np.maximum(views, 0.05)


def data_of(kind: str, grid: CameraGrid, views: np.ndarray) -> PhotonCounts | Views:
    if kind == "views":
        return Views(views, grid)
    counts = np.random.default_rng(4).poisson(20 * views[..., 0])
    return PhotonCounts.from_dense(counts, grid)


@pytest.mark.parametrize(("method", "kind", "most_px"), METHODS)
def test_a_wall_is_found_where_it_is(method: str, kind: str, most_px: float) -> None:
    grid = unit_grid(5, 7, 64, 72, pitch_mm=(1.0, 0.6))
    seen = wall_views(grid, (TRUE_PX, 0.6 * TRUE_PX))
    depth = estimate_depth(data_of(kind, grid, seen), RANGE_MM, method=method)
    inner = np.s_[16:-16, 16:-16]
    error_px = np.abs(6 / depth.z_mm[inner] - 6 * TRUE_PX)
    assert np.median(error_px) < most_px
    # Neighbouring planes can be the same section, since shifts are whole pixels.
    assert (error_px < 2).mean() > 0.97
    assert ((depth.confidence > 0) == np.isfinite(depth.z_mm)).all()


def test_depth_has_no_levels_that_whole_shifts_would_give() -> None:
    grid = unit_grid(6, 6, 64, 64)  # of an even number of cameras all are half a pixel off at once
    error_px = []
    for disparity_px in np.arange(3.6, 5.6, 0.2):
        depth = estimate_depth(Views(wall_views(grid, (disparity_px, disparity_px)), grid), RANGE_MM)
        error_px.append(np.nanmedian(5 / depth.z_mm[16:-16, 16:-16]) - 5 * disparity_px)
    # 0.6 px with shifts to the nearest pixel.
    assert np.sqrt(np.mean(np.square(error_px))) < 0.4


@pytest.mark.parametrize(("method", "kind", "most_px"), METHODS)
def test_cameras_in_the_wrong_order_do_not_pass(method: str, kind: str, most_px: float) -> None:
    grid = unit_grid(5, 7, 64, 72)
    seen = wall_views(grid, (TRUE_PX, TRUE_PX))[::-1, ::-1]
    depth = estimate_depth(data_of(kind, grid, seen), RANGE_MM, method=method)
    error_px = np.abs(6 / depth.z_mm[16:-16, 16:-16] - 6 * TRUE_PX)
    assert not np.median(error_px) < most_px  # or it is not answered


@pytest.mark.parametrize("method", ["sweep-17", "variance-sweep"])
def test_brightness_alone_is_no_depth(method: str) -> None:
    # A mosaic whose colours differ much: where all shifts are even a voxel has samples of one colour only.
    grid = unit_grid(5, 5, 48, 48)
    rates = np.where(np.indices((48, 48)).sum(axis=0) % 2 == 0, 8.0, 0.5)
    counts = np.random.default_rng(0).poisson(np.broadcast_to(rates, grid.shape_KLHW))
    depth = estimate_depth(PhotonCounts.from_dense(counts, grid, cfa="GRBG"), (1 / 6, 1 / 2), method=method)
    total_px = 4 / depth.z_mm
    # 17 planes from 8 to 24 px: none has more than its share, by far.
    chosen = np.bincount(np.rint(total_px[np.isfinite(total_px)]).astype(int) - 8, minlength=17)
    assert chosen.max() < 0.3 * chosen.sum()


@pytest.mark.parametrize(("method", "photons"), [*((each, 0) for each in depth_methods()), ("posterior", 1)])
def test_where_nothing_is_seen_there_is_no_depth(method: str, photons: int) -> None:
    grid = unit_grid(3, 3, 24, 20)
    data = PhotonCounts.from_events(*np.array([[0, 2, 12, 10, photons]]).T, grid)
    if method not in depth_methods(data):
        data = Views(np.zeros((*grid.shape_KLHW, 3)), grid)
    depth = estimate_depth(data, (0.2, 1.0), method=method)
    assert np.isnan(depth.z_mm).all()
    assert (depth.confidence == 0).all()


SMALL = unit_grid(2, 2, 8, 8)
EVEN = PhotonCounts.from_dense(np.ones(SMALL.shape_KLHW, int), SMALL)


def halfway(data: Any, z_range_mm: tuple[float, float]) -> pcii.DepthMap:
    """A method of another package."""
    film = np.full((data.grid.height, data.grid.width), sum(z_range_mm) / 2)
    return pcii.DepthMap(film, np.ones(film.shape))


def half_a_map(data: Any, z_range_mm: tuple[float, float]) -> pcii.DepthMap:
    depth = halfway(data, z_range_mm)
    return pcii.DepthMap(depth.z_mm[::2], depth.confidence[::2])


def test_another_package_brings_a_method(monkeypatch: pytest.MonkeyPatch) -> None:
    points = [
        EntryPoint(name, f"{__name__}:{name}", "pcii.depth_methods") for name in ("halfway", "half_a_map")
    ]
    monkeypatch.setattr(
        "importlib.metadata.entry_points", lambda group: [point for point in points if point.group == group]
    )
    assert "halfway" in depth_methods(EVEN)
    assert (estimate_depth(EVEN, (0.5, 1.0), method="halfway").z_mm == 0.75).all()
    words = r"'half_a_map' of a package must return a pcii\.DepthMap of 8 x 8"
    with pytest.raises(pcii.InputError, match=words):
        estimate_depth(EVEN, (0.5, 1.0), method="half_a_map")


def answering(z_mm: float, confidence: float) -> Any:
    def wrong(data: Any, z_range_mm: tuple[float, float]) -> pcii.DepthMap:
        return pcii.DepthMap(np.full((8, 8), z_mm), np.full((8, 8), confidence))

    return wrong


@pytest.mark.parametrize(
    ("photons", "method", "words"),
    [
        (1, "structure-tensor", "no estimator of depth from photon counts named 'structure-tensor'"),
        (1, "nearest", "named 'nearest'; use posterior, sweep-17, variance-sweep$"),
        (1, answering(-0.5, 1.0), "^method: 'wrong' must return depths above 0 mm, or NaN where it has no"),
        (1, answering(0.5, np.nan), "^method: 'wrong' must return a confidence from 0 to 1, also where"),
        (2**20 + 1, "sweep-17", r"more than 2\^40 photons"),
    ],
)
def test_what_cannot_be_done_is_refused(photons: int, method: Any, words: str) -> None:
    counts = PhotonCounts.from_dense(photons * EVEN.dense, SMALL)
    with pytest.raises(pcii.InputError, match=words):
        estimate_depth(counts, (0.5, 1.0), method=method)
