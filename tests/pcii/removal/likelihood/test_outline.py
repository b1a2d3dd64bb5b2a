import itertools
import math

import numpy as np
import pytest
from twins import intersection_over_union

from pcii.imaging.bright_regions import box_around
from pcii.removal.likelihood.outline import outlined
from pcii.removal.likelihood.outline_kernels import least_outline, shorten_outline


def energies(masks: np.ndarray, gain: np.ndarray, length_cost: float) -> np.ndarray:
    """Outline less gain of pictures (N, H, W): steps right and down are one vector at each pixel."""
    u = masks.astype(np.float64)
    right, down = np.zeros_like(u), np.zeros_like(u)
    right[:, :, :-1] = u[:, :, 1:] - u[:, :, :-1]
    down[:, :-1] = u[:, 1:] - u[:, :-1]
    return length_cost * np.hypot(right, down).sum(axis=(1, 2)) - (gain * u).sum(axis=(1, 2))


def solved(gain: np.ndarray, length_cost: float, iterations: int = 1000) -> np.ndarray:
    inside = np.full(gain.shape, np.nan, np.float32)
    least_outline(gain.astype(np.float32), length_cost, iterations, inside)
    return inside


@pytest.mark.parametrize("shape", [(3, 3), (2, 5), (1, 9), (9, 1)])
@pytest.mark.parametrize("length_cost", [0.3, 1.0, 3.0])
def test_no_mask_has_a_better_outline(shape, length_cost):
    every = np.array(list(itertools.product((0, 1), repeat=math.prod(shape)))).reshape(-1, *shape)
    for seed in range(2):
        gain = np.random.default_rng(seed).normal(size=shape)
        least = energies(every, gain, length_cost).min()
        inside = solved(gain, length_cost)
        assert 0 <= inside.min() <= inside.max() <= 1
        # A mask is one of the pictures in [0, 1], so the least of these is no worse than the best mask.
        # Many steps in single precision end within 1e-3 of it.
        assert energies(inside[None], gain, length_cost)[0] <= least + 1e-3
        if 1 in shape:  # along a line every threshold of the best picture is a best mask
            thresholded = energies(inside[None] > 0.5, gain, length_cost)[0]
            assert thresholded == pytest.approx(least, abs=1e-3)


@pytest.mark.parametrize("axis", ["down", "across"])
def test_an_outline_is_found_where_it_pays(axis):
    # Two pixels that gain 1.5 each; a strip of them has two ends, which cost 1 each.
    gain = np.array([[-9.0, 1.5, 1.5, -9.0, 1.5, -9.0]])
    expected = np.array([[0, 1, 1, 0, 0, 0]])
    if axis == "down":
        gain, expected = gain.T, expected.T
    np.testing.assert_array_equal(solved(gain, 1.0) > 0.5, expected)


def test_what_gains_everywhere_is_all_inside_and_what_loses_outside():
    assert solved(np.full((6, 7), 0.2), 1.5).min() == 1
    assert solved(np.full((6, 7), -0.2), 1.5).max() == 0


def test_going_on_is_as_good_as_more_steps_at_once():
    gain = np.random.default_rng(1).normal(size=(12, 9)).astype(np.float32)
    at_once = np.zeros_like(gain)
    least_outline(gain, 1.0, 30, at_once)
    inside = (gain > 0).astype(np.float32)
    state = inside, inside.copy(), np.zeros_like(gain), np.zeros_like(gain)
    for _ in range(3):
        shorten_outline(gain, 1.0, 10, *state)
    np.testing.assert_array_equal(inside, at_once)


def disc(size: int, radius: float) -> np.ndarray:
    middle = (size - 1) / 2
    return np.hypot(*(np.mgrid[:size, :size] - middle)) <= radius


SIZE_PX, RADIUS_PX = 120, 32.0
VIEWS = 30


def section(rates: np.ndarray, seed: int, views: int = VIEWS) -> tuple[np.ndarray, np.ndarray]:
    """Photons and samples (H, W, 1) where `rates` (H, W) photons per voxel arrive in so many samples."""
    photons = np.random.default_rng(seed).poisson(rates).astype(np.float32)[..., None]
    return photons, np.full_like(photons, views)


# The distance between photons is 1 / sqrt(rate), and an outline among them is known to half of it, if not to
# a third of a pixel: 1 - IoU is that times the perimeter over the area, 2 / radius.
@pytest.mark.parametrize("rate", [0.1, 0.3, 1.0, 3.0, 10.0])
@pytest.mark.parametrize("start_px", [-4, 0, 4])
def test_a_disc_is_found_as_well_as_its_photons_are_dense(rate, start_px):
    """Before a hundredth of its light, from a start that is a cell of 4 px too small or too large."""
    truth = disc(SIZE_PX, RADIUS_PX)
    found = []
    for seed in range(3):
        photons, samples = section(np.where(truth, rate, rate / 100), seed)
        region = outlined(photons, samples, disc(SIZE_PX, RADIUS_PX + start_px), np.zeros_like(truth))
        found.append(intersection_over_union(region, truth))
    off_px = max(1 / math.sqrt(rate) / 2, 1 / 3)
    assert np.mean(found) > 1 - 2 * off_px / RADIUS_PX


