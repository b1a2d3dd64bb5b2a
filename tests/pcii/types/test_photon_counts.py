"""Photon counts, however they come, and frames of few bits beside a twin in decimals."""

from decimal import Decimal, localcontext
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import poisson
from twins import unit_grid

from pcii.base import InputError
from pcii.sections import reconstruct
from pcii.types import MOST_FRAMES, Light, PhotonCounts, Readout, Views, limit_photons


def events_of(counts: PhotonCounts) -> list[tuple[int, ...]]:
    e = counts.events
    return list(zip(*(getattr(e, name).tolist() for name in "klijn"), strict=True))


def test_events_are_sorted_repeats_added_and_zeros_dropped():
    rows = [(1, 0, 2, 3, 4), (0, 2, 0, 0, 1), (1, 0, 2, 3, 5), (0, 0, 1, 1, 0)]
    counts = PhotonCounts.from_events(*np.array(rows).T, unit_grid(2, 3, 4, 6))
    assert events_of(counts) == [(0, 2, 0, 0, 1), (1, 0, 2, 3, 9)]
    assert counts.total == 10


small_counts = st.builds(
    lambda seed, shape, rate: np.random.default_rng(seed).poisson(rate, size=shape),
    st.integers(0, 999),
    st.tuples(st.integers(1, 3), st.integers(1, 3), st.integers(1, 5), st.integers(1, 5)),
    st.sampled_from([0.0, 0.2, 3.0]),
)


@given(dense=small_counts, shuffle=st.integers(0, 99))
def test_dense_and_events_hold_the_same_counts_in_any_order(dense, shuffle):
    grid = unit_grid(*dense.shape)
    from_dense = PhotonCounts.from_dense(dense, grid, cfa="GRBG")
    where = np.random.default_rng(shuffle).permutation(np.argwhere(dense))
    n = dense[tuple(where.T)]
    # Photons of a pixel given as separate events are the same counts.
    single = np.repeat(where, n, axis=0)
    for rows, photons in ((where, n), (single, np.ones(len(single), dtype=int))):
        sparse = PhotonCounts.from_events(*rows.T, photons, grid, cfa="GRBG")
        assert events_of(sparse) == events_of(from_dense)
        assert sparse.total == from_dense.total == dense.sum()
        for k, l in np.ndindex(grid.rows, grid.cols):
            np.testing.assert_array_equal(sparse.view(k, l), dense[k, l])
        np.testing.assert_array_equal(sparse.dense, dense)
        np.testing.assert_array_equal(from_dense.dense, dense)


def test_arrays_that_do_not_fit_are_refused_by_name():
    grid, zeros, one = unit_grid(1, 1, 2, 2), np.zeros((1, 1, 2, 2), dtype=int), np.zeros(1, dtype=int)
    for bad in (-1, 0.5, float("nan")):
        with pytest.raises(InputError, match=r"^n: photon counts must"):
            PhotonCounts.from_events(one, one, one, one, np.array([bad]), grid)
        with pytest.raises(InputError, match=r"^counts: photon counts must"):
            PhotonCounts.from_dense(np.full((1, 1, 2, 2), bad), grid)
    with pytest.raises(InputError, match=r"^counts: expected shape \(1, 1, 2, 2\)"):
        PhotonCounts.from_dense(zeros[..., :1], grid)
    with pytest.raises(InputError, match=r"^l: "):
        PhotonCounts.from_events(*np.array([[0, 3, 0, 0, 1]]).T, unit_grid(2, 3, 4, 5))
    with pytest.raises(InputError, match=r"same length"):
        PhotonCounts.from_events(one, one, one, one, np.ones(2, dtype=int), grid)
    with pytest.raises(InputError, match=r"view: expected a camera \(k, l\) of 1 x 1"):
        PhotonCounts.from_dense(zeros, grid).view(-1, 0)


