"""Sections of counts and of views, sparse and dense: sums and variances of the samples at each voxel."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from twins import (
    Reader,
    blocky_texture,
    colour_of,
    demosaic_twin,
    samples_of,
    section_twin,
    unit_grid,
    variance_of,
)

import pcii
from pcii.base import InputError
from pcii.sections import demosaic, reconstruct
from pcii.types import PATTERNS, CameraGrid, PhotonCounts, Views, mosaic

patterns = st.sampled_from([*PATTERNS, None])
# Depths whose disparity is exact, so that the twin's order of operations cannot matter.
depths = st.lists(st.sampled_from([0.25, 0.5, 1.0, 2.0, 4.0]), min_size=1, max_size=2)
grids = st.builds(
    unit_grid,
    st.integers(1, 4),
    st.integers(1, 4),
    st.integers(1, 6),
    st.integers(1, 6),
    st.tuples(st.floats(0.01, 4), st.floats(0.01, 4)),
)


@given(grid=grids, cfa=patterns, z=depths, subpixel=st.integers(1, 3), seed=st.integers(0, 999))
def test_sections_are_eq_3_to_the_bit(grid, cfa, z, subpixel, seed):
    dense = np.random.default_rng(seed).poisson(2.0, size=grid.shape_KLHW)
    sections = reconstruct(PhotonCounts.from_dense(dense, grid, cfa=cfa), z, subpixel=subpixel)
    # Whole numbers of radiance have exact float64 sums.
    views = reconstruct(Views(dense[..., None].astype(float), grid, cfa), z, subpixel=subpixel)
    total, coverage = section_twin(dense, grid, cfa, z, subpixel)
    for each in (sections, views):
        np.testing.assert_array_equal(each.counts, total)
        np.testing.assert_array_equal(each.coverage, coverage)
    assert sections.counts.dtype.kind == "i"
    mean = [t / c if c else 0.0 for t, c in zip(total.ravel(), coverage.ravel(), strict=True)]
    np.testing.assert_array_equal(sections.estimate.ravel(), mean)


def test_the_view_from_the_right_moves_right_by_hand():
    grid = unit_grid(1, 2, 1, 4, pitch_mm=(2.0, 1.0))  # at z = 1 the shifts are -1 and +1
    dense = np.array([[[[0, 1, 2, 3]], [[4, 5, 6, 7]]]])
    sections = reconstruct(PhotonCounts.from_dense(dense, grid), 1.0)
    assert sections.counts[0, 0, :, 0].tolist() == [1, 2 + 4, 3 + 5, 6]
    assert sections.coverage[0, 0, :, 0].tolist() == [1, 2, 2, 1]
    assert sections.estimate[0, 0, :, 0].tolist() == [1.0, 3.0, 4.0, 6.0]


def test_colours_never_mix_by_hand():
    grid = unit_grid(1, 2, 1, 4, pitch_mm=(2.0, 1.0))  # odd shifts: green falls on red
    dense = np.array([[[[1, 10, 2, 20]], [[3, 30, 4, 40]]]])  # G R G R
    sections = reconstruct(PhotonCounts.from_dense(dense, grid, cfa="GRBG"), 1.0)
    red, green, blue = np.moveaxis(sections.counts[0, 0], -1, 0)
    assert red.tolist() == [10, 0, 20 + 30, 0]
    assert green.tolist() == [0, 2 + 3, 0, 4]
    assert blue.tolist() == [0, 0, 0, 0]


def views_of_a_plane(
    grid: CameraGrid, disparity_px: tuple[int, int], seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Crops (K, L, H, W, 3) of one large picture, and what the virtual centre sees of it (H, W, 3)."""
    K, L, H, W = grid.shape_KLHW
    margin = 32
    picture = np.random.default_rng(seed).integers(0, 256, size=(H + 2 * margin, W + 2 * margin, 3))

    def crop(k: float, l: float) -> np.ndarray:
        # A camera further right has a field of view further right.
        top = margin + int((k - (K - 1) / 2) * disparity_px[1])
        left = margin + int((l - (L - 1) / 2) * disparity_px[0])
        return picture[top : top + H, left : left + W]

    views = np.array([[crop(k, l) for l in range(L)] for k in range(K)])
    return views.astype(float), crop((K - 1) / 2, (L - 1) / 2)


