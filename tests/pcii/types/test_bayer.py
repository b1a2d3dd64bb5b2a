import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from twins import colour_of

from pcii.base import InputError
from pcii.types import PATTERNS, colour_cells, colour_index, mosaic

R, G, B = 0, 1, 2


@pytest.mark.parametrize(("cfa", "cells"), [("GRBG", [[G, R], [B, G]]), (None, [[0, 0], [0, 0]])])
def test_a_pattern_is_named_by_its_first_two_rows(cfa, cells):
    np.testing.assert_array_equal(colour_cells(cfa), cells)


@given(
    cfa=st.sampled_from(PATTERNS), height=st.integers(1, 7), width=st.integers(1, 7), seed=st.integers(0, 9)
)
def test_a_mosaic_keeps_the_colour_that_each_pixel_sees(cfa, height, width, seed):
    rgb = np.random.default_rng(seed).integers(0, 1000, size=(2, height, width, 3))
    raw, colours = mosaic(rgb, cfa), colour_index(height, width, cfa)
    for i, j in np.ndindex(height, width):
        assert colours[i, j] == colour_of(i, j, cfa)
        np.testing.assert_array_equal(raw[:, i, j], rgb[:, i, j, colour_of(i, j, cfa)])


def test_what_is_no_mosaic_is_refused():
    with pytest.raises(InputError, match=r"^rgb: "):
        mosaic(np.zeros((4, 4, 4)), "GRBG")
    with pytest.raises(InputError, match=f"^cfa: .*'grbg'.* {', '.join(PATTERNS)}, or none"):
        colour_index(2, 2, "grbg")