def test_photons_are_drawn_fairly_and_always_alike() -> None:
    grid, rng = unit_grid(7, 7, 32, 32), np.random.default_rng(6)
    many = rng.poisson(rng.uniform(0, 4, 49)[:, None], (49, 1024)).reshape(grid.shape_KLHW)
    counts = PhotonCounts.from_dense(many, grid, cfa="GRBG")
    most = counts.total / 5
    few = counts.subsample(most, np.random.default_rng(0))
    assert (few.grid, few.cfa) == (grid, "GRBG")
    assert abs(few.total - most) < 5 * np.sqrt(most)
    kept = np.stack([few.view(k, l) for k in range(7) for l in range(7)]).reshape(many.shape)
    assert (kept <= many).all()
    # Views keep their shares: chi square of 48 degrees of freedom, 5 deviations of its mean of 48.
    by_view, expected = kept.sum(axis=(2, 3)), many.sum(axis=(2, 3)) / 5
    chi2 = ((by_view - expected) ** 2 / (0.8 * expected)).sum()
    assert 48 - 5 * np.sqrt(96) < chi2 < 48 + 5 * np.sqrt(96)
    again = PhotonCounts.from_events(*(getattr(few.events, name) for name in "klijn"), grid, cfa="GRBG")
    assert events_of(few) == events_of(again) == events_of(counts.subsample(most, np.random.default_rng(0)))
    assert counts.subsample(counts.total, np.random.default_rng(0)) is counts


@pytest.mark.parametrize("number", [0, float("nan"), 1e13])
def test_what_is_no_number_of_photons_is_refused(number: Any) -> None:
    with pytest.raises(InputError, match=r"^photons: expected a number above 0"):
        Light(number)
    assert [Light.parse(t).stored for t in ("300", "exposure", "full-light")] == [300, None, "full-light"]


def test_photons_of_views_are_poisson_numbers_of_their_own() -> None:
    grid = unit_grid(2, 3, 40, 60)
    light = np.ones((*grid.shape_KLHW, 3))
    light[..., 30:, :] = 3
    counts = limit_photons(Views(light, grid), 5000, seed=1, cfa="GRBG")
    by_view = counts.dense.sum(axis=(2, 3))
    assert np.abs(by_view - 5000).max() < 5 * np.sqrt(5000)
    assert len(set(by_view.ravel().tolist())) > 1
    assert abs(counts.dense[..., 30:].sum() / counts.total - 3 / 4) < 5 * np.sqrt(3 / 16 / 30_000)
    with pytest.raises(InputError, match=r"^seed: "):
        limit_photons(Views(light, grid), 10, seed=-1)


