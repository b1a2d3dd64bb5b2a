import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from property_settings import at_least
from twins import colour_of

from pcii.base.errors import InputError
from pcii.types.bayer import PATTERNS, colour_cells, colour_index, mosaic

R, G, B = 0, 1, 2


@pytest.mark.parametrize(
    ("cfa", "cells"),
    [
        ("GRBG", [[G, R], [B, G]]),
        ("RGGB", [[R, G], [G, B]]),
        ("BGGR", [[B, G], [G, R]]),
        ("GBRG", [[G, B], [R, G]]),
        (None, [[0, 0], [0, 0]]),
    ],
)
def test_a_pattern_is_named_by_its_first_two_rows(cfa, cells):
    np.testing.assert_array_equal(colour_cells(cfa), cells)


@pytest.mark.parametrize("cfa", [*PATTERNS, None])
@pytest.mark.parametrize("size", [(1, 1), (1, 4), (3, 1), (2, 2), (3, 5), (4, 7)])
def test_every_pixel_repeats_the_cell_of_its_parity(cfa, size):
    expected = [[colour_of(i, j, cfa) for j in range(size[1])] for i in range(size[0])]
    np.testing.assert_array_equal(colour_index(*size, cfa), expected)


@given(
    cfa=st.sampled_from(PATTERNS), height=st.integers(1, 7), width=st.integers(1, 7), seed=st.integers(0, 9)
)
@at_least(100)
def test_a_mosaic_keeps_the_colour_that_each_pixel_sees(cfa, height, width, seed):
    rgb = np.random.default_rng(seed).integers(0, 1000, size=(2, height, width, 3))
    raw = mosaic(rgb, cfa)
    for i in range(height):
        for j in range(width):
            np.testing.assert_array_equal(raw[:, i, j], rgb[:, i, j, colour_of(i, j, cfa)])


@pytest.mark.parametrize("shape", [(3,), (4, 4, 4)])
def test_a_mosaic_needs_three_colours(shape):
    with pytest.raises(InputError, match=r"^rgb: "):
        mosaic(np.zeros(shape), "GRBG")


@pytest.mark.parametrize("bad", ["grbg", "RGB", 3])
def test_a_bad_pattern_is_refused_in_one_sentence_that_names_the_good_ones(bad):
    with pytest.raises(InputError, match=f"^cfa: .*{bad!r}.* {', '.join(PATTERNS)}, or none"):
        colour_index(2, 2, bad)
