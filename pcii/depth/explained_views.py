"""What the photons of all cameras say of masks of sheets, by an objective that does not fall.

Each camera sees the sheets from near to far: where camera k looks at x, a photon has the density

    q_k(x) = sum_l m_l T_l prod_(j nearer than l) (1 - m_j) + T_L prod_j (1 - m_j),

each mask m and texture T at the block that the ray meets, T_L the light without depth. Textures are what
reaches the blocks, so that all follows from the masks. The objective is the log-likelihood

    F(m) = sum_photons log q - integral q,

in which each photon is predicted by the others alone: what explains its own noise gains nothing. Masks start
as the network has them, and move towards what it and the photons say together, as far as F rises
(docs/theory.md, "What hides what").
"""

from typing import NamedTuple

import numpy as np

from pcii.base import block_sums, each_in_threads, helper, shared
from pcii.depth.sheet_textures import LEAST_LEFT, smooth_texture, textures
from pcii.depth.sheets import SheetModel, Sheets, posterior_after
from pcii.evidence import doubled, gaussian_mean, gaussian_weights
from pcii.types import DepthPosterior, PhotonCounts, parallax_per_total

FILM_BLOCKS = 2
"""Distance in blocks between the places of a film for which expected photons are computed. If it is larger,
sweeps are faster and expected numbers less exact."""
TINY = np.finfo(np.float32).tiny


class Rays(NamedTuple):
    """Where N rays meet L sheets (`_meet_sheets`): `blocks`, `order` (N, L + 1); and `colour` (N,) int8."""

    blocks: np.ndarray
    order: np.ndarray
    colour: np.ndarray


class State(NamedTuple):
    """`masks` (L, h, w), their `objective` in nats, and its `slope` (L, h, w): by how much more a block
    explains if the sheet is there than if it is not, as all else stays."""

    masks: np.ndarray
    objective: float
    slope: np.ndarray


