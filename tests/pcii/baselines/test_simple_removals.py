"""The simple removals: each does what its one cue can, and no more."""

import numpy as np
import pytest
from twins import even_light, intersection_over_union, unit_grid

from pcii.baselines.simple_removals import sum_modified_laplacian
from pcii.removal.methods import segment
from pcii.types.photon_counts import PhotonCounts

OFFSETS = np.arange(7) - 3


def flat_square(gain: np.ndarray, seed: int = 3) -> PhotonCounts:
    """7 x 7 views of 96 x 96: a flat square of 48 px at disparity 2, `gain` (7, 7) times as bright."""
    grid = unit_grid(7, 7, 96, 96)
    rates = np.zeros(grid.shape_KLHW)
    for k, l in np.ndindex(7, 7):
        top, left = 24 - 2 * OFFSETS[k], 24 - 2 * OFFSETS[l]
        rates[k, l, top : top + 48, left : left + 48] = 0.2 * gain[k, l]
    return PhotonCounts.from_dense(np.random.default_rng(seed).poisson(rates), grid)


def test_brightness_keeps_what_is_bright_in_focus_or_not(two_squares):
    focus = segment(two_squares.counts, two_squares.z_mm, method="brightness")
    for plane, here in enumerate(two_squares.masks):
        there = two_squares.masks[1 - plane]
        # Otsu loses what is darker than half way; a blurred square keeps its middle.
        assert (focus.in_focus[plane] & here).sum() > 0.8 * here.sum()
        assert (focus.in_focus[plane] & there).sum() > 0.3 * there.sum()


def test_brightness_claims_nothing_of_an_even_dark():
    grid = unit_grid(4, 4, 96, 96)
    dark = even_light(grid, 0.05, seed=5)
    assert not segment(dark, [0.5], method="brightness").in_focus.any()


@pytest.mark.parametrize("method", ["brightness", "variance", "shape-from-focus"])
@pytest.mark.parametrize(("count", "size"), [(3, (1, 1)), (2**40, (40, 44))])
def test_an_even_section_has_one_class_and_it_is_dark(method, count, size):
    # A saturated counter. Roundings of the root of a large count are too small a range for a histogram.
    grid = unit_grid(3, 3, *size)
    counts = PhotonCounts.from_dense(np.full(grid.shape_KLHW, count), grid, cfa="GRBG")
    assert not segment(counts, [0.5, 1.0], method=method).in_focus.any()


@pytest.mark.parametrize("method", ["variance", "shape-from-focus"])
def test_one_cue_beside_brightness_is_better_than_brightness(two_squares, method):
    simple = segment(two_squares.counts, two_squares.z_mm, method="brightness").in_focus
    focus = segment(two_squares.counts, two_squares.z_mm, method=method).in_focus
    flipped = PhotonCounts.from_dense(two_squares.dense[::-1, ::-1], two_squares.grid, cfa="GRBG")
    wrong = segment(flipped, two_squares.z_mm, method=method).in_focus
    for plane, mask in enumerate(two_squares.masks):
        here = intersection_over_union(focus[plane], mask)
        assert here > intersection_over_union(simple[plane], mask) + 0.05
        # The planted fault: the sign of the shifts reversed.
        assert intersection_over_union(wrong[plane], mask) < here / 2


def test_views_that_differ_by_poisson_noise_alone_pass_the_variance_test():
    inner = np.s_[0, 30:66, 30:66]  # windows that see nothing but the square
    even = segment(flat_square(np.ones((7, 7))), [0.5], method="variance").steps["even"][inner]
    # One window of a thousand fails; 16 cells share a window, so failures come in groups.
    assert even.mean() > 0.97
    # The planted fault: every other view half as bright, 1 +- 1/3 about its mean. At m photons a sample the
    # dispersion is 1 + m / 9 of 48 degrees of freedom, above the threshold of 1.75 with m = 10.
    gain = np.where(np.indices((7, 7)).sum(axis=0) % 2, 1.0, 0.5)
    assert segment(flat_square(gain), [0.5], method="variance").steps["even"][inner].mean() < 0.3


@pytest.mark.parametrize(
    ("samples", "even"),
    [([0, 0, 0, 1, 1, 2, 3, 3, 8], True), ([0, 0, 0, 0, 1, 2, 3, 4, 8], False)],
)
def test_dispersion_is_that_of_all_views_with_the_dark_ones(samples, even):
    # Nine views of one window: 18 photons, 88 or 94 the sum of their squares. Dispersions about the mean of 2
    # are (88 - 9 x 4) / 2 = 26 and 29; chi-square of 8 exceeds 26.1 once in a thousand times.
    assert (sum(samples), sum(n * n for n in samples)) == (18, 88 if even else 94)
    grid = unit_grid(3, 3, 8, 8)
    k, l = np.divmod(np.arange(9), 3)
    # z so far away that no view moves; all photons in pixel (4, 4).
    four = np.full(9, 4)
    counts = PhotonCounts.from_events(k, l, four, four, np.array(samples), grid)
    found = segment(counts, [1e6], method="variance").steps["even"]
    assert found.all() if even else not found.any()


def test_modified_laplacian_of_a_point_and_of_a_slope():
    image = np.zeros((21, 21))
    image[10, 10] = 10.0
    side = 6 + 1  # six samples along each axis
    # |2 I - ..| is 20 + 20 at the point and 10 at its four neighbours; all are in the window.
    assert sum_modified_laplacian(image, 1)[10, 10] == pytest.approx(80 / side**2)
    faint = image / 100  # 0.4 is within the noise of sqrt(6) / 2
    assert not sum_modified_laplacian(faint, 1).any()
    slope = np.add.outer(np.arange(40.0), 2 * np.arange(40.0))
    assert np.abs(sum_modified_laplacian(slope, 1)[8:-8, 8:-8]).max() < 1e-9  # running sums round


def test_shape_from_focus_leaves_what_is_sharper_at_a_probe(two_squares):
    between = 2 / (1 / two_squares.z_mm[0] + 1 / two_squares.z_mm[1])  # 6 px of blur from either
    focus = segment(two_squares.counts, [*two_squares.z_mm, between], method="shape-from-focus")
    assert focus.in_focus[2].sum() < 0.2 * two_squares.masks[0].sum()
