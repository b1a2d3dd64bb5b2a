"""Opaque layers at the requested depths, fitted to all photons together: what hides what?

Where something narrow stands before a contrasty surface most cameras see past it, so that evidence counted
cell by cell is for the surface behind. Here each plane has a mask, and what a camera sees is the nearest
masked cell on its way. A layer's light is estimated from the rays that reach it and from no others, each
photon predicted by all other photons. The masks sought are those of least

    E = - log likelihood of all photons + LENGTH_NATS per px of outline + AREA_NATS per cell.

The last term is Occam's: where a nearer surface explains nothing better, the one behind goes on. Layers are
fitted one by one, from far to near, each outline the best one given the others (total variation,
`outline_kernels`), again and again.

Notation: D layers from far to near, V views, (h, w) cells of 4 px, N events.
"""

from collections.abc import Sequence

import numpy as np

from pcii.bayer import sites_of_colours
from pcii.cells import CELL_PX
from pcii.focus import cell_shape, typical_light
from pcii.geometry import whole_shifts_px
from pcii.photon_counts import PhotonCounts

LENGTH_NATS, AREA_NATS = 0.3, 0.15
HIDDEN_SHARE, MOSTLY_HIDDEN = 0.5, 0.25
"""While a mask is fitted, a cell that less than a quarter of the views see costs less, down to half, so that
holes behind others close. Results are compared by the whole E."""
SWEEPS, STEPS = 5, 80
PRIOR_SAMPLES = 1.0
"""Where few rays reach a place, what is around it tells as much as so many."""
BLOCKED_WEIGHT = 0.02
"""Of a place that nothing sees freely, what comes through tells at least something."""
MOST_PHOTONS, MOST_PHOTONS_PER_PX = 300_000, 0.3
"""Masks of cells do not get better by more: of brighter films as many photons are drawn, or as many per px
of a large one."""
DARK_SHARE, DARKEST_SHARE, LEAST_DARK = 0.25, 0.1, 1e-3
"""Behind all layers it is dark. If the darkest fifth of the film is as bright as a quarter of what a photon
typically sees, there is no dark, and a tenth of that is the most that is behind."""


def layered(counts: PhotonCounts, spread_px: np.ndarray, starts: Sequence[np.ndarray]) -> np.ndarray:
    """The layer (h, w) int64 that the virtual centre sees in each cell, -1 where it is dark.

    `spread_px` (D,) ascends, from far to near; `starts` are guesses of the result. All are followed, and the
    nearest that they lead to; the result of least E is given. Deterministic.
    """
    layers = _Layers(_drawn(counts), spread_px)
    different = [
        start for i, start in enumerate(starts) if not any(np.array_equal(start, o) for o in starts[:i])
    ]
    found = [layers.settled(start) for start in different]
    if len(found) > 1:
        # What one of them found in front another may have missed: what explains nothing goes again.
        found.append(layers.settled(np.max([seen for _, seen in found], axis=0)))
    return min(found, key=lambda one: one[0])[1]


def _drawn(counts: PhotonCounts) -> PhotonCounts:
    """The counts, or where there are many photons a fair draw of them (always the same)."""
    events, grid = counts.events, counts.grid
    most = max(MOST_PHOTONS, MOST_PHOTONS_PER_PX * grid.height * grid.width)
    share = most / max(float(events.n.sum()), 1.0)
    if share >= 1:
        return counts
    n = np.random.default_rng(0).binomial(events.n.astype(np.int64), share)
    kept = n > 0
    k, l, i, j = (getattr(events, name)[kept] for name in "klij")
    return PhotonCounts.from_events(k, l, i, j, n[kept], grid, cfa=counts.cfa)


