"""Evidence of texture: depths that are shown, hot pixels, and a wrong order, shift or pitch of views."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from property_settings import mostly_slow
from rendered_cards import Card, render
from scipy.ndimage import gaussian_filter
from twins import blocky_texture, even_light, patch_views, unit_grid

from pcii import CameraGrid, PhotonCounts, ViewOrder, Views, check_grid, limit_photons
from pcii.base import block_sums
from pcii.evidence import CameraFit, ShownDepth, TextureModel, evidence_of_texture, without_hot_pixels
from pcii.sections import reconstruct
from pcii.types import FocalPlanes


@pytest.mark.parametrize("octaves", [1, 4])
@pytest.mark.parametrize("rate", [0.05, 100.0])
@pytest.mark.parametrize("cfa", ["GRBG", None])
def test_noise_has_none_on_average(cfa: str | None, rate: float, octaves: int) -> None:
    grid = unit_grid(4, 4, 256, 256)
    # Where texture would stand far above the noise a coefficient has (y^2 / v - 1) / 2, of variance 1 / 2.
    model = TextureModel(contrast=1e3, averaging_error=0.0, saturation_nats=1e12, octaves=octaves)
    counts, planes = even_light(grid, rate, 3, cfa), FocalPlanes.at_depths(grid, [0.5])
    inner = evidence_of_texture(counts, planes, model=model).nats[0, 16:-16, 16:-16]
    # The first octaves have as many independent coefficients as blocks, the others fewer.
    deviation = np.sqrt(sum(4.0**-octave / 2 for octave in range(octaves)) / inner.size)
    assert abs(inner.mean()) < 4 * deviation


def test_it_is_largest_in_focus_and_bounded(two_squares) -> None:
    planes = FocalPlanes.at_depths(two_squares.grid, [1 / d for d in (2.0, 2.5, 3.0, 3.5, 4.0)])
    nats = evidence_of_texture(two_squares.counts, planes).nats
    at_third = two_squares.masks[list(two_squares.z_mm).index(1 / 3)][::2, ::2]
    assert nats[:, at_third].sum(axis=1).argmax() == 2
    octaves = sum(4.0**-octave for octave in range(TextureModel().octaves))
    assert nats.max() <= TextureModel().saturation_nats * octaves


def test_two_octaves_are_those_of_the_equations() -> None:
    grid, model = unit_grid(3, 4, 67, 90), TextureModel(octaves=2, saturation_nats=1e12)
    counts = even_light(grid, 2.0, 5, "GRBG")
    planes = replace(FocalPlanes.at_depths(grid, [0.3, 0.8]), rounding=0.75)
    section = reconstruct(counts, planes)
    colours_apart = section.counts, section.coverage
    fine = [block_sums(part.sum(axis=-1, dtype=float), 2, float) for part in colours_apart]
    fine = [np.pad(part, [(0, 0), *((0, -size % 4) for size in part.shape[1:])]) for part in fine]
    impulse, expected = np.zeros((99, 99)), np.zeros(1)
    impulse[49, 49] = 1
    for octave, sigma in enumerate((1.0, 3**0.5)):
        coarse = [gaussian_filter(part, sigma, mode="constant", axes=(1, 2)) for part in fine]
        wider = gaussian_filter(impulse, sigma)
        y, b = (total / np.maximum(number, 1e-3) for total, number in (fine, coarse))
        v = ((impulse - wider) ** 2).sum() * coarse[0] / np.maximum(coarse[1], 1e-3) ** 2
        v = np.maximum(v, 1e-24) + (model.averaging_error * b) ** 2
        r = (model.contrast * b) ** 2 / v
        e = r / (1 + r) * ((y - b) ** 2 / v - 1) / 2
        expected = expected + np.where(coarse[1] >= model.least_coverage * 12 * 4, e, 0) / 4**octave
        fine, impulse = coarse, wider
    nats = evidence_of_texture(counts, planes, model=model).nats
    np.testing.assert_allclose(nats, expected[:, :34, :45], rtol=2e-4, atol=2e-6)


@pytest.mark.parametrize("octaves", [1, 4, 7])
@pytest.mark.parametrize("size", [(1, 1), (37, 50), (66, 23)])
def test_films_of_any_size_have_as_many_octaves_as_are_asked_for(size: tuple[int, int], octaves: int) -> None:
    grid = unit_grid(2, 3, *size)
    planes = FocalPlanes.at_depths(grid, [0.5, 1.0])
    light, model = even_light(grid, 1.0, 0, None), TextureModel(octaves=octaves)
    nats = evidence_of_texture(light, planes, model=model).nats
    assert nats.shape == (2, -(-size[0] // 2), -(-size[1] // 2))
    assert np.isfinite(nats).all()


MODEL, BLOCK_PX, DISPARITIES_PX = TextureModel(), 2, (4.0, 4.5, 5.0, 5.5, 6.0)
PATCH = np.s_[18:42, 26:50]  # blocks well inside the texture of `patch_of`


def shown_and_supported(counts: PhotonCounts, plane: int = 2) -> tuple[np.ndarray, np.ndarray]:
    """Where a depth is shown, and where that of a plane, 5 px, is supported."""
    steps = max(counts.grid.rows, counts.grid.cols) - 1
    planes = FocalPlanes.at_total_disparity(counts.grid, steps * np.array(DISPARITIES_PX))
    nats = evidence_of_texture(counts, planes, BLOCK_PX, MODEL).nats
    depth = np.full(nats.shape[1:], plane)
    return ShownDepth(support_planes=0)(counts, planes, slice(0, len(planes)), nats, depth, BLOCK_PX, MODEL)


def shown(counts: PhotonCounts) -> np.ndarray:
    return shown_and_supported(counts)[0]


def patch_of(disparity_px: int, *, photons: float, shear_px: int = 0) -> PhotonCounts:
    """A square with texture on a dark film of 5 x 7 cameras, as shear leaves it."""
    rng = np.random.default_rng(0)
    square = photons * blocky_texture(rng, 64, 64)
    films = patch_views(square, 32, 48, disparity_px - shear_px, unit_grid(5, 7, 128, 160))
    grid = unit_grid(5, 7, 128, 160, shear_px=(shear_px, shear_px))
    return PhotonCounts.from_dense(rng.poisson(films[..., 0]), grid)


@pytest.mark.parametrize("shear_px", [0, 5, 8])
@pytest.mark.parametrize("photons", [0.05, 100.0])
def test_a_surface_in_the_range_shows_its_depth(photons: float, shear_px: int) -> None:
    counts = patch_of(5, photons=photons, shear_px=shear_px)
    for part in shown_and_supported(counts):
        assert part[PATCH].mean() > 0.95


def test_a_depth_where_the_surface_is_out_of_focus_is_not_supported() -> None:
    counts = patch_of(5, photons=1.0)
    for plane, is_supported in ((2, True), (4, False)):  # that is 6 px of total disparity away
        assert (shown_and_supported(counts, plane)[1][PATCH] == is_supported).mean() > 0.95


def test_what_lies_outside_the_range_shows_no_depth_in_it() -> None:
    # The textures at 0, of the films themselves, and at 8 are sharper there than in the range of 4 to 6.
    for disparity_px in (0, 2, 8):
        assert not shown(patch_of(disparity_px, photons=1.0)).any()


def test_noise_that_all_cameras_share_is_a_surface_where_they_put_it() -> None:
    # The planted fault: with the opposite order of cameras the same noise is none.
    noise = np.random.default_rng(2).poisson(1.0, (200, 200, 1))
    grid = unit_grid(3, 3, 128, 128)
    film = patch_views(noise, -36, -36, 5, grid)[..., 0].astype(int)
    assert shown(PhotonCounts.from_dense(film, grid)).mean() > 0.9
    assert not shown(PhotonCounts.from_dense(film[::-1, ::-1], grid)).any()


def test_a_gain_is_compared_with_the_noise_of_all_that_a_camera_may_have_brought_there() -> None:
    # Three cameras see a dim square: half of it gains no more than twelve deviations of the noise in reach,
    # all of it more than those of the noise at its own place behind infinity.
    rng, grid = np.random.default_rng(0), unit_grid(1, 3, 64, 96)
    films = patch_views(0.2 * blocky_texture(rng, 32, 32), 16, 16, 5, grid)[..., 0]
    assert shown(PhotonCounts.from_dense(rng.poisson(films), grid))[8:24, 8:24].mean() == 0.5


PLACES = [(0, 0), (5, 1), (5, 9), (9, 11)]
HOT_DISPARITIES_PX = [4.0, 5.0, 6.0]  # from camera to camera


def cleaned(counts: PhotonCounts) -> tuple[PhotonCounts, int]:
    steps = max(counts.grid.rows, counts.grid.cols) - 1
    planes = FocalPlanes.at_total_disparity(counts.grid, steps * np.array(HOT_DISPARITIES_PX))
    return without_hot_pixels(counts, planes)


@pytest.mark.parametrize(("cfa", "step"), [("GRBG", 2), (None, 1)])
@pytest.mark.parametrize("views", [(2, 1), (3, 3)])
def test_a_hot_pixel_has_what_its_neighbour_of_the_same_colour_has(cfa, step, views):
    grid = unit_grid(*views, 10, 12)
    film = np.random.default_rng(0).poisson(1.0, grid.shape_KLHW)
    expected = film.copy()
    for i, j in PLACES:
        film[:, :, i, j] = 10**4
        expected[:, :, i, j] = expected[:, :, i, j - step if j >= step else j + step]
    with pytest.warns(UserWarning, match="4 of 120 pixels are at least twice as bright"):
        found, replaced = cleaned(PhotonCounts.from_dense(film, grid, cfa=cfa))
    assert replaced == 4
    for k, l in np.ndindex(views):
        np.testing.assert_array_equal(found.view(k, l), expected[k, l])
    assert found.cfa == cfa


def test_what_is_hot_in_half_of_the_views_stays():
    grid = unit_grid(2, 2, 10, 12)
    film = np.random.default_rng(0).poisson(1.0, grid.shape_KLHW)
    film[0, :, 5, 5] = 10**4
    counts = PhotonCounts.from_dense(film, grid, cfa=None)
    assert cleaned(counts)[0] is counts


@pytest.mark.parametrize("rate", [0.0, 0.01, 1.0, 1e4])
@pytest.mark.parametrize("size", [(1, 1), (1, 2), (60, 80)])
def test_noise_has_no_hot_pixels(rate, size):
    grid = unit_grid(2, 1, *size)
    counts = even_light(grid, rate, 0, "GRBG")
    if rate < 1e4 or size != (1, 1):
        assert cleaned(counts)[0] is counts


@pytest.mark.parametrize(("shear_px", "is_kept"), [(0.0, False), (2.5, False), (3.5, True), (5.2, True)])
def test_what_stands_still_is_hot_unless_the_films_rest_among_the_planes(shear_px, is_kept):
    # With three cameras in a row a point less than 1 px from rest stays in its pixel in most of the views.
    grid = unit_grid(1, 3, 30, 30, shear_px=(shear_px, 0.0))
    film = np.ones(grid.shape_KLHW, dtype=int)
    film[:, :, 15, 15] = 10**4
    counts = PhotonCounts.from_dense(film, grid, cfa=None)
    assert (cleaned(counts)[0] is counts) == is_kept


GRID = CameraGrid(rows=3, cols=3, pitch_mm=(4, 4), focal_mm=35, pixel_mm=36 / 120, height=90, width=120)
CARDS = [Card(180, seed=1), Card(80, (0.2, 0.8, 0.1, 0.5), 2), Card(50, (0.3, 0.8, 0.6, 0.95), 3)]
PARALLAX_PX = 35 * 4 / 0.3
"""From camera to camera, of 1 mm of depth: 9.3, 5.8 and 2.6 px of the cards."""
ORDERS = [
    ViewOrder(swap_axes=swap, flip_rows=rows, flip_cols=cols)
    for swap, rows, cols in product((False, True), repeat=3)
]


def stored_so_that(views: np.ndarray, mended_by: ViewOrder) -> np.ndarray:
    """Views as somebody stored them who has to be told `mended_by`, read as if in the usual order."""
    K, L = views.shape[:2]
    table = (L, K) if mended_by.swap_axes else (K, L)
    numbers = mended_by.arrange(np.arange(K * L).reshape(table))
    stored = np.empty_like(views.reshape(K * L, *views.shape[2:]))
    stored[numbers.ravel()] = views.reshape(stored.shape)
    return stored.reshape(*table, *views.shape[2:])


@pytest.fixture(scope="module")
def views() -> np.ndarray:
    return render(GRID, CARDS, cell=8)


def test_right_views_are_not_warned_about_and_their_depths_are_found(views) -> None:
    """To 0.7 px of total disparity: planes are half a pixel apart, of views that move by whole ones."""
    fit = check_grid(Views(views, GRID), (30.0, 250.0))
    assert fit == CameraFit(fit.z_mm, fit.nearest_mm)
    found, expected = ([2 * PARALLAX_PX / z for z in depths] for depths in (fit.z_mm, (50, 80, 180)))
    assert found == pytest.approx(expected, abs=0.7)


@pytest.mark.parametrize("mended_by", ORDERS[1:], ids=str)
def test_every_wrong_order_is_found(views, mended_by) -> None:
    fit = check_grid(Views(stored_so_that(views, mended_by), GRID))
    assert (fit.order, fit.shear_px, fit.z_mm) == (mended_by, None, ())


def test_rows_and_columns_exchanged_in_a_grid_that_is_not_square() -> None:
    grid = replace(GRID, rows=2, cols=4)
    swapped = ViewOrder(swap_axes=True)
    right = render(grid, CARDS, cell=8)
    stated = replace(grid, rows=4, cols=2)
    assert check_grid(Views(stored_so_that(right, swapped), stated), (30, 250)).order == swapped
    assert check_grid(Views(right, grid), (30, 250)).order is None


@pytest.mark.parametrize(
    ("rows_cols", "noise"),
    mostly_slow(
        product([(1, 5), (5, 1), (2, 2), (4, 3)], [0.0, 0.1]),
        quick=[((1, 5), 0.1), ((2, 2), 0.0), ((4, 3), 0.1)],
    ),
)
def test_grids_of_any_shape_also_with_noise(rows_cols, noise) -> None:
    grid = replace(GRID, rows=rows_cols[0], cols=rows_cols[1])
    clean = render(grid, CARDS, cell=8)
    noisy = np.maximum(clean + noise * np.random.default_rng(4).normal(size=clean.shape), 0)
    fit = check_grid(Views(noisy, grid), (30, 250))
    assert fit == CameraFit(fit.z_mm, fit.nearest_mm)
    turned = check_grid(Views(noisy[::-1, ::-1], grid), (30, 250)).order
    assert turned == ViewOrder(flip_rows=grid.rows > 1, flip_cols=grid.cols > 1)


SHEAR = PARALLAX_PX / 90
"""Px per camera, so that what is at 90 mm stands still: disparities of both signs."""


def test_a_sheared_grid_is_judged_like_any_other() -> None:
    grid = replace(GRID, shear_px=(SHEAR, SHEAR))
    views = render(grid, CARDS, cell=8)
    assert len(check_grid(Views(views, grid), (30, 250)).z_mm) == 3
    assert check_grid(Views(views[:, ::-1], grid), (30, 250)).order == ViewOrder(flip_cols=True)


@pytest.mark.parametrize(
    ("stated", "order"),
    [(0.0, ViewOrder()), (-SHEAR, ViewOrder()), (SHEAR / 8, ViewOrder(swap_axes=True))],
    ids=["none", "opposite", "some, and swapped"],
)
def test_a_shift_that_was_taken_out_is_no_flip(stated, order) -> None:
    """Both signs of disparity in one grid tell a shift from a flip; the farthest is 2.6 px behind SHEAR."""
    shifted = render(replace(GRID, shear_px=(SHEAR, SHEAR)), CARDS, cell=8)
    fit = check_grid(Views(stored_so_that(shifted, order), replace(GRID, shear_px=(stated, stated))))
    assert fit.order == (order if order.swap_axes else None)
    assert fit.shear_px is not None
    least = SHEAR - PARALLAX_PX / 180
    assert least < fit.shear_px[0] < 3 * least
    mended = replace(GRID, shear_px=fit.shear_px)
    fit = check_grid(Views(shifted, mended))
    assert (fit.order, fit.shear_px, len(fit.z_mm)) == (None, None, 3)


def test_photon_counts_are_judged_if_there_are_enough() -> None:
    """30 000 photons per view are 4 in a cell of 4 x 4 px; of 1000 nothing is said, and nothing wrong."""
    grid = replace(GRID, rows=5, cols=5, pixel_mm=0.12, height=240, width=300)
    cards = [Card(450, seed=1), Card(200, (0.2, 0.8, 0.1, 0.5), 2), Card(125, (0.3, 0.8, 0.6, 0.95), 3)]
    light = Views(render(grid, cards, cell=20), grid)
    counts = limit_photons(light, 30_000, seed=1)
    assert len(check_grid(counts).z_mm) == 3
    flipped = PhotonCounts.from_dense(counts.dense[:, ::-1], grid)
    assert check_grid(flipped).order == ViewOrder(flip_cols=True)
    few = limit_photons(light, 1000, seed=1)
    assert check_grid(few) == check_grid(PhotonCounts.from_dense(few.dense[::-1, ::-1], grid)) == CameraFit()


@pytest.mark.parametrize("pattern", ["blank", "noise", "columns", "shuffled"])
def test_what_cannot_be_judged_is_not(views, pattern) -> None:
    rng = np.random.default_rng(1)
    seen = {
        "blank": np.ones_like(views),
        "noise": rng.random(views.shape),
        "columns": np.broadcast_to(render(GRID, CARDS[:1])[:1, :, :1], views.shape),
        "shuffled": views.reshape(9, 90, 120, 3)[rng.permutation(9)].reshape(views.shape),
    }[pattern]
    # Rows of cameras that see the same tell nothing of the order of rows.
    fit = check_grid(Views(seen[::-1] if pattern == "columns" else seen, GRID), (30, 250))
    assert (fit.order, fit.shear_px) == (None, None)
    assert fit.z_mm == () or pattern == "columns"
    assert fit.nearest_mm is not None