class ExplainedViews:
    """The photons of all cameras, explained by sheets, whose masks are in `state`."""

    def __init__(self, counts: PhotonCounts, sheets: Sheets, block_px: int, model: SheetModel) -> None:
        self.model, self.sheets = model, sheets
        self.prior = sheets.masks(model.least)
        colours = np.array([1.0]) if counts.cfa is None else np.array([0.25, 0.5, 0.25])
        self.samples = (colours * block_px**2).astype(np.float32)
        """Of each colour in a block of one view."""
        self.photons = _met(sheets, *_photon_rays(counts, block_px, model.most_photons))
        film, self.views = _film_rays(counts, block_px, model.cameras)
        self.film = _met(sheets, film, np.zeros(film[0].size, np.int8))
        photons_per_colour = np.bincount(self.photons.colour, minlength=self.samples.size)
        film_samples = self.samples * self.views.sum()
        self.mean = np.maximum(photons_per_colour / film_samples, TINY).astype(np.float32)
        self.state = self._state(self.prior)

    def objective(self) -> float:
        """F of the masks as they are, in nats."""
        return self.state.objective

    def sweep(self) -> bool:
        """The best masks if all else stays; False where they would lower F, and masks stay as they are."""
        state = self._state(self._best_masks())
        is_better = state.objective >= self.state.objective
        if is_better:
            self.state = state
        return is_better

    def _of_blocks(self, rays: Rays, values: np.ndarray) -> np.ndarray:
        """The sums (S, h, w) of the values (N, S) of rays in the blocks that they meet."""
        return self._of_colours(rays._replace(colour=np.zeros_like(rays.colour)), values, 1)[:, 0]

    def _of_colours(self, rays: Rays, values: np.ndarray, colours: int) -> np.ndarray:
        """The same by colour, (S, Q, h, w)."""
        _, h, w = self.prior.shape
        sums = np.zeros((values.shape[1], colours, h * w), np.float32)
        _add_up(sums, rays.blocks, rays.colour, values)
        return sums.reshape(*sums.shape[:2], h, w)

    def _best_masks(self) -> np.ndarray:
        """The most probable masks (L, h, w) if all else stays as it is.

        The logit of each is that of the network, and what the photons around say, as the mean of a window:
        each block as if all of its window were like it, but no more than `most_nats`. Means are shrunk by the
        share of noise in their squares (James and Stein 1961), both in a wide window; noise is how much the
        blocks of a window differ.
        """
        model = self.model
        weights, nearest = gaussian_weights(model.window_blocks, 3), gaussian_weights(1.0, 3)
        window = np.float32(2 * np.pi * model.window_blocks**2)

        def of_sheet(sheet: int) -> np.ndarray:
            nats = window * gaussian_mean(self.state.slope[sheet], nearest)
            prior = self.prior[sheet]
            nats = nats.clip(-model.most_nats, model.most_nats)
            mean_nats = gaussian_mean(nats, weights)
            # Of the blocks of a window, seen in windows of 1 block, as many as its variance are independent.
            noise = (gaussian_mean(nats**2, weights) - mean_nats**2).clip(0) / np.float32(
                model.window_blocks**2
            )
            noise, signal = (_wide_mean(part, model.wide_octave) for part in (noise, mean_nats**2))
            odds = np.exp(mean_nats * (1 - noise / np.maximum(signal, np.maximum(noise, TINY))))
            odds *= prior / (1 - prior)
            return odds / (1 + odds)

        masks = np.stack(each_in_threads(of_sheet, range(len(self.prior))))
        return masks.clip(model.least, 1 - model.least)

    def _state(self, masks: np.ndarray) -> State:
        L, Q, photons, film = len(masks), self.samples.size, self.photons, self.film
        flat = masks.reshape(L, -1)
        photon_reach, film_reach = (np.zeros(rays.blocks.shape, np.float32) for rays in (photons, film))
        _reach_sheets(photons.blocks, photons.order, flat, photon_reach)
        _reach_sheets(film.blocks, film.order, flat, film_reach)
        film_reach *= self.views[:, None]
        reached, exposure = self._of_colours(photons, photon_reach, Q), self._of_blocks(film, film_reach)
        T, photon_share = self._textures(masks, reached, exposure)
        sheet_state = flat, T.reshape(Q, L + 1, -1), photon_share.reshape(Q, L, -1)
        gain, loss = (np.empty((len(rays.blocks), L), np.float32) for rays in (photons, film))
        likelihood = sum(_explain_photons(*photons, photon_reach, sheet_state, gain))
        expected = sum(_expect_photons(film.blocks, film.order, self.samples, film_reach, sheet_state, loss))
        slope = self._of_blocks(photons, gain) - self._of_blocks(film, loss)
        return State(masks, likelihood - expected, slope)

    def _textures(
        self, masks: np.ndarray, reached: np.ndarray, exposure: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Textures (Q, L + 1, h, w) of all sheets and the light without depth, and the share (Q, L, h, w) of
        a photon in each, from what reaches their blocks."""
        L, Q, common = len(masks), self.samples.size, (self.mean, self.samples, self.model)
        T = np.empty((Q, L + 1, *masks.shape[1:]), np.float32)
        photon_share = np.empty((Q, L, *masks.shape[1:]), np.float32)

        def of_sheet(sheet: int) -> None:
            if sheet == L:
                T[:, L] = smooth_texture(reached[L], exposure[L], *common)
            else:
                both = textures(reached[sheet], exposure[sheet], masks[sheet], *common)
                T[:, sheet], photon_share[:, sheet] = both

        each_in_threads(of_sheet, range(L + 1))
        return T, photon_share


def explain_posterior(
    counts: PhotonCounts, posterior: DepthPosterior, sheets: Sheets, model: SheetModel
) -> DepthPosterior:
    """The posterior after its sheets explain the photons, by as many sweeps as raise the objective."""
    views = ExplainedViews(counts, sheets, posterior.block_px, model)
    for _ in range(model.sweeps):
        if not views.sweep():
            break
    before, after = (sheets.visible(masks) for masks in (views.prior, views.state.masks))
    return posterior_after(posterior, sheets, before, after, model.least)


def _wide_mean(values: np.ndarray, octave: int) -> np.ndarray:
    """Means (h, w) in windows of 2^octave blocks."""
    shapes = list[tuple[int, ...]]()
    for _ in range(octave):
        shapes.append(values.shape)
        values = block_sums(values, 2, np.float32) / 4
    mean = gaussian_mean(values, gaussian_weights(1.0, 3))
    for height, width in reversed(shapes):
        mean = doubled(mean[None], height, width)[0]
    return mean


def _met(sheets: Sheets, rays: tuple[np.ndarray, ...], colour: np.ndarray) -> Rays:
    shape = rays[0].size, len(sheets.total_px) + 1
    blocks, order = np.empty(shape, np.int32), np.empty(shape, np.int8)
    _meet_sheets(blocks, order, sheets.total_px, rays)
    return Rays(blocks, order, colour)


def _photon_rays(counts: PhotonCounts, block_px: int, most: int) -> tuple[tuple[np.ndarray, ...], np.ndarray]:
    """Rays of photons, of `most` at most, each somewhere in its pixel, and their colours (N,) int8."""
    events, random = counts.events, np.random.default_rng(0)
    n, total = np.asarray(events.n), int(events.n.sum())
    if total > most:
        n = random.binomial(n, most / total)
    k, l, i, j, colour = (
        np.repeat(part, n) for part in (events.k, events.l, events.i, events.j, counts.event_colours)
    )
    pixels = i + random.random(i.size), j + random.random(j.size)
    return _rays(counts, (k, l), pixels, block_px), colour.astype(np.int8)


def _film_rays(counts: PhotonCounts, block_px: int, most: int) -> tuple[tuple[np.ndarray, ...], np.ndarray]:
    """Rays of places evenly apart on the films of some cameras, and how many views (N,) float32 of a block
    each stands for.

    Each of these cameras is the mean of some next to each other that have photons. Places differ from camera
    to camera, so that no blocks are left out.
    """
    grid, side = counts.grid, FILM_BLOCKS * block_px
    cells = np.argwhere((np.diff(counts.view_starts) > 0).reshape(grid.rows, grid.cols))
    cameras = list[tuple[float, ...]]()
    for row, of_row in enumerate(np.array_split(np.arange(grid.rows), min(most, grid.rows))):
        for col, of_col in enumerate(np.array_split(np.arange(grid.cols), min(most, grid.cols))):
            near = cells[np.isin(cells[:, 0], of_row) & np.isin(cells[:, 1], of_col)]
            if near.size:
                place = (row + 2 * (col % 2)) % 4, (col + 2 * (row % 2)) % 4
                cameras.append((*near.mean(axis=0), *place, len(near)))
    rows, cols = np.arange(0, grid.height, side), np.arange(0, grid.width, side)
    film_shape = len(cameras), len(rows), len(cols)
    k, l, down, right, views = (np.array(part)[:, None, None] for part in zip(*cameras, strict=True))
    i = rows[:, None] + (down + 0.5) * side / 4
    j = cols + (right + 0.5) * side / 4
    k, l, i, j, views = (np.broadcast_to(part, film_shape).ravel() for part in (k, l, i, j, views))
    return _rays(counts, (k, l), (i, j), block_px), views.astype(np.float32) * FILM_BLOCKS**2


def _rays(
    counts: PhotonCounts,
    cameras: tuple[np.ndarray, np.ndarray],
    pixels: tuple[np.ndarray, np.ndarray],
    block_px: int,
) -> tuple[np.ndarray, ...]:
    """The (u, v, a, b) (N,) float32 of rays at places on the films of cameras, in px."""
    grid, (across, down) = counts.grid, parallax_per_total(counts.grid)
    rows, cols = cameras[0] - (grid.rows - 1) / 2, cameras[1] - (grid.cols - 1) / 2
    at = pixels[0] - rows * grid.shear_px[1], pixels[1] - cols * grid.shear_px[0]
    moves = rows * down, cols * across
    return tuple((part / block_px).astype(np.float32) for part in (*at, *moves))


# Compiled: where rays meet sheets, and what photons and cameras see of them.
#
# A ray is the place (u, v) of a photon on the film of the virtual centre, in blocks, and by how much it moves
# with each px of total disparity (a, b). Notation: N rays, L sheets and behind them, as number L, the light
# without depth; n = h w blocks, Q colours. Of sheets from near to far, one is reached by a ray with the
# probability t that no nearer one is there; m are masks and T textures, in photons per sample.


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
def _meet_sheets(
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
def _reach_sheets(
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
def _explain_photons(
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
def _expect_photons(
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
def _add_up(
    first: int, last: int, sums: np.ndarray, blocks: np.ndarray, colour: np.ndarray, values: np.ndarray
) -> None:
    """Add the `values` (N, S) of rays to the blocks that they meet of S sheets, (S, Q, n), by colour."""
    for sheet in range(first, last):
        for ray in range(len(blocks)):
            if blocks[ray, sheet] >= 0:
                sums[sheet, colour[ray], blocks[ray, sheet]] += values[ray, sheet]
