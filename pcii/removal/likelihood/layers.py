"""Opaque layers at the requested depths, fitted to all photons together: what hides what?

Where something narrow stands before a contrasty surface most cameras see past it, so that evidence counted
cell by cell is for the surface behind. Here each plane has a mask, and what a camera sees is the nearest
masked cell on its way. A layer's light is estimated from the rays that reach it and from no others, each
photon predicted by all other photons. The masks sought are those of least

    E = - log likelihood of all photons + LENGTH_NATS per px of outline + AREA_NATS per cell.

The last term is Occam's: where a nearer surface explains nothing better, the one behind goes on. While masks
are fitted some of it may be asked for rays alone that would else end in the dark: a piece is then not
too dear because it hides another. Layers are fitted one by one, from far to near, each outline the best one
given the others (total variation, `outline_kernels`), again and again.

Notation: D layers from far to near, V views, (h, w) cells of 4 px, N events.
"""

import numpy as np

from pcii.evidence.cells import CELL_PX, in_cells
from pcii.evidence.focus_likelihood import cell_shape, dark_around, photon_weighted_mean
from pcii.evidence.prediction_types import PlacedEvents, PlaneView, Predicted
from pcii.types.bayer import sites_of_colours
from pcii.types.focal_planes import FocalPlanes
from pcii.types.photon_counts import PhotonCounts

LENGTH_NATS, AREA_NATS = 0.3, 0.15
HIDDEN_SHARE, MOSTLY_HIDDEN = 0.5, 0.25
"""While a mask is fitted, a cell that less than a quarter of the views see costs less, down to half, so that
holes behind others close. Results are compared by the whole E."""
STEPS = 80
PRIOR_SAMPLES = 1.0
"""Where few rays reach a place, what is around it tells as much as so many."""
BESIDE_SHARE = 0.35
"""Of a surface that is told by itself what lands beside it tells so much: masks err by a cell."""
BLOCKED_WEIGHT = 0.02
"""Of a place that nothing sees freely, what comes through tells at least something."""
LEAST_DARK, DARKEST_SHARE, BRIGHTEST_SHARE, BRIGHTER = 1e-3, 0.1, 0.25, 1.3
"""Behind all layers it is dark: at most twice as bright as the darkest fifth of the film, and hardly more
than a quarter of what a photon typically sees. If there is no dark, a tenth of that is the most."""
DARK_CELLS = 3


