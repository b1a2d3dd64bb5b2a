import numpy as np
import pytest
from property_settings import mostly_slow
from twins import even_light, paper_grid, unit_grid

from pcii.evidence.focus_likelihood import FocusEvidence, focus_evidence
from pcii.evidence.half_agreement import Halves, Products, halves_of
from pcii.removal.likelihood.likelihood_method import searched_planes
from pcii.removal.likelihood.regions import (
    Planes,
    bright_cells,
    dark_pieces,
    regions_of,
    settled,
)
from pcii.types.focal_planes import FocalPlanes

SHAPE = (30, 40)
SURE_NATS = 10.0  # of chance once in e^10 = 20 000 times
HALO_CELLS = 4  # a blurred outline shows up to 16 px outside
# Two planes, at 20 and 40 px of total disparity, among five searched depths.
TOTAL_PX = np.array([10.0, 20.0, 30.0, 40.0, 60.0])
SEARCHED = FocalPlanes.at_total_disparity(unit_grid(3, 3, 120, 160), TOTAL_PX)
PLANES = Planes(
    total_disparity_px=TOTAL_PX,
    nearest=np.array([0, 0, 0, 1, 1]),
    away_px=np.array([10.5, 0.0, 10.5, 0.0, 20.0]),
    sure=np.array([False, True, False, True, False]),
    far_px=10.0,
)
FIRST, BETWEEN, SECOND = 1, 2, 3

