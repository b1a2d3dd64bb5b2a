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

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from pcii.base import block_sums, each_in_threads
from pcii.depth.sheet_kernels import (
    add_up,
    expect_photons,
    explain_photons,
    grow_planes,
    meet_sheets,
    reach_sheets,
)
from pcii.depth.sheet_textures import smooth_texture, textures
from pcii.depth.sheets import SheetModel, Sheets
from pcii.evidence import doubled, gaussian_mean, gaussian_weights
from pcii.types import DepthPosterior, PhotonCounts, parallax_per_total

FILM_BLOCKS = 2
"""Distance in blocks between the places of a film for which expected photons are computed. If it is larger,
sweeps are faster and expected numbers less exact."""
TINY = np.finfo(np.float32).tiny


class Rays(NamedTuple):
    """Where N rays meet L sheets (`meet_sheets`): `blocks`, `order` (N, L + 1); and `colour` (N,) int8."""

    blocks: np.ndarray
    order: np.ndarray
    colour: np.ndarray


class State(NamedTuple):
    """`masks` (L, h, w), their `objective` in nats, and its `slope` (L, h, w): by how much more a block
    explains if the sheet is there than if it is not, as all else stays."""

    masks: np.ndarray
    objective: float
    slope: np.ndarray


class Explanation(NamedTuple):
    """Probabilities (L, h, w) that each sheet is what is seen, `before` by the network alone and `after` by
    the photons."""

    before: np.ndarray
    after: np.ndarray


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
        add_up(sums, rays.blocks, rays.colour, values)
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
        reach_sheets(photons.blocks, photons.order, flat, photon_reach)
        reach_sheets(film.blocks, film.order, flat, film_reach)
        film_reach *= self.views[:, None]
        reached, exposure = self._of_colours(photons, photon_reach, Q), self._of_blocks(film, film_reach)
        T, photon_share = self._textures(masks, reached, exposure)
        sheet_state = flat, T.reshape(Q, L + 1, -1), photon_share.reshape(Q, L, -1)
        gain, loss = (np.empty((len(rays.blocks), L), np.float32) for rays in (photons, film))
        likelihood = sum(explain_photons(*photons, photon_reach, sheet_state, gain))
        expected = sum(expect_photons(film.blocks, film.order, self.samples, film_reach, sheet_state, loss))
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
    explanation = Explanation(sheets.visible(views.prior), sheets.visible(views.state.masks))
    return posterior_after(posterior, sheets, explanation, model.least)


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
    meet_sheets(blocks, order, sheets.total_px, rays)
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
    """The (u, v, a, b) (N,) float32 of `sheet_kernels` at places on the films of cameras, in px."""
    grid, (across, down) = counts.grid, parallax_per_total(counts.grid)
    rows, cols = cameras[0] - (grid.rows - 1) / 2, cameras[1] - (grid.cols - 1) / 2
    at = pixels[0] - rows * grid.shear_px[1], pixels[1] - cols * grid.shear_px[0]
    moves = rows * down, cols * across
    return tuple((part / block_px).astype(np.float32) for part in (*at, *moves))


def posterior_after(
    posterior: DepthPosterior, sheets: Sheets, explained: Explanation, least: float
) -> DepthPosterior:
    """The posterior whose planes near a sheet grow by the root of how much more it is seen.

    So do no surface and planes far from all sheets with the light without depth. Where the photons
    around do not tell the depth the network's stays. The probability of being in focus at a requested plane
    grows by as much as the sheets at the plane do, that of no plane by as much as the others and the light
    without depth. Where nothing changes the posterior does not either.
    """
    before, after = (_with_nothing(visible) for visible in (explained.before, explained.after))
    growth = _by_depth(sheets, after, least) / _by_depth(sheets, before, least)
    in_focus = _in_focus_after(posterior.in_focus, sheets, before, growth)
    probability, no_surface = posterior.probability.copy(), posterior.no_surface.copy()
    planes_px = posterior.planes.total_disparity_px
    # The network's planes know the same photons already, so that what sheets say of them counts half.
    grow_planes(probability, no_surface, planes_px, sheets.total_px, sheets.same_px, np.sqrt(growth))
    is_supported = posterior.is_supported
    probability = np.where(is_supported, probability, posterior.probability)
    no_surface = np.where(is_supported, no_surface, posterior.no_surface)
    return replace(posterior, probability=probability, no_surface=no_surface, in_focus=in_focus)


def _with_nothing(visible: np.ndarray) -> np.ndarray:
    """The probabilities (L + 1, h, w) of sheets (L, h, w), and of the light without depth."""
    return np.concatenate([visible, 1 - visible.sum(axis=0, keepdims=True)])


def _by_depth(sheets: Sheets, visible: np.ndarray, least: float) -> np.ndarray:
    """The probability (L + 1, h, w) that a sheet, or another at its depth, is what is seen, more by `least`;
    and of the light without depth."""
    depths, same_px = sheets.total_px, sheets.same_px
    near = [(visible[:-1] * (np.abs(depths - depth) < same_px)).sum(axis=0) for depth in depths]
    return np.stack([*near, visible[-1]]) + np.float32(least)


def _in_focus_after(
    in_focus: np.ndarray, sheets: Sheets, before: np.ndarray, growth: np.ndarray
) -> np.ndarray:
    """Probabilities (R, h, w) of being in focus, each times the mean `growth` of its sheets, normalised."""
    weight = before + np.finfo(np.float32).eps
    # The sheets of each requested plane, then those of no plane and the light without depth.
    members = [np.append(is_at_plane, False) for is_at_plane in sheets.is_at]
    members.append(np.append(~sheets.is_at.any(axis=0), True))
    claimed = np.concatenate([in_focus, (1 - in_focus.sum(axis=0, keepdims=True)).clip(0)])
    for probability, member in zip(claimed, members, strict=True):
        probability *= (weight[member] * growth[member]).sum(axis=0) / weight[member].sum(axis=0)
    return claimed[:-1] / claimed.sum(axis=0)
