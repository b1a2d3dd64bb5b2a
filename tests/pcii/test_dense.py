"""Sections of dense views: sums and variances of the samples at each voxel, whatever the shifts."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from twins import colour_of, unit_grid, voxel_of

from pcii.dense import BATCH
from pcii.errors import InputError
from pcii.photon_counts import PhotonCounts
from pcii.reconstruct import reconstruct
from pcii.types import Views

patterns = st.sampled_from(["GRBG", "RGGB", "BGGR", "GBRG", None])


def samples_twin(images: np.ndarray, grid, cfa: str | None, z_mm: float) -> dict:
    """The samples that meet at each (row, column, colour), by loops."""
    K, L, H, W, C = images.shape
    meeting: dict[tuple[int, int, int], list[float]] = {}
    for k, l, i, j in np.ndindex(K, L, H, W):
        row = voxel_of(i, k, K, grid.pitch_mm[1] / z_mm, 1)
        col = voxel_of(j, l, L, grid.pitch_mm[0] / z_mm, 1)
        if 0 <= row < H and 0 <= col < W:
            for channel in range(C):
                colour = channel if cfa is None else colour_of(i, j, cfa)
                meeting.setdefault((row, col, colour), []).append(float(images[k, l, i, j, channel]))
    return meeting


class Reader:
    """Views that are read one by one, as from disk."""

    def __init__(self, images: np.ndarray) -> None:
        self.images, self.shape, self.dtype = images, images.shape, images.dtype

    def __getitem__(self, index: tuple[int, int]) -> np.ndarray:
        return self.images[index]


@given(
    cameras=st.tuples(st.integers(1, 5), st.integers(1, 5)),
    pixels=st.tuples(st.integers(1, 9), st.integers(1, 9)),
    pitch=st.tuples(st.floats(0.3, 3), st.floats(0.3, 3)),
    z=st.floats(0.3, 8),
    cfa=patterns,
    channels=st.sampled_from([1, 3]),
    double=st.booleans(),
    seed=st.integers(0, 999),
)
@settings(max_examples=150, deadline=None)
def test_sums_and_variances_are_those_of_the_samples(
    cameras, pixels, pitch, z, cfa, channels, double, seed
) -> None:
    grid = unit_grid(*cameras, *pixels, pitch)
    shape = (*grid.shape_KLHW, 1 if cfa else channels)
    # Whole numbers of a few digits: their sums are exact in single precision too.
    images = np.random.default_rng(seed).integers(0, 50, shape).astype(np.float64 if double else np.float32)
    sections = reconstruct(Views(images, grid, cfa), z, variance=True)
    expected = np.zeros((2, *sections.counts.shape[1:]))
    for where, values in samples_twin(images, grid, cfa, z).items():
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


@pytest.mark.parametrize("cfa", ["GRBG", None])
@pytest.mark.parametrize("spread", [1e-2, 1e-4, 1e-6])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_variance_survives_a_mean_of_a_million_deviations(cfa, spread, dtype) -> None:
    grid = unit_grid(10, 10, 6, 6, (1.0, 1.0))
    rng = np.random.default_rng(5)
    images = (7 * (1 + spread * rng.standard_normal((*grid.shape_KLHW, 1)))).astype(dtype)
    sections = reconstruct(Views(images.astype(np.float64), grid, cfa), 1e6, variance=True)
    # At this depth nothing moves, so voxel (i, j) holds pixel (i, j) of every view.
    exact = images[..., 0].astype(np.longdouble).reshape(100, 6, 6).var(axis=0, ddof=1)
    assert sections.variance is not None
    found = sections.variance[0].max(axis=-1)
    np.testing.assert_allclose(found, exact.astype(float), rtol=1e-6)
    if dtype == np.float32 and spread == 1e-6:  # the fault: mean of squares less square of mean
        pixels = images[..., 0].reshape(100, 6, 6)
        one_pass = (pixels**2).mean(axis=0) - pixels.mean(axis=0) ** 2
        assert not np.allclose(one_pass * 100 / 99, exact.astype(float), rtol=0.5)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("place", [(0, 0), (2, 3), (5, 5)])
@pytest.mark.parametrize("z", [0.4, 1.0, 100.0])
def test_nan_is_found_wherever_it_is(bad, place, z) -> None:
    grid = unit_grid(3, 3, 6, 6)
    images = np.ones((*grid.shape_KLHW, 1), dtype=np.float32)
    images[2, 0][place] = bad
    for views in (images, Reader(images)):
        with pytest.raises(InputError, match=r"view \(2, 0\) holds NaN or infinity"):
            reconstruct(Views(views, grid), z, variance=True)


def test_more_views_than_are_held_at_a_time() -> None:
    grid = unit_grid(BATCH + 3, 2, 4, 5)
    images = np.random.default_rng(1).random((*grid.shape_KLHW, 3))
    for z in (1.0, 2.7):
        held, read = (reconstruct(Views(v, grid), z, variance=True) for v in (images, Reader(images)))
        np.testing.assert_allclose(read.counts, held.counts, rtol=1e-14)
        assert held.variance is not None
        assert read.variance is not None
        np.testing.assert_allclose(read.variance, held.variance, rtol=1e-12)


def test_variance_is_told_of_views_on_whole_pixels_only() -> None:
    grid = unit_grid(2, 2, 4, 4)
    with pytest.raises(InputError, match="variance"):
        reconstruct(Views(np.ones((2, 2, 4, 4, 1)), grid), 1.0, subpixel=2, variance=True)
    counts = PhotonCounts.from_dense(np.ones((2, 2, 4, 4), dtype=np.int64), grid, cfa=None)
    with pytest.raises(InputError, match="variance"):
        reconstruct(counts, 1.0, variance=True)


@given(
    cameras=st.tuples(st.integers(1, 5), st.integers(1, 5)),
    pixels=st.tuples(st.integers(1, 9), st.integers(1, 9)),
    z=st.floats(0.3, 8),
    cfa=patterns,
    most=st.sampled_from([1, 255, 65_535, 10**9]),
    seed=st.integers(0, 999),
)
@settings(max_examples=150, deadline=None)
def test_bright_counts_are_the_same_as_images_and_as_photons(cameras, pixels, z, cfa, most, seed) -> None:
    grid = unit_grid(*cameras, *pixels)
    kind = {1: np.uint8, 255: np.uint8, 65_535: np.uint16, 10**9: np.int64}[most]
    dense = np.random.default_rng(seed).integers(0, most, grid.shape_KLHW, endpoint=True).astype(kind)
    bright = PhotonCounts.from_dense(dense, grid, cfa=cfa)
    events = bright.events
    sparse = PhotonCounts.from_events(events.k, events.l, events.i, events.j, events.n, grid, cfa=cfa)
    as_images, as_photons = reconstruct(bright, z), reconstruct(sparse, z)
    np.testing.assert_array_equal(as_images.counts, as_photons.counts)
    np.testing.assert_array_equal(as_images.coverage, as_photons.coverage)