@pytest.mark.parametrize("cfa", ["GRBG", "BGGR", None])
@pytest.mark.parametrize(
    ("shape", "parallax", "shear"),
    [
        ((3, 5, 20, 21), (3, 2), (0, 0)),
        ((4, 2, 21, 20), (6, 2), (0, 0)),
        ((3, 5, 20, 21), (3, 2), (3, 2)),  # the plane stands still
        ((3, 5, 20, 21), (3, 2), (5, 7)),  # and is turned round
    ],
)
def test_a_plane_is_exact_at_its_depth_and_nowhere_else(cfa, shape, parallax, shear):
    pitch = (float(parallax[0]), float(parallax[1]))
    grid = unit_grid(*shape, pitch_mm=pitch, shear_px=shear)
    images, pattern = views_of_a_plane(grid, (parallax[0] - shear[0], parallax[1] - shear[1]), seed=3)
    views = Views(images, grid) if cfa is None else Views(mosaic(images, cfa)[..., None], grid, cfa)
    sections = reconstruct(views, [1.0, 0.25, 2.0])
    covered = sections.coverage > 0
    np.testing.assert_array_equal(sections.estimate[0], np.where(covered[0], pattern, 0))
    assert covered[0].any(axis=-1).mean() > 0.5
    # The mean of at least two unrelated bytes is rarely the right byte.
    assert (sections.estimate[1] != pattern)[sections.coverage[1] > 1].mean() > 0.9
    if any(shear):  # the fault: the same views taken for those of a grid that is not sheared
        fault = reconstruct(Views(views.radiance, unit_grid(*shape, pitch_mm=pitch), cfa), 1.0)
        assert (fault.estimate[0] != pattern)[fault.coverage[0] > 1].mean() > 0.5
    else:
        assert (sections.estimate[2] != pattern)[sections.coverage[2] > 1].mean() > 0.9


def test_views_on_disk_are_read_once_however_many_planes(monkeypatch: pytest.MonkeyPatch) -> None:
    grid = unit_grid(2, 3, 16, 16)
    pixels = blocky_texture(np.random.default_rng(0), 16, 16)
    reads: list[tuple[int, int]] = []

    class NotingReader(Reader):
        def __getitem__(self, index: tuple[int, int]) -> np.ndarray:
            reads.append(index)
            return super().__getitem__(index)

    images, cameras = np.tile(pixels, (2, 3, 1, 1, 1)), list(np.ndindex(2, 3))
    on_disk, everything = Views(NotingReader(images), grid), Views(images, grid)
    sections = reconstruct(on_disk, [1.0, 2.0, 4.0])
    assert sorted(reads) == cameras
    np.testing.assert_array_equal(sections.counts, reconstruct(everything, [1.0, 2.0, 4.0]).counts)

    reads.clear()
    depth = pcii.estimate_depth(on_disk, (0.25, 2.0))
    assert sorted(reads) == cameras
    monkeypatch.setattr("pcii.sections.dense_sections.MOST_BYTES", 0)  # too many for the memory
    again = pcii.estimate_depth(on_disk, (0.25, 2.0))
    assert len(reads) > 10 * len(cameras)
    for other in (again, pcii.estimate_depth(everything, (0.25, 2.0))):
        np.testing.assert_allclose(depth.z_mm, other.z_mm, rtol=1e-6)


@given(
    cameras=st.tuples(st.integers(1, 5), st.integers(1, 5)),  # more views than are read at a time
    pixels=st.tuples(st.integers(1, 9), st.integers(1, 9)),
    pitch=st.tuples(st.floats(0.3, 3), st.floats(0.3, 3)),
    z=st.floats(0.3, 8),
    cfa=patterns,
    channels=st.sampled_from([1, 3]),
    double=st.booleans(),
    seed=st.integers(0, 999),
)
def test_sums_and_variances_are_those_of_the_samples(
    cameras, pixels, pitch, z, cfa, channels, double, seed
) -> None:
    grid = unit_grid(*cameras, *pixels, pitch)
    shape = (*grid.shape_KLHW, 1 if cfa else channels)
    # Whole numbers of a few digits: their sums are exact in single precision too.
    images = np.random.default_rng(seed).integers(0, 50, shape).astype(np.float64 if double else np.float32)
    sections: Any = reconstruct(Views(images, grid, cfa), z, variance=True)
    expected = np.zeros((2, *sections.counts.shape[1:]))
    for where, values in samples_of(images, grid, z, cfa=cfa).items():
        expected[0][where] = sum(values)
        expected[1][where] = np.var(values, ddof=1) if len(values) > 1 else 0
    np.testing.assert_array_equal(sections.counts[0], expected[0])
    np.testing.assert_allclose(sections.variance[0], expected[1], rtol=1e-5, atol=1e-9)
    read: Any = reconstruct(Views(Reader(images), grid, cfa), z, variance=True)
    np.testing.assert_array_equal(read.counts, sections.counts)
    np.testing.assert_allclose(read.variance, sections.variance, rtol=1e-5, atol=1e-9)
    without = reconstruct(Views(images, grid, cfa), z)
    np.testing.assert_array_equal(without.counts, sections.counts)
    assert without.variance is None


