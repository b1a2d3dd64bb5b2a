import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from property_settings import at_least
from twins import demosaic_twin

from pcii.base.errors import InputError
from pcii.core.bayer import PATTERNS, colour_index, mosaic
from pcii.sections.demosaicing import demosaic

RED, GREEN, BLUE = 0, 1, 2
# The paper counts rows and columns from 1: its pixel 43 is [3, 2] here.


def at(*pixels: tuple[int, float], size: int = 7) -> np.ndarray:
    """A GRBG mosaic of zeros but for the pixels named in the paper's way: (43, 10.0) is row 4, column 3."""
    raw = np.zeros((size, size))
    for place, value in pixels:
        raw[place // 10 - 1, place % 10 - 1] = value
    return raw


GREENS_OF_43 = ((42, 4), (44, 8), (33, 100), (53, 200))


def test_eq_4_takes_the_horizontal_pair_if_alpha_is_less():
    raw = at(*GREENS_OF_43, (43, 10), (41, 10), (45, 10))  # alpha 0, beta 10
    assert demosaic(raw)[3, 2, GREEN] == (4 + 8) / 2


def test_eq_4_takes_the_vertical_pair_if_alpha_is_more():
    raw = at(*GREENS_OF_43, (43, 10), (23, 10), (63, 10))  # alpha 10, beta 0
    # The misprint (G33 + G42) / 2 would give 52.
    assert demosaic(raw)[3, 2, GREEN] == (100 + 200) / 2


def test_eq_4_takes_all_four_on_a_tie():
    raw = at(*GREENS_OF_43, (43, 10), (41, 20), (63, 20))  # alpha 0, beta 0
    assert demosaic(raw)[3, 2, GREEN] == (4 + 8 + 100 + 200) / 4


GREENS_OF_34 = ((33, 4), (35, 8), (24, 100), (44, 200))


def test_eq_5_takes_the_horizontal_pair_if_alpha_is_less():
    raw = at(*GREENS_OF_34, (34, 10), (32, 6), (36, 12), (14, 40))  # alpha 1, beta 10
    assert demosaic(raw)[2, 3, GREEN] == (4 + 8) / 2


def test_eq_5_takes_the_vertical_pair_if_alpha_is_more():
    raw = at(*GREENS_OF_34, (34, 10), (14, 6), (54, 12), (32, 40))  # alpha 10, beta 1
    # The misprint (G24 + G24) / 2 would give 100.
    assert demosaic(raw)[2, 3, GREEN] == (100 + 200) / 2


def test_eq_5_takes_all_four_on_a_tie():
    raw = at(*GREENS_OF_34, (34, 10), (32, 4), (36, 4), (14, 32), (54, 0))  # alpha 6, beta 6
    assert demosaic(raw)[2, 3, GREEN] == (4 + 8 + 100 + 200) / 4


def on_flat_green(*pixels: tuple[int, float]) -> np.ndarray:
    """The mosaic `at` with green 10 everywhere, so that every interpolated green is 10 too."""
    raw = at(*pixels)
    raw[colour_index(7, 7, "GRBG") == GREEN] = 10
    return raw


REDS = ((32, 30.0), (34, 50.0), (52, 110.0), (54, 70.0))
BLUES = ((23, 30.0), (43, 50.0), (25, 110.0), (45, 70.0))


def test_eq_6_red_at_a_green_pixel_of_a_red_row_is_the_horizontal_mean():
    assert demosaic(on_flat_green(*REDS))[2, 2, RED] == ((30 - 10) + (50 - 10)) / 2 + 10


def test_eq_6_red_at_a_green_pixel_of_a_blue_row_is_the_vertical_mean():
    assert demosaic(on_flat_green(*REDS))[3, 3, RED] == ((50 - 10) + (70 - 10)) / 2 + 10


def test_eq_6_red_at_a_blue_pixel_is_the_diagonal_mean():
    assert demosaic(on_flat_green(*REDS))[3, 2, RED] == (20 + 40 + 100 + 60) / 4 + 10


def test_eq_6_blue_at_a_green_pixel_of_a_red_row_is_the_vertical_mean():
    assert demosaic(on_flat_green(*BLUES))[2, 2, BLUE] == ((30 - 10) + (50 - 10)) / 2 + 10


def test_eq_6_blue_at_a_green_pixel_of_a_blue_row_is_the_horizontal_mean():
    assert demosaic(on_flat_green(*BLUES))[3, 3, BLUE] == ((50 - 10) + (70 - 10)) / 2 + 10


def test_eq_6_blue_at_a_red_pixel_is_the_diagonal_mean():
    assert demosaic(on_flat_green(*BLUES))[2, 3, BLUE] == (20 + 40 + 100 + 60) / 4 + 10


def test_eq_6_follows_green_at_the_pixel_itself():
    # Green differs at 33 alone; the greens at 32 and 34 are vertical means (alpha > beta) and stay 10.
    raw = on_flat_green((12, 30), (32, 30), (52, 30), (14, 50), (34, 50), (54, 50))
    raw[2, 2] = 18
    assert demosaic(raw)[2, 2].tolist()[:2] == [(20 + 40) / 2 + 18, 18]


images = st.builds(
    lambda seed, height, width, top: np.random.default_rng(seed).integers(0, top, size=(height, width)),
    st.integers(0, 9999),
    st.integers(2, 8),
    st.integers(2, 8),
    st.sampled_from([2, 3, 256, 10**9]),  # photon counts, where ties are the rule, to saturation
)


@given(raw=images, cfa=st.sampled_from(PATTERNS))
@at_least(150)
def test_demosaicing_is_eqs_4_to_6_to_the_bit(raw, cfa):
    # Halves and quarters of whole numbers are exact, so the order of additions cannot matter.
    np.testing.assert_array_equal(demosaic(raw, cfa=cfa), demosaic_twin(raw, cfa))


@given(raw=images, cfa=st.sampled_from(PATTERNS))
@at_least(100)
def test_what_the_sensor_saw_is_kept(raw, cfa):
    np.testing.assert_array_equal(mosaic(demosaic(raw, cfa=cfa), cfa), raw)


@given(raw=images, cfa=st.sampled_from(PATTERNS))
@at_least(100)
def test_rows_and_columns_are_treated_alike(raw, cfa):
    transposed = cfa[0] + cfa[2] + cfa[1] + cfa[3]
    np.testing.assert_array_equal(demosaic(raw.T, cfa=transposed), np.swapaxes(demosaic(raw, cfa=cfa), 0, 1))


@pytest.mark.parametrize(("down", "right", "cfa"), [(0, 1, "RGGB"), (1, 0, "BGGR"), (1, 1, "GBRG")])
def test_all_patterns_are_grbg_seen_from_another_corner(down, right, cfa):
    raw = np.random.default_rng(2).integers(0, 4, size=(14, 15))
    whole = demosaic(raw, cfa="GRBG")[down:, right:]
    part = demosaic(raw[down:, right:], cfa=cfa)
    # A pixel's answer reaches 1 px for chroma and 2 more for the green there; beyond that no border shows.
    np.testing.assert_array_equal(part[3:-3, 3:-3], whole[3:-3, 3:-3])


@pytest.mark.parametrize("cfa", PATTERNS)
@pytest.mark.parametrize("size", [(2, 2), (2, 5), (3, 3), (6, 7)])
def test_a_constant_colour_is_reproduced_to_the_border(cfa, size):
    # Any numbers: differences of equal numbers vanish, and sums of 2 or 4 of these are exact.
    rgb = np.broadcast_to(np.array([0.75, 0.5, 0.125]), (*size, 3))
    np.testing.assert_array_equal(demosaic(mosaic(rgb, cfa), cfa=cfa), rgb)


@pytest.mark.parametrize("cfa", PATTERNS)
def test_a_linear_ramp_is_reproduced_inside(cfa):
    i, j = np.mgrid[:12, :13]
    rgb = np.stack([3 * i + 5 * j + offset for offset in (7, 0, 40)], axis=-1)
    rebuilt = demosaic(mosaic(rgb, cfa), cfa=cfa)
    np.testing.assert_array_equal(rebuilt[3:-3, 3:-3], rgb[3:-3, 3:-3])


@pytest.mark.parametrize("cfa", PATTERNS)
@pytest.mark.parametrize("along_rows", [True, False])
def test_stripes_are_reproduced_exactly(cfa, along_rows):
    # Along a stripe nothing changes and across it the square has a gradient everywhere, so green is
    # interpolated along it, and chroma follows green: means of R and B alone would be wrong.
    stripes = np.broadcast_to(np.arange(12) ** 2, (10, 12))
    rgb = np.stack([stripes + 7, stripes, stripes - 3], axis=-1)
    rgb = rgb if along_rows else np.swapaxes(rgb, 0, 1)
    np.testing.assert_array_equal(demosaic(mosaic(rgb, cfa), cfa=cfa), rgb)


def test_the_result_is_linear_in_exposure():
    raw = np.random.default_rng(0).integers(0, 9, size=(8, 9))
    np.testing.assert_array_equal(demosaic(4 * raw), 4 * demosaic(raw))


def test_green_borders_are_reflected_about_the_border_pixel():
    raw = np.zeros((4, 4))
    raw[1, 1] = 8
    # Red pixel [0, 1]: green neighbours left 0, right 0, below 8 and, reflected, above 8.
    assert demosaic(raw)[0, 1, GREEN] == (0 + 0 + 8 + 8) / 4


@pytest.mark.parametrize("shape", [(4,), (1, 4), (4, 1), (0, 0), (4, 4, 3)])
def test_an_image_below_2_x_2_is_refused(shape):
    with pytest.raises(InputError, match=r"^mosaic: expected an image"):
        demosaic(np.zeros(shape))


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_nan_and_infinity_are_refused(bad):
    raw = np.zeros((4, 4))
    raw[2, 1] = bad
    with pytest.raises(InputError, match=r"^mosaic: holds NaN"):
        demosaic(raw)


def test_an_unknown_method_is_refused_with_the_known_ones():
    with pytest.raises(InputError, match=r"^method: .*laroche-prescott"):
        demosaic(np.zeros((4, 4)), method="nearest")


@pytest.mark.parametrize("bad", ["grbg", "RGB", None])
def test_a_bad_pattern_is_refused(bad):
    with pytest.raises(InputError, match=r"^cfa: "):
        demosaic(np.zeros((4, 4)), cfa=bad)


def test_no_photons_stay_no_photons():
    assert not demosaic(np.zeros((5, 5), dtype=np.uint8)).any()


# Other methods

COMPARED = ["bilinear", "malvar", "menon"]


@pytest.mark.parametrize("method", COMPARED)
@pytest.mark.parametrize("cfa", PATTERNS)
def test_every_method_keeps_its_sites_and_a_grey_image(method, cfa):
    rng = np.random.default_rng(1)
    raw = rng.random((12, 15))
    image = demosaic(raw, cfa=cfa, method=method)
    at_sites = np.take_along_axis(image, colour_index(12, 15, cfa)[..., None].astype(np.int64), axis=2)[
        ..., 0
    ]
    np.testing.assert_allclose(at_sites, raw, rtol=1e-12)
    np.testing.assert_allclose(demosaic(np.full((9, 8), 0.3), cfa=cfa, method=method), 0.3, rtol=1e-12)


@pytest.mark.parametrize("method", COMPARED)
def test_colours_do_not_mix_at_the_border_by_any_method(method):
    # Red is 1 and the rest 0.2: the package alone lets a border's red leak into the other colours.
    flat = mosaic(np.broadcast_to([1.0, 0.2, 0.2], (10, 10, 3)), "RGGB")
    image = demosaic(flat, cfa="RGGB", method=method)
    np.testing.assert_allclose(image, np.broadcast_to([1.0, 0.2, 0.2], image.shape), atol=1e-12)


def test_bilinear_is_the_mean_of_the_neighbours_by_hand():
    raw = at((42, 4), (44, 8), (33, 100), (53, 200), (43, 10))
    assert demosaic(raw, method="bilinear")[3, 2].tolist() == [0.0, (4 + 8 + 100 + 200) / 4, 10.0]


@pytest.mark.parametrize("method", COMPARED)
def test_no_method_changes_how_numbers_are_printed_or_takes_a_bad_pattern(method):
    before = np.get_printoptions()
    demosaic(np.ones((4, 4)), method=method)
    assert np.get_printoptions() == before
    for bad in ("grbg", "XXXX"):
        with pytest.raises(InputError, match=r"^cfa: "):
            demosaic(np.ones((4, 4)), cfa=bad, method=method)


@pytest.mark.parametrize("method", COMPARED)
@pytest.mark.parametrize("shape", [(2, 2), (2, 7), (3, 3), (5, 2)])
def test_small_images_have_an_answer_by_every_method(method, shape):
    image = demosaic(np.arange(np.prod(shape), dtype=float).reshape(shape), method=method)
    assert image.shape == (*shape, 3)
    assert np.isfinite(image).all()
