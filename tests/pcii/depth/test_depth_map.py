"""Depth maps of every method: right where something is seen, without an answer elsewhere, or refused."""

from importlib.metadata import EntryPoint
from typing import Any

import numpy as np
import pytest
from twins import bayer_photons, blocky_texture, opaque_views, patch_views, unit_grid

import pcii
from pcii.base import InputError
from pcii.depth import NetworkInputs, PosteriorDepth, SheetModel, depth_methods, estimate_depth, run_network
from pcii.evidence import without_hot_pixels
from pcii.removal import segment
from pcii.store import sample
from pcii.types import CameraGrid, DepthMap, FocalPlanes, PhotonCounts, Views

RANGE_MM = (1 / 9, 1 / 1)


@pytest.mark.parametrize("photons_per_view", [1e3, 1e5])
def test_things_of_eighteen_pixels_have_a_depth_however_much_light_there_is(photons_per_view: float) -> None:
    grid, rng, side = unit_grid(5, 5, 128, 128), np.random.default_rng(3), 18
    i, j = np.indices((side, side)) - (side - 1) / 2
    disc = (i**2 + j**2 < (side / 2) ** 2)[..., None] * blocky_texture(rng, side, side)
    discs = [(36, 6), (75, 7)]  # first row and column, disparity
    views = [patch_views(disc, corner, corner, disparity, grid) for corner, disparity in discs]
    rates = np.sum(views, axis=0)
    # Of the light of three colours a pixel takes one.
    light = bayer_photons(3 * photons_per_view * grid.view_count / rates.sum() * rates, "GRBG", seed=1)
    depth = estimate_depth(PhotonCounts.from_dense(light, grid, cfa="GRBG"), (1 / 9, 1 / 3))
    for corner, disparity in discs:
        z_mm = depth.z_mm[corner : corner + side, corner : corner + side][disc[..., 0] > 0]
        assert np.isfinite(z_mm).mean() > 0.9
        assert np.nanmedian(np.abs(4 / z_mm - 4 * disparity)) < 0.5  # four steps between five cameras


def test_the_dark_has_no_depth(two_squares):
    depth = estimate_depth(two_squares.counts, RANGE_MM)
    # No photon of a plane in the range comes within 8 px, the deviation of the window, of this corner.
    corner = (slice(0, 24), slice(-24, None))
    assert np.isnan(depth.z_mm[corner]).all()
    # Elsewhere a square may be near enough, or its blur at another plane.
    dark = ~(two_squares.masks[0] | two_squares.masks[1])
    assert np.isnan(depth.z_mm[dark]).mean() > 0.7


def slanted_card(grid: CameraGrid, near: float, far: float, seed: int) -> PhotonCounts:
    """A textured card over the whole frame, of the disparity `far` at its left and `near` at its right."""
    rng = np.random.default_rng(seed)
    texture = blocky_texture(rng, 2 * grid.height, 2 * grid.width).repeat(4, axis=0).repeat(4, axis=1)
    K, L, H, W = grid.shape_KLHW
    slope = (near - far) / (W - 1)
    rates = np.zeros((*grid.shape_KLHW, 3))
    for k in range(K):
        for l in range(L):
            down, right = k - (K - 1) / 2, l - (L - 1) / 2
            # Column x of the virtual centre, of the disparity far + slope x, is seen at x - right disparity.
            x = (np.arange(W) + right * far) / (1 - right * slope)
            y = np.arange(H)[:, None] + down * (far + slope * x)
            # To a quarter of a pixel: whole ones would be another disparity than the true one.
            i = np.round(4 * (y + H / 2)).astype(int)
            j = np.broadcast_to(np.round(4 * (x + W / 2)).astype(int), i.shape)
            rates[k, l] = texture[i, j]
    return PhotonCounts.from_dense(bayer_photons(0.1 * rates, "GRBG", seed), grid, cfa="GRBG")