@given(
    cameras=st.tuples(st.integers(1, 4), st.integers(1, 4)),
    pixels=st.tuples(st.integers(1, 6), st.integers(1, 6)),
    z=st.sampled_from([0.25, 0.5, 1.0, 2.0, 4.0]),  # exact disparities, in whatever order the twin computes
    cfa=patterns,
    most=st.sampled_from([1, 3, 1000, 10**6]),
    seed=st.integers(0, 999),
)
def test_variances_of_counts_are_those_of_fractions(cameras, pixels, z, cfa, most, seed) -> None:
    grid = unit_grid(*cameras, *pixels)
    dense = np.random.default_rng(seed).integers(0, most, grid.shape_KLHW, endpoint=True)
    samples = samples_of(dense[..., None], grid, z, cfa=cfa)
    for data in dense_and_sparse(dense, grid, cfa):
        sections: Any = reconstruct(data, z, variance=True)
        expected = np.zeros(sections.counts.shape[1:])
        for voxel, values in samples.items():
            expected[voxel] = variance_of(values)
        # One rounding of each of numerator and denominator, and of the quotient.
        np.testing.assert_allclose(sections.variance[0], expected, rtol=5e-16)


def dense_and_sparse(dense: np.ndarray, grid: CameraGrid, cfa: str | None) -> list[PhotonCounts]:
    whole = PhotonCounts.from_dense(dense, grid, cfa=cfa)
    e = whole.events
    return [whole, PhotonCounts.from_events(e.k, e.l, e.i, e.j, e.n, grid, cfa=cfa)]


@given(
    cameras=st.tuples(st.integers(1, 5), st.integers(1, 5)),
    pixels=st.tuples(st.integers(1, 9), st.integers(1, 9)),
    z=st.floats(0.2, 8),
    cfa=st.sampled_from(["GRBG", "RGGB", "BGGR", "GBRG"]),
    seed=st.integers(0, 999),
)
def test_even_shifts_add_raw_samples_of_one_colour(cameras, pixels, z, cfa, seed) -> None:
    grid = unit_grid(*cameras, *pixels)
    K, L, H, W = grid.shape_KLHW
    dense = np.random.default_rng(seed).poisson(1.0, grid.shape_KLHW)
    sums, samples = np.zeros((H, W), int), np.zeros((H, W), int)
    for k, l, i, j in np.ndindex(K, L, H, W):
        row = i + 2 * int(np.floor((k - (K - 1) / 2) / z / 2 + 0.5))
        col = j + 2 * int(np.floor((l - (L - 1) / 2) / z / 2 + 0.5))
        if 0 <= row < H and 0 <= col < W:
            assert colour_of(i, j, cfa) == colour_of(row, col, cfa)
            sums[row, col] += dense[k, l, i, j]
            samples[row, col] += 1
    views = Views(dense[..., None].astype(np.float64), grid, cfa)
    for data in (*dense_and_sparse(dense, grid, cfa), views):
        sections = reconstruct(data, z, shifts="even")
        assert sections.cfa == cfa
        np.testing.assert_array_equal(sections.counts[0, ..., 0], sums)
        np.testing.assert_array_equal(sections.coverage[0, ..., 0], samples)


