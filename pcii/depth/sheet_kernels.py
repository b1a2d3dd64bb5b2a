"""Compiled: where rays meet sheets, what photons and cameras see of them, and textures.

A ray is the place (u, v) of a photon on the film of the virtual centre, in blocks, and by how much it moves
with each px of total disparity (a, b). Notation: N rays, L sheets and behind them, as number L, the light
without depth; n = h w blocks, Q colours. Of sheets from near to far, one is reached by a ray with the
probability t that no nearer one is there; m are masks and T textures, in photons per sample.
"""

import numpy as np

from pcii.base import compiled, helper, shared

LEAST_LEFT = np.float32(0.05)
"""Share of a texture that is left of it without the photon that it is to predict."""


@helper
def _block_at(total_px: np.ndarray, u: float, v: float, a: float, b: float) -> int:
    """The block of a sheet (h, w) that a ray meets, by two steps to its own depth; -1 beyond the film."""
    h, w = total_px.shape
    i, j = min(max(int(u), 0), h - 1), min(max(int(v), 0), w - 1)
    for _ in range(2):
        depth = total_px[i, j]
        i, j = min(max(int(u + a * depth), 0), h - 1), min(max(int(v + b * depth), 0), w - 1)
    x, y = u + a * total_px[i, j], v + b * total_px[i, j]
    return int(x) * w + int(y) if 0 <= x < h and 0 <= y < w else -1