@pytest.mark.parametrize("turned", [False, True])
def test_the_depth_of_a_slanted_card_is_monotone(turned):
    grid = unit_grid(7, 7, 128, 160)
    counts = slanted_card(grid, near=6.0, far=3.0, seed=0)
    if turned:  # nearer at its left: views mirrored, cameras in the other order
        counts = PhotonCounts.from_dense(counts.dense[:, ::-1, :, ::-1], grid, cfa="RGGB")
    z = estimate_depth(counts, (1 / 8, 1 / 2)).z_mm[20:-20]
    if turned:
        z = z[:, ::-1]
    middle = np.arange(24, 136, 16)
    found = np.array([np.nanmedian(6 / z[:, x - 8 : x + 8]) for x in middle])
    true = 6 * (3.0 + 3.0 * middle / 159)
    assert np.all(np.diff(found) > 0)
    # Bands of 16 px span 1.8 px of total disparity, planes 1: half of each.
    np.testing.assert_allclose(found, true, atol=1.4)
    assert np.isfinite(z[:, 16:-16]).mean() > 0.9


def test_hot_pixels_are_replaced_before_depth_is_looked_for() -> None:
    film = slanted_card(unit_grid(7, 7, 64, 64), near=6.0, far=3.0, seed=0).dense.copy()
    film[:, :, 20:50:10, 20:50:10] += 100
    hot = PhotonCounts.from_dense(film, unit_grid(7, 7, 64, 64), cfa="GRBG")
    z_range_mm = (1 / 8, 1 / 2)
    cleaned, replaced = without_hot_pixels(hot, FocalPlanes.at_depths(hot.grid, z_range_mm))
    found, expected = (estimate_depth(counts, z_range_mm) for counts in (hot, cleaned))
    assert found.hot_pixels == replaced == 9
    np.testing.assert_array_equal(found.z_mm, expected.z_mm)
    np.testing.assert_array_equal(found.confidence, expected.confidence)


def test_what_is_beyond_the_ends_of_the_range_has_no_answer_and_belongs_to_no_mask() -> None:
    grid = unit_grid(7, 7, 128, 160)
    # Total disparities of 10 px at the left to 44 px; the range is 20 to 32 px.
    counts, total_px = slanted_card(grid, near=44 / 6, far=10 / 6, seed=0), np.linspace(10, 44, 160)
    z_range_mm = (6 / 32, 6 / 20)
    z_mm = estimate_depth(counts, z_range_mm).z_mm
    assert z_range_mm[0] <= np.nanmin(z_mm) <= np.nanmax(z_mm) <= z_range_mm[1]
    is_answered = np.isfinite(z_mm).mean(axis=0)
    assert is_answered[(total_px > 22) & (total_px < 30)].mean() > 0.9
    assert is_answered[(total_px < 18) | (total_px > 34)].mean() < 0.05
    masks = segment(counts, z_range_mm, z_range_mm=z_range_mm).in_focus.any(axis=0).mean(axis=0)
    assert masks[(total_px < 18) | (total_px > 34)].mean() < 0.05


@pytest.mark.parametrize("total_px", [31.0, 33.0, 13.5])
def test_a_wall_just_outside_the_range_has_no_answer(total_px: float) -> None:
    # The range is 15 to 31.5 px: the network is to see how evidence falls off on either side of the wall.
    grid = unit_grid(7, 7, 96, 96)
    counts = slanted_card(grid, total_px / 6, total_px / 6, seed=1)
    answered = np.isfinite(estimate_depth(counts, (6 / 31.5, 6 / 15)).z_mm).mean()
    assert answered > 0.9 if total_px == 31 else answered < 0.02


def test_plain_light_around_a_thing_is_not_sure_of_its_depth() -> None:
    grid, rng, side = unit_grid(5, 5, 128, 128), np.random.default_rng(3), 40
    thing = patch_views(2 * blocky_texture(rng, side, side), 44, 44, 6, grid)[..., 0]
    depth = estimate_depth(PhotonCounts.from_dense(rng.poisson(1 + thing), grid), (1 / 9, 1 / 3))
    is_plain = np.ones(grid.shape_HW, bool)
    is_plain[32:96, 32:96] = False
    assert np.median(depth.confidence[44:84, 44:84]) > 0.7
    # Where a region is answered with the certainty of the network it is .35.
    assert depth.confidence[is_plain].mean() < 0.1


@pytest.mark.parametrize("bad", [(0, 1), (1.0, 1.0), (1, float("inf")), (1.0, 2.0, 3.0), ("near", "far")])
def test_a_range_that_is_not_near_to_far_is_refused(bad: Any) -> None:
    grid = unit_grid(2, 2, 4, 4)
    counts = PhotonCounts.from_dense(np.ones(grid.shape_KLHW, dtype=int), grid)
    with pytest.raises(InputError, match=r"^z_(range_)?mm: ") as caught:
        estimate_depth(counts, bad)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("rows", "cols"), [(1, 9), (9, 1)])
