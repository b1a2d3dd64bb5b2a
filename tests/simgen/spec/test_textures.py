"""Textures against what they promise: means, periods, angles, spectra, and which way up they stand."""

import math
from typing import Any

import numpy as np
import pytest

from pcii.base import InputError, srgb_to_linear
from simgen.assets import paint
from simgen.spec import Checks, Edge, Noise, Star, Stripes, Text, Texture

RED, GREY = (0.9, 0.1, 0.2), (0.6, 0.6, 0.6)
LINEAR = srgb_to_linear(np.array([RED, GREY]))
BLACK_WHITE = ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))


def share_of_second(texture: Texture, aspect: float = 1.0) -> np.ndarray:
    """Of a texture in black and white, (H, W), so that reflectance is the area's share itself."""
    return paint(texture.change(colours=BLACK_WHITE), aspect)[..., 0].astype(float)


def test_checks_start_with_the_first_colour_and_are_mixed_by_area_in_linear_light() -> None:
    painted = paint(Checks(rows=4, columns=6, colours=(RED, GREY), pixels=96), 1.5)
    assert painted.shape == (64, 96, 3)
    board = np.add.outer(np.arange(64) // 16, np.arange(96) // 16) % 2
    np.testing.assert_allclose(painted, LINEAR[board], atol=1e-6)
    # 3 columns on 16 pixels: the pixel from 5 to 6 holds a third of the first cell.
    painted = paint(Checks(rows=1, columns=3, colours=(RED, GREY), pixels=16), 1.0)
    np.testing.assert_allclose(painted[0, 5], LINEAR[0] / 3 + 2 * LINEAR[1] / 3, atol=1e-6)
    # An odd board has one cell more of the first colour; exact areas keep the mean exact too.
    np.testing.assert_allclose(painted.mean((0, 1), np.float64), (2 * LINEAR[0] + LINEAR[1]) / 3, atol=1e-6)
    # Far more cells than pixels: grey, each pixel with the mean of the colours, not a moire.
    fine = share_of_second(Checks(rows=1024, columns=1024, pixels=16))
    np.testing.assert_allclose(fine, 0.5, atol=1e-6)


@pytest.mark.parametrize("profile", ["square", "sine"])
@pytest.mark.parametrize(("angle_deg", "aspect"), [(0.0, 1.0), (90.0, 1.0), (30.0, 2.0), (-50.0, 0.5)])
def test_stripes_have_their_period_and_direction(profile: Any, angle_deg: float, aspect: float) -> None:
    periods = 16.0
    share = share_of_second(
        Stripes(periods=periods, angle_deg=angle_deg, profile=profile, pixels=256), aspect
    )
    H, W = share.shape
    windowed = (share - share.mean()) * np.hanning(H)[:, None] * np.hanning(W)
    spectrum = np.abs(np.fft.fft2(windowed, (1024, 1024)))
    at = np.unravel_index(np.argmax(spectrum[:, :512]), (1024, 512))
    frequency = np.fft.fftfreq(1024)[at[0]], at[1] / 1024  # down, across; cycles per pixel
    angle = math.radians(angle_deg)
    expected = np.array([math.sin(angle), math.cos(angle)]) * periods / W
    if expected[1] < 1e-9:
        frequency = abs(frequency[0]), frequency[1]  # a wave straight down has no sign
    # The padded spectrum's grid is 1 / 1024; half a step, and as much for the window's width.
    np.testing.assert_allclose(frequency, expected, atol=1 / 1024)


def test_upright_stripes_start_with_the_first_colour_and_a_sine_is_a_sine() -> None:
    square = share_of_second(Stripes(periods=5, pixels=80))
    np.testing.assert_allclose(square[0], np.tile(np.repeat([0.0, 1.0], 8), 5), atol=1e-6)
    sine = share_of_second(Stripes(periods=5, profile="sine", pixels=80))
    middle = (np.arange(80) + 0.5) / 16
    expected = 0.5 - 0.5 * np.sin(2 * np.pi * middle) * np.sinc(1 / 16)  # the pixel's own blur
    np.testing.assert_allclose(sine[5], expected, atol=1e-6)


def test_turned_stripes_are_mixed_by_area() -> None:
    """Against a raster of 32 x 32 points a pixel, which is off by a row of them where a border crosses it."""
    side, fine = 24, 32
    share = share_of_second(Stripes(periods=5, angle_deg=30, pixels=side))
    axis = (np.arange(side * fine) + 0.5) / (side * fine) - 0.5
    cycles = 2.5 + 5 * (axis * math.cos(math.radians(30)) + axis[:, None] * math.sin(math.radians(30)))
    many = (np.sin(2 * np.pi * cycles) < 0).reshape(side, fine, side, fine).mean((1, 3))
    np.testing.assert_allclose(share, many, atol=1 / fine)


@pytest.mark.parametrize(("angle_deg", "aspect"), [(5.0, 1.0), (-12.0, 1.6), (40.0, 1.0)])
def test_the_slanted_edge_lies_where_its_angle_puts_it(angle_deg: float, aspect: float) -> None:
    share = share_of_second(Edge(angle_deg=angle_deg, pixels=200), aspect)
    H, W = share.shape
    middle = (np.arange(H) + 0.5) - H / 2
    expected = W / 2 - middle * math.tan(math.radians(angle_deg))  # clockwise: the top leans right
    inside = (expected > 2) & (expected < W - 2)
    # All that is left of the edge is black: how much is not says where the edge is.
    np.testing.assert_allclose((1 - share).sum(1)[inside], expected[inside], atol=0.01)
    wrong = W / 2 - middle * math.tan(math.radians(angle_deg + 0.05))
    assert np.abs((1 - share).sum(1) - wrong)[inside].max() > 0.01


@pytest.mark.parametrize(("angle_deg", "black"), [(0, "left"), (90, "top"), (180, "right"), (-90, "bottom")])
def test_edges_turn_clockwise(angle_deg: float, black: str) -> None:
    share = share_of_second(Edge(angle_deg=angle_deg, pixels=16))
    where = {"left": share[:, :8], "right": share[:, 8:], "top": share[:8], "bottom": share[8:]}
    np.testing.assert_allclose(where[black], 0, atol=1e-6)
    assert share.mean() == pytest.approx(0.5, abs=1e-6)


@pytest.mark.parametrize(("spokes", "aspect"), [(1, 1.0), (7, 1.0), (36, 1.7), (72, 0.6)])
def test_a_star_is_half_and_half_and_has_its_spokes_all_round(spokes: int, aspect: float) -> None:
    share = share_of_second(Star(spokes=spokes, pixels=256), aspect)
    assert share.mean() == pytest.approx(0.5, abs=1e-6)
    H, W = share.shape
    turn = 2 * np.pi * np.arange(4096) / 4096
    radius = 0.45 * min(H, W)
    i = np.floor(H / 2 + radius * np.sin(turn)).astype(int)
    j = np.floor(W / 2 + radius * np.cos(turn)).astype(int)
    spectrum = np.abs(np.fft.rfft(share[i, j] - 0.5))
    assert np.argmax(spectrum) == spokes
    # A star that is not round would spread over neighbouring orders; a square wave has its 4 / pi,
    # less what pixels of up to 1.4 px blur: sinc(1.4 spokes / circumference) >= 0.7 for the finest.
    strength = 2 * spectrum[spokes] / turn.size / 0.5
    assert 0.7 * 4 / math.pi < strength < 1.01 * 4 / math.pi


def slope_of(plane: np.ndarray) -> float:
    """Of the logarithm of the amplitude spectrum over the logarithm of frequency, by rings."""
    H, W = plane.shape
    power = np.abs(np.fft.fft2(plane)) ** 2
    frequency = np.hypot(np.fft.fftfreq(H)[:, None], np.fft.fftfreq(W))
    number = np.digitize(frequency, np.geomspace(0.02, 0.45, 13))
    means = [(np.log(frequency[number == n]).mean(), power[number == n].mean()) for n in range(1, 13)]
    x, y = np.array(means).T
    return np.polyfit(x, np.log(y) / 2, 1)[0]


@pytest.mark.parametrize(("exponent", "aspect"), [(0.0, 1.0), (1.0, 2.0), (1.6, 1.0)])
def test_the_noises_spectrum_falls_by_its_exponent(exponent: float, aspect: float) -> None:
    def mean_slope(exponent: float) -> float:
        noises = (Noise(exponent=exponent, contrast=0.2, pixels=256, seed=seed) for seed in range(9))
        return float(np.mean([slope_of(paint(noise, aspect)[..., 0]) for noise in noises]))

    # The first ring holds some 20 independent modes of exponential power, so its half logarithm is
    # known to 0.5 / sqrt(20) = 0.1 and the slope over a factor of 22 to 0.03: to 0.01 from nine seeds.
    assert mean_slope(exponent) == pytest.approx(-exponent, abs=0.03)
    assert mean_slope(exponent + 0.1) != pytest.approx(-exponent, abs=0.03)


@pytest.mark.parametrize("chroma", [0.0, 0.4, 1.0])
def test_the_noise_has_its_mean_contrast_and_correlation(chroma: float) -> None:
    noise = Noise(colour=(0.5, 0.6, 0.4), contrast=0.3, chroma=chroma, exponent=0.5, pixels=256)
    painted = paint(noise, 1.0).astype(float)
    mean = painted.mean((0, 1))
    # Each channel is scaled to its mean and deviation; clipping 4 in 10 000 values takes what is left.
    np.testing.assert_allclose(mean, srgb_to_linear(np.array(noise.colour)), rtol=1e-3)
    np.testing.assert_allclose(painted.std((0, 1)) / mean, 0.3, rtol=2e-3)
    correlation = np.corrcoef(painted.reshape(-1, 3).T)[[0, 0, 1], [1, 2, 2]]
    # Of 65536 values with exponent 0.5: worth some 10 000 independent ones, so 0.01, three times.
    np.testing.assert_allclose(correlation, 1 - chroma, atol=0.03)


def test_noise_is_clipped_no_more_than_it_says() -> None:
    noise = Noise(colour=(0.6, 0.6, 0.6), contrast=0.42, exponent=0.3, pixels=512)
    painted = paint(noise, 1.0)
    assert ((painted == 0) | (painted == 1)).mean() < 0.011  # 1 %, and sampling
    with pytest.raises(InputError, match="puts more than 1% of the values outside"):
        Noise(colour=(0.6, 0.6, 0.6), contrast=0.44)
    assert Noise(colour=(0, 0, 0), contrast=0.4).contrast == 0.4  # nothing to clip in black


def test_the_seed_decides_the_noise_and_its_borders_meet() -> None:
    first, again, other = (paint(Noise(seed=seed, pixels=128), 2.0) for seed in (3, 3, 4))
    assert first.tobytes() == again.tobytes()
    assert np.abs(first - other).mean() > 0.01
    steps = np.abs(np.diff(first[..., 0], axis=1)).mean(), np.abs(np.diff(first[..., 0], axis=0)).mean()
    seams = np.abs(first[:, 0, 0] - first[:, -1, 0]).mean(), np.abs(first[0, :, 0] - first[-1, :, 0]).mean()
    np.testing.assert_allclose(seams, steps, rtol=0.5)  # 64 and 128 pixels; what does not tile is 3 x


def test_text_stands_upright_unmirrored_and_fills_its_card() -> None:
    ink = 1 - share_of_second(Text(text="L", pixels=128), 0.8)
    H, W = ink.shape
    i, j = np.nonzero(ink > 0.5)
    assert ink[:, : W // 2].sum() > 1.5 * ink[:, W // 2 :].sum()
    assert ink[H // 2 :].sum() > 1.5 * ink[: H // 2].sum()
    assert 0.85 * H < np.ptp(i) + 1 <= 0.92 * H  # nine tenths, and whole pixels
    assert abs(i.mean() - (H - 1) / 2) < 0.2 * H
    assert (j.min() + j.max()) / 2 == pytest.approx((W - 1) / 2, abs=1.5)
    assert ((ink > 0.1) & (ink < 0.9)).any()
    long = 1 - share_of_second(Text(text="The quick brown fox, 12 µm: Ångström!", pixels=512), 3.0)
    assert np.concatenate([long[0], long[-1], long[:, 0], long[:, -1]]).max() == 0
    assert np.ptp(np.nonzero(long.max(0) > 0.5)[0]) > 0.85 * 512


@pytest.mark.parametrize("aspect", [1e-4, 0.3, 7.0, 1e4])
@pytest.mark.parametrize(
    "texture",
    [
        Checks(rows=1024, columns=1, pixels=16, colours=(RED, GREY)),
        Stripes(periods=1024, angle_deg=89.999, pixels=48),
        Stripes(periods=1.5, angle_deg=1e-7, profile="sine", pixels=17, colours=(RED, GREY)),
        Star(spokes=360, pixels=33),
        Edge(angle_deg=-179.99, pixels=16, colours=(GREY, RED)),
        Text(text="\xc5 (12 \xb5m)!", pixels=40),
        Noise(exponent=4, contrast=0.42, colour=GREY, chroma=1, seed=2**63 - 1, pixels=31),
    ],
    ids=lambda texture: texture.type,
)
def test_every_texture_is_reflectance_on_every_aspect(texture: Texture, aspect: float) -> None:
    painted = paint(texture, aspect)
    longer, shorter = texture.pixels, max(1, round(texture.pixels * min(aspect, 1 / aspect)))
    assert painted.shape == ((shorter, longer, 3) if aspect > 1 else (longer, shorter, 3))
    assert painted.dtype == np.float32
    assert np.isfinite(painted).all()
    assert painted.min() >= 0
    assert painted.max() <= 1
    if not isinstance(texture, Noise):
        ends = np.sort(srgb_to_linear(np.array(texture.colours)), axis=0)
        assert (painted >= ends[0] - 1e-6).all()
        assert (painted <= ends[1] + 1e-6).all()
