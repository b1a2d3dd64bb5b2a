"""Light, films and depths of any size: values are right, or refused by name."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from twins import Reader, blocky_texture, patch_views, samples_of, unit_grid, variance_of

import pcii
from pcii.sections import view_samples
from pcii.types import LARGEST_COUNT, FocalPlanes, total_disparity_px

FAR_MM = 1e6  # no view shifts
GRID = unit_grid(2, 2, 4, 4)
MODES: list[dict[str, Any]] = [{}, {"variance": True}, {"subpixel": 2}]


def constant(value: float, dtype: type = np.float64, channels: int = 1) -> pcii.Views:
    return pcii.Views(np.full((*GRID.shape_KLHW, channels), value, dtype), GRID)


@pytest.mark.parametrize("options", MODES)
@pytest.mark.parametrize(
    ("value", "dtype"),
    [
        (0.0, np.float32),
        (5e-324, np.float64),  # the smallest numbers above 0, which have one bit
        (1e-45, np.float32),
        (6e-8, np.float16),
        (1e-300, np.float64),
        (-3.0, np.float32),
        (65504.0, np.float16),
        (1e30, np.float32),
        (1e300, np.float64),
        (2**53 - 1, np.int64),
    ],
)
def test_a_constant_film_is_that_constant(value: float, dtype: type, options: dict[str, Any]) -> None:
    sections = pcii.reconstruct(constant(value, dtype), FAR_MM, **options)
    reached, kept = sections.coverage > 0, np.float64(np.asarray(value, dtype))
    tolerance = 1e-6 if sections.counts.dtype == np.float32 else 1e-15  # float32 rounds the sum
    np.testing.assert_allclose(sections.estimate[reached], kept, rtol=tolerance, atol=1e-323)
    assert (sections.estimate[~reached] == 0).all()
    assert sections.variance is None or (sections.variance == 0).all()
    assert all(np.isfinite(array).all() for array in (sections.counts, sections.estimate))


@pytest.mark.parametrize("options", MODES)
@pytest.mark.parametrize(("value", "dtype"), [(3e38, np.float32), (1.7e308, np.float64)])
def test_sums_that_no_number_holds_are_refused(value: float, dtype: type, options: dict[str, Any]) -> None:
    views = constant(value, dtype)
    if options.get("subpixel"):  # no two samples of these views meet, so their sum is one of them
        assert np.isfinite(pcii.reconstruct(views, 2.0, **options).counts).all()
        return
    with pytest.raises(pcii.InputError, match=r"^radiance: values are too large for their sum"):
        pcii.reconstruct(views, FAR_MM, **options)


@pytest.mark.parametrize(("value", "dtype"), [(1e30, np.float32), (1e200, np.float64)])
def test_variances_that_no_number_holds_are_refused(value: float, dtype: type) -> None:
    """Sums are finite, squares are not: infinity must not be stored."""
    grid = unit_grid(3, 3, 4, 4)
    light = np.zeros((*grid.shape_KLHW, 1), dtype)
    light[1] = value
    views = pcii.Views(light, grid)
    assert np.isfinite(pcii.reconstruct(views, FAR_MM).counts).all()
    with pytest.raises(pcii.InputError, match=r"^radiance: values are too large for .*variance"):
        pcii.reconstruct(views, FAR_MM, variance=True)


def test_a_variance_just_below_the_largest_number_is_right() -> None:
    """100 samples of which half are 1e152: the square of their sum is infinite, the variance is not."""
    grid = unit_grid(10, 10, 1, 1)
    light = np.zeros((10, 10, 1, 1, 1))
    light[:5] = 1e153
    for radiance in (light, Reader(light)):
        sections: Any = pcii.reconstruct(pcii.Views(radiance, grid), FAR_MM, variance=True)
        np.testing.assert_allclose(sections.variance.item(), 25 / 99 * 1e306, rtol=1e-12)


def digits(found: float, certified: float) -> float:
    """Number of correct decimal digits, at most 15: the logarithm of the relative error."""
    return 15.0 if found == certified else min(15.0, -math.log10(abs(found / certified - 1)))


@pytest.mark.parametrize(
    ("values", "repeats", "mean", "deviation", "least"),
    [
        ([10000001, 10000003], 1, 10000002, 1, 11.5),
        ([1.1, 1.3], 500, 1.2, 0.1, 11.5),
        ([1000000.1, 1000000.3], 500, 1000000.2, 0.1, 8.5),
        ([10000000.1, 10000000.3], 500, 10000000.2, 0.1, 8.0),  # float64 is off by 2e-9 of the deviation
    ],
)
def test_statistics_are_those_certified_for_nists_reference_data(
    values: list[float], repeats: int, mean: float, deviation: float, least: float
) -> None:
    """NumAcc1 to 4: a datum is a view of one pixel. In float32 only whole numbers are those of the data."""
    for dtype in (np.float64, np.float32)[: 1 + (repeats == 1)]:
        light = np.array([mean, *values * repeats], dtype).reshape(1, -1, 1, 1, 1)
        views = pcii.Views(light, unit_grid(*light.shape[:4]))
        sections: Any = pcii.reconstruct(views, 1e9, variance=True)
        single = sections.counts.dtype == np.float32  # results are rounded to it once
        assert digits(sections.estimate.item(), mean) > (7 if single else 14)
        found = float(np.sqrt(sections.variance, dtype=np.float64).item())
        assert digits(found, deviation) > (7 if single else least)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("cfa", [None, "GRBG"])
@pytest.mark.parametrize("ratio", [1e6, 1e12])
def test_one_pixel_may_be_10_to_the_12_times_as_bright(ratio: float, cfa: str | None, dtype: type) -> None:
    """Each sum is that of fractions within the roundings of its own samples: no bright neighbour leaks."""
    grid = unit_grid(3, 2, 6, 5, (0.8, 1.4))
    light = np.random.default_rng(4).uniform(0.5, 1.5, (*grid.shape_KLHW, 1)).astype(dtype)
    light[:, :, 3, 2] *= dtype(ratio)
    sections: Any = pcii.reconstruct(pcii.Views(light, grid, cfa), 1.0, variance=True)
    ulp = float(np.finfo(dtype).eps)
    for where, samples in samples_of(light, grid, 1.0, cfa=cfa).items():
        np.testing.assert_allclose(sections.counts[0][where], math.fsum(samples), rtol=4 * ulp)
        np.testing.assert_allclose(
            sections.variance[0][where], variance_of(samples), rtol=8 * ulp, atol=1e-25
        )


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize(
    ("value", "dtype"),
    [(1, np.int32), (2**62, np.int64), (5e-324, np.float64), (1e-45, np.float32), (1e300, np.float64)],
)
def test_photons_do_not_depend_on_the_unit_of_light(value: float, dtype: type, channels: int) -> None:
    expected = pcii.limit_photons(constant(1.0, channels=channels), 1000, seed=6)
    found = pcii.limit_photons(constant(value, dtype, channels), 1000, seed=6)
    assert abs(found.total - expected.total) <= 2  # a rate may be rounded over a Poisson step
    assert abs(found.total - 4000) < 5 * np.sqrt(4000)


@pytest.mark.parametrize("method", ["posterior", "structure-tensor", "variance-sweep"])
@pytest.mark.parametrize("exponent", [-1000, -40, 960])
def test_depth_does_not_depend_on_the_unit_of_radiance(method: str, exponent: int) -> None:
    grid = unit_grid(3, 3, 32, 32, (4.0, 4.0))
    light = patch_views(blocky_texture(np.random.default_rng(9), 32, 32), 0, 0, 2, grid) + 0.1
    if method != "structure-tensor":  # the others make variances, and so squares
        exponent = int(np.clip(exponent, -400, 400))
    plain, scaled = (
        pcii.estimate_depth(pcii.Views(light * unit, grid), (1.0, 4.0), method=method)
        for unit in (2.0**30, 2.0**exponent)
    )
    assert np.isfinite(plain.z_mm).any()
    np.testing.assert_array_equal(np.isfinite(plain.z_mm), np.isfinite(scaled.z_mm))
    np.testing.assert_allclose(plain.z_mm, scaled.z_mm, rtol=1e-6)


def test_luminance_of_whole_numbers_is_not_cut_off() -> None:
    """Red light of 1 has a luminance of 0.2126, which was cut off to 0: no photons at all."""
    light = np.zeros((*GRID.shape_KLHW, 3), np.int64)
    light[..., 0] = 1
    assert pcii.limit_photons(pcii.Views(light, GRID), 1000, seed=7).total > 3000


@pytest.mark.parametrize("budget", [0, 1, 10**3, 10**6, 10**12])
@pytest.mark.parametrize("cfa", [None, "GRBG"])
def test_sums_of_any_budget_are_those_of_python_integers(budget: int, cfa: str | None) -> None:
    grid = unit_grid(2, 3, 5, 4, (1.3, 0.7))
    in_views = np.random.default_rng(0).multinomial(budget, np.full(20, 1 / 20), (2, 3))
    film = in_views.reshape(grid.shape_KLHW)
    expected = samples_of(film[..., None], grid, 1.1, cfa=cfa)
    where = np.nonzero(film)
    events = pcii.PhotonCounts.from_events(*where, film[where], grid, cfa=cfa)
    for counts in (pcii.PhotonCounts.from_dense(film, grid, cfa=cfa), events):
        assert counts.total == budget * grid.view_count
        sections = pcii.reconstruct(counts, 1.1)
        assert sections.counts.sum(dtype=object) == sum(sum(each) for each in expected.values())
        for where, samples in expected.items():
            assert int(sections.counts[0][where]) == sum(samples)
            assert sections.coverage[0][where] == len(samples)
            assert sections.estimate[0][where] == sum(samples) / len(samples)
        assert np.isfinite(sections.estimate).all()


@pytest.mark.parametrize("count", [10**10, LARGEST_COUNT])
def test_variances_that_64_bits_cannot_make_exactly_are_refused(count: int) -> None:
    grid = unit_grid(2, 2, 2, 2)
    counts = pcii.PhotonCounts.from_dense(np.full(grid.shape_KLHW, count), grid)
    with pytest.raises(pcii.InputError, match=r"^variance: the counts are too large"):
        pcii.reconstruct(counts, 10.0, variance=True)


def test_more_than_2_to_the_53_photons_of_a_voxel_are_counted_to_the_last() -> None:
    """10 000 views of 2^40 - 1 photons each: double precision would miss 1808 of them."""
    grid = unit_grid(100, 100, 1, 1)
    counts = pcii.PhotonCounts.from_dense(np.full(grid.shape_KLHW, LARGEST_COUNT - 1), grid)
    assert int(pcii.reconstruct(counts, 1e6).counts[0, 0, 0, 0]) == 10_000 * (LARGEST_COUNT - 1)


def test_a_pixel_holds_2_to_the_40_photons_however_they_come() -> None:
    grid, zero = unit_grid(1, 1, 1, 1), np.zeros(2, int)
    most = pcii.PhotonCounts.from_events(zero, zero, zero, zero, np.array([LARGEST_COUNT - 1, 1]), grid)
    assert most.total == LARGEST_COUNT
    with pytest.raises(pcii.InputError, match=r"^n: more than 2\^40 photons in a pixel"):
        pcii.PhotonCounts.from_events(zero, zero, zero, zero, np.array([LARGEST_COUNT, 1]), grid)
    with pytest.raises(pcii.InputError, match=r"^counts: more than 2\^40 photons in a pixel"):
        pcii.PhotonCounts.from_dense(np.full((1, 1, 1, 1), LARGEST_COUNT + 1), grid)


@pytest.mark.parametrize("level", [10**3, 10**6, 10**9, 10**11])
@pytest.mark.parametrize("differing", [False, True])
def test_the_variance_over_views_is_right_in_bright_windows(level: int, differing: bool) -> None:
    """Squares of differences of 10^12 photons are 10^24: added up in 64 bits they would be noise."""
    grid = unit_grid(3, 3, 4, 4)
    film = np.random.default_rng(2).poisson(level, grid.shape_KLHW)
    if differing:  # as where surfaces are out of focus
        film *= np.arange(1, 10).reshape(3, 3, 1, 1)
    counts = pcii.PhotonCounts.from_dense(film, grid)
    found = view_samples(counts, FocalPlanes.at_depths(grid, 1e6), 0, cell_px=4, window_cells=1)
    samples = [int(total) for total in film.sum(axis=(2, 3)).ravel()]
    assert found.number.item() == 9
    np.testing.assert_allclose(found.mean.item(), np.mean(samples), rtol=4e-16)
    np.testing.assert_allclose(found.variance.item(), variance_of(samples), rtol=1e-14)


RANGE_MM = (300.0, 900.0)


def grid_of(rows: int, cols: int, height: int, width: int) -> pcii.CameraGrid:
    return pcii.Optics(pitch_mm=(5.0, 5.0), focal_mm=50.0, pixel_mm=0.25).grid((rows, cols, height, width))


def sparse(grid: pcii.CameraGrid, photons: int, cfa: str | None = None) -> pcii.PhotonCounts:
    rng = np.random.default_rng(0)
    k, l, i, j = (rng.integers(0, size, photons) for size in grid.shape_KLHW)
    return pcii.PhotonCounts.from_events(k, l, i, j, np.ones(photons, int), grid, cfa=cfa)


@pytest.mark.parametrize(
    ("size", "cfa"),
    [((1, 1), None), ((1, 17), "BGGR"), pytest.param((13, 64), "BGGR", marks=pytest.mark.slow)],
)
def test_every_method_answers_on_films_of_any_size(size: tuple[int, int], cfa: str | None) -> None:
    grid = grid_of(2, 3, *size)
    counts = pcii.PhotonCounts.from_dense(np.random.default_rng(1).poisson(2, grid.shape_KLHW), grid, cfa=cfa)
    for method in pcii.removal_methods():
        focus = pcii.segment(counts, [400.0, 500.0], method=method)
        assert focus.in_focus.shape == (2, *size)
    views = pcii.Views(np.random.default_rng(2).uniform(0, 1, (*grid.shape_KLHW, 3)), grid)
    for data in (counts, views):
        for method in pcii.depth_methods(data):
            check_depth(pcii.estimate_depth(data, RANGE_MM, method=method), size)


def check_depth(depth: pcii.DepthMap, size: tuple[int, int]) -> None:
    """NaN where there is no depth, and nowhere else."""
    assert depth.z_mm.shape == size
    answered = np.isfinite(depth.z_mm)
    assert (np.isnan(depth.z_mm) | answered).all()
    slack = 1 + 1e-9
    assert (depth.z_mm[answered] >= RANGE_MM[0] / slack).all()
    assert (depth.z_mm[answered] <= RANGE_MM[1] * slack).all()
    assert np.isfinite(depth.confidence).all()
    assert (depth.confidence[~answered] == 0).all()


@pytest.mark.parametrize("z_mm", [1e-3, 1.0, 1e3, 1e7, 1.7e308])
@pytest.mark.parametrize("subpixel", [1, 3])
def test_no_depth_makes_photons_or_loses_those_that_stay(z_mm: float, subpixel: int) -> None:
    grid = grid_of(3, 3, 6, 7)
    counts = sparse(grid, 200)
    sections = pcii.reconstruct(counts, z_mm, subpixel=subpixel)
    if z_mm >= 1e7:  # no view shifts by half a voxel
        assert sections.counts.sum() == 200
    if z_mm <= 1:  # all views but the middle one leave the film
        assert sections.counts.sum() == counts.view(1, 1).sum()
    assert np.isfinite(sections.estimate).all()


@pytest.mark.parametrize("z_mm", [5e-324, 1e-300, 1.0, 1.7e308])
@pytest.mark.parametrize("pixel_mm", [5e-324, 0.05, 1e300])
@pytest.mark.parametrize("length_mm", [1e-300, 5.0, 1e300])
@pytest.mark.parametrize("cameras", [1, 2])
def test_lengths_whose_products_no_number_holds_are_refused_or_right(
    z_mm: float, pixel_mm: float, length_mm: float, cameras: int
) -> None:
    lengths: dict[str, Any] = {"pitch_mm": (length_mm, length_mm), "focal_mm": length_mm}
    grid = replace(grid_of(1, cameras, 2, 3), **lengths, pixel_mm=pixel_mm)
    total_disparity_px(grid, z_mm)  # without a warning
    counts = sparse(grid, 10)
    try:
        section = pcii.reconstruct(counts, z_mm)
    except pcii.InputError as fault:
        assert str(fault).startswith("z_mm: ")  # noqa: PT017
        return
    assert section.counts.sum() <= 10
    assert np.isfinite(section.planes.total_disparity_px).all()


@pytest.mark.stress
@pytest.mark.parametrize("side", [1024, 4096, 8192])
@pytest.mark.parametrize("cfa", [None, "GRBG"])
def test_the_largest_films_keep_every_photon(side: int, cfa: str | None) -> None:
    """2 x 2 views of up to 8192 x 8192 pixels hold a million photons; none shifts out at infinity."""
    counts = sparse(grid_of(2, 2, side, side), 1_000_000, cfa)
    for z_mm, least in ((1e9, 1_000_000), (500.0, 990_000)):
        sections = pcii.reconstruct(counts, z_mm)
        assert least <= int(sections.counts.sum(dtype=np.int64)) <= 1_000_000