def test_a_start_that_is_too_large_shrinks():
    truth = disc(SIZE_PX, RADIUS_PX)
    photons, samples = section(np.where(truth, 2.0, 0.02), seed=0)
    region = outlined(photons, samples, disc(SIZE_PX, RADIUS_PX + 6), np.zeros_like(truth))
    # As above: 1 / sqrt(2) / 2 px off at most.
    assert intersection_over_union(region, truth) > 1 - 2 * 0.36 / RADIUS_PX


def test_shading_is_no_outline():
    truth = disc(SIZE_PX, RADIUS_PX)
    shade = np.linspace(0.15, 1.0, SIZE_PX)[None]  # from left to right, 0.3 to 0.9 over the disc
    photons, samples = section(np.where(truth, 4 * shade, 0.02), seed=1)
    region = outlined(photons, samples, disc(SIZE_PX, RADIUS_PX - 6), np.zeros_like(truth))
    # As above for the 1.3 photons at its dark side.
    assert intersection_over_union(region, truth) > 1 - 2 * 0.44 / RADIUS_PX


@pytest.mark.parametrize(("share", "filled"), [(0.02, True), (0.06, False), (0.125, False)])
def test_holes_are_filled_if_they_are_a_small_share(share, filled):
    """Dark holes of up to a twentieth of what is around them are paint."""
    truth = disc(SIZE_PX, RADIUS_PX)
    hole = disc(SIZE_PX, RADIUS_PX * math.sqrt(share))
    photons, samples = section(np.where(truth & ~hole, 10.0, 0.01), seed=0)
    region = outlined(photons, samples, truth, np.zeros_like(truth))
    middle = region[SIZE_PX // 2, SIZE_PX // 2]
    assert middle == filled
    assert intersection_over_union(region, truth if filled else truth & ~hole) > 0.95


def test_nothing_comes_of_nothing():
    nothing = np.zeros((50, 40), dtype=bool)
    photons, samples = section(np.ones((50, 40)), seed=0)
    assert not outlined(photons, samples, nothing, nothing).any()
    some = nothing.copy()
    some[10:30, 10:30] = True
    assert not outlined(np.zeros_like(photons), samples, some, nothing).any()
    assert not outlined(np.zeros_like(photons), np.zeros_like(samples), some, nothing).any()


def test_what_is_taken_is_never_claimed():
    truth = disc(SIZE_PX, RADIUS_PX)
    photons, samples = section(np.where(truth, 3.0, 0.01), seed=0)
    taken = np.zeros_like(truth)
    taken[:, SIZE_PX // 2 :] = True  # the right half, and a spot inside the left one
    spot = disc(SIZE_PX, 5.0)
    taken |= np.roll(spot, -14, axis=1)
    region = outlined(photons, samples, disc(SIZE_PX, 28.0) & ~taken, taken)
    assert not (region & taken).any()
    assert intersection_over_union(region, truth & ~taken) > 0.95
    assert not outlined(photons, samples, truth, np.ones_like(truth)).any()


def test_specks_are_left_out():
    rates = np.full((80, 80), 0.02)
    rates[10:50, 10:50] = 8.0
    rates[66:74, 66:74] = 8.0  # less than the 100 px of the smallest region
    photons, samples = section(rates, seed=0)
    region = outlined(photons, samples, rates > 1, np.zeros(rates.shape, dtype=bool))
    assert not region[60:, 60:].any()
    assert region[12:48, 12:48].all()


def test_colours_count_on_their_own():
    # Red inside, green around it, equally bright: the sum of colours shows nothing.
    truth = disc(SIZE_PX, RADIUS_PX)
    red, samples = section(np.where(truth, 2.0, 0.02), seed=0)
    green, _ = section(np.where(truth, 0.02, 2.0), seed=1)
    both = np.concatenate([red, green], axis=-1)
    start = disc(SIZE_PX, RADIUS_PX - 4)
    region = outlined(both, np.concatenate([samples] * 2, axis=-1), start, np.zeros_like(truth))
    assert intersection_over_union(region, truth) > 0.97


def test_photons_scattered_evenly_have_no_outline_of_their_own():
    # What is outlined of a flat film, if anything, has no longer an outline than the start; each photon
    # on its own would have 1000 of some 4 px.
    photons, samples = section(np.full((100, 100), 0.3), seed=4)
    start = disc(100, 25.0)
    region = outlined(photons, samples, start, np.zeros_like(start))
    inner = region[:-1, :-1]
    edges = (inner != region[1:, :-1]) | (inner != region[:-1, 1:])
    assert edges.sum() <= 2 * math.pi * 25 * 1.5


def test_a_box_has_a_margin_cut_at_the_frame():
    mask = np.zeros((300, 200), dtype=bool)
    mask[100:120, 5] = True
    assert box_around(mask) == (slice(100 - 40, 120 + 40), slice(0, 6 + 40))