def test_a_line_of_cameras_has_depths_of_shaded_things_and_none_of_shaded_light(rows: int, cols: int) -> None:
    """Edges along the line are as sharp out of focus, and so is shading."""
    grid = unit_grid(rows, cols, 128, 128)
    y, x = np.mgrid[-1:1:64j, -1:1:64j]
    disc = (1 - x**2 - y**2).clip(min=0)[..., None] * np.ones(3)
    rates = opaque_views([(disc, 32, 32, 4)], grid) + 0.002
    rates *= 3 * 20000 * grid.view_count / rates.sum()  # a pixel sees one colour of three
    counts = PhotonCounts.from_dense(bayer_photons(rates, "GRBG", seed=1), grid, cfa="GRBG")
    error_px = np.abs(8 / estimate_depth(counts, (1 / 6, 1 / 2)).z_mm[42:86, 42:86] - 8 * 4)
    assert (error_px <= 3).mean() > 0.7  # .77 and .99; none where regions are compared by blur
    shading = 1 + 0.5 * np.sin(np.arange(128) / 20)
    light = shading[:, None] * shading * np.ones(grid.shape_KLHW)
    film = PhotonCounts.from_dense(np.random.default_rng(1).poisson(light), grid, cfa="GRBG")
    assert np.isnan(estimate_depth(film, (1 / 6, 1 / 2)).z_mm).all()


def test_depths_that_are_too_many_or_seen_by_one_camera_are_refused():
    one_view = PhotonCounts.from_dense(np.ones((1, 1, 8, 8), dtype=int), unit_grid(1, 1, 8, 8))
    with pytest.raises(InputError, match=r"^data: one view has no depth"):
        estimate_depth(one_view, (1.0, 2.0))
    counts = PhotonCounts.from_dense(np.ones((2, 2, 8, 8), dtype=int), unit_grid(2, 2, 8, 8))
    with pytest.raises(InputError, match=r"z_range_mm: .* choose a farther near end"):
        estimate_depth(counts, (1e-6, 1.0))
    # The disparity at z is 1 / z px, and films of 256 px have nothing in common from 256 px on.
    estimate_depth(counts, (1 / 257, 1 / 255.9))
    with pytest.raises(InputError, match=r"z_range_mm: up to 0.00390625 mm no two cameras see the same"):
        estimate_depth(counts, (1 / 256 - 1e-12, 1 / 256))
    for z_mm, sentence in (([1e-3], "no two cameras"), ([1e-6, 1.0], "choose a farther near end")):
        with pytest.raises(InputError, match=f"z_mm: .*{sentence}"):
            segment(counts, z_mm=z_mm)


def test_the_network_is_run_where_there_are_photons_and_a_margin(two_squares, monkeypatch) -> None:
    """The dark far from all photons is left out: bounded, as the depth map of the whole film says."""
    events, range_mm = two_squares.counts.events, (1 / 4, 1 / 2.4)
    grid = unit_grid(7, 7, 512, 512)
    place = events.k, events.l, events.i + 64, events.j + 64, events.n
    counts, sizes = PhotonCounts.from_events(*place, grid, cfa="GRBG"), list[tuple[int, ...]]()

    def noting(inputs: NetworkInputs, requested_planes: np.ndarray) -> Any:
        sizes.append(inputs.evidence.shape[1:])
        return run_network(inputs, requested_planes)

    monkeypatch.setattr("pcii.depth.posterior_depth.run_network", noting)
    whole, part, edges = (PosteriorDepth(margin_blocks=n)(counts, range_mm) for n in (1000, 64, 0))
    assert sizes == [(256, 256), (224, 224), (128, 128)]  # blocks of 2 px

    def errors_px(found: DepthMap) -> np.ndarray:
        both = np.isfinite(found.z_mm) & np.isfinite(whole.z_mm)
        assert (np.isfinite(found.z_mm) != np.isfinite(whole.z_mm)).mean() < 1e-3
        return np.abs(6 / found.z_mm[both] - 6 / whole.z_mm[both])

    assert errors_px(part).mean() < 0.01
    assert errors_px(edges).mean() > 3 * errors_px(part).mean()  # the fault: no margin


