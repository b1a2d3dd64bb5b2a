"""The energy of a scene of opaque surfaces: how badly they explain all photons, and what they cost.

    E(s) = - sum_e log rate(e | other photons of its surface)  +  sum_x V(x) rate(x)
           +  l |outlines|  +  a (number of surfaces)  +  b sum_x (s(x) - mean of s around x)^2

with s(x) the label of cell x of the virtual centre, and V(x) the pixels of all cameras that see its surface.
"""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from pcii.base.compiled_loops import each_in_threads
from pcii.scene_model.parameters import SceneParameters
from pcii.scene_model.rays import Rays
from pcii.scene_model.surfaces import prior_nats, window_decay


@dataclass(frozen=True, eq=False)
class SceneEnergy:
    """The energy of labellings for the photons of `rays`, in nats."""

    rays: Rays
    parameters: SceneParameters = field(default_factory=SceneParameters)

    def of(self, labels: np.ndarray) -> np.ndarray:
        """Energy (h, w) of labels (h, w) int16; photons count where they land at the middle of the ladder."""
        return self.photon_nats(labels) + prior_nats(labels, self.parameters)

    def photon_nats(self, labels: np.ndarray) -> np.ndarray:
        """Minus the log likelihood (h, w) of the photons, less what no labelling changes."""
        from pcii.scene_model import rate_kernels as kernels
        from pcii.scene_model import ray_kernels

        rays, (h, w), M = self.rays, self.rays.shape, labels.size
        hidden = ray_kernels.behind(labels, rays.largest_step)
        owner, other = self.owners(labels, hidden)
        seen = self.exposure(labels, hidden)
        photons = np.zeros((2 * M + 1, len(self._shares)), np.float32)
        kernels.photons_of_cells(owner, rays.n, rays.colour, photons)
        lost_px = self.parameters.lost_share * rays.exposed_px
        dark_px = max(rays.exposed_px - float(seen.sum()), 0.0)
        dark = photons[2 * M].sum(dtype=float)
        rate = (dark + self._mean * lost_px) / (dark_px + lost_px)
        by_colour = rate * (photons[2 * M] + self._shares) / (dark + 1)
        own_rate, other_rate = (
            np.where(cells == 2 * M, by_colour[rays.colour], 0.0) for cells in (owner, other)
        )
        energy = np.full(M, dark_px * rate / M)
        of_cells = photons[: 2 * M].T.reshape(-1, 2, h, w)
        goes_on = hidden >= 0
        for begin, surface, here, own_px in (
            (0, labels, np.zeros_like(goes_on), seen[0]),
            # The photon rate of a hidden part is predicted from the visible part of the same surface.
            (M, np.where(goes_on, hidden, labels), goes_on, np.where(goes_on, seen[1], 0)),
        ):
            if begin and not goes_on.any():
                continue
            values = np.where(here, of_cells[:, 1], of_cells[:, 0]), np.where(here, seen[1], seen[0])
            energy += self._surface_rates(
                begin, surface, values, own_px, (owner, other), (own_rate, other_rate)
            )
        beside = np.where(other >= 0, self.parameters.beside_share, 0.0)
        rates = np.maximum((1 - beside) * own_rate + beside * other_rate, 1e-12)
        energy -= np.bincount(rays.middle_cell, rays.n * np.log(rates), M)
        return energy.reshape(h, w)

    def exposure(self, labels: np.ndarray, hidden: np.ndarray) -> np.ndarray:
        """Pixels of all cameras (2, h, w) float32 that see each cell, and what goes on behind it."""
        from scipy.ndimage import maximum_filter

        from pcii.scene_model.ray_kernels import exposures

        rays, K, L = self.rays, self.rays.counts.grid.rows, self.rays.counts.grid.cols
        reach = int(np.ceil(rays.largest_step * len(rays.planes)))
        nearest = maximum_filter(labels, 2 * reach + 1)
        camera = np.arange(K * L)
        # Evenly spread in the cell from camera to camera (additive recurrence by the golden ratio).
        offsets = np.stack([(camera + 0.5) / (K * L), (0.25 + camera * (5**0.5 - 1) / 2) % 1], axis=1)
        result = [np.zeros(labels.shape, np.float32) for _ in range(2)]
        for own, seen in zip((labels, hidden), result, strict=True):
            arguments = own, labels, hidden, nearest, offsets, *rays.shifts, *rays.steps, *rays.film
            exposures(*arguments, rays.cell_px, seen)
        return np.stack(result)

    def owners(self, labels: np.ndarray, hidden: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Cell (N,) int32 that each photon comes from, and that across an outline near it, or -1."""
        from pcii.scene_model.ray_kernels import outlines, owners

        h, w = labels.shape
        beside, at_edge = np.empty((2 * h, 2 * w), np.int16), np.empty((2 * h, 2 * w), np.bool_)
        outlines(labels, beside, at_edge)
        owner, other = (np.empty(self.rays.n.size, np.int32) for _ in range(2))
        owners(*self.rays.lines, labels, hidden, beside, at_edge, owner, other)
        return owner, other

    @cached_property
    def _mean(self) -> float:
        """Photons per pixel of all that counts."""
        return float(self.rays.n.sum(dtype=float)) / max(self.rays.exposed_px, 1.0)

    @cached_property
    def _shares(self) -> np.ndarray:
        """Shares of the colours in all photons."""
        photons = np.bincount(self.rays.colour, self.rays.n, 1 if self.rays.counts.cfa is None else 3)
        return (photons + 1 / photons.size) / (photons.sum() + 1)

    def _surface_rates(
        self,
        begin: int,
        labels: np.ndarray,
        values: tuple[np.ndarray, np.ndarray],
        own_px: np.ndarray,
        cells: tuple[np.ndarray, np.ndarray],
        rates: tuple[np.ndarray, np.ndarray],
    ) -> np.ndarray:
        """Photons (M,) expected of a surface of these `labels` (h, w); writes `rates` of its photons.

        `values` are photons (C, h, w) of its cells and pixels (h, w) that see them, `own_px` (h, w) those
        where it is not another's; `cells` and `rates` are those of owners and of the other sides of outlines.
        """
        from pcii.scene_model import rate_kernels as kernels

        rays, windows, (h, w) = self.rays, self.parameters.windows_cells, labels.shape
        S, C = len(windows), len(values[0])
        right, down = (np.empty((h, w), np.bool_) for _ in range(2))
        kernels.ends_of(labels, right, down)
        layers = [np.ascontiguousarray(layer, np.float32) for layer in (*values[0], values[1])]
        sums = np.empty((S, C + 1, h, w), np.float32)

        def sum_layer(which: tuple[int, int]) -> None:
            s, c = which
            kernels.window_sums(layers[c], right, down, window_decay(windows[s]), sums[s, c])

        each_in_threads(sum_layer, list(np.ndindex(S, C + 1)))
        photons = np.ascontiguousarray(sums[:, :C].reshape(S, C, -1))
        exposure = np.ascontiguousarray(sums[:, C].reshape(S, -1))
        expected = np.empty((S, labels.size), np.float32)
        kernels.expected_photons(own_px.ravel(), photons, exposure, self._mean, expected)
        by_window = [np.empty((rays.n.size, S), np.float32) for _ in cells]
        for which, own, result in zip(cells, (1.0, 0.0), by_window, strict=True):
            arguments = which, rays.colour, begin, photons, exposure, self._mean, self._shares, own
            kernels.window_rates(*arguments, result)
        gain = np.zeros((S - 1, labels.size), np.float32)
        kernels.add_log_likelihood_gain(cells[0], rays.n, begin, by_window[0], gain)
        gain += expected[-1] - expected[:-1]
        around = np.empty((S - 1, h, w), np.float32)
        decay = window_decay(self.parameters.quality_cells)
        each_in_threads(
            lambda s: kernels.window_sums(gain[s].reshape(h, w), right, down, decay, around[s]), range(S - 1)
        )
        shares = np.empty((S, labels.size), np.float32)
        kernels.window_shares(around.reshape(S - 1, -1), self.parameters.widest_share, shares)
        for which, windowed, rate in zip(cells, by_window, rates, strict=True):
            kernels.mixed_rates(which, begin, windowed, shares, rate)
        return (shares * expected).sum(axis=0)
