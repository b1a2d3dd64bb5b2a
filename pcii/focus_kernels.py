"""Compiled loops of the likelihood method: evidence of focus, its windows, labels and outlines.

Axes: Z planes or labels, C colours, (H, W) cells of 4 x 4 pixels unless said otherwise, N events.
"""

import math

import numba as nb
import numpy as np

from pcii.kernels import compiled, helper

BLOCK_PX = 2
"""Voxels of 2 x 2 pixels: whatever the shifts, each block is covered equally by each Bayer colour.

Single pixels are not. At depths where all shifts are even a colour falls on every fourth voxel only, where
photons have four times as many partners, and textured patches would be drawn to such depths.
"""
CELL_PX = 4
"""Evidence is kept on cells of 4 x 4 pixels: windows are larger."""
SCALES = 5
"""Rates are smoothed over 2, 4, 8, 16 and 32 px and their mean taken: texture may be of any scale."""
COLOUR_SCALE = 3
"""What is finer than 16 px is estimated from all colours together, and shared out as they are around it."""
COLOUR_PRIOR = 0.3
"""Photons that are thought to be of each colour in proportion to its sites: one photon tells no colour."""
BASE_SCALE = 4
"""What a plane that shows nothing of its own would predict: the rate smoothed over 32 px."""
BASE_SHARE = 0.05
"""Least share of the base in a prediction, so that a single photon in the dark cannot decide."""

# Smoothing is by the binomial weights 1/4, 1/2, 1/4 along both axes, then linear between centres.
CENTRE, SIDE = 0.5, 0.25


@helper
def _smoothed(values: np.ndarray) -> np.ndarray:
    """Each plane of (C, H, W) smoothed by binomial weights; nothing comes in across borders."""
    C, H, W = values.shape
    across = np.zeros_like(values)
    for c in range(C):
        for i in range(H):
            for j in range(W):
                total = CENTRE * values[c, i, j]
                if j > 0:
                    total += SIDE * values[c, i, j - 1]
                if j + 1 < W:
                    total += SIDE * values[c, i, j + 1]
                across[c, i, j] = total
    result = np.zeros_like(values)
    for c in range(C):
        for i in range(H):
            for j in range(W):
                total = CENTRE * across[c, i, j]
                if i > 0:
                    total += SIDE * across[c, i - 1, j]
                if i + 1 < H:
                    total += SIDE * across[c, i + 1, j]
                result[c, i, j] = total
    return result


