"""The simple removals: each does what its one cue can, and no more."""

import numpy as np
import pytest
from twins import even_light, intersection_over_union, unit_grid

from pcii.removal import segment
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
