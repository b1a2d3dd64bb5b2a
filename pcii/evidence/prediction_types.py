"""What the compiled loops that predict photons take and give, without the compiler.

Axes: N events, K rows and L columns of cameras, C colours, (H, W) cells of 4 x 4 pixels.
"""

from typing import NamedTuple

import numpy as np


class PlacedEvents(NamedTuple):
    """Pixels that caught photons, (N,) each, and where they fall in one section."""

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
    """From 0 to 1, how far the event is believed, float32."""
    cell: np.ndarray
    """Flat index of the cell that the event falls into, int32; -1 outside (`cells_of_events`)."""


class PlaneView(NamedTuple):
    """A section at one plane, and what is believed there."""

    row_shifts_px: np.ndarray
    """Whole shifts of the rows (K,) of cameras."""
    col_shifts_px: np.ndarray
    """Whole shifts of the columns (L,) of cameras."""
    height_px: int
    """Height of the film, and `width_px` its width."""
    width_px: int
    sites: np.ndarray
    """Sites (C,) of each colour in a block."""
    share: np.ndarray
    """Of the views that cover a cell (H, W) the share that is believed."""
    prior_samples: float
    """How many samples a coarser scale is worth."""


class Predicted(NamedTuple):
    """What a section predicts, overwritten, in double precision: of many photons a small share is many."""

    rate: np.ndarray
    """Photons per sample of the pixel of each event (N,), by all other events."""
    base: np.ndarray
    """The same by the widest window alone."""
    samples: np.ndarray
    """Of each cell (H, W) the views of all its blocks."""
    mean: np.ndarray
    """Photons per block and view of each cell (H, W)."""
    blurred: np.ndarray
    """The same by the widest window alone."""