def background_bounds(counts: PhotonCounts, total_disparity_px: float) -> tuple[float, float]:
    """The least and the most light behind all things, in photons per cell and view, from one section."""
    from scipy.ndimage import gaussian_filter

    grid, events = counts.grid, counts.events
    V, (h, w) = grid.view_count, cell_shape(counts)
    planes = FocalPlanes.at_total_disparity(grid, total_disparity_px)
    row, col, inside = planes.project(events, 0)
    cell = (row // CELL_PX * w + col // CELL_PX)[inside]
    photons = np.bincount(cell, events.n[inside], h * w).reshape(h, w)
    rows, cols = (axis[0] for axis in planes.whole_shifts_px)
    # A cell is seen by whoever sees the pixel at its centre.
    i, j = (np.arange(size) * CELL_PX + CELL_PX // 2 for size in (h, w))
    views = _views_of(i, j, rows, cols, grid.shape_HW)
    smooth, seen = (gaussian_filter(part.astype(np.float64), DARK_CELLS) for part in (photons, views))
    typical = photon_weighted_mean(photons) / V
    well_seen = views >= views.max() / 2
    dark, there = dark_around(
        (smooth / np.maximum(seen, 1))[well_seen], typical, V * 4 * np.pi * DARK_CELLS**2
    )
    least = max(0.3 * dark, LEAST_DARK * typical, 1e-9)
    if not there:
        return least, max(DARKEST_SHARE * typical, least)
    most = max(min(2 * dark, BRIGHTEST_SHARE * typical), BRIGHTER * dark, 2 * LEAST_DARK * typical)
    return least, max(most, least)


def _views_of(
    i: np.ndarray, j: np.ndarray, rows: np.ndarray, cols: np.ndarray, shape_HW: tuple[int, int]
) -> np.ndarray:
    """How many views have places i (h,) x j (w,) on their film (H, W) if they are shifted, (h, w)."""
    cameras = []
    for place, shifts, size in zip((i, j), (rows, cols), shape_HW, strict=True):
        seen = place[:, None] - shifts
        cameras.append(((seen >= 0) & (seen < size)).sum(axis=1))
    return np.outer(*cameras)


class Layers:
    """The masks (D, h, w), and who hides what while they are fitted.

    `total_disparity_px` (D,) ascends, from far to near; `dark` is the least and the most light behind all
    (`background_bounds`).
    """

    def __init__(
        self, counts: PhotonCounts, total_disparity_px: np.ndarray, dark: tuple[float, float]
    ) -> None:
        from pcii.evidence.projection_kernels import cells_of_events

        grid, events = counts.grid, counts.events
        self.shape_HW = grid.shape_HW
        self.least_dark, self.most_dark = dark
        self.rows, self.cols = FocalPlanes.at_total_disparity(grid, total_disparity_px).whole_shifts_px
        self.n = events.n.astype(np.float32)
        self.place = events.k, events.l, events.i, events.j
        self.colours, self.sites = counts.event_colours, sites_of_colours(counts.cfa)
        D, V, N, (h, w) = len(total_disparity_px), grid.view_count, self.n.size, cell_shape(counts)
        self.masks = np.zeros((D, h, w), dtype=bool)
        # How many px of each view's cell nearer layers cover.
        self.covered = np.zeros((V, h, w), np.uint16)
        self.hidden = np.zeros(N, np.int32)
        self.cells = np.zeros((D, N), np.int32)
        self.rate, self.base = np.zeros((2, N))
        self.samples, self.light, self.blurred = np.zeros((3, h, w))
        # How many views see each cell if nothing is nearer: the film's frame is all that hides.
        self.within = np.zeros((D, h, w), np.float32)
        self.free = np.zeros((h, w), np.float32)
        for layer in range(D):
            self._look(layer)
            self.within[layer] = self.free
        # What the search for outlines goes on from: relaxed mask, a step ahead, flows across and down.
        self.relaxed = np.zeros((D, 4, h, w), np.float32)
        for layer in range(D):
            cells_of_events(
                *self.place, self.rows[layer], self.cols[layer], self.shape_HW, CELL_PX, self.cells[layer]
            )
        self.home = self._home(D // 2)

    def put(self, masks: np.ndarray) -> None:
        """Go on from these masks (D, h, w)."""
        for layer, mask in enumerate(masks):
            if not np.array_equal(mask, self.masks[layer]):
                self._cover(layer, -1)
                self.masks[layer] = mask
                self._cover(layer, 1)
        self.relaxed[:, :2] = masks[:, None]
        self.relaxed[:, 2:] = 0

    def visible(self) -> np.ndarray:
        """The nearest layer (h, w) in each cell of the virtual centre, -1 for none."""
        D = len(self.masks)
        return np.where(self.masks.any(axis=0), D - 1 - np.argmax(self.masks[::-1], axis=0), -1)

    def photons(self, layer: int) -> np.ndarray:
        """How many photons of each colour land in each cell (C, h, w) of a layer, whatever hides it."""
        (h, w), C, inside = self.light.shape, self.sites.size, self.cells[layer] >= 0
        where = self.colours[inside].astype(np.int64) * (h * w) + self.cells[layer][inside]
        return np.bincount(where, self.n[inside], C * h * w).reshape(C, h, w)

    def sweep(self, lit_nats: float = 0.0) -> None:
        """Fit each layer's mask to the others, from far to near.

        `lit_nats`, of the AREA_NATS, are asked for rays alone that would else end in the dark.
        """
        self._compose(fit=True, lit_nats=lit_nats)

    def cost_seen(self) -> np.ndarray:
        """What outlines cost, and cells for the rays alone that end on any of them, in nats (h, w)."""
        from pcii.removal.likelihood.layer_kernels import gathered

        middle, lit = len(self.masks) // 2, np.zeros(self.covered.shape, np.float32)
        for layer in range(len(self.masks)):
            self._light_up(layer, lit)
        rays = np.empty(self.light.shape)
        gathered(lit, in_cells(self.rows[middle]), in_cells(self.cols[middle]), rays)
        return self._outlines() + AREA_NATS / len(lit) * rays

    def _outlines(self) -> np.ndarray:
        """What the outlines of the masks cost, in nats, by the cell (h, w) of each."""
        edge = np.pad(self.masks, ((0, 0), (0, 1), (0, 1)), mode="edge").astype(np.float32)
        length = np.hypot(np.diff(edge, axis=1)[:, :, :-1], np.diff(edge, axis=2)[:, :-1]).sum(axis=0)
        return LENGTH_NATS * CELL_PX * length

    def light_explained(self, *, beside: float = 1.0) -> np.ndarray:
        """Log likelihood of all photons but for a constant, in nats, by cell (h, w) of the middle layer.

        What lands `beside` a mask tells so much of its light: at less than 1 borders between surfaces cost
        nothing but their length, yet parting one surface into two along the edges that it shows explains
        something.
        """
        from pcii.removal.likelihood.layer_kernels import gathered

        rate, behind = self._compose(fit=False, beside=beside)
        middle, (h, w) = len(self.masks) // 2, self.light.shape
        expected = np.empty((h, w))
        gathered(behind, in_cells(self.rows[middle]), in_cells(self.cols[middle]), expected)
        return np.bincount(self.home, self.n * np.log(rate), h * w).reshape(h, w) - expected

    def in_the_open(self) -> list[np.ndarray]:
        """Nats (h, w) that each layer would gain over what is believed now, were it in front of all."""
        rate, behind = self._compose(fit=False)
        self._cover_all(-1)
        gains = []
        for layer in range(len(self.masks)):
            self._predict(layer)
            gains.append(self._gain(layer, rate, behind))
        self._cover_all(1)
        return gains

    def _compose(
        self, *, fit: bool, beside: float = 1.0, lit_nats: float = 0.0
    ) -> tuple[np.ndarray, np.ndarray]:
        """Rates (N,) of the events and light (V, h, w) of the views, all layers in front of the dark."""
        from pcii.removal.likelihood import layer_kernels as kernels
        from pcii.removal.likelihood.hiding_kernels import claim

        self._predict(0, None if fit else self.hidden == 0, blurred=True)
        least, most = self.least_dark / CELL_PX**2, self.most_dark / CELL_PX**2
        # The dark is what the farthest section shows if it is blurred; what is brighter is a surface.
        rate = np.clip(self.base, least, most).astype(np.float32)
        behind = np.full(self.covered.shape, self.least_dark, np.float32)
        dark = np.clip(self.blurred, self.least_dark, self.most_dark)
        kernels.paint(np.ones(dark.shape, dtype=bool), dark, self.rows[0], self.cols[0], behind)
        lit = np.zeros(behind.shape, np.float32)
        for layer in range(len(self.masks)):
            mask = self.masks[layer]
            if not fit and not mask.any():
                continue
            self._cover(layer, -1)
            if fit:
                self._predict(layer)
                self._fit(layer, rate, behind, lit_nats, lit)
            else:
                top, bottom, _, _ = kernels.filled(mask)
                self._predict(layer, self._claimed(layer), (top, bottom), beside=beside)
            kernels.paint(mask, self.light, self.rows[layer], self.cols[layer], behind)
            claim(mask, self.cells[layer], self.rate, rate)
        self._cover_all(1)
        return rate, behind

    def _fit(
        self, layer: int, rate: np.ndarray, behind: np.ndarray, lit_nats: float, lit: np.ndarray
    ) -> None:
        """The layer's best mask in front of what is behind it; what ends on it is added to `lit`."""
        from pcii.removal.likelihood.outline_kernels import shorten_outline

        gain = self._gain(layer, rate, behind)
        seen = self.free / (MOSTLY_HIDDEN * len(self.covered))
        gain -= ((AREA_NATS - lit_nats) * np.clip(seen, HIDDEN_SHARE, 1)).astype(np.float32)
        if lit_nats > 0:
            gain -= np.float32(lit_nats) * self._lit_by(layer, lit)
        shorten_outline(gain, LENGTH_NATS * CELL_PX, STEPS, *self.relaxed[layer])
        self.masks[layer] = self.relaxed[layer, 0] > 0.5
        if lit_nats > 0:
            self._light_up(layer, lit)

    def _lit_by(self, layer: int, lit: np.ndarray) -> np.ndarray:
        """Of the rays to each cell (h, w) the share that ends in the dark but for this layer.

        `lit` (V, h, w) is the share of each view's cell that ends on what is behind it.
        """
        from pcii.removal.likelihood.layer_kernels import light_of

        elsewhere = np.empty(self.light.shape, np.float32)
        light_of(lit, self.covered, self.rows[layer], self.cols[layer], elsewhere)
        return (self.free - elsewhere) / np.maximum(self.within[layer], 1)

    def _light_up(self, layer: int, lit: np.ndarray) -> None:
        """Add what ends on a layer to `lit` (V, h, w)."""
        from pcii.removal.likelihood.layer_kernels import paint

        paint(self.masks[layer], np.ones_like(self.light), self.rows[layer], self.cols[layer], lit)

    def _gain(self, layer: int, rate: np.ndarray, behind: np.ndarray) -> np.ndarray:
        """Nats (h, w) that the layer as it is predicted explains better than what is behind it."""
        from pcii.removal.likelihood.hiding_kernels import better_predicted
        from pcii.removal.likelihood.layer_kernels import light_of

        gain = np.empty(self.light.shape, np.float32)
        light_of(behind, self.covered, self.rows[layer], self.cols[layer], gain)
        gain -= self.light * self.free  # photons that are expected less
        better_predicted(self.cells[layer], self.n, self.hidden, self.rate, rate, gain)
        return gain

    def _predict(
        self,
        layer: int,
        asked: np.ndarray | None = None,
        asked_rows: tuple[int, int] | None = None,
        *,
        beside: float = 1.0,
        blurred: bool = False,
    ) -> None:
        """What the rays that reach a layer say of its light; those `beside` its mask count so much.

        Rates are wanted of the events that are `asked` for (N,), light of the cells in `asked_rows`, the
        first and the last + 1; of all if not given. If `blurred`, by the widest window alone.
        """
        from pcii.evidence.prediction_kernels import BASE_SCALE, predict_shared

        self._look(layer)
        seen = BLOCKED_WEIGHT + (1 - BLOCKED_WEIGHT) * self.free / np.maximum(self.within[layer], 1)
        weight = np.where(self.hidden == 0, np.float32(1), np.float32(BLOCKED_WEIGHT))
        if beside < 1:
            cell, share = self.cells[layer], np.where(self.masks[layer], 1, beside).astype(np.float32)
            seen *= share
            weight *= share.ravel()[np.maximum(cell, 0)]
        if asked is None:
            asked = np.ones(self.n.size, dtype=bool)
        first, last = asked_rows or (0, len(self.light))
        events = PlacedEvents(*self.place, self.colours, self.n, weight, self.cells[layer])
        section = PlaneView(
            self.rows[layer],
            self.cols[layer],
            *self.shape_HW,
            self.sites,
            seen.astype(np.float32),
            PRIOR_SAMPLES,
        )
        predicted = Predicted(self.rate, self.base, self.samples, self.light, self.blurred)
        finest = BASE_SCALE if blurred else 0
        predict_shared(asked, (first, last), finest, events, section, predicted)
        for light in (self.blurred,) if blurred else (self.light, self.blurred):
            light[first:last] *= 4  # from blocks to cells

    def _claimed(self, layer: int) -> np.ndarray:
        """Which events (N,) land in the layer's mask and in none that is nearer."""
        cell = self.cells[layer]
        return (self.hidden == 0) & (cell >= 0) & self.masks[layer].ravel()[np.maximum(cell, 0)]

    def _look(self, layer: int) -> None:
        """How many views see each cell of a layer, in parts."""
        from pcii.removal.likelihood.layer_kernels import views_of

        views_of(self.covered, self.rows[layer], self.cols[layer], self.free)

    def _home(self, layer: int) -> np.ndarray:
        """The cell (N,), row by row, in which a layer would show each event, or the nearest in its frame."""
        h, w = self.light.shape
        k, l, i, j = self.place
        row = np.clip((i + self.rows[layer][k]) // CELL_PX, 0, h - 1)
        return row * w + np.clip((j + self.cols[layer][l]) // CELL_PX, 0, w - 1)

    def _cover_all(self, step: int) -> None:
        for layer in range(len(self.masks)):
            self._cover(layer, step)

    def _cover(self, layer: int, step: int) -> None:
        from pcii.removal.likelihood.hiding_kernels import hide
        from pcii.removal.likelihood.layer_kernels import cover

        mask = self.masks[layer]
        if mask.any():
            cover(mask, self.rows[layer], self.cols[layer], step, self.covered)
            hide(mask, self.cells[layer], step, self.hidden)
