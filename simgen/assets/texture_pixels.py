"""Patterns as pixels: linear reflectance, with every border antialiased by area in linear light."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pcii.base import srgb_to_linear
from simgen.spec import Checks, Edge, Noise, Star, Stripes, Text, Texture

NEGLIGIBLE_CYCLES = 1e-8
"""A wave that changes by less across a pixel is taken as constant that way; see `square_wave`."""
BAND_ROWS = 256
"""Rows that are painted at once, to bound memory."""
SUBPIXELS = 8
"""Subpixels per side where a pixel of a star may hold several borders."""
TEXT_SHARE = 0.9
"""Share of the width or height that text fills."""


def half_plane(distance: np.ndarray, span_x: np.ndarray | float, span_y: np.ndarray | float) -> np.ndarray:
    """Share of each pixel that lies beyond a straight line, in [0, 1], float64.

    `distance` is that of the pixel's centre from the line, positive beyond it; the spans are the
    pixel's width and height times the absolute components of the line's unit normal.
    """
    long, short = np.maximum(span_x, span_y), np.minimum(span_x, span_y)
    # How deep the line has cut into the pixel from its nearest corner, along the normal. The part
    # cut off is a triangle until the line reaches the next corner, then a trapezium.
    depth = np.maximum((long + short) / 2 - np.abs(distance), 0)
    triangle = depth**2 / (2 * long * np.maximum(short, np.finfo(float).tiny))
    cut = np.where(depth < short, triangle, (depth - short / 2) / long)
    return np.where(distance > 0, 1 - cut, cut)


def square_wave(cycles: np.ndarray, span_x: float, span_y: float) -> np.ndarray:
    """Mean over each pixel of the wave that is +1 in the first half of each cycle and -1 in the second.

    `cycles` at the pixel's centre; the spans say how many cycles a pixel is wide and high. The mean
    is a second difference of the wave's second integral: right to 2e-5 at 4096 pixels per cycle,
    where rounding and what `NEGLIGIBLE_CYCLES` neglects are at their worst, and far better else.
    """
    long, short = max(span_x, span_y), min(span_x, span_y)
    outer, inner = (long + short) / 2, (long - short) / 2
    if short < NEGLIGIBLE_CYCLES:
        mean = (_integral(cycles + outer) - _integral(cycles - outer)) / long
    else:
        rise = _second_integral(cycles + outer) - _second_integral(cycles + inner)
        fall = _second_integral(cycles - inner) - _second_integral(cycles - outer)
        mean = (rise - fall) / (long * short)
    return np.clip(mean, -1, 1)  # past which rounding may carry it


def sine_wave(cycles: np.ndarray, span_x: float, span_y: float) -> np.ndarray:
    """Mean over each pixel of sin(2 pi cycles); arguments as for `square_wave`."""
    return np.sin(2 * np.pi * cycles) * np.sinc(span_x) * np.sinc(span_y)


def _integral(cycles: np.ndarray) -> np.ndarray:
    return 0.25 - np.abs(cycles - np.floor(cycles) - 0.5)


def _second_integral(cycles: np.ndarray) -> np.ndarray:
    phase = cycles - np.floor(cycles)
    half = np.where(phase < 0.5, phase, phase - 0.5)
    parabola = half * (half / 2 - 0.25)
    return np.where(phase < 0.5, parabola, -parabola)


class _Canvas(NamedTuple):
    """Where the centres of columns (1, W) and rows (H, 1) lie, and width and height of a pixel.

    The longer side has length 1, the centre is (0, 0), Y runs down.
    """

    shape: tuple[int, int]
    width: float
    x: np.ndarray
    y: np.ndarray
    pixel: tuple[float, float]


def paint(texture: Texture, width_over_height: float) -> np.ndarray:
    """Linear reflectance (H, W, 3), float32 in [0, 1], of a surface of this aspect.

    Row 0 is at the top and column 0 at the left for who looks at the front. The longer side has
    `texture.pixels` pixels.
    """
    width, height = min(width_over_height, 1.0), min(1 / width_over_height, 1.0)
    columns, rows = (max(1, round(side * texture.pixels)) for side in (width, height))
    x, y = (((np.arange(n) + 0.5) / n - 0.5) * side for n, side in ((columns, width), (rows, height)))
    canvas = _Canvas((rows, columns), width, x[None], y[:, None], (width / columns, height / rows))
    if isinstance(texture, Noise):
        return _noise(texture, canvas)
    shares_of = {Checks: _checks, Stripes: _stripes, Star: _star, Edge: _edge, Text: _text}
    share = shares_of[type(texture)](texture, canvas)[..., None].astype(np.float32)
    first, second = srgb_to_linear(np.array(texture.colours)).astype(np.float32)
    return share * first + (1 - share) * second


def _by_bands(canvas: _Canvas, share: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> np.ndarray:
    """Shares (H, W) float32 by a function of x (1, W) and y (h, 1) that is called for a band of rows."""
    starts = range(0, canvas.y.size, BAND_ROWS)
    bands = (share(canvas.x, canvas.y[start : start + BAND_ROWS]) for start in starts)
    return np.concatenate([band.astype(np.float32) for band in bands])


def _checks(texture: Checks, canvas: _Canvas) -> np.ndarray:
    # A chessboard is the product of two square waves, and so is its mean over a pixel.
    down, across = (
        square_wave((np.arange(count) + 0.5) * cells / (2 * count), cells / (2 * count), 0.0)
        for count, cells in zip(canvas.shape, (texture.rows, texture.columns), strict=True)
    )
    return (1 + down[:, None] * across) / 2


def _stripes(texture: Stripes, canvas: _Canvas) -> np.ndarray:
    angle = math.radians(texture.angle_deg)
    cycles_x = math.cos(angle) * texture.periods / canvas.width
    cycles_y = math.sin(angle) * texture.periods / canvas.width
    spans = abs(cycles_x) * canvas.pixel[0], abs(cycles_y) * canvas.pixel[1]
    wave, half = square_wave if texture.profile == "square" else sine_wave, texture.periods / 2
    return _by_bands(canvas, lambda x, y: (1 + wave(half + cycles_x * x + cycles_y * y, *spans)) / 2)


def _edge(texture: Edge, canvas: _Canvas) -> np.ndarray:
    angle = math.radians(texture.angle_deg)
    normal_x, normal_y = -math.cos(angle), -math.sin(angle)  # to the left, where the first colour is
    spans = abs(normal_x) * canvas.pixel[0], abs(normal_y) * canvas.pixel[1]
    return _by_bands(canvas, lambda x, y: half_plane(normal_x * x + normal_y * y, *spans))


def _star(texture: Star, canvas: _Canvas) -> np.ndarray:
    """Share of the first colour, exact where no more than one border can cross a pixel."""
    spokes, (width, height) = texture.spokes, canvas.pixel
    crowded_within = math.hypot(width, height) / (2 * math.sin(math.pi / (2 * spokes)))
    inside = (np.arange(SUBPIXELS) + 0.5) / SUBPIXELS - 0.5

    def share_of_band(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        x, y = np.broadcast_arrays(x, y)
        share = _nearest_border(x, y, canvas.pixel, spokes)
        crowded = np.hypot(x, y) < crowded_within
        sub_x = x[crowded][:, None, None] + inside[:, None] * width
        sub_y = y[crowded][:, None, None] + inside * height
        finer = width / SUBPIXELS, height / SUBPIXELS
        share[crowded] = _nearest_border(sub_x, sub_y, finer, spokes).mean(axis=(1, 2))
        return share

    return _by_bands(canvas, share_of_band)


def _nearest_border(x: np.ndarray, y: np.ndarray, pixel: tuple[float, float], spokes: int) -> np.ndarray:
    """Share where sin(spokes x angle) > 0, as if the nearest border were the only one."""
    angle = np.arctan2(y, x)
    number = np.rint(angle * (spokes / math.pi))
    border = number * (math.pi / spokes)
    distance = np.hypot(x, y) * np.sin(angle - border)
    beyond = half_plane(distance, np.abs(np.sin(border)) * pixel[0], np.abs(np.cos(border)) * pixel[1])
    return np.where(number % 2 == 0, beyond, 1 - beyond)


def _text(texture: Text, canvas: _Canvas) -> np.ndarray:
    import matplotlib as mpl
    from PIL import Image, ImageDraw, ImageFont

    file = Path(mpl.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"  # the same on every machine

    def ink(size: float) -> Image.Image:
        """A picture of the text as tight as its ink, 8 bits of coverage."""
        font = ImageFont.truetype(str(file), size, layout_engine=ImageFont.Layout.BASIC)
        left, top, right, bottom = font.getbbox(texture.text)
        line = Image.new("L", (max(1, int(right - left)), max(1, int(bottom - top))))
        ImageDraw.Draw(line).text((-left, -top), texture.text, fill=255, font=font)
        return line.crop(line.getbbox())

    (rows, columns), size, letters = canvas.shape, 256.0, ink(256.0)
    for _ in range(2):  # again, since letters keep whole pixels apart
        size = max(1.0, size * TEXT_SHARE * min(columns / letters.width, rows / letters.height))
        letters = ink(size)
    page = Image.new("L", (columns, rows))
    page.paste(letters, ((columns - letters.width) // 2, (rows - letters.height) // 2))
    # FreeType's grey levels are the covered area, so they are shares of linear light as they are.
    return np.asarray(page) / 255


def _noise(texture: Noise, canvas: _Canvas) -> np.ndarray:
    # SciPy's transforms stay in single precision, which takes half the time.
    from scipy.fft import irfft2, rfft2

    generator, (rows, columns) = np.random.default_rng(texture.seed), canvas.shape
    across, down = np.fft.rfftfreq(columns, canvas.pixel[0]), np.fft.fftfreq(rows, canvas.pixel[1])
    squared = (down**2)[:, None] + across**2
    squared[0, 0] = 1.0
    amplitude = squared.astype(np.float32) ** np.float32(-texture.exponent / 2)
    amplitude[0, 0] = 0.0  # the mean

    def noise() -> np.ndarray:
        """Normal noise (H, W), float32, periodic, of this spectrum, with mean 0 and deviation 1."""
        white = generator.standard_normal(canvas.shape).astype(np.float32)
        values = np.asarray(irfft2(np.asarray(rfft2(white)) * amplitude, canvas.shape))
        return values / values.std(dtype=np.float64).astype(np.float32)

    shared, channels = noise(), []
    for mean in srgb_to_linear(np.array(texture.colour)).tolist():
        mixed = shared
        if texture.chroma > 0:
            mixed = math.sqrt(1 - texture.chroma) * shared + math.sqrt(texture.chroma) * noise()
            mixed /= mixed.std()
        channels.append(np.clip(mean * (1 + texture.contrast * mixed), 0, 1).astype(np.float32))
    return np.stack(channels, axis=-1)
