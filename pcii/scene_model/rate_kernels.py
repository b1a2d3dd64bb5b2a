"""Compiled: how many photons surfaces send, predicted for each photon from all others around it.

Axes: S windows from narrow to wide, C colours, M cells of a surface (h w in a row), N photons. Sums over
windows end where a surface does. A window's prediction is shrunk towards that of the next wider one, as if
that had told of one more pixel.
"""

import math

import numpy as np

from pcii.base.compiled_loops import compiled, shared
from pcii.scene_model.ray_kernels import JUMP


@compiled
def ends_of(labels: np.ndarray, right: np.ndarray, down: np.ndarray) -> None:
    """Writes where (h, w) bool a surface ends to the right of a cell, and below it."""
    h, w = labels.shape
    for i in range(h):
        for j in range(w):
            right[i, j] = j + 1 < w and abs(labels[i, j] - labels[i, j + 1]) > JUMP
            down[i, j] = i + 1 < h and abs(labels[i, j] - labels[i + 1, j]) > JUMP


@compiled
def window_sums(
    values: np.ndarray, right: np.ndarray, down: np.ndarray, decay: float, sums: np.ndarray
) -> None:
    """Writes sums (h, w) of values times decay^distance along rows, then columns, until surfaces end."""
    h, w = values.shape
    factor = np.float32(decay)
    for i in range(h):
        carried = np.float32(0)
        for j in range(w):
            carried = values[i, j] + factor * carried
            sums[i, j] = carried
            if right[i, j]:
                carried = np.float32(0)
        carried = np.float32(0)
        for j in range(w - 1, -1, -1):
            sums[i, j] += factor * carried
            carried = values[i, j] + factor * carried
            if j > 0 and right[i, j - 1]:
                carried = np.float32(0)
    rows = sums.copy()
    for i in range(1, h):
        for j in range(w):
            if not down[i - 1, j]:
                sums[i, j] += factor * sums[i - 1, j]
    below = np.zeros(w, np.float32)
    for i in range(h - 2, -1, -1):
        for j in range(w):
            below[j] = np.float32(0) if down[i, j] else factor * (rows[i + 1, j] + below[j])
            sums[i, j] += below[j]


@compiled
def photons_of_cells(owner: np.ndarray, n: np.ndarray, colour: np.ndarray, photons: np.ndarray) -> None:
    """Adds n photons to those of their owner and colour, `photons` (2 M + 1, C)."""
    for event in range(owner.size):
        photons[owner[event], colour[event]] += n[event]


@shared(lambda owner, *_: len(owner))
def window_rates(
    first: int,
    last: int,
    owner: np.ndarray,
    colour: np.ndarray,
    begin: int,
    photons: np.ndarray,
    exposure: np.ndarray,
    mean: float,
    shares: np.ndarray,
    own: float,
    rates: np.ndarray,
) -> None:
    """Writes `rates` (N, S) in photons per px of the colour, of owners from `begin` on, less `own` photons.

    `photons` (S, C, M) and `exposure` (S, M) are sums over windows, `mean` and `shares` (C,) those of the
    film.
    """
    S, C, M = photons.shape
    for event in range(first, last):
        cell = owner[event] - begin
        if cell < 0 or cell >= M:
            continue
        rate, share = mean, shares[colour[event]]
        for s in range(S - 1, -1, -1):
            total = -own
            for c in range(C):
                total += photons[s, c, cell]
            same = max(photons[s, colour[event], cell] - own, 0.0)
            total = max(total, 0.0)
            share = (same + share) / (total + 1)
            rate = (total + rate) / (exposure[s, cell] + 1)
            rates[event, s] = rate * share


@compiled
def expected_photons(
    seen: np.ndarray, photons: np.ndarray, exposure: np.ndarray, mean: float, expected: np.ndarray
) -> None:
    """Writes how many photons cells seen by so many px (M,) send by each window, `expected` (S, M)."""
    S, C, M = photons.shape
    for cell in range(M):
        rate = mean
        for s in range(S - 1, -1, -1):
            total = 0.0
            for c in range(C):
                total += photons[s, c, cell]
            rate = (total + rate) / (exposure[s, cell] + 1)
            expected[s, cell] = seen[cell] * rate


@compiled
def add_log_likelihood_gain(
    owner: np.ndarray, n: np.ndarray, begin: int, rates: np.ndarray, gain: np.ndarray
) -> None:
    """Adds to `gain` (S - 1, M) the log-likelihood of photons by each window less that by the widest one."""
    narrower, M = gain.shape
    for event in range(owner.size):
        cell = owner[event] - begin
        if 0 <= cell < M:
            widest = math.log(rates[event, narrower])
            for s in range(narrower):
                gain[s, cell] += n[event] * (math.log(rates[event, s]) - widest)


@compiled
def window_shares(gain: np.ndarray, least: float, shares: np.ndarray) -> None:
    """Writes shares (S, M) of windows, in proportion to e^gain (S - 1, M); the widest has `least` or more."""
    narrower, M = gain.shape
    for cell in range(M):
        largest = max(0.0, gain[:, cell].max())
        shares[narrower, cell] = total = math.exp(-largest)
        for s in range(narrower):
            shares[s, cell] = math.exp(gain[s, cell] - largest)
            total += shares[s, cell]
        for s in range(narrower + 1):
            shares[s, cell] *= (1 - least) / total
        shares[narrower, cell] += least


@shared(lambda owner, *_: len(owner))
def mixed_rates(
    first: int,
    last: int,
    owner: np.ndarray,
    begin: int,
    rates: np.ndarray,
    shares: np.ndarray,
    mixed: np.ndarray,
) -> None:
    """Writes means (N,) of window rates (N, S) by the shares (S, M) of owners from `begin` on."""
    S, M = shares.shape
    for event in range(first, last):
        cell = owner[event] - begin
        if 0 <= cell < M:
            rate = 0.0
            for s in range(S):
                rate += shares[s, cell] * rates[event, s]
            mixed[event] = rate