@helper
def _halved(values: np.ndarray) -> np.ndarray:
    """Sums over 2 x 2 of (C, H, W), sizes rounded up."""
    C, H, W = values.shape
    result = np.zeros((C, (H + 1) // 2, (W + 1) // 2), np.float32)
    for c in range(C):
        for i in range(H):
            for j in range(W):
                result[c, i // 2, j // 2] += values[c, i, j]
    return result


@helper
def _between(place: float, size: int) -> tuple[int, float, float]:
    """Cell centre below a place (in cells), the share of the next, and what an event there gives itself."""
    low = math.floor(place - 0.5)
    share = place - 0.5 - low
    if low < 0 or low + 1 >= size:  # beside the frame both centres are the same
        return low, share, CENTRE
    own = CENTRE * (1 - share) + SIDE * share if share < 0.5 else CENTRE * share + SIDE * (1 - share)
    return low, share, own


@helper
def _at(values: np.ndarray, c: int, low_i: int, share_i: float, low_j: int, share_j: float) -> float:
    """Linear between the four centres around a place; borders continue."""
    _, H, W = values.shape
    top, bottom = min(max(low_i, 0), H - 1), min(max(low_i + 1, 0), H - 1)
    left, right = min(max(low_j, 0), W - 1), min(max(low_j + 1, 0), W - 1)
    upper = (1 - share_j) * values[c, top, left] + share_j * values[c, top, right]
    lower = (1 - share_j) * values[c, bottom, left] + share_j * values[c, bottom, right]
    return (1 - share_i) * upper + share_i * lower


@helper
def _whole_blocks(shift: int, size: int) -> tuple[int, int]:
    """First and last row (or column) + 1 of the blocks that a shifted view covers as a whole.

    Blocks that it covers in part are left out: there it would bring more of one colour than of another.
    """
    first, last = max(0, shift), min(size, size + shift)
    return first + first % BLOCK_PX, last - last % BLOCK_PX


@helper
def _views_of_blocks(shifts: np.ndarray, size: int, blocks: int) -> np.ndarray:
    """How many camera rows (or columns) see each block row (or column), (blocks,)."""
    seen = np.zeros(blocks, np.float32)
    for camera in range(shifts.size):
        first, last = _whole_blocks(int(shifts[camera]), size)
        for place in range(first, last):
            seen[place // BLOCK_PX] += 1.0 / BLOCK_PX
    return seen


@helper
def _plane(
    k: np.ndarray,
    l: np.ndarray,
    i: np.ndarray,
    j: np.ndarray,
    colour: np.ndarray,
    n: np.ndarray,
    rows: np.ndarray,
    cols: np.ndarray,
    size: tuple[int, int],
    sites: np.ndarray,
    gain: np.ndarray,
    photons: np.ndarray,
    predicted: np.ndarray,
    cell: np.ndarray,
    expected: np.ndarray,
) -> None:
    """One plane of `focus_planes`."""
    H, W = size
    h, w = gain.shape
    C = sites.size
    share_of_site = sites / sites.sum()
    own_cells = np.empty(k.size, np.int32)
    counts = np.zeros((C, 2 * h, 2 * w), np.float32)
    for e in range(k.size):
        row, col = i[e] + rows[k[e]], j[e] + cols[l[e]]
        top, bottom = _whole_blocks(int(rows[k[e]]), H)
        left, right = _whole_blocks(int(cols[l[e]]), W)
        if top <= row < bottom and left <= col < right:
            counts[colour[e], row // BLOCK_PX, col // BLOCK_PX] += n[e]
            own_cells[e] = (row // CELL_PX) * w + col // CELL_PX
        else:
            own_cells[e] = -1
    by_row = _views_of_blocks(rows, H, 2 * h)
    by_col = _views_of_blocks(cols, W, 2 * w)
    views = np.empty((1, 2 * h, 2 * w), np.float32)
    for a in range(2 * h):
        for b in range(2 * w):
            views[0, a, b] = by_row[a] * by_col[b]
    totals = np.zeros((1, 2 * h, 2 * w), np.float32)
    for c in range(C):
        totals[0] += counts[c]
    seen = [_smoothed(views)]
    light = [_smoothed(totals)]
    coloured = [counts[:, :1, :1].copy()]  # finer than the colour scale no colour is smoothed on its own
    for scale in range(1, SCALES):
        counts, totals, views = _halved(counts), _halved(totals), _halved(views)
        seen.append(_smoothed(views))
        light.append(_smoothed(totals))
        coloured.append(_smoothed(counts) if scale >= COLOUR_SCALE else counts[:, :1, :1].copy())

    for e in range(k.size):
        if own_cells[e] < 0:
            continue
        c = colour[e]
        row, col = i[e] + rows[k[e]] + 0.5, j[e] + cols[l[e]] + 0.5
        share = 1.0
        mean = 0.0
        base = 0.0
        for reverse in range(SCALES):
            scale = SCALES - 1 - reverse
            if scale == 0:  # a block is its own best estimate: nothing between centres
                low_i, share_i, own_i = int(row) // BLOCK_PX, 0.0, CENTRE
                low_j, share_j, own_j = int(col) // BLOCK_PX, 0.0, CENTRE
            else:
                width = float(BLOCK_PX << scale)
                low_i, share_i, own_i = _between(row / width, light[scale].shape[1])
                low_j, share_j, own_j = _between(col / width, light[scale].shape[2])
            samples = _at(seen[scale], 0, low_i, share_i, low_j, share_j) * sites[c]
            others = max(_at(light[scale], 0, low_i, share_i, low_j, share_j) - own_i * own_j, 0.0)
            if scale >= COLOUR_SCALE:
                same = max(_at(coloured[scale], c, low_i, share_i, low_j, share_j) - own_i * own_j, 0.0)
                share = (same + COLOUR_PRIOR * share_of_site[c]) / (others + COLOUR_PRIOR)
            rate = others * share / max(samples, 1e-6)
            mean += rate / SCALES
            if scale == BASE_SCALE:
                base = max(rate, 1e-12)
        rate = (1 - BASE_SHARE) * mean + BASE_SHARE * base
        a, b = own_cells[e] // w, own_cells[e] % w
        gain[a, b] += n[e] * math.log(rate / base)
        photons[c, a, b] += n[e]
        if predicted.size:
            predicted[e] = rate
    if cell.size:
        cell[:] = own_cells

    for a in range(h):
        for b in range(w):
            samples = 0.0
            mean = 0.0
            base = 0.0
            for u in range(2):
                for v in range(2):
                    views_here = by_row[2 * a + u] * by_col[2 * b + v]
                    samples += views_here
                    if views_here > 0:
                        block = light[0][0, 2 * a + u, 2 * b + v] / seen[0][0, 2 * a + u, 2 * b + v]
                        mean += block / (4 * SCALES)
            if samples <= 0:
                continue
            for scale in range(1, SCALES):
                width = float(BLOCK_PX << scale)
                low_i, share_i, _ = _between((a + 0.5) * CELL_PX / width, light[scale].shape[1])
                low_j, share_j, _ = _between((b + 0.5) * CELL_PX / width, light[scale].shape[2])
                there = _at(seen[scale], 0, low_i, share_i, low_j, share_j)
                rate = _at(light[scale], 0, low_i, share_i, low_j, share_j) / max(there, 1e-6)
                mean += rate / SCALES
                if scale == BASE_SCALE:
                    base = rate
            gain[a, b] -= samples * (1 - BASE_SHARE) * (mean - base)
            if expected.size:
                expected[a, b] = samples * ((1 - BASE_SHARE) * mean + BASE_SHARE * base)


@compiled
def focus_planes(
    k: np.ndarray,
    l: np.ndarray,
    i: np.ndarray,
    j: np.ndarray,
    colour: np.ndarray,
    n: np.ndarray,
    rows: np.ndarray,
    cols: np.ndarray,
    size: tuple[int, int],
    sites: np.ndarray,
    gain: np.ndarray,
    photons: np.ndarray,
    predicted: np.ndarray,
    cell: np.ndarray,
    expected: np.ndarray,
) -> None:
    """What each plane predicts better than a blurred picture would: all outputs from zeros.

    Events (N,) with their `colour` and number `n`; whole shifts `rows` (Z, K) and `cols` (Z, L); `size` of
    the film in px; `sites` (C,) of each colour in a block. `gain` (Z, H, W) and `photons` (Z, C, H, W) by
    cell. If they are not empty: `predicted` (Z, N), the rate of each event's pixel by all other events; its
    `cell` (Z, N), -1 outside; `expected` (Z, H, W) photons in each cell.
    """
    for plane in nb.prange(rows.shape[0]):
        _plane(
            k, l, i, j, colour, n, rows[plane], cols[plane], size, sites, gain[plane], photons[plane],
            predicted[plane], cell[plane], expected[plane],
        )  # fmt: skip


@helper
def _recursive_mean(values: np.ndarray, left: np.ndarray, up: np.ndarray) -> None:
    """Exponential means along rows, then columns, there and back; weights (H, W) to the cell before."""
    H, W = values.shape
    for i in range(H):
        for j in range(1, W):
            values[i, j] += left[i, j] * (values[i, j - 1] - values[i, j])
        for j in range(W - 2, -1, -1):
            values[i, j] += left[i, j + 1] * (values[i, j + 1] - values[i, j])
    for i in range(1, H):
        for j in range(W):
            values[i, j] += up[i, j] * (values[i - 1, j] - values[i, j])
    for i in range(H - 2, -1, -1):
        for j in range(W):
            values[i, j] += up[i + 1, j] * (values[i + 1, j] - values[i, j])


@compiled
def windows_within_edges(
    near: np.ndarray,
    picture: np.ndarray,
    noise: float,
    stiffness: float,
    scales: np.ndarray,
    weights: np.ndarray,
    result: np.ndarray,
) -> None:
    """`near` (Z, H, W) plus its weighted means over wide windows that stop at edges: `result`, overwritten.

    `picture` (Z, C, H, W) is what each plane shows; a step in it of more than `noise` lengthens the way to
    the next cell, by `stiffness` for twice the noise. Domain transform of Gastal and Oliveira 2011.
    """
    Z, H, W = near.shape
    for z in nb.prange(Z):
        way = np.ones((2, H, W), np.float32)
        for i in range(H):
            for j in range(W):
                across = 0.0
                down = 0.0
                for c in range(picture.shape[1]):
                    if j > 0:
                        across += (picture[z, c, i, j] - picture[z, c, i, j - 1]) ** 2
                    if i > 0:
                        down += (picture[z, c, i, j] - picture[z, c, i - 1, j]) ** 2
                way[0, i, j] += stiffness * max(math.sqrt(across) / noise - 1, 0.0) ** 2
                way[1, i, j] += stiffness * max(math.sqrt(down) / noise - 1, 0.0) ** 2
        left = np.empty((H, W), np.float32)
        up = np.empty((H, W), np.float32)
        result[z] = near[z]
        for scale in range(scales.size):
            mean = near[z].copy()
            for turn in range(2):
                length = scales[scale] * math.sqrt(3.0) * 2.0 ** (1 - turn) / math.sqrt(15.0)
                for i in range(H):
                    for j in range(W):
                        left[i, j] = math.exp(-math.sqrt(2.0) / length * way[0, i, j])
                        up[i, j] = math.exp(-math.sqrt(2.0) / length * way[1, i, j])
                _recursive_mean(mean, left, up)
            for i in range(H):
                for j in range(W):
                    result[z, i, j] += weights[scale] * mean[i, j]


@helper
def _passed_on(message: np.ndarray, steps: np.ndarray, jump: float) -> None:
    """The least cost of each label given the neighbour's costs: some per step, at most `jump`."""
    top = message.min() + jump
    low = message.min()
    for z in range(1, message.size):
        message[z] = min(message[z], message[z - 1] + steps[z - 1])
    for z in range(message.size - 2, -1, -1):
        message[z] = min(message[z], message[z + 1] + steps[z])
    for z in range(message.size):
        message[z] = min(message[z], top) - low


@compiled
def pass_messages(
    cost: np.ndarray, messages: np.ndarray, direction: int, steps: np.ndarray, jump: float
) -> None:
    """One sweep of belief propagation: costs (H, W, Z), messages (4, H, W, Z) from left, right, above, below.

    The way to the next label costs `steps` (Z - 1,), and at most `jump`. Lines are independent.
    """
    H, W, Z = cost.shape
    sideways = direction < 2
    opposite = direction + 1 if direction % 2 == 0 else direction - 1
    for number in nb.prange(H if sideways else W):
        line = np.int64(number)
        length = W if sideways else H
        message = np.zeros(Z, np.float32)
        for step in range(length):
            at = step if direction % 2 == 0 else length - 1 - step
            i, j = (line, at) if sideways else (at, line)
            for z in range(Z):
                messages[direction, i, j, z] = message[z]
            for z in range(Z):
                total = cost[i, j, z]
                for other in range(4):
                    if other != opposite:
                        total += messages[other, i, j, z]
                message[z] = total
            _passed_on(message, steps, jump)


@compiled
def views_of_planes(
    expected: np.ndarray, rows: np.ndarray, cols: np.ndarray, weight: float, views: np.ndarray
) -> None:
    """What the planes (Z, H, W) together send to cameras, on cells: adds `weight` times to `views` (V, H, W).

    `rows` (Z, A) and `cols` (Z, B) are shifts of A x B = V cameras in whole cells.
    """
    Z, H, W = expected.shape
    across = cols.shape[1]
    for view in nb.prange(views.shape[0]):
        v = np.int64(view)
        for z in range(Z):
            down, right = rows[z, v // across], cols[z, v % across]
            for i in range(max(0, down), min(H, H + down)):
                for j in range(max(0, right), min(W, W + right)):
                    views[v, i - down, j - right] += weight * expected[z, i, j]


@compiled
def duel_planes(
    views: np.ndarray,
    expected: np.ndarray,
    rows: np.ndarray,
    cols: np.ndarray,
    predicted: np.ndarray,
    cell: np.ndarray,
    together: np.ndarray,
    n: np.ndarray,
    result: np.ndarray,
) -> None:
    """Log-likelihood that each plane gains over all of them together, by cell: `result` (Z, H, W) from zeros.

    `together` (N,) is the rate that the planes predict for each event together, `views` (V, H, W) for all.
    """
    Z, H, W = expected.shape
    across = cols.shape[1]
    for plane in nb.prange(Z):
        z = np.int64(plane)
        total = np.zeros((H, W), np.float32)
        number = np.zeros((H, W), np.float32)
        for v in range(views.shape[0]):
            down, right = rows[z, v // across], cols[z, v % across]
            for i in range(max(0, down), min(H, H + down)):
                for j in range(max(0, right), min(W, W + right)):
                    total[i, j] += views[v, i - down, j - right]
                    number[i, j] += 1
        for i in range(H):
            for j in range(W):
                if number[i, j] > 0:
                    result[z, i, j] = total[i, j] / number[i, j] - expected[z, i, j]
        for e in range(cell.shape[1]):
            at = cell[z, e]
            if at >= 0:
                result[z, at // W, at % W] += n[e] * math.log(predicted[z, e] / together[e])


@helper
def least_outline(gain: np.ndarray, length_cost: float, iterations: int, inside: np.ndarray) -> None:
    """The mask that gains most, less `length_cost` per px of its outline: relaxed to [0, 1] in `inside`.

    Minimises length_cost TV(u) - sum gain u over 0 <= u <= 1 for a picture (H, W) by the primal-dual steps
    of Chambolle and Pock 2011; thresholding u anywhere gives a best mask (Chan, Esedoglu and Nikolova 2006).
    """
    H, W = gain.shape
    ahead = np.empty((H, W), np.float32)
    across = np.zeros((H, W), np.float32)
    down = np.zeros((H, W), np.float32)
    step = 0.35  # 8 step^2 < 1
    for i in range(H):
        for j in range(W):
            inside[i, j] = 1.0 if gain[i, j] > 0 else 0.0
            ahead[i, j] = inside[i, j]
    for _ in range(iterations):
        for i in range(H):
            for j in range(W):
                x = across[i, j] + (step * (ahead[i, j + 1] - ahead[i, j]) if j + 1 < W else 0.0)
                y = down[i, j] + (step * (ahead[i + 1, j] - ahead[i, j]) if i + 1 < H else 0.0)
                size = max(1.0, math.sqrt(x * x + y * y) / length_cost)
                across[i, j] = x / size
                down[i, j] = y / size
        for i in range(H):
            for j in range(W):
                flow = across[i, j] + down[i, j]
                if j > 0:
                    flow -= across[i, j - 1]
                if i > 0:
                    flow -= down[i - 1, j]
                new = min(max(inside[i, j] + step * (flow + gain[i, j]), 0.0), 1.0)
                ahead[i, j] = 2 * new - inside[i, j]
                inside[i, j] = new