BLOCKS = [(TOTAL_PX.size, -(-SHAPE[0] // side), -(-SHAPE[1] // side)) for side in (1, 2, 4, 8)]


def halves_with(p: list[np.ndarray]) -> Halves:
    """Halves with these products at each plane, and none elsewhere."""
    own, nothing = (
        [Products(part * is_own, 0 * part, np.ones(part.shape, bool)) for part in p] for is_own in (1, 0)
    )
    return Halves(own, nothing)


AGREED, UNSURE = (halves_with([np.full(shape, p) for shape in BLOCKS]) for p in (1.0, 0.0))
"""What is seen by both halves of the cameras everywhere, and nowhere."""


def box(top: int, left: int, height: int, width: int) -> np.ndarray:
    mask = np.zeros(SHAPE, dtype=bool)
    mask[top : top + height, left : left + width] = True
    return mask


def focus_with(*gains: tuple[int, np.ndarray, float]) -> FocusEvidence:
    """Evidence that is 0 but for (depth, where, nats in all)."""
    gain = np.zeros((TOTAL_PX.size, *SHAPE), np.float32)
    for depth, where, nats in gains:
        gain[depth][where] += nats / where.sum()
    return FocusEvidence(SEARCHED, gain, np.zeros((TOTAL_PX.size, 1, *SHAPE), np.float32))


def test_without_photons_nothing_is_bright():
    assert not bright_cells(np.zeros(SHAPE, np.float32)).any()


@pytest.mark.parametrize("rate", [0.3, 3.0, 100.0])
def test_a_flat_film_has_no_dark_around_things(rate):
    assert bright_cells(np.random.default_rng(0).poisson(rate, SHAPE).astype(np.float32)).all()


@pytest.mark.parametrize("rate", [3.0, 100.0])
def test_what_is_bright_is_the_object_and_not_the_dark(rate):
    here = box(8, 10, 12, 16)
    photons = np.random.default_rng(1).poisson(np.where(here, rate, rate / 100)).astype(np.float32)
    bright = bright_cells(photons)
    assert bright[here].all()
    # Smoothing is by at most 4 cells, and it is bright down to a tenth: within 8 cells of it.
    far = np.ones(SHAPE, dtype=bool)
    far[:28, 2:34] = False
    assert not bright[far].any()


def test_one_lamp_is_bright_and_the_dark_around_it_is_not():
    photons = np.random.default_rng(2).poisson(0.05, SHAPE).astype(np.float32)
    photons[25, 35] = 1000.0
    bright = bright_cells(photons)
    assert bright[25, 35]
    assert not bright[:, :25].any()  # more than twice the widest smoothing away


def test_one_lamp_does_not_put_out_the_rest():
    # A lamp of a cell, a thousand times as bright as an object that holds most of the light.
    here = box(8, 10, 12, 16)
    photons = np.where(here, 20.0, 0.0).astype(np.float32)
    photons[25, 35] = 1000.0
    bright = bright_cells(np.random.default_rng(2).poisson(photons).astype(np.float32))
    assert bright[25, 35]
    assert bright[here].mean() > 0.9


def test_around_a_highlight_goes_on_what_it_is_on():
    # A disc of 20 photons per cell with a highlight fifty times as bright, and a lamp by itself.
    from scipy.ndimage import gaussian_filter

    i, j = np.indices((80, 160))
    disc = np.hypot(i - 40, j - 40) < 26
    lamps = (np.hypot(i - 32, j - 46) < 3) | (np.hypot(i - 40, j - 120) < 1.5)
    photons = np.where(disc, 20.0, 0.05) + gaussian_filter(np.where(lamps, 1000.0, 0.0), 1.5)
    photons = np.random.default_rng(4).poisson(photons).astype(np.float32)
    bright = bright_cells(photons)
    assert bright[np.hypot(i - 40, j - 40) < 24].mean() > 0.99
    # Around the other lamp nothing goes on: it ends within 8 cells, twice the smoothing.
    assert bright[40, 120]
    assert not bright[:, 80:][np.hypot(i - 40, j - 120)[:, 80:] > 9.5].any()


def test_a_dim_but_even_surround_is_dark():
    # A thing of 160 photons per cell before a wall of 40: the wall is as bright as parts of things may be,
    # but even. One that is lit from the side is not, and is seen as a thing.
    photons = np.full((64, 64), 40.0)
    photons[20:44, 20:44] = 160
    bright = bright_cells(np.random.default_rng(3).poisson(photons).astype(np.float32))
    assert bright[22:42, 22:42].all()
    assert bright[:12].mean() < 0.01
    photons *= np.linspace(0.4, 1.6, 64)
    assert bright_cells(np.random.default_rng(3).poisson(photons).astype(np.float32)).all()


def test_a_weak_piece_joins_its_neighbour():
    large, small = box(5, 5, 12, 12), box(5, 17, 3, 2)
    plane = np.where(small, 1, 0)
    focus = focus_with((FIRST, large, 300.0), (SECOND, small, 3.0))
    result = settled(plane, large | small, focus, PLANES)
    assert (result[large | small] == 0).all()
    assert (plane[small] == 1).all()  # what was given is left as it was


def test_a_weak_piece_joins_a_smaller_one_that_is_sure():
    weak, sure = box(5, 5, 12, 12), box(5, 17, 9, 3)
    focus = focus_with((FIRST, weak, 3.0), (SECOND, sure, 300.0))
    result = settled(np.where(sure, 1, 0), weak | sure, focus, PLANES)
    assert (result[weak | sure] == 1).all()


def test_a_piece_is_what_explains_it_better_though_only_a_speck_beside_it_shows_that_plane():
    mistaken, speck = box(5, 5, 12, 12), box(5, 17, 4, 4)
    focus = focus_with((FIRST, mistaken, 300.0), (SECOND, mistaken, 400.0), (SECOND, speck, 30.0))
    result = settled(np.where(speck, 1, 0), mistaken | speck, focus, PLANES)
    assert (result[mistaken | speck] == 1).all()


@pytest.mark.parametrize(("total_disparity_px", "stays"), [(26.0, True), (28.6, True), (30.0, False)])
def test_what_shows_best_midway_between_planes_is_no_reason_to_part_a_thing(total_disparity_px, stays):
    # Planes at 28.6 and 34 px of total disparity: what shows best at 30 px may be at 32, nearer the other.
    thing, rim = box(5, 5, 12, 12), box(5, 17, 9, 3)
    planes = searched_planes(np.array([28.6, 34.0]))
    gain = np.zeros((planes.total_disparity_px.size, *SHAPE), np.float32)
    shown = int(np.argmin(np.abs(planes.total_disparity_px - total_disparity_px)))
    for depth, where in ((shown, rim), (int(np.argmin(np.abs(planes.total_disparity_px - 34.0))), thing)):
        gain[depth][where] = 10.0
    searched = FocalPlanes.at_total_disparity(SEARCHED.grid, planes.total_disparity_px)
    focus = FocusEvidence(searched, gain, np.zeros((len(gain), 1, *SHAPE), np.float32))
    result = settled(np.where(rim, 0, 1), thing | rim, focus, planes)
    assert (result[rim] == (0 if stays else 1)).all()
    assert (result[thing] == 1).all()


def test_a_strong_piece_stays():
    large, small = box(5, 5, 12, 12), box(5, 17, 9, 3)
    plane = np.where(small, 1, 0)
    # Beyond half a nat for each cell of its border, and what is sure.
    focus = focus_with((FIRST, large, 300.0), (SECOND, small, SURE_NATS + 20.0))
    result = settled(plane, large | small, focus, PLANES)
    np.testing.assert_array_equal(result[large | small], plane[large | small])


def test_a_piece_narrower_than_the_windows_has_no_opinion():
    large, small = box(5, 5, 12, 12), box(5, 17, 4, 4)
    focus = focus_with((FIRST, large, 300.0), (SECOND, small, 1000.0))
    result = settled(np.where(small, 1, 0), large | small, focus, PLANES)
    assert (result[large | small] == 0).all()


def test_a_piece_on_its_own_joins_nothing():
    one, other = box(5, 5, 6, 6), box(5, 20, 6, 6)
    plane = np.where(other, 1, 0)
    result = settled(plane, one | other, focus_with(), PLANES)
    np.testing.assert_array_equal(result[one | other], plane[one | other])


def test_a_region_is_at_the_depth_that_gains_most_with_the_dark_around_it():
    piece = box(10, 10, 6, 6)
    around = box(10 - HALO_CELLS, 12, 1, 2)  # its outline shows in the dark
    too_far = box(10 - HALO_CELLS - 1, 12, 1, 2)
    focus = focus_with((FIRST, piece, 15.0), (FIRST, around, 7.0), (FIRST, too_far, 900.0))
    numbers, (region,) = regions_of(np.zeros(SHAPE, np.int64), piece, focus, PLANES, AGREED)
    np.testing.assert_array_equal(numbers, piece)
    assert (region.number, region.plane, region.cells, region.total_disparity_px) == (1, 0, 36, 20.0)
    assert region.gain_nats == pytest.approx(22.0, rel=1e-5)  # sums of single precision
    assert region.is_there


@pytest.mark.parametrize("depth", [0, BETWEEN, 4])
def test_a_region_that_another_depth_explains_better_is_not_there(depth):
    piece = box(10, 10, 6, 6)
    focus = focus_with((FIRST, piece, 40.0), (depth, piece, 41.0 + SURE_NATS))
    _, (region,) = regions_of(np.zeros(SHAPE, np.int64), piece, focus, PLANES, AGREED)
    assert not region.is_there
    assert region.plane == -1
    assert region.total_disparity_px == TOTAL_PX[depth]


@pytest.mark.parametrize(("side_cells", "is_there"), [(6, True), (4, False)])
def test_noise_does_not_put_a_region_out_of_focus_unless_it_is_a_speck(side_cells, is_there):
    piece = box(10, 10, side_cells, side_cells)
    focus = focus_with((FIRST, piece, 40.0), (BETWEEN, piece, 39.0 + SURE_NATS))
    _, (region,) = regions_of(np.zeros(SHAPE, np.int64), piece, focus, PLANES, AGREED)
    assert region.is_there == is_there


@pytest.mark.parametrize(("nats", "is_there"), [(SURE_NATS - 1, False), (SURE_NATS + 1, True)])
def test_a_region_without_sure_evidence_is_not_there(nats, is_there):
    piece = box(10, 10, 6, 6)
    _, (region,) = regions_of(
        np.zeros(SHAPE, np.int64), piece, focus_with((FIRST, piece, nats)), PLANES, AGREED
    )
    assert region.is_there == is_there


def test_a_region_that_the_halves_of_the_cameras_do_not_agree_on_is_not_there():
    piece = box(10, 10, 6, 6)
    focus = focus_with((FIRST, piece, 1e6))
    for halves, is_there in ((AGREED, True), (UNSURE, False)):
        _, (region,) = regions_of(np.zeros(SHAPE, np.int64), piece, focus, PLANES, halves)
        assert region.is_there == is_there


def test_the_halves_need_not_agree_on_each_part_of_a_piece():
    part, rest = box(10, 10, 6, 6), box(10, 16, 6, 20)
    there = [np.zeros(shape) for shape in BLOCKS]
    there[0][:, rest] = 1.0
    halves = halves_with(there)
    focus = focus_with((FIRST, part, 40.0), (SECOND, rest, 40.0))
    _, regions = regions_of(np.where(rest, 1, 0), part | rest, focus, PLANES, halves)
    assert [region.is_there for region in regions] == [True, True]


def test_a_piece_of_a_plane_that_is_dark_everywhere_is_unseen():
    lit, half_lit, dark = box(2, 2, 6, 6), box(12, 2, 8, 8), box(2, 20, 12, 12)
    plane = np.where(lit | dark, 0, np.where(half_lit, 1, -1))
    bright = lit | box(12, 2, 1, 1) | box(25, 35, 2, 2)
    np.testing.assert_array_equal(dark_pieces(plane, bright), dark)
    np.testing.assert_array_equal(dark_pieces(np.full(SHAPE, -1), bright), False)


def test_pieces_are_numbered_and_specks_left_out():
    one, other, speck = box(3, 3, 5, 5), box(3, 20, 5, 5), box(20, 20, 1, 5)  # of less than 6 cells
    focus = focus_with((FIRST, one, 50.0), (SECOND, other, 50.0), (FIRST, speck, 50.0))
    plane = np.where(other, 1, 0)
    numbers, regions = regions_of(plane, one | other | speck, focus, PLANES, AGREED)
    assert [region.plane for region in regions] == [0, 1]
    np.testing.assert_array_equal(numbers, one + 2 * other)


NOISE_NATS = 1000.0  # what noise costs at each depth, give or take sqrt(2000) = 45


@pytest.mark.parametrize(("sigmas", "is_there"), [(4.0, False), (5.0, True)])
def test_a_large_dim_region_is_there_if_its_depth_stands_out_of_the_noise(sigmas, is_there):
    # 10 nats are e^-(s^2 / 2) = e^-10, s = 4.5 standard deviations.
    piece = box(5, 5, 20, 30)
    costs = [(depth, piece, -NOISE_NATS) for depth in range(TOTAL_PX.size)]
    focus = focus_with(*costs, (FIRST, piece, sigmas * np.sqrt(2 * NOISE_NATS)))
    _, (region,) = regions_of(np.zeros(SHAPE, np.int64), piece, focus, PLANES, AGREED)
    assert region.is_there == is_there
    assert region.gain_nats == pytest.approx(sigmas**2 / 2, rel=1e-3)


@pytest.mark.parametrize("elsewhere", [-SURE_NATS, -3.0, 0.0])
def test_of_few_photons_the_evidence_itself_counts(elsewhere):
    piece = box(10, 10, 6, 6)
    focus = focus_with((FIRST, piece, 7.0), *((depth, piece, elsewhere) for depth in (0, BETWEEN, 4)))
    _, (region,) = regions_of(np.zeros(SHAPE, np.int64), piece, focus, PLANES, AGREED)
    assert not region.is_there


@pytest.mark.parametrize("photons_per_px", mostly_slow([0.02, 0.1, 1.0], quick=[0.1]))
def test_noise_alone_is_never_sure(photons_per_px):
    # The whole of a film on which nothing is: about a hundred nats of noise at each of 11 depths that may be
    # a plane's. Three films are at most 33 trials, of which e^-10 is not one.
    size, total_disparity_px = 256, np.arange(60.0, 140.0, 2.0)
    away = np.abs(total_disparity_px - 100)
    planes = Planes(total_disparity_px, np.zeros(away.size, np.int64), away, sure=away <= 4.5, far_px=10.0)
    everything = np.ones((size // 4, size // 4), dtype=bool)
    grid = paper_grid(size, size)
    for seed in range(3):
        counts = even_light(grid, photons_per_px / 100, seed, "GRBG")
        searched = FocalPlanes.at_total_disparity(counts.grid, total_disparity_px)
        focus, halves = focus_evidence(counts, searched), halves_of(counts, searched)
        _, (region,) = regions_of(np.zeros(everything.shape, np.int64), everything, focus, planes, halves)
        assert not region.is_there
        assert np.median(focus.gain.sum(axis=(1, 2))) < -50
        assert region.gain_nats < SURE_NATS