@pytest.mark.parametrize("frames", [1, 16, 1000, MOST_FRAMES])
def test_estimates_of_one_bit_are_those_of_a_twin_in_decimals(frames: int) -> None:
    samples = np.array([1, 3, 25, 100])
    trials = samples * frames
    counts = np.unique(np.concatenate([[0, 1, 2], trials // 1000, trials // 2, trials - 1, trials]))
    pairs = [(int(n), int(v)) for v in samples for n in counts if n <= v * frames]
    n, v = (np.array(column) for column in zip(*pairs, strict=True))
    found = Readout(frames, 1).photons(n, v)
    for value, number, seen in zip(found, n.tolist(), v.tolist(), strict=True):
        if number == seen * frames:
            assert value == np.inf
            continue
        with localcontext(prec=40):
            exact = -frames * (1 - Decimal(number) / (seen * frames)).ln()
        assert value == pytest.approx(float(exact), rel=4e-16, abs=0)


def test_a_reconstruction_inverts_saturation_voxel_by_voxel() -> None:
    grid, frames = unit_grid(3, 3, 6, 7, pitch_mm=(2.0, 1.0)), 4
    dense = np.random.default_rng(1).integers(0, frames + 1, grid.shape_KLHW)
    sections = reconstruct(PhotonCounts.from_dense(dense, grid, cfa="GRBG", frames=frames, bits=1), 1.0)
    is_seen = sections.coverage > 0
    assert 0 < is_seen.mean() < 1
    assert np.isinf(sections.estimate).any()
    assert not sections.estimate[~is_seen].any()
    expected = Readout(frames, 1).photons(sections.counts[is_seen], sections.coverage[is_seen])
    np.testing.assert_array_equal(sections.estimate[is_seen], expected)


@pytest.mark.parametrize("bits", [2, 3, 8, 32])
def test_estimates_of_more_bits_invert_the_mean_of_clipped_counts(bits: int) -> None:
    most = 2**bits - 1
    rates = np.array([1e-4, 0.3, 2.0, 7.0, min(1.2 * most, 1e6)])
    terms = np.arange(min(most, 2000))
    sums = [poisson.sf(terms, rate).sum() for rate in rates]  # E min(X, m) = sum P(X > n)
    clipped = rates if bits == 32 else np.array(sums)
    scale = 10**9
    found = Readout(1, bits).photons(np.rint(clipped * scale).astype(np.int64), np.full(rates.size, scale))
    slope = np.array([poisson.cdf(min(most, 2**31) - 1, rate) for rate in rates])
    np.testing.assert_allclose(found, rates, rtol=1e-12, atol=(1 / scale / slope).max())
    full = Readout(3, bits).photons(np.array([3 * most * 5]), np.array([5]))
    assert np.isinf(full).all()


FILM = unit_grid(2, 2, 4, 6)


def test_frames_follow_their_events() -> None:
    pixels = np.array([[1, 0, 3, 5], [0, 1, 2, 4], [1, 0, 3, 5], [0, 1, 2, 0]]).T
    frame = np.array([4, 0, 3, 2, 0, 4, 1])
    counts = PhotonCounts.from_events(*pixels, np.array([2, 1, 1, 3]), FILM, frames=5, bits=1, frame=frame)
    e: Any = counts.frame_events
    found = list(zip(*(column.tolist() for column in (e.k, e.l, e.i, e.j, e.frame)), strict=True))
    assert found == [
        (0, 1, 2, 0, 0), (0, 1, 2, 0, 1), (0, 1, 2, 0, 4), (0, 1, 2, 4, 3),
        (1, 0, 3, 5, 0), (1, 0, 3, 5, 2), (1, 0, 3, 5, 4),
    ]  # fmt: skip
    some: Any = counts.subsample(3, np.random.default_rng(1))
    assert some.frame.size == some.total < counts.total
    assert some.readout == counts.readout


@pytest.mark.parametrize("span", [(3, 9), (0, 12)])
def test_rates_of_a_range_of_frames_are_those_of_its_bits(span: tuple[int, int]) -> None:
    bits = np.random.default_rng(5).random((*FILM.shape_KLHW, 12)) < 0.4
    *pixels, frame = np.nonzero(bits)
    n = np.ones(frame.size, int)
    counts = PhotonCounts.from_events(*pixels, n, FILM, frames=12, bits=1, frame=frame)
    sums = PhotonCounts.from_dense(bits.sum(axis=-1), FILM, frames=12, bits=1)
    for k, l in np.ndindex(2, 2):
        with np.errstate(divide="ignore"):
            expected = -np.log(1 - bits[k, l, ..., slice(*span)].mean(axis=-1))
        np.testing.assert_allclose(counts.rate(k, l, frames=span), expected, rtol=1e-14, atol=1e-15)
        if span == (0, 12):
            np.testing.assert_allclose(sums.rate(k, l), expected, rtol=1e-14, atol=1e-15)
        else:
            with pytest.raises(InputError, match="only the sums over all 12 frames"):
                sums.rate(k, l, frames=span)
    for frames in ((span[0], 13), 5, (0, 1.5)):
        with pytest.raises(InputError, match="first < end <= 12"):
            counts.rate(0, 0, frames=frames)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        ({"frames": 2.0}, "frames: expected a whole number"),
        ({"n": [3]}, "n: a pixel has 3 counts, where frames = 2, bits = 1 hold 2"),
        ({"frame": np.array([0, 2])}, "frame: 2 is outside 0 .. 1"),
        ({"frame": np.array([1, 1])}, "frame: a pixel has more counts in frame 1 than 1"),
    ],
)
def test_what_frames_cannot_hold_is_refused(changed: dict, named: str) -> None:
    options = {"n": [2], "frames": 2, "bits": 1} | changed
    n, place = np.array(options.pop("n")), np.array([[0], [0], [1], [1]])
    with pytest.raises(InputError, match=named):
        PhotonCounts.from_events(*place, n, FILM, **options)