@pytest.mark.parametrize(
    ("options", "cfa", "words"),
    [
        ({"shifts": "cubic"}, "GRBG", "shifts: use 'nearest' or 'even'"),
        ({"shifts": "even"}, None, "shifts: 'even' is for Bayer mosaics"),
        ({"subpixel": 0}, None, "subpixel: "),
        ({"subpixel": 2, "variance": True}, None, "variance: is for whole pixels"),
    ],
)
def test_options_that_do_not_go_together_are_refused(options, cfa, words) -> None:
    with pytest.raises(InputError, match=f"^{words}"):
        reconstruct(Views(np.ones((2, 2, 4, 4, 1)), unit_grid(2, 2, 4, 4), cfa), 1.0, **options)


GREEN = 1
# The paper counts rows and columns from 1: its pixel 43 is [3, 2] here.


def at(*pixels: tuple[int, float], size: int = 7) -> np.ndarray:
    """A GRBG mosaic of zeros but for the pixels named in the paper's way: (43, 10.0) is row 4, column 3."""
    raw = np.zeros((size, size))
    for place, value in pixels:
        raw[place // 10 - 1, place % 10 - 1] = value
    return raw


AROUND_43 = ((42, 4), (44, 8), (33, 100), (53, 200), (43, 10))
AROUND_34 = ((33, 4), (35, 8), (24, 100), (44, 200), (34, 10))


@pytest.mark.parametrize(
    ("pixels", "place", "green"),
    [
        ((*AROUND_43, (41, 10), (45, 10)), (3, 2), (4 + 8) / 2),  # Eq. 4: alpha 0, beta 10
        ((*AROUND_43, (23, 10), (63, 10)), (3, 2), (100 + 200) / 2),  # 10, 0; misprinted it would be 52
        ((*AROUND_43, (41, 20), (63, 20)), (3, 2), (4 + 8 + 100 + 200) / 4),  # 0, 0
        ((*AROUND_34, (32, 6), (36, 12), (14, 40)), (2, 3), (4 + 8) / 2),  # Eq. 5: alpha 1, beta 10
        ((*AROUND_34, (14, 6), (54, 12), (32, 40)), (2, 3), (100 + 200) / 2),  # 10, 1; misprinted: 100
        ((*AROUND_34, (32, 4), (36, 4), (14, 32), (54, 0)), (2, 3), (4 + 8 + 100 + 200) / 4),  # 6, 6
    ],
)
def test_green_follows_the_smaller_gradient_by_eqs_4_and_5(pixels, place, green):
    assert demosaic(at(*pixels))[*place, GREEN] == green


images = st.builds(
    lambda seed, height, width, top: np.random.default_rng(seed).integers(0, top, size=(height, width)),
    st.integers(0, 9999),
    st.integers(2, 8),
    st.integers(2, 8),
    st.sampled_from([2, 3, 256, 10**9]),  # photon counts, where ties are the rule, to saturation
)


@given(raw=images, cfa=st.sampled_from(PATTERNS))
def test_demosaicing_is_eqs_4_to_6_to_the_bit(raw, cfa):
    # Halves and quarters of whole numbers are exact, so the order of additions cannot matter.
    np.testing.assert_array_equal(demosaic(raw, cfa=cfa), demosaic_twin(raw, cfa))


@pytest.mark.parametrize("cfa", PATTERNS)
@pytest.mark.parametrize("along_rows", [True, False])
def test_stripes_are_reproduced_exactly(cfa, along_rows):
    # Along a stripe nothing changes and across it the square has a gradient everywhere, so green is
    # interpolated along it, and chroma follows green: means of R and B alone would be wrong.
    stripes = np.broadcast_to(np.arange(12) ** 2, (10, 12))
    rgb = np.stack([stripes + 7, stripes, stripes - 3], axis=-1)
    rgb = rgb if along_rows else np.swapaxes(rgb, 0, 1)
    np.testing.assert_array_equal(demosaic(mosaic(rgb, cfa), cfa=cfa), rgb)


@pytest.mark.parametrize(
    ("raw", "options", "words"),
    [
        (np.zeros((1, 4)), {}, "mosaic: expected an image"),
        (np.full((4, 4), np.nan), {}, "mosaic: holds NaN"),
        (np.zeros((4, 4)), {"method": "nearest"}, "method: .*laroche-prescott"),
        (np.zeros((4, 4)), {"cfa": None}, "cfa: "),
    ],
)
def test_what_cannot_be_demosaiced_is_refused_by_name(raw, options, words):
    with pytest.raises(InputError, match=f"^{words}"):
        demosaic(raw, **options)
