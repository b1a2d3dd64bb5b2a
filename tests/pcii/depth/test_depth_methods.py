from importlib.metadata import EntryPoint
from typing import Any

import numpy as np
import pytest
from twins import unit_grid

import pcii
from pcii.depth import depth_methods, estimate_depth
from pcii.depth.methods import GROUP, modes_mm
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
@pytest.mark.parametrize("pitch_mm", [(1.0, 1.0), (1.0, 0.6)])
def test_a_wall_is_found_where_it_is(
    method: str, kind: str, most_px: float, pitch_mm: tuple[float, float]
) -> None:
    grid = unit_grid(5, 7, 64, 72, pitch_mm)
    seen = wall_views(grid, (TRUE_PX * pitch_mm[0], TRUE_PX * pitch_mm[1]))
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


@pytest.mark.parametrize("method", depth_methods())
def test_where_nothing_is_seen_there_is_no_depth(method: str) -> None:
    grid = unit_grid(3, 3, 24, 20)
    data = PhotonCounts.from_dense(np.zeros(grid.shape_KLHW, int), grid)
    if method not in depth_methods(data):
        data = Views(np.zeros((*grid.shape_KLHW, 3)), grid)
    depth = estimate_depth(data, (0.2, 1.0), method=method)
    assert np.isnan(depth.z_mm).all()
    assert (depth.confidence == 0).all()


def test_the_default_follows_the_data() -> None:
    grid = unit_grid(3, 3, 24, 24)
    views = wall_views(grid, (2.0, 2.0))
    by_default = pcii.estimate_depth(Views(views, grid), (0.3, 0.9))
    by_name = pcii.estimate_depth(Views(views, grid), (0.3, 0.9), method="posterior")
    assert np.array_equal(by_default.z_mm, by_name.z_mm, equal_nan=True)


@pytest.mark.parametrize(
    ("method", "sentence"),
    [
        ("structure-tensor", "no estimator of depth from photon counts named 'structure-tensor'"),
        ("nearest", "named 'nearest'; use posterior, sweep-17, variance-sweep$"),
    ],
)
def test_a_method_that_cannot_take_the_data_is_refused(method: str, sentence: str) -> None:
    grid = unit_grid(2, 2, 8, 8)
    counts = PhotonCounts.from_dense(np.ones(grid.shape_KLHW, int), grid)
    with pytest.raises(pcii.InputError, match=sentence):
        estimate_depth(counts, (0.5, 1.0), method=method)


def halfway(data: Any, z_range_mm: tuple[float, float]) -> pcii.DepthMap:
    """A method of another package."""
    film = np.full((data.grid.height, data.grid.width), sum(z_range_mm) / 2)
    return pcii.DepthMap(film, np.ones(film.shape))


def half_a_map(data: Any, z_range_mm: tuple[float, float]) -> pcii.DepthMap:
    depth = halfway(data, z_range_mm)
    return pcii.DepthMap(depth.z_mm[::2], depth.confidence[::2])


def test_another_package_brings_a_method(monkeypatch: pytest.MonkeyPatch) -> None:
    points = [EntryPoint(name, f"{__name__}:{name}", GROUP) for name in ("halfway", "half_a_map")]
    monkeypatch.setattr(
        "importlib.metadata.entry_points", lambda group: [point for point in points if point.group == group]
    )
    grid = unit_grid(2, 2, 8, 8)
    counts = PhotonCounts.from_dense(np.ones(grid.shape_KLHW, int), grid)
    assert "halfway" in depth_methods(counts)
    assert (estimate_depth(counts, (0.5, 1.0), method="halfway").z_mm == 0.75).all()
    with pytest.raises(
        pcii.InputError, match=r"'half_a_map' of a package must return a pcii\.DepthMap of 8 x 8"
    ):
        estimate_depth(counts, (0.5, 1.0), method="half_a_map")


@pytest.mark.parametrize(
    ("z_mm", "confidence", "sentence"),
    [
        (-0.5, 1.0, "^method: 'wrong' must return depths above 0 mm, or NaN where it has no answer$"),
        (np.inf, 1.0, "^method: 'wrong' must return depths above 0 mm"),
        (0.5, np.nan, "^method: 'wrong' must return a confidence from 0 to 1, also where"),
        (0.5, 1.5, "^method: 'wrong' must return a confidence from 0 to 1"),
        (0.5j, 1.0, "^z_mm: expected real numbers"),
        (0.5, 1j, "^confidence: expected real numbers"),
    ],
)
def test_a_map_that_cannot_be_is_refused(z_mm: complex, confidence: complex, sentence: str) -> None:
    grid = unit_grid(2, 2, 8, 8)

    def wrong(data: Any, z_range_mm: tuple[float, float]) -> pcii.DepthMap:
        film = np.ones((8, 8))
        return pcii.DepthMap(film * z_mm, film * confidence)

    with pytest.raises(pcii.InputError, match=sentence):
        estimate_depth(PhotonCounts.from_dense(np.ones(grid.shape_KLHW, int), grid), (0.5, 1.0), method=wrong)


def test_too_many_photons_for_the_likelihood_sweep_are_refused() -> None:
    grid = unit_grid(2, 2, 8, 8)
    bright = PhotonCounts.from_dense(np.full(grid.shape_KLHW, 2**20 + 1), grid)
    with pytest.raises(pcii.InputError, match=r"more than 2\^40 photons"):
        estimate_depth(bright, (0.5, 1.0), method="sweep-17")


def test_planes_are_where_a_depth_map_has_most_surfaces() -> None:
    """Two walls and a card, by hand: shares of the confidence, not of the pixels, decide."""
    grid = unit_grid(4, 4, 20, 40)  # total disparities are 3 / z px
    total_px = np.full((20, 40), np.nan)
    confidence = np.ones((20, 40))
    total_px[:, :20], total_px[:, 20:30] = 30.0, 33.5
    total_px[:, 30:33], total_px[:, 33:36] = 50.0, 52.0  # of one bulging thing
    total_px[:, 36:], confidence[:, 36:] = 70.0, 0.1  # as large, and unsure
    depth = pcii.DepthMap(3 / total_px, confidence)
    # What is within 4 px of the largest window belongs to it: its edge, not a surface of its own.
    assert modes_mm(depth, grid) == pytest.approx([3 / 51, 3 / 31.1667], rel=1e-4)
    apart = pcii.DepthMap(3 / np.where(total_px == 33.5, 35.5, total_px), confidence)
    assert modes_mm(apart, grid) == pytest.approx([3 / 51, 3 / 35.5, 3 / 30], rel=1e-4)
    assert modes_mm(pcii.DepthMap(np.full((20, 40), np.nan), 0 * confidence), grid) == ()
