"""Exact means of sharp and smooth patterns over rectangular pixels."""

import numpy as np

NEGLIGIBLE_CYCLES = 1e-8
"""A wave that changes by less across a pixel is taken as constant that way; see `square_wave`."""


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
