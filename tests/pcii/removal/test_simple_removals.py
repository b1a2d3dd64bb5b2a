"""The simple removals: each does what its one cue can, and no more."""

import numpy as np
import pytest
from twins import even_light, intersection_over_union, unit_grid

from pcii.removal import segment
from pcii.removal.simple_removals import sum_modified_laplacian
from pcii.types import PhotonCounts


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


@pytest.mark.parametrize("method", ["brightness", "shape-from-focus"])
@pytest.mark.parametrize(("count", "size"), [(3, (1, 1)), (2**40, (40, 44))])
def test_an_even_section_has_one_class_and_it_is_dark(method, count, size):
    # A saturated counter. Roundings of the root of a large count are too small a range for a histogram.
    grid = unit_grid(3, 3, *size)
    counts = PhotonCounts.from_dense(np.full(grid.shape_KLHW, count), grid, cfa="GRBG")
    assert not segment(counts, [0.5, 1.0], method=method).in_focus.any()


def test_sharpness_beside_brightness_is_better_than_brightness(two_squares):
    method = "shape-from-focus"
    simple = segment(two_squares.counts, two_squares.z_mm, method="brightness").in_focus
    focus = segment(two_squares.counts, two_squares.z_mm, method=method).in_focus
    flipped = PhotonCounts.from_dense(two_squares.dense[::-1, ::-1], two_squares.grid, cfa="GRBG")
    wrong = segment(flipped, two_squares.z_mm, method=method).in_focus
    for plane, mask in enumerate(two_squares.masks):
        here = intersection_over_union(focus[plane], mask)
        assert here > intersection_over_union(simple[plane], mask) + 0.05
        # The planted fault: the sign of the shifts reversed.
        assert intersection_over_union(wrong[plane], mask) < here / 2


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
