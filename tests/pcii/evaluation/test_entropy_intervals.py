"""Intervals of entropies by a jackknife over photons, against the spread over draws."""

import numpy as np
import pytest

from pcii.evaluation import entropy_intervals
from pcii.evaluation.entropy_intervals import entropy_half_widths
from pcii.metrics.scoring import score
from pcii.sections.reconstruction import reconstruct
from pcii.types.camera_grid import CameraGrid
from pcii.types.estimates import Segmented
from pcii.types.photon_counts import PhotonCounts
from pcii.types.truth import Truth

GRID = CameraGrid(rows=3, cols=3, pitch_mm=(5, 5), focal_mm=50, pixel_mm=0.25, height=48, width=64)
IDS = np.zeros((48, 64), np.int16)
IDS[8:40, 10:40] = 1
TRUTH = Truth(np.where(IDS > 0, 500.0, np.inf), IDS, {1: "card", 2: "unseen"})
ROWS, COLS = np.mgrid[:48, :64]
RATE = np.where(IDS > 0, 0.3 + 0.2 * np.sin(COLS / 4.0) * np.cos(ROWS / 5.0), 0.02)
DRAWS = 12


def drawn(seed: int) -> PhotonCounts:
    """Photons of a card that is as bright in every view."""
    rates = np.broadcast_to(RATE, GRID.shape_KLHW)
    return PhotonCounts.from_dense(np.random.default_rng(seed).poisson(rates), GRID)


def test_half_widths_cover_the_spread_over_draws_without_being_long() -> None:
    bits, halves = [], []
    for seed in range(DRAWS):
        counts = drawn(seed)
        sections = reconstruct(counts, [500, 600])
        nothing = Segmented(np.zeros((2, 48, 64), dtype=bool), "none", sections)
        card = score(nothing, None, TRUTH).objects[0]
        (half, unseen) = entropy_half_widths(counts, sections, TRUTH)
        assert unseen == {}
        assert list(half) == list(card["entropy"])
        bits.append(list(card["entropy"].values()))
        halves.append(list(half.values()))
    needed = 1.96 * np.std(bits, axis=0, ddof=1)
    # Twelve draws know a spread to 21 %; a jackknife is rather too long, by up to twice where levels are few.
    ratio = np.mean(halves, axis=0) / needed
    assert (ratio > 0.8).all()
    assert (ratio < 4).all()


def test_every_photon_is_in_one_group() -> None:
    counts = drawn(0)
    total = np.zeros(GRID.shape_KLHW, dtype=int)
    sizes = []
    for k, l, i, j, n in entropy_intervals._photon_groups(counts, np.random.default_rng(0)):
        np.add.at(total, (k, l, i, j), n)
        sizes.append(n.sum())
    np.testing.assert_array_equal(total, counts.dense)
    share = counts.total / entropy_intervals.GROUPS
    assert np.abs(np.array(sizes) - share).max() < 5 * np.sqrt(share)


def test_without_photons_or_with_very_many_events_there_are_none(monkeypatch: pytest.MonkeyPatch) -> None:
    dense = np.zeros(GRID.shape_KLHW, dtype=int)
    dense[0, 0, 20, 20] = entropy_intervals.GROUPS - 1
    few = PhotonCounts.from_dense(dense, GRID)
    assert entropy_half_widths(few, reconstruct(few, 500), TRUTH) == []
    counts = drawn(0)
    monkeypatch.setattr(entropy_intervals, "MOST_EVENTS", counts.events.n.size - 1)
    assert entropy_half_widths(counts, reconstruct(counts, 500), TRUTH) == []
