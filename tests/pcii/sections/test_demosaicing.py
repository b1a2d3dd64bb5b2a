import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from twins import demosaic_twin

from pcii.base import InputError
from pcii.sections import demosaic
from pcii.types import PATTERNS, mosaic

GREEN = 1
# The paper counts rows and columns from 1: its pixel 43 is [3, 2] here.


def at(*pixels: tuple[int, float], size: int = 7) -> np.ndarray:
    """A GRBG mosaic of zeros but for the pixels named in the paper's way: (43, 10.0) is row 4, column 3."""
    raw = np.zeros((size, size))
    for place, value in pixels:
        raw[place // 10 - 1, place % 10 - 1] = value
    return raw


AROUND_43 = ((42, 4), (44, 8), (33, 100), (53, 200), (43, 10))
AROUND_34 = ((33, 4), (35, 8), (24, 100), (44, 200), (34, 10))


@pytest.mark.parametrize(
    ("pixels", "place", "green"),
    [
        ((*AROUND_43, (41, 10), (45, 10)), (3, 2), (4 + 8) / 2),  # Eq. 4: alpha 0, beta 10
        ((*AROUND_43, (23, 10), (63, 10)), (3, 2), (100 + 200) / 2),  # 10, 0; misprinted it would be 52
        ((*AROUND_43, (41, 20), (63, 20)), (3, 2), (4 + 8 + 100 + 200) / 4),  # 0, 0
        ((*AROUND_34, (32, 6), (36, 12), (14, 40)), (2, 3), (4 + 8) / 2),  # Eq. 5: alpha 1, beta 10
        ((*AROUND_34, (14, 6), (54, 12), (32, 40)), (2, 3), (100 + 200) / 2),  # 10, 1; misprinted: 100
        ((*AROUND_34, (32, 4), (36, 4), (14, 32), (54, 0)), (2, 3), (4 + 8 + 100 + 200) / 4),  # 6, 6
    ],
)
def test_green_follows_the_smaller_gradient_by_eqs_4_and_5(pixels, place, green):
    assert demosaic(at(*pixels))[*place, GREEN] == green


images = st.builds(
    lambda seed, height, width, top: np.random.default_rng(seed).integers(0, top, size=(height, width)),
    st.integers(0, 9999),
    st.integers(2, 8),
    st.integers(2, 8),
    st.sampled_from([2, 3, 256, 10**9]),  # photon counts, where ties are the rule, to saturation
)


@given(raw=images, cfa=st.sampled_from(PATTERNS))
def test_demosaicing_is_eqs_4_to_6_to_the_bit(raw, cfa):
    # Halves and quarters of whole numbers are exact, so the order of additions cannot matter.
    np.testing.assert_array_equal(demosaic(raw, cfa=cfa), demosaic_twin(raw, cfa))


@pytest.mark.parametrize("cfa", PATTERNS)
@pytest.mark.parametrize("along_rows", [True, False])
def test_stripes_are_reproduced_exactly(cfa, along_rows):
    # Along a stripe nothing changes and across it the square has a gradient everywhere, so green is
    # interpolated along it, and chroma follows green: means of R and B alone would be wrong.
    stripes = np.broadcast_to(np.arange(12) ** 2, (10, 12))
    rgb = np.stack([stripes + 7, stripes, stripes - 3], axis=-1)
    rgb = rgb if along_rows else np.swapaxes(rgb, 0, 1)
    np.testing.assert_array_equal(demosaic(mosaic(rgb, cfa), cfa=cfa), rgb)


@pytest.mark.parametrize(
    ("raw", "options", "words"),
    [
        (np.zeros((1, 4)), {}, "mosaic: expected an image"),
        (np.full((4, 4), np.nan), {}, "mosaic: holds NaN"),
        (np.zeros((4, 4)), {"method": "nearest"}, "method: .*laroche-prescott"),
        (np.zeros((4, 4)), {"cfa": None}, "cfa: "),
    ],
)
def test_what_cannot_be_demosaiced_is_refused_by_name(raw, options, words):
    with pytest.raises(InputError, match=f"^{words}"):
        demosaic(raw, **options)
