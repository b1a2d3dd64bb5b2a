"""Arguments and results of the compiled loops that predict photons; importing them needs no compiler.

Axes: N events, K rows and L columns of cameras, C colours, (H, W) cells of 4 x 4 pixels.
"""

from typing import NamedTuple

import numpy as np


class PlacedEvents(NamedTuple):
    """Pixels that counted photons, (N,) each, and the cell of one section that each falls into."""

    k: np.ndarray
    """Camera row, and `l` its column."""
    l: np.ndarray
    i: np.ndarray
    """Pixel row, and `j` its column."""
    j: np.ndarray
    colour: np.ndarray
    n: np.ndarray
    """Photons, float32."""
    weight: np.ndarray
    """Share of the event that predictions count, from 0 to 1, float32."""
    cell: np.ndarray
    """Flat index of the cell, int32; -1 outside the section (`cells_of_events`)."""


class PlaneView(NamedTuple):
    """A section at one plane: shifts of the views, size, colours, and the share of the views that counts."""

    row_shifts_px: np.ndarray
    """Whole shifts of the rows (K,) of cameras."""
    col_shifts_px: np.ndarray
    """Whole shifts of the columns (L,) of cameras."""
    height_px: int
    """Height of the film, and `width_px` its width."""
    width_px: int
    sites: np.ndarray
    """Pixels (C,) of each colour in a block."""
    share: np.ndarray
    """Share of the views covering each cell (H, W) that predictions count."""
    prior_samples: float
    """Weight of the next coarser scale's rate, in samples."""


class Scales(NamedTuple):
    """A section at S scales, smoothed, float64: each in the first rows and columns of its plane.

    Blocks are of 2 px at the finest scale, and twice as wide at each further one.
    """

    views: np.ndarray
    """Views that cover each block (S, 2 H, 2 W), and `photons` the photons there."""
    photons: np.ndarray
    colours: np.ndarray
    """Photons by colour (S', C, ...), of the S' coarsest scales."""
    by_row: np.ndarray
    """How many camera rows cover each row of the finest blocks (2 H,)."""
    by_col: np.ndarray
    """How many camera columns cover each column of the finest blocks (2 W,)."""
    mean_rate: float
    """Photons per block and view of the section as a whole."""


class Predicted(NamedTuple):
    """Rates that a section predicts, overwritten; float64, as a small share of many photons is many."""

    rate: np.ndarray
    """Photons per sample of each event's pixel (N,), estimated from all other events."""
    base: np.ndarray
    """`rate` by the widest window alone."""
    samples: np.ndarray
    """Views that cover each cell (H, W), summed over its blocks."""
    mean: np.ndarray
    """Photons per block and view of each cell (H, W)."""
    blurred: np.ndarray
    """`mean` by the widest window alone."""
