import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from property_settings import at_least
from twins import colour_of

from pcii.base.errors import InputError
from pcii.core.bayer import PATTERNS, channel_count, check_cfa, colour_cells, colour_index, mosaic

R, G, B = 0, 1, 2


def test_grbg_starts_green_red_over_blue_green():
    expected = [[G, R, G], [B, G, B], [G, R, G]]
    np.testing.assert_array_equal(colour_index(3, 3, "GRBG"), expected)


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


@pytest.mark.parametrize("dtype", [np.uint8, np.int64, np.float32])
def test_a_mosaic_keeps_the_dtype(dtype):
    assert mosaic(np.ones((3, 3, 3), dtype=dtype), "RGGB").dtype == dtype


def test_a_mosaic_is_a_copy():
    rgb = np.ones((2, 2, 3))
    mosaic(rgb, "GRBG")[:] = 5
    assert rgb.max() == 1


@pytest.mark.parametrize("shape", [(3,), (4, 4), (4, 4, 1), (4, 4, 4)])
def test_a_mosaic_needs_three_colours(shape):
    with pytest.raises(InputError, match=r"^rgb: "):
        mosaic(np.zeros(shape), "GRBG")


@pytest.mark.parametrize("bad", ["grbg", "GGRB", "RGB", "", "GRBGX", 3, ["G", "R", "B", "G"]])
def test_a_bad_pattern_is_refused_in_one_sentence_that_names_the_good_ones(bad):
    for use in (check_cfa, colour_cells, lambda cfa: colour_index(2, 2, cfa)):
        with pytest.raises(InputError) as caught:
            use(bad)
        message = str(caught.value)
        assert message.startswith("cfa: ")
        assert repr(bad) in message
        assert all(pattern in message for pattern in PATTERNS)
        assert "\n" not in message


def test_monochrome_has_one_channel_and_bayer_three():
    assert [channel_count(cfa) for cfa in (None, *PATTERNS)] == [1, 3, 3, 3, 3]


@pytest.mark.parametrize("cfa", PATTERNS)
def test_half_of_the_pixels_are_green(cfa):
    assert np.bincount(colour_index(6, 4, cfa).ravel()).tolist() == [6, 12, 6]