@shared(lambda blocks, *_: len(blocks))
def meet_sheets(
    first: int,
    last: int,
    blocks: np.ndarray,
    order: np.ndarray,
    total_px: np.ndarray,
    rays: tuple[np.ndarray, ...],
) -> None:
    """Fill the `blocks` (N, L + 1) int32 that rays meet, -1 where none, and the sheets met from near to far,
    `order` (N, L + 1) int8, which ends with L.

    The light without depth is met where the ray comes from, or at the nearest block of the film.
    """
    u, v, a, b = rays
    L, h, w = total_px.shape
    depth = np.empty(L, np.float32)
    for ray in range(first, last):
        met = 0
        for sheet in range(L):
            block = _block_at(total_px[sheet], u[ray], v[ray], a[ray], b[ray])
            blocks[ray, sheet] = block
            if block < 0:
                continue
            depth[sheet] = total_px[sheet, block // w, block % w]
            place = met
            while place > 0 and depth[order[ray, place - 1]] < depth[sheet]:
                order[ray, place] = order[ray, place - 1]
                place -= 1
            order[ray, place] = sheet
            met += 1
        order[ray, met] = L
        i, j = min(max(int(u[ray]), 0), h - 1), min(max(int(v[ray]), 0), w - 1)
        blocks[ray, L] = i * w + j


@shared(lambda blocks, *_: len(blocks))
def reach_sheets(
    first: int, last: int, blocks: np.ndarray, order: np.ndarray, m: np.ndarray, reach: np.ndarray
) -> None:
    """Fill `reach` (N, L + 1) float32, the t of sheets that are met and of the light without depth, from
    m (L, n)."""
    L = len(m)
    for ray in range(first, last):
        t, place = np.float32(1), 0
        while order[ray, place] < L:
            sheet = order[ray, place]
            reach[ray, sheet] = t
            t *= np.float32(1) - m[sheet, blocks[ray, sheet]]
            place += 1
        reach[ray, L] = t


@shared(lambda blocks, *_: len(blocks))
def explain_photons(
    first: int,
    last: int,
    blocks: np.ndarray,
    order: np.ndarray,
    colour: np.ndarray,
    reach: np.ndarray,
    state: tuple[np.ndarray, ...],
    gain: np.ndarray,
) -> float:
    """The sum of log q of photons, q how bright the sheets say that it is where they are.

    `state` is m (L, n), T (Q, L + 1, n), and the share (Q, L, n) of each photon in the texture at its own
    block, which is taken out of it. Fills `gain` (N, L), t log(T / q behind it).
    """
    m, T, photon_share = state
    L = len(m)
    total = 0.0
    for ray in range(first, last):
        q, behind, place = colour[ray], T[colour[ray], L, blocks[ray, L]], 0
        while order[ray, place] < L:
            place += 1
        for nearer in range(place - 1, -1, -1):
            sheet = order[ray, nearer]
            block, t = blocks[ray, sheet], reach[ray, sheet]
            texture = T[q, sheet, block]
            others = max(texture - t * photon_share[q, sheet, block], texture * LEAST_LEFT)
            gain[ray, sheet] = t * np.log(others / behind)
            behind += m[sheet, block] * (others - behind)
        total += np.log(behind)
    return total


@shared(lambda blocks, *_: len(blocks))
def expect_photons(
    first: int,
    last: int,
    blocks: np.ndarray,
    order: np.ndarray,
    samples: np.ndarray,
    reach: np.ndarray,
    state: tuple[np.ndarray, ...],
    loss: np.ndarray,
) -> float:
    """The expected number of photons of rays, each with `samples` (Q,) float32 times the views that it stands
    for, which `reach` is multiplied by.

    Fills `loss` (N, L), by how much it grows with the mask of each sheet.
    """
    m, T, _ = state
    L = len(m)
    behind = np.empty(samples.size, np.float32)
    total = 0.0
    for ray in range(first, last):
        place = 0
        while order[ray, place] < L:
            place += 1
        for q in range(samples.size):
            behind[q] = T[q, L, blocks[ray, L]]
        for nearer in range(place - 1, -1, -1):
            sheet = order[ray, nearer]
            block = blocks[ray, sheet]
            more = np.float32(0)
            for q in range(samples.size):
                difference = T[q, sheet, block] - behind[q]
                more += samples[q] * difference
                behind[q] += m[sheet, block] * difference
            loss[ray, sheet] = reach[ray, sheet] * more
        for q in range(samples.size):
            total += reach[ray, order[ray, 0]] * samples[q] * behind[q]
    return total


@shared(lambda sums, *_: len(sums))
def add_up(
    first: int, last: int, sums: np.ndarray, blocks: np.ndarray, colour: np.ndarray, values: np.ndarray
) -> None:
    """Add the `values` (N, S) of rays to the blocks that they meet of S sheets, (S, Q, n), by colour."""
    for sheet in range(first, last):
        for ray in range(len(blocks)):
            if blocks[ray, sheet] >= 0:
                sums[sheet, colour[ray], blocks[ray, sheet]] += values[ray, sheet]


@compiled
def level_likelihoods(
    sums: np.ndarray, rate: np.ndarray, share: np.ndarray, samples: np.ndarray
) -> np.ndarray:
    """The log-likelihood (h, w) of the photons of each block, each predicted by the others.

    `sums` (Q + 1, h, w) are weighted photons and exposures, `rate` (Q, h, w) a texture, `share` (h, w) the
    share of one photon in it times the samples (Q,).
    """
    Q, h, w = rate.shape
    nats = np.zeros((h, w), np.float32)
    for i in range(h):
        for j in range(w):
            for q in range(Q):
                texture = rate[q, i, j]
                nats[i, j] -= sums[Q, i, j] * samples[q] * texture
                if sums[q, i, j] > 0:
                    others = max(texture - share[i, j] / samples[q], texture * LEAST_LEFT)
                    nats[i, j] += sums[q, i, j] * np.log(others)
    return nats


@compiled
def mix_levels(
    nats: np.ndarray, rate: np.ndarray, share: np.ndarray, samples: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Means of textures (K, Q, h, w), and of shares (K, h, w), by how likely (K, h, w) each is: (Q, h, w)."""
    K, Q, h, w = rate.shape
    texture, photon_share = np.zeros((Q, h, w), np.float32), np.zeros((Q, h, w), np.float32)
    weight = np.empty(K, np.float32)
    for i in range(h):
        for j in range(w):
            most, total = nats[0, i, j], np.float32(0)
            for k in range(1, K):
                most = max(most, nats[k, i, j])
            for k in range(K):
                weight[k] = np.exp(nats[k, i, j] - most)
                total += weight[k]
            for k in range(K):
                for q in range(Q):
                    texture[q, i, j] += weight[k] / total * rate[k, q, i, j]
                    photon_share[q, i, j] += weight[k] / total * share[k, i, j] / samples[q]
    return texture, photon_share


@helper
def _nearest_sheet(total_px: np.ndarray, i: int, j: int, plane_px: float, near_px: float) -> int:
    """The sheet of total_px (L, h, w) nearest to a plane at a block; L if none is nearer than `near_px`."""
    nearest, distance = len(total_px), np.float32(near_px)
    for sheet in range(len(total_px)):
        away = abs(total_px[sheet, i, j] - plane_px)
        if away < distance:
            nearest, distance = sheet, away
    return nearest


@shared(lambda probability, *_: probability.shape[1])
def share_planes(
    first: int,
    last: int,
    probability: np.ndarray,
    planes: np.ndarray,
    planes_px: np.ndarray,
    total_px: np.ndarray,
    near_px: float,
) -> None:
    """Add the planes (Z, h, w) of a posterior to the `probability` (L, h, w) of the sheet near them."""
    for i in range(first, last):
        for z in range(len(planes)):
            for j in range(probability.shape[2]):
                nearest = _nearest_sheet(total_px, i, j, planes_px[z], near_px)
                if nearest < len(total_px):
                    probability[nearest, i, j] += planes[z, i, j]


@shared(lambda probability, *_: probability.shape[1])
def grow_planes(
    first: int,
    last: int,
    probability: np.ndarray,
    no_surface: np.ndarray,
    planes_px: np.ndarray,
    total_px: np.ndarray,
    near_px: float,
    growth: np.ndarray,
) -> None:
    """Multiply the `probability` (Z, h, w) of planes near a sheet, and that of `no_surface` (h, w), by how
    many times more (L + 1, h, w) the sheet is seen, and the light without depth is; normalised."""
    Z, _, w = probability.shape
    L = len(total_px)
    for i in range(first, last):
        for j in range(w):
            no_surface[i, j] *= growth[L, i, j]
        total = no_surface[i].copy()
        for z in range(Z):
            for j in range(w):
                nearest = _nearest_sheet(total_px, i, j, planes_px[z], near_px)
                probability[z, i, j] *= growth[nearest, i, j]
                total[j] += probability[z, i, j]
        for j in range(w):
            no_surface[i, j] /= total[j]
            probability[:, i, j] /= total[j]
