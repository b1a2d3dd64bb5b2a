"""Compiled: sums of photons at coarser and coarser scales, interpolated between the centres of cells.

Axes: C colours, (H, W) cells.
"""

import numpy as np

from pcii.base.compiled_loops import helper

# Smoothing is by the binomial weights 1/4, 1/2, 1/4 along both axes, then linear between centres.
CENTRE, SIDE = 0.5, 0.25


@helper
def smoothed(values: np.ndarray) -> np.ndarray:
    """Each plane of (C, H, W) smoothed along both axes; zero beyond the borders."""
    C, H, W = values.shape
    centre, side = CENTRE, SIDE
    result = np.empty_like(values)
    across = np.empty((H, W))
    for c in range(C):
        for i in range(H):
            # Slices, so that the compiler sees that neighbours exist and takes several at a time.
            row, line = values[c, i], across[i]
            for j in range(line.size):
                line[j] = centre * row[j]
            before, after, later, earlier = row[:-1], row[1:], line[1:], line[:-1]
            for j in range(later.size):
                later[j] += side * before[j]
            for j in range(later.size):
                earlier[j] += side * after[j]
        for i in range(H):
            row, line = across[i], result[c, i]
            above, below = across[max(i - 1, 0)], across[min(i + 1, H - 1)]
            up, down = side if i > 0 else 0.0, side if i + 1 < H else 0.0
            for j in range(line.size):
                line[j] = centre * row[j] + up * above[j] + down * below[j]
    return result


@helper
def halved(values: np.ndarray) -> np.ndarray:
    """Sums over 2 x 2 of (C, H, W), sizes rounded up."""
    C, H, W = values.shape
    result = np.zeros((C, (H + 1) // 2, (W + 1) // 2))
    for c in range(C):
        for i in range(H):
            row, line = values[c, i], result[c, i // 2]
            for b in range(W // 2):
                line[b] = (line[b] + row[2 * b]) + row[2 * b + 1]
            if W % 2:
                line[W // 2] += row[W - 1]
    return result


@helper
def enclosing_centres(place: float, size: int) -> tuple[int, int, float, float]:
    """Indices of the two cells whose centres enclose a `place` (in cells), and weights between them.

    The weights are that of the second cell, and the one with which an event at `place` enters its own
    interpolated sum after smoothing. Beyond the outermost centres both cells are the same.
    """
    low = int(place + 0.5) - 1
    share = place - 0.5 - low
    if low < 0 or low + 1 >= size:
        low = min(max(low, 0), size - 1)
        return low, low, share, CENTRE
    nearer = max(share, 1 - share)
    return low, low + 1, share, CENTRE * nearer + SIDE * (1 - nearer)


@helper
def linear_at(
    values: np.ndarray, top: int, bottom: int, share_i: float, left: int, right: int, share_j: float
) -> float:
    """Bilinear interpolation of `values` (H, W) between the four centres of `enclosing_centres`."""
    upper = (1 - share_j) * values[top, left] + share_j * values[top, right]
    lower = (1 - share_j) * values[bottom, left] + share_j * values[bottom, right]
    return (1 - share_i) * upper + share_i * lower
