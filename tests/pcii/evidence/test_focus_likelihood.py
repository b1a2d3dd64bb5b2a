import itertools
import math
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from scipy.special import gammaln, xlogy
from twins import bayer_photons, blocky_texture, colour_of, even_light, patch_views, unit_grid

from pcii.evidence.focus_likelihood import (
    best_labels,
    cell_shape,
    focus_evidence,
    photon_weighted_mean,
    windowed,
)
from pcii.sections.reconstruction import reconstruct
from pcii.types.camera_grid import CameraGrid
from pcii.types.focal_planes import FocalPlanes
from pcii.types.photon_counts import PhotonCounts

DISPARITIES = np.arange(1, 9)  # z = 1 / d mm on a unit grid
WINDOW_CELLS, WIDER_CELLS = 2.0, (4.0, 8.0, 16.0)  # 8 px, and up to 64 px where there are no edges
# The widths squared, the wider ones weighing as 1 / width: 2 pi 2^2 (1 + 4 / 2 + 8 / 2 + 16 / 2).
WINDOW_WEIGHT = 2 * math.pi * 4 * 15


def plane_at(grid: CameraGrid, disparity: float) -> FocalPlanes:
    return FocalPlanes.at_total_disparity(grid, (max(grid.rows, grid.cols) - 1.0) * disparity)


class Twin(NamedTuple):
    gain: np.ndarray
    size: np.ndarray  # sum of the absolute terms of each gain, for its rounding


