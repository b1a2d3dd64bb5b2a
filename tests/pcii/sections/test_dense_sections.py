"""Sections of dense views: sums and variances of the samples at each voxel, whatever the shifts."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from twins import Reader, colour_of, samples_of, unit_grid, variance_of

from pcii.base import InputError
from pcii.sections import reconstruct
from pcii.types import CameraGrid, PhotonCounts, Views

patterns = st.sampled_from(["GRBG", "RGGB", "BGGR", "GBRG", None])


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
    sections = reconstruct(Views(images, grid, cfa), z, variance=True)
    expected = np.zeros((2, *sections.counts.shape[1:]))
    for where, values in samples_of(images, grid, z, cfa=cfa).items():
        expected[0][where] = sum(values)
        expected[1][where] = np.var(values, ddof=1) if len(values) > 1 else 0
    assert sections.variance is not None
    np.testing.assert_array_equal(sections.counts[0], expected[0])
    np.testing.assert_allclose(sections.variance[0], expected[1], rtol=1e-5, atol=1e-9)
    read = reconstruct(Views(Reader(images), grid, cfa), z, variance=True)
    np.testing.assert_array_equal(read.counts, sections.counts)
    assert read.variance is not None
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
        sections = reconstruct(data, z, variance=True)
        expected = np.zeros(sections.counts.shape[1:])
        for voxel, values in samples.items():
            expected[voxel] = variance_of(values)
        assert sections.variance is not None
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