def test_a_film_larger_than_those_of_training_is_seen_in_blocks_of_two_sizes() -> None:
    counts, z_mm, range_mm, network = sample().counts, np.array([540, 620]), (450, 750), SheetModel(sweeps=0)
    long_px = max(counts.grid.shape_HW)
    fine, coarse = (
        PosteriorDepth(sheets=network, block_px=side, trained_blocks=long_px // side).posterior(
            counts, range_mm, z_mm
        )
        for side in (2, 4)
    )
    both = PosteriorDepth(sheets=network, trained_blocks=long_px // 4).posterior(counts, range_mm, z_mm)
    for name in ("probability", "no_surface", "in_focus"):
        one, other = (getattr(each, name) for each in (fine, coarse))
        down, right = (
            np.array([np.interp((np.arange(size) - 0.5) / 2, np.arange(len(row)), row) for row in rows])
            for size, rows in ((size, np.eye(-(-size // 2))) for size in one.shape[-2:])
        )
        linear = np.einsum("ri,...rc,cj->...ij", down, other, right)
        np.testing.assert_allclose(getattr(both, name), (one + linear) / 2, atol=1e-5)
    np.testing.assert_allclose(coarse.probability.sum(axis=0), 1 - coarse.no_surface, atol=1e-5)


WALL_RANGE_MM = (1 / 5.9, 1 / 3.1)
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
        along = np.cos(angle) * right[..., None] + np.sin(angle) * down[..., None]
        views[k, l, ..., 0] = 1 + 2 * np.cos(frequency * along + phase).mean(axis=-1)
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
    depth = estimate_depth(data_of(kind, grid, seen), WALL_RANGE_MM, method=method)
    inner = np.s_[16:-16, 16:-16]
    error_px = np.abs(6 / depth.z_mm[inner] - 6 * TRUE_PX)
    assert np.median(error_px) < most_px
    # Neighbouring planes can be the same section, since shifts are whole pixels.
    assert (error_px < 2).mean() > 0.97
    assert ((depth.confidence > 0) == np.isfinite(depth.z_mm)).all()
    # The fault: cameras in the wrong order. Their depth is another one, or there is none.
    wrong = estimate_depth(data_of(kind, grid, seen[::-1, ::-1]), WALL_RANGE_MM, method=method)
    assert not np.median(np.abs(6 / wrong.z_mm[inner] - 6 * TRUE_PX)) < most_px


def test_depth_has_no_levels_that_whole_shifts_would_give() -> None:
    grid = unit_grid(6, 6, 64, 64)  # of an even number of cameras all are half a pixel off at once
    error_px = []
    for disparity_px in np.arange(3.6, 5.6, 0.4):
        depth = estimate_depth(Views(wall_views(grid, (disparity_px, disparity_px)), grid), WALL_RANGE_MM)
        error_px.append(np.nanmedian(5 / depth.z_mm[16:-16, 16:-16]) - 5 * disparity_px)
    # 0.6 px with shifts to the nearest pixel.
    assert np.sqrt(np.mean(np.square(error_px))) < 0.4


def test_a_saturated_pixel_leaves_the_depth_of_the_others_as_it_is() -> None:
    grid = unit_grid(1, 2, 40, 40)
    wall = np.random.default_rng(5).poisson(wall_views(grid, (3.0, 3.0))[..., 0]).clip(max=30)
    depths: list[np.ndarray] = []
    for photons in (3, 31):
        wall[0, 0, 20, 1] = photons  # the other camera does not see its voxels
        counts = PhotonCounts.from_dense(wall, grid, frames=31, bits=1)
        depths.append(estimate_depth(counts, RANGE_MM, method="variance-sweep").z_mm)
    assert np.isfinite(depths[0][:, 15:]).mean() > 0.5
    np.testing.assert_allclose(depths[1][:, 15:], depths[0][:, 15:])


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
    group, names = "pcii.depth_methods", ("halfway", "half_a_map")
    points = {group: [EntryPoint(name, f"{__name__}:{name}", group) for name in names]}
    monkeypatch.setattr("importlib.metadata.entry_points", lambda group: points.get(group, []))
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