def reach(place_px: float, block: int, width_px: int, blocks: int) -> float:
    """How much of what is in a block counts at a place along one axis: binomial, then between centres."""
    if width_px == 2:
        centres = [(int(place_px // 2), 1.0)]
    else:
        low = math.floor(place_px / width_px - 0.5)
        share = place_px / width_px - 0.5 - low
        centres = [(low, 1 - share), (low + 1, share)]
    inside = [(min(max(centre, 0), blocks - 1), share) for centre, share in centres]
    return sum(share * {0: 0.5, 1: 0.25}.get(abs(centre - block), 0.0) for centre, share in inside)


def views_along(shifts: list[int], size: int, blocks: int, width_px: int) -> list[float]:
    """Pairs of pixels and cameras in each block of an axis, in blocks of 2."""
    covering_views = [0.0] * blocks
    for shift in shifts:
        for place in range(size):
            if covered(place, shift, size):
                covering_views[place // width_px] += 1 / 2
    return covering_views


def covered(place: int, shift: int, size: int) -> bool:
    """Whether a shifted view covers all of the block of 2 px that a place is in."""
    return all(0 <= px < size and 0 <= px - shift < size for px in (place // 2 * 2, place // 2 * 2 + 1))


def focus_twin(counts: PhotonCounts, disparity: float) -> Twin:
    """One plane, photon by photon: each prediction adds up all other photons."""
    grid = counts.grid
    K, L, H, W = grid.shape_KLHW
    h, w = math.ceil(H / 4), math.ceil(W / 4)
    shift = [[math.floor((c - (n - 1) / 2) * disparity + 1 / 2) for c in range(n)] for n in (K, L)]
    colours = [colour_of(a, b, counts.cfa) for a in (0, 1) for b in (0, 1)]
    sites = [colours.count(c) for c in range(counts.channel_count)]
    scales = []
    for scale in range(5):
        width = 2 << scale
        rows, cols = -(-2 * h // (1 << scale)), -(-2 * w // (1 << scale))
        scales.append((width, rows, cols))
    covering_views = [
        (views_along(shift[0], H, rows, width), views_along(shift[1], W, cols, width))
        for width, rows, cols in scales
    ]
    photons = []
    for k, l, i, j, n in zip(*(getattr(counts.events, name) for name in "klijn"), strict=True):
        row, col = int(i) + shift[0][k], int(j) + shift[1][l]
        inside = covered(row, shift[0][k], H) and covered(col, shift[1][l], W)
        photons.append((row, col, colour_of(int(i), int(j), counts.cfa), int(n), inside))

    def light(scale: int, y: float, x: float, colour: int | None, without: int | None) -> float:
        width, rows, cols = scales[scale]
        total = 0.0
        for number, (row, col, c, n, inside) in enumerate(photons):
            if inside and colour in (None, c):
                there = reach(y, row // width, width, rows) * reach(x, col // width, width, cols)
                total += (n - (number == without)) * there
        return total

    def samples(scale: int, y: float, x: float) -> float:
        """Per site of the pattern."""
        width, rows, cols = scales[scale]
        down = sum(v * reach(y, b, width, rows) for b, v in enumerate(covering_views[scale][0]))
        return down * sum(v * reach(x, b, width, cols) for b, v in enumerate(covering_views[scale][1]))

    gain, size = np.zeros((h, w)), np.zeros((h, w))
    for e, (row, col, c, n, inside) in enumerate(photons):
        if not inside:
            continue
        y, x = row + 0.5, col + 0.5
        rates = []
        for scale in range(5):
            # The prior of the colours' shares: 0.3 photons in proportion to the sites.
            wide, around = max(scale, 3), light(max(scale, 3), y, x, None, e)
            share = (light(wide, y, x, c, e) + 0.3 * sites[c] / sum(sites)) / (around + 0.3)
            rates.append(light(scale, y, x, None, e) * share / (samples(scale, y, x) * sites[c]))
        base = max(rates[4], 1e-12)
        rate = 0.95 * sum(rates) / 5 + 0.05 * base
        gain[row // 4, col // 4] += n * math.log(rate / base)
        size[row // 4, col // 4] += n * abs(math.log(rate / base))
    for a, b in itertools.product(range(h), range(w)):
        blocks = [(y, x) for y in (2 * a, 2 * a + 1) for x in (2 * b, 2 * b + 1)]
        here = {(y, x): covering_views[0][0][y] * covering_views[0][1][x] for y, x in blocks}
        if not sum(here.values()):
            continue
        for y, x in blocks:
            if not here[y, x]:
                continue
            # At the centre of each block, between which rates are linear.
            rates = [
                light(s, 2 * y + 1, 2 * x + 1, None, None) / samples(s, 2 * y + 1, 2 * x + 1)
                for s in range(5)
            ]
            mean, base = sum(rates) / 5, rates[4]
            gain[a, b] -= here[y, x] * 0.95 * (mean - base)
            size[a, b] += here[y, x] * (mean + base)
    return Twin(gain, size)


def scattered(grid: CameraGrid, cfa: str | None, photons: int, seed: int, margin: int = 0) -> PhotonCounts:
    """Some pixels with 1 to 4 photons, none nearer to the frame than a margin."""
    rng = np.random.default_rng(seed)
    k, l = rng.integers(grid.rows, size=photons), rng.integers(grid.cols, size=photons)
    i = rng.integers(margin, grid.height - margin, size=photons)
    j = rng.integers(margin, grid.width - margin, size=photons)
    return PhotonCounts.from_events(k, l, i, j, rng.integers(1, 5, size=photons), grid, cfa=cfa)


@pytest.mark.parametrize(("cfa", "disparity"), [("GRBG", 2), ("BGGR", 3.4), (None, 3.4)])
def test_gains_are_those_of_all_other_photons(cfa, disparity):
    # Landing 16 px or more from the frame, between the centres of the widest blocks (see the next test).
    counts = scattered(unit_grid(2, 3, 71, 69), cfa, photons=30, seed=3, margin=20)
    focus = focus_evidence(counts, plane_at(counts.grid, disparity))
    twin = focus_twin(counts, disparity)
    # Sums of gains are kept in single precision: a few roundings of 6e-8 each.
    assert np.all(np.abs(focus.gain[0] - twin.gain) <= 1e-6 * twin.size + 1e-9)


TINY = [((9, 11), 1), ((9, 11), 3), ((9, 11), 7.5), ((1, 1), 1), ((5, 2), 2), ((16, 8), 40), ((33, 34), 4)]


@pytest.mark.parametrize("cfa", ["GRBG", None])
@pytest.mark.parametrize(("size", "disparity"), TINY)
def test_gains_at_the_frame_are_those_of_all_other_photons(cfa, size, disparity):
    counts = scattered(unit_grid(2, 3, *size), cfa, photons=20, seed=1)
    focus = focus_evidence(counts, plane_at(counts.grid, disparity))
    twin = focus_twin(counts, disparity)
    assert np.all(np.abs(focus.gain[0] - twin.gain) <= 1e-6 * twin.size + 1e-9)


@pytest.mark.parametrize("cfa", ["GRBG", None])
@pytest.mark.parametrize(("i", "j"), [(48, 48), (40, 61), (0, 0), (0, 50), (95, 3)])
def test_a_single_photon_is_not_predicted(cfa, i, j):
    one = PhotonCounts.from_events(*np.array([[0, 0, i, j, 1]]).T, unit_grid(2, 2, 96, 96), cfa=cfa)
    # With no other photon both rates are the same floor; what is left are photons that were expected.
    assert focus_evidence(one, FocalPlanes.at_total_disparity(one.grid, [1e-6])).gain.max() < 0.01


def test_two_photons_of_different_colour_are_no_evidence():
    events = np.array([[0, 0, 64, 64, 1], [0, 0, 64, 65, 1]]).T  # a green pixel and the red one beside it
    counts = PhotonCounts.from_events(*events, unit_grid(2, 2, 128, 128), cfa="GRBG")
    # Two photons beside each other on a film of A samples: chance within r px is pi r^2 / A, so they are
    # worth less than 2 log(A / (pi r^2)) = 2 log(128^2 / (4 pi)) = 14 nats, were all known beforehand.
    assert focus_evidence(counts, FocalPlanes.at_total_disparity(counts.grid, [1e-6])).gain.sum() < 14


@cache
def flat_gain(rate: float, seed: int, cfa: str | None, size: int) -> np.ndarray:
    """Gain (h, w) of a flat film at one depth."""
    grid = unit_grid(5, 5, size, size)
    return focus_evidence(even_light(grid, rate, seed, cfa), plane_at(grid, 3)).gain[0]


def flat_gains(rate: float, scenes: int, cfa: str | None = "GRBG", size: int = 128) -> np.ndarray:
    """Gain (scenes, h, w) of flat films at one depth."""
    return np.array([flat_gain(rate, seed, cfa, size) for seed in range(scenes)])


RATES = [1e-5, 0.01, 2.0]  # from one photon in 64 x 64 px of the section to 50 in each


@pytest.mark.parametrize(("rate", "cfa"), [*((rate, "GRBG") for rate in RATES), (0.2, None)])
def test_a_flat_film_gains_nothing_on_average(rate, cfa):
    totals = flat_gains(rate, scenes=12, cfa=cfa).sum(axis=(1, 2), dtype=np.float64)
    assert totals.mean() < 4 * totals.std() / math.sqrt(totals.size)


def large_gains(gains: np.ndarray) -> float:
    """Share of regions of flat films that gain more than log 20: quarters without 16 px at the frame."""
    scenes = gains.shape[0]
    quarters = gains[:, 4:28, 4:28].reshape(scenes, 2, 12, 2, 12).sum(axis=(2, 4), dtype=np.float64)
    return float((quarters > math.log(20)).mean())


@pytest.mark.parametrize("rate", RATES)
def test_a_region_of_a_flat_film_exceeds_log_20_about_once_in_20_times(rate):
    # Were e^gain 1 on average it would exceed 20 once in 20 times at most (Markov). It is not quite: photons
    # predict each other, so that what happens to lie together counts twice, and at 50 photons a pixel of
    # the section 1 region in 20 exceeds it. 80 regions at 1/20 show that +- 0.024; three times that.
    assert large_gains(flat_gains(rate, scenes=20)) < 1 / 20 + 0.073


def test_photons_in_pairs_are_seen():
    # The planted fault: each photon is counted twice, in neighbouring views, so that counts are not Poisson.
    grid = unit_grid(5, 6, 128, 128)
    drawn = np.random.default_rng(0).poisson(0.02, size=(12, 5, 3, 128, 128))
    films = []
    for half in drawn:
        film = np.zeros(grid.shape_KLHW, dtype=int)
        film[:, 0::2], film[:, 1::2, :, :-3] = half, half[..., 3:]  # at the disparity 3
        counts = PhotonCounts.from_dense(film, grid)
        films.append(focus_evidence(counts, plane_at(grid, 3)).gain[0])
    assert large_gains(np.array(films)) > 0.9


@pytest.mark.parametrize("size", [(7, 128), (10, 128), (128, 14), (64, 65)])
def test_gains_of_a_flat_film_are_the_same_in_any_light_and_on_any_film(size):
    # What is expected of a cell is the sum of what its pixels are predicted with: else all photons of it were
    # gained or lost by the share by which the two differ, and chance would grow as the root of the photons.
    for rate in (0.1, 10.0, 1e3):
        grid = unit_grid(5, 5, *size)
        films = [even_light(grid, rate, seed) for seed in range(4)]
        gains = np.array([focus_evidence(film, plane_at(grid, 3)).gain[0] for film in films])
        # A cell's four finest rates cost half a nat each at most, give or take sqrt(1/2), times the fifth for
        # which their scale counts; coarser scales are fewer, and shared by cells.
        assert gains.std() < 0.6
        totals = gains.sum(axis=(1, 2), dtype=np.float64)
        assert abs(totals.mean()) < 0.05 * gains[0].size + 4 * 0.6 * math.sqrt(gains[0].size / 4)


@pytest.mark.parametrize("cfa", ["GRBG", None])
@pytest.mark.parametrize("rate", [0.01, 10.0])
def test_no_bias_at_the_frame_of_a_flat_film(rate, cfa):
    # Views leave the frame there: blocks are covered by fewer views, and unequally.
    gains = flat_gains(rate, scenes=12, cfa=cfa, size=96)
    edge = np.ones(gains.shape[1:], dtype=bool)
    edge[2:-2, 2:-2] = False  # 8 px, to which the farthest view shifts by 6
    for frame in (edge, ~edge):
        totals = gains[:, frame].sum(axis=1, dtype=np.float64)
        # Estimated rates cost some, as much as half a nat for each independent rate: a block of 2 x 2 px
        # smoothed over 4 x 4 and weighed by 1/5 has 1/25 of that, in a cell of 4 px a few times 0.02.
        assert -0.1 * frame.sum() < totals.mean() < 4 * totals.std() / math.sqrt(totals.size)


@pytest.mark.parametrize(("true_disparity", "cfa"), [(2, "GRBG"), (3, "BGGR"), (6, None)])
def test_a_textured_plane_scores_highest_at_its_depth(true_disparity, cfa):
    grid = unit_grid(5, 7, 96, 96)
    texture = 0.1 * blocky_texture(np.random.default_rng(0), 96, 96)
    rates = patch_views(texture, 0, 0, true_disparity, grid)
    if cfa is None:
        counts = PhotonCounts.from_dense(np.random.default_rng(1).poisson(rates[..., 1]), grid)
    else:
        counts = PhotonCounts.from_dense(bayer_photons(rates, cfa, 1), grid, cfa=cfa)
    focus = focus_evidence(counts, FocalPlanes.at_depths(grid, 1 / DISPARITIES))
    best = DISPARITIES[np.argmax(windowed(focus.gain, focus.photons), axis=0)]
    assert set(best[6:18, 6:18].ravel()) == {true_disparity}
    # The planted fault, cameras in the wrong order, blurs by twice the disparity and leaves little.
    mirrored = PhotonCounts.from_dense(counts.dense[::-1, ::-1], grid, cfa=cfa)
    right, wrong = (
        focus_evidence(c, plane_at(grid, true_disparity)).gain[0, 6:18, 6:18].sum()
        for c in (counts, mirrored)
    )
    assert wrong < right / 2


def per_pixel_scores(counts: PhotonCounts) -> np.ndarray:
    """The planted fault: a likelihood ratio on single pixels and colours, over the middle of the picture."""
    scores = []
    for disparity in DISPARITIES:
        section = reconstruct(counts, 1 / disparity)
        K = section.counts[0, 48:-48, 48:-48].astype(float)
        V = section.coverage[0, 48:-48, 48:-48].astype(float)
        mean = V * K.sum(axis=(0, 1)) / V.sum(axis=(0, 1))
        scores.append((xlogy(K, K) - xlogy(K, V) - information(mean) + xlogy(mean, V)).sum())
    return np.array(scores)


def information(mean: np.ndarray) -> np.ndarray:
    """E[K log K] of Poisson counts, by adding up probabilities of up to 60 photons."""
    values, which = np.unique(mean, return_inverse=True)
    K = np.arange(61)
    probability = np.exp(xlogy(K, values[:, None]) - values[:, None] - gammaln(K + 1))
    return (probability @ xlogy(K, K))[which].reshape(mean.shape)


def test_depths_whose_shifts_are_all_even_do_not_attract_texture():
    true_disparity = 3  # its neighbours 2 and 4 shift each of the 7 x 7 views by an even number of pixels
    grid = unit_grid(7, 7, 160, 160)
    # Smooth texture changes little under the blur of a neighbouring depth, so partners count for more.
    noise = gaussian_filter(np.random.default_rng(3).normal(size=(160, 160)), 8, mode="wrap")
    texture = np.exp(0.8 * noise / noise.std())[..., None] * np.ones(3)
    rates = 0.05 * patch_views(texture, 0, 0, true_disparity, grid)
    counts = PhotonCounts.from_dense(bayer_photons(rates, "GRBG", 1), grid, cfa="GRBG")
    gain = focus_evidence(counts, FocalPlanes.at_depths(grid, 1 / DISPARITIES)).gain
    middle = gain[:, 12:-12, 12:-12].sum(axis=(1, 2))
    assert DISPARITIES[np.argmax(middle)] == true_disparity
    assert DISPARITIES[np.argmax(per_pixel_scores(counts))] in (2, 4)


@pytest.mark.parametrize("cfa", ["GRBG", None])
@pytest.mark.parametrize("size", [(1, 1), (3, 5), (8, 9)])
def test_no_photons_gain_nothing_on_cells_rounded_up(cfa, size):
    grid = unit_grid(2, 2, *size)
    counts = PhotonCounts.from_dense(np.zeros(grid.shape_KLHW, dtype=int), grid, cfa=cfa)
    focus = focus_evidence(counts, FocalPlanes.at_total_disparity(counts.grid, [1.0, 2.0]))
    assert cell_shape(counts) == (math.ceil(size[0] / 4), math.ceil(size[1] / 4))
    assert focus.gain.shape == (2, *cell_shape(counts))
    assert focus.photons.shape == (2, counts.channel_count, *cell_shape(counts))
    assert not focus.gain.any()
    assert not focus.photons.any()
    assert not windowed(focus.gain, focus.photons).any()


@pytest.mark.parametrize("size", [(1, 1), (7, 5), (16, 16)])
def test_the_largest_counts_have_finite_gains(size):
    grid = unit_grid(3, 3, *size)
    counts = PhotonCounts.from_dense(np.full(grid.shape_KLHW, 1 << 40), grid, cfa="GRBG")
    focus = focus_evidence(
        counts, FocalPlanes.at_total_disparity(counts.grid, [1.0, 2.0, 200.0])
    )  # some views do not reach the last
    for values in (focus.gain, windowed(focus.gain, focus.photons)):
        assert np.all(np.isfinite(values))


def test_photons_are_counted_by_colour_and_cell():
    # Two rows of cameras 3 px of parallax apart: camera 0 shifts by floor(-1.5 + 1/2) = -1, camera 1 by 2.
    grid = unit_grid(2, 1, 8, 8)
    events = np.array([[0, 0, 4, 4, 2], [1, 0, 3, 5, 1], [1, 0, 6, 0, 7]]).T
    focus = focus_evidence(
        PhotonCounts.from_events(*events, grid, cfa="GRBG"), FocalPlanes.at_total_disparity(grid, 3.0)
    )
    expected = np.zeros((3, 2, 2))
    expected[1, 0, 1] = 2  # green at (4, 4), projected to row 3
    expected[1, 1, 1] = 1  # green at (3, 5), projected to row 5; the last photon leaves the frame for row 8
    np.testing.assert_array_equal(focus.photons[0], expected)


def near_twin(gain: np.ndarray) -> np.ndarray:
    """Sum over a Gaussian window of the weight 1 at its centre, cut at 4 standard deviations."""
    h, w = gain.shape
    result = np.zeros((h, w))
    for a, b, c, d in itertools.product(range(h), range(w), range(h), range(w)):
        if max(abs(a - c), abs(b - d)) <= 4 * WINDOW_CELLS:
            squares = (a - c) ** 2 + (b - d) ** 2
            result[a, b] += math.exp(-squares / (2 * WINDOW_CELLS**2)) * gain[c, d]
    return result


def exponential_twin(values: np.ndarray, width: float) -> np.ndarray:
    """Two turns of exponential means there and back, of the variance 4/5 and 1/5 of the whole."""
    mean = values.copy()
    for turn in (0, 1):
        length = width * math.sqrt(3) * 2 ** (1 - turn) / math.sqrt(4**2 - 1)
        kept = math.exp(-math.sqrt(2) / length)
        for lines in (mean, mean.T):
            for line in lines:
                for order in (range(1, line.size), range(line.size - 2, -1, -1)):
                    for at in order:
                        before = at - 1 if order.step == 1 else at + 1
                        line[at] = (1 - kept) * line[at] + kept * line[before]
    return mean


def test_windows_without_edges_are_plain_exponentials():
    gain = np.random.default_rng(0).normal(size=(1, 9, 13)).astype(np.float32)
    near = near_twin(gain[0])
    expected = near + sum(width / WINDOW_CELLS * exponential_twin(near, width) for width in WIDER_CELLS)
    # The Gaussian that is cut has lost 1e-4 of its weight on either axis, for which it is made up.
    flat = np.zeros((1, 3, 9, 13), np.float32)
    np.testing.assert_allclose(windowed(gain, flat)[0], expected, rtol=1e-3, atol=2e-3)


def test_windows_are_linear_in_the_gain_and_keep_planes_apart():
    rng = np.random.default_rng(1)
    one, other = rng.normal(size=(2, 3, 12, 14)).astype(np.float32)
    photons = rng.poisson(3.0, size=(3, 3, 12, 14)).astype(np.float32)
    both = windowed(2 * one - 3 * other, photons)
    apart = 2 * windowed(one, photons) - 3 * windowed(other, photons)
    np.testing.assert_allclose(both, apart, atol=1e-3)  # values up to 200 in single precision
    np.testing.assert_array_equal(windowed(one[1:2], photons[1:2])[0], windowed(one, photons)[1])


def impulse(height: int, width: int, row: int, col: int) -> np.ndarray:
    gain = np.zeros((1, height, width), np.float32)
    gain[0, row, col] = 1
    return gain


def test_a_cell_that_edges_cut_off_stands_for_its_wide_windows_too():
    # Around a peak of light every step is an edge, so that each wide window holds one cell. The nearest has
    # the weight 1 at its own cell, and exp(-1/8) at the next; the others weigh 2, 4 and 8.
    photons = 1e9 * impulse(41, 41, 20, 20)[None]
    response = windowed(impulse(41, 41, 20, 20), photons)[0]
    weight = 1 + sum(WIDER_CELLS) / WINDOW_CELLS
    # The Gaussian that is cut has lost 1e-4 of its weight on either axis, for which it is made up.
    assert response[20, 20] == pytest.approx(weight, rel=1e-3)
    assert response[20, 21] == pytest.approx(math.exp(-1 / 8) * weight, rel=1e-3)


def test_each_cell_is_counted_as_often_as_the_weight_of_windows_says():
    response = windowed(impulse(241, 241, 120, 120), np.zeros((1, 1, 241, 241), np.float32))[0]
    # The widest window reaches 16 cells, a seventh of the way to the border: next to nothing is lost.
    assert response.sum() == pytest.approx(WINDOW_WEIGHT, rel=0.01)


def test_windows_stop_at_an_edge():
    photons = np.zeros((1, 3, 40, 80), np.float32)
    photons[..., 40:] = 100.0
    gain = impulse(40, 80, 20, 30)
    with_edge, without = windowed(gain, photons)[0], windowed(gain, np.zeros_like(photons))[0]
    # 20 cells on, ten from the edge, the nearest window (8 cells at most) has ended on both pictures.
    assert without[20, 50] > 0.01
    assert abs(with_edge[20, 50]) < 0.01 * without[20, 50]
    # This side of the edge what cannot leave is left.
    assert with_edge[20, 36:38].sum() > without[20, 36:38].sum()


def test_noise_is_no_edge():
    # A flat film of 20 photons a cell and colour: the windows are to be about what they are without noise.
    photons = np.random.default_rng(2).poisson(20.0, size=(1, 3, 121, 121)).astype(np.float32)
    gain = impulse(121, 121, 60, 60)
    noisy, plain = windowed(gain, photons)[0], windowed(gain, np.zeros_like(photons))[0]
    around = np.hypot(*np.mgrid[-60:61, -60:61])
    reach_cells = [float((part * around).sum() / part.sum()) for part in (noisy, plain)]
    assert reach_cells[0] > 0.5 * reach_cells[1]


def energy(labels: tuple[int, ...], evidence: np.ndarray, steps: np.ndarray, jump: float) -> float:
    """What belief propagation is to make least, on a chain: evidence (Z, n) against changes."""
    total = -sum(float(evidence[label, at]) for at, label in enumerate(labels))
    for one, next_one in itertools.pairwise(labels):
        low, high = min(one, next_one), max(one, next_one)
        total += WINDOW_WEIGHT * min(float(steps[low:high].sum()), jump)
    return total


@pytest.mark.parametrize("down", [False, True])
@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("change", [0.02, 0.3, 1.5])
def test_labels_of_a_chain_are_the_best_of_all(seed, change, down):
    rng = np.random.default_rng(seed)
    evidence = (WINDOW_WEIGHT * rng.normal(size=(4, 6))).astype(np.float32)
    steps = change * rng.uniform(0.5, 1.5, size=3)
    jump = 2 * change
    best = min(itertools.product(range(4), repeat=6), key=lambda one: energy(one, evidence, steps, jump))
    shape = (6, 1) if down else (1, 6)
    found = best_labels(evidence.reshape(4, *shape), steps, jump)
    assert found.shape == shape
    np.testing.assert_array_equal(found.ravel(), best)


def test_changes_that_cost_nothing_leave_each_cell_its_best_label():
    evidence = np.random.default_rng(0).normal(size=(5, 7, 8)).astype(np.float32)
    np.testing.assert_array_equal(best_labels(evidence, np.zeros(4), 0.0), np.argmax(evidence, axis=0))


def test_a_lone_cell_gives_in_to_its_neighbours_and_a_patch_does_not():
    evidence = np.zeros((2, 20, 20), np.float32)
    evidence[0] = 1.0
    evidence[1, 4, 4] = 3.0  # gains 2, and its outline costs 4
    evidence[1, 10:16, 10:16] = 3.0  # gains 72, and its outline costs 24
    expected = np.zeros((20, 20))
    expected[10:16, 10:16] = 1
    np.testing.assert_array_equal(best_labels(evidence, np.array([1 / WINDOW_WEIGHT]), 9.0), expected)


@pytest.mark.parametrize("labels", [1, 3])
def test_without_evidence_the_first_label_is_taken(labels):
    assert not best_labels(np.zeros((labels, 4, 6), np.float32), np.full(labels - 1, 0.1), 0.5).any()


@pytest.mark.parametrize("rate", [0.05, 3.0])
@pytest.mark.parametrize("bright_share", [1.0, 0.25])
def test_photon_weighted_mean_is_that_of_bright_cells(rate, bright_share):
    cells = np.random.default_rng(0).poisson(
        np.where(np.arange(200) < 200 * bright_share, rate, 0.0), (200, 200)
    )
    # The pairs n (n - 1) tell it; of them there are rate^2 a cell.
    pairs = 200 * 200 * bright_share * rate**2
    assert abs(photon_weighted_mean(cells.astype(np.float32)) / rate - 1) < 5 * np.sqrt(
        2 / pairs + 4 / (pairs / rate)
    )


def test_without_photons_there_is_no_light():
    assert photon_weighted_mean(np.zeros((3, 4), np.float32)) == 0