class _Layers:
    """The masks (D, h, w), and who hides what while they are fitted."""

    def __init__(self, counts: PhotonCounts, spread_px: np.ndarray) -> None:
        from pcii.prediction_kernels import land

        grid, events = counts.grid, counts.events
        self.film = grid.height, grid.width
        self.rows, self.cols = whole_shifts_px(grid, spread_px)
        self.cell_rows, self.cell_cols = (
            np.floor(shifts / CELL_PX + 0.5).astype(np.int64) for shifts in (self.rows, self.cols)
        )
        self.n = events.n.astype(np.float32)
        self.place = events.k, events.l, events.i, events.j
        self.colours, self.sites = counts.event_colours, sites_of_colours(counts.cfa)
        D, V, N, (h, w) = len(spread_px), grid.view_count, self.n.size, cell_shape(counts)
        self.masks = np.zeros((D, h, w), dtype=bool)
        self.near = np.zeros((V, h, w), np.uint16)
        self.hidden = np.zeros(N, np.int32)
        self.cells = np.zeros((D, N), np.int32)
        self.rate, self.base = np.zeros((2, N), np.float32)
        self.samples, self.light, self.blurred = np.zeros((3, h, w), np.float32)
        self.free, self.within = np.zeros((2, h, w), np.int32)
        # What the search for outlines goes on from: relaxed mask, a step ahead, flows across and down.
        self.relaxed = np.zeros((D, 4, h, w), np.float32)
        for layer in range(D):
            land(*self.place, self.rows[layer], self.cols[layer], self.film, self.cells[layer])
        self.least_dark, self.most_dark = self._dark()

    def put(self, masks: np.ndarray) -> None:
        """Go on from these masks (D, h, w)."""
        for layer in range(len(masks)):
            self._cover(layer, -1)
        self.masks[:] = masks
        self.relaxed[:, :2] = masks[:, None]
        self.relaxed[:, 2:] = 0
        for layer in range(len(masks)):
            self._cover(layer, 1)

    def settled(self, start: np.ndarray) -> tuple[float, np.ndarray]:
        """E and what is seen (h, w) after sweeps from a guess of what is seen."""
        self.put(np.arange(len(self.masks))[:, None, None] == start)
        for _ in range(SWEEPS):
            self.sweep()
        return self.energy(), self.visible()

    def visible(self) -> np.ndarray:
        """The nearest layer (h, w) in each cell of the virtual centre, -1 for none."""
        D = len(self.masks)
        return np.where(self.masks.any(axis=0), D - 1 - np.argmax(self.masks[::-1], axis=0), -1)

    def sweep(self) -> None:
        """Fit each layer's mask to the others, from far to near."""
        self._compose(fit=True)

    def energy(self) -> float:
        """E of the masks as they are, in nats."""
        rate, behind = self._compose(fit=False)
        fit = float((self.n * np.log(rate)).sum(dtype=np.float64)) - float(behind.sum(dtype=np.float64))
        edge = np.pad(self.masks, ((0, 0), (0, 1), (0, 1)), mode="edge").astype(np.float32)
        length = np.hypot(np.diff(edge, axis=1)[:, :, :-1], np.diff(edge, axis=2)[:, :-1]).sum()
        return -fit + LENGTH_NATS * CELL_PX * float(length) + AREA_NATS * int(self.masks.sum())

    def _compose(self, *, fit: bool) -> tuple[np.ndarray, np.ndarray]:
        """Rates (N,) of the events and light (V, h, w) of the views, all layers in front of the dark."""
        from pcii import layer_kernels as kernels

        self._predict(0)
        least, most = self.least_dark / CELL_PX**2, self.most_dark / CELL_PX**2
        # The dark is what the farthest section shows if it is blurred; what is brighter is a surface.
        rate = np.clip(self.base, least, most).astype(np.float32)
        behind = np.full(self.near.shape, self.least_dark, np.float32)
        dark = np.clip(self.blurred, self.least_dark, self.most_dark)
        kernels.paint(np.ones_like(self.masks[0]), dark, self.cell_rows[0], self.cell_cols[0], behind)
        for layer in range(len(self.masks)):
            self._cover(layer, -1)
            self._predict(layer)
            if fit:
                self._fit(layer, rate, behind)
            mask = self.masks[layer]
            kernels.paint(mask, self.light, self.cell_rows[layer], self.cell_cols[layer], behind)
            kernels.claim(mask, self.cells[layer], self.rate, rate)
        for layer in range(len(self.masks)):
            self._cover(layer, 1)
        return rate, behind

    def _fit(self, layer: int, rate: np.ndarray, behind: np.ndarray) -> None:
        """The layer's best mask in front of what is behind it."""
        from pcii import layer_kernels as kernels
        from pcii.outline_kernels import shorten_outline

        gain = np.zeros(self.light.shape, np.float32)
        kernels.less_light(self.near, behind, self.cell_rows[layer], self.cell_cols[layer], self.light, gain)
        kernels.better_predicted(self.cells[layer], self.n, self.hidden, self.rate, rate, gain)
        seen = self.free / (MOSTLY_HIDDEN * len(self.near))
        gain -= (AREA_NATS * np.clip(seen, HIDDEN_SHARE, 1)).astype(np.float32)
        shorten_outline(gain, LENGTH_NATS * CELL_PX, STEPS, *self.relaxed[layer])
        self.masks[layer] = self.relaxed[layer, 0] > 0.5

    def _predict(self, layer: int) -> None:
        """What the rays that reach a layer say of its light."""
        from pcii.prediction_kernels import predict

        self._look(layer)
        seen = BLOCKED_WEIGHT + (1 - BLOCKED_WEIGHT) * self.free / np.maximum(self.within, 1)
        weight = np.where(self.hidden == 0, np.float32(1), np.float32(BLOCKED_WEIGHT))
        predict(
            *self.place, self.colours, self.n, weight, self.cells[layer],
            self.rows[layer], self.cols[layer], self.film, self.sites, seen.astype(np.float32), PRIOR_SAMPLES,
            self.rate, self.base, self.samples, self.light, self.blurred,
        )  # fmt: skip
        for light in (self.light, self.blurred):
            light *= 4  # from blocks to cells

    def _look(self, layer: int) -> None:
        """How many views see each cell of a layer, and would if nothing were nearer."""
        from pcii.layer_kernels import free_views

        free_views(self.near, self.cell_rows[layer], self.cell_cols[layer], self.free, self.within)

    def _cover(self, layer: int, step: int) -> None:
        from pcii.focus_kernels import views_of_planes
        from pcii.layer_kernels import hide

        mask = self.masks[layer]
        if mask.any():
            own = slice(layer, layer + 1)
            views_of_planes(self.masks[own], self.cell_rows[own], self.cell_cols[own], step, self.near)
            hide(mask, self.cells[layer], step, self.hidden)

    def _dark(self) -> tuple[float, float]:
        """The least and the most light behind all layers, in photons per cell and view."""
        from scipy.ndimage import gaussian_filter

        layer, (V, h, w) = len(self.masks) // 2, self.near.shape
        self._look(layer)
        inside = self.cells[layer] >= 0
        photons = np.bincount(self.cells[layer][inside], self.n[inside], h * w).reshape(h, w)
        smooth = gaussian_filter(photons, 3) / np.maximum(
            gaussian_filter(self.within.astype(np.float64), 3), 1
        )
        typical = typical_light(photons) / V
        dark = float(np.quantile(smooth[self.within >= self.within.max() / 2], 0.2))
        least = max(0.3 * dark, LEAST_DARK * typical, 1e-9)
        if dark > DARK_SHARE * typical:
            return least, max(DARKEST_SHARE * typical, least)
        return least, max(min(2 * dark, DARK_SHARE * typical), 2 * LEAST_DARK * typical, least)
