"""Frames of few bits: exact estimates beside a twin in decimals, their bias and variance, kept frames."""

from decimal import Decimal, localcontext
from fractions import Fraction

import numpy as np
import pytest
from twins import samples_of, unit_grid

import pcii
from pcii.base.errors import InputError
from pcii.types.photon_counts import MOST_FRAMES, PhotonCounts, Readout


def minus_log(share: Fraction) -> Decimal:
    """-ln(1 - share), to 40 digits."""
    with localcontext() as context:
        context.prec = 40
        rest = 1 - share
        return -(Decimal(rest.numerator) / Decimal(rest.denominator)).ln()


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
        exact = frames * minus_log(Fraction(number, seen * frames))
        assert value == pytest.approx(float(exact), rel=4e-16, abs=0)


def test_a_reconstruction_inverts_saturation_voxel_by_voxel() -> None:
    """Coverage is that of the views, borders included; every voxel by the sum of its own samples."""
    grid, frames = unit_grid(3, 3, 6, 7, pitch_mm=(2.0, 1.0)), 4
    dense = np.random.default_rng(1).integers(0, frames + 1, grid.shape_KLHW)
    counts = PhotonCounts.from_dense(dense, grid, cfa="GRBG", frames=frames, bits=1)
    sections = pcii.reconstruct(counts, z_mm=[1.0])
    meeting = samples_of(dense[..., None], grid, 1.0, cfa="GRBG")
    assert np.isinf(sections.estimate).any()
    for i, j, c in np.ndindex(6, 7, 3):
        samples = [int(n) for n in meeting.get((i, j, c), [])]
        number, seen = sum(samples), len(samples)
        assert (number, seen) == (sections.counts[0, i, j, c], sections.coverage[0, i, j, c])
        if seen == 0:
            expected = 0.0
        elif number == seen * frames:
            expected = np.inf
        else:
            expected = float(frames * minus_log(Fraction(number, seen * frames)))
        assert sections.estimate[0, i, j, c] == pytest.approx(expected, rel=4e-16)


@pytest.mark.parametrize("share", [0.001, 0.01, 0.1, 0.5, 0.9, 0.99])
def test_bias_and_variance_are_those_of_theory(share: float) -> None:
    """To second order in 1 / (V T), as docs/theory.md has them; 10 000 repeats of 20 views, 100 frames."""
    views, frames, repeats = 20, 100, 10_000
    trials, rate = views * frames, -np.log1p(-share)
    numbers = np.random.default_rng(7).binomial(trials, share, repeats)
    found = Readout(frames, 1).photons(numbers, np.full(repeats, views))
    assert np.isfinite(found).all()
    odds = share / (1 - share) / trials
    bias, variance = frames * (odds / 2), frames**2 * (odds + odds**2 * (0.5 + 1 / share))
    spread = np.sqrt(variance / repeats)
    assert abs(found.mean() - frames * rate - bias) < 4 * spread
    assert abs(found.var() / variance - 1) < 4 * np.sqrt(2 / repeats)
    plain = numbers / views  # the fault: what is lost is not made up for
    assert abs(plain.mean() - frames * rate) > 4 * spread or share < 0.1


@pytest.mark.parametrize("bits", [2, 3, 8, 32])
def test_estimates_of_more_bits_invert_the_mean_of_clipped_counts(bits: int) -> None:
    most = 2**bits - 1
    rates = np.array([1e-4, 0.3, 2.0, 7.0, min(1.2 * most, 1e6)])
    terms = np.arange(min(most, 2000))
    from scipy.stats import poisson

    if bits == 32:
        clipped = rates
    else:
        clipped = np.array([poisson.sf(terms, rate).sum() for rate in rates])  # E min(X, m) = sum P(X > n)
    scale = 10**9
    found = Readout(1, bits).photons(np.rint(clipped * scale).astype(np.int64), np.full(rates.size, scale))
    slope = np.array([poisson.cdf(min(most, 2**31) - 1, rate) for rate in rates])
    np.testing.assert_allclose(found, rates, rtol=1e-12, atol=(1 / scale / slope).max())
    full = Readout(3, bits).photons(np.array([3 * most * 5]), np.array([5]))
    assert np.isinf(full).all()


FILM = unit_grid(2, 2, 4, 6)


def with_frames() -> PhotonCounts:
    pixels = np.array([[1, 0, 3, 5], [0, 1, 2, 4], [1, 0, 3, 5], [0, 1, 2, 0]]).T
    frame = np.array([4, 0, 3, 2, 0, 4, 1])
    return PhotonCounts.from_events(*pixels, np.array([2, 1, 1, 3]), FILM, frames=5, bits=1, frame=frame)


def test_frames_follow_their_events() -> None:
    counts = with_frames()
    e = counts.frame_events
    assert e is not None
    found = list(zip(*(column.tolist() for column in (e.k, e.l, e.i, e.j, e.frame)), strict=True))
    assert found == [
        (0, 1, 2, 0, 0), (0, 1, 2, 0, 1), (0, 1, 2, 0, 4), (0, 1, 2, 4, 3),
        (1, 0, 3, 5, 0), (1, 0, 3, 5, 2), (1, 0, 3, 5, 4),
    ]  # fmt: skip
    some = counts.subsample(3, np.random.default_rng(1))
    assert some.frame is not None
    assert some.frame.size == some.total < counts.total
    assert some.readout == counts.readout


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        ({"frames": 2.0}, "frames: expected a whole number"),
        ({"bits": 33}, "bits: expected a whole number from 1 to 32"),
        ({"n": [3]}, "n: a pixel has 3 counts, where frames = 2, bits = 1 hold 2"),
        ({"frame": [0]}, "frame: expected one for each of 2 counts"),
        ({"frame": [0, 2]}, "frame: 2 is outside 0 .. 1"),
        ({"frame": [1, 1]}, "frame: a pixel has more counts in frame 1 than 1"),
    ],
)
def test_what_frames_cannot_hold_is_refused(changed: dict, named: str) -> None:
    said = {"n": [2], "frames": 2, "bits": 1, "frame": [0, 1]} | changed
    n = np.array(said.pop("n"))
    frame = np.array(said.pop("frame"))
    with pytest.raises(InputError, match=named):
        PhotonCounts.from_events(
            *np.array([[0], [0], [1], [1]]), n, FILM, **said, frame=frame if "frame" in changed else None
        )
