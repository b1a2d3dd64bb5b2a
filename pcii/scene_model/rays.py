"""Rays of photons through a ladder of depths, in cells of the virtual centre."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pcii.core.focal_planes import FocalPlanes
from pcii.core.geometry import total_disparity_px
from pcii.core.photon_counts import PhotonCounts
from pcii.scene_model.parameters import SceneParameters


@dataclass(frozen=True, eq=False)
class Rays:
    """The photons of counts as rays through `planes` of evenly spaced total disparity, from far to near.

    Counted are rays that stay within the film of the virtual centre at all planes: so every labelling
    explains the same photons. A photon lies anywhere in its pixel, at random (by `seed`, always the same).
    """

    counts: PhotonCounts
    planes: FocalPlanes
    cell_px: int
    seed: int = 0

    @classmethod
    def through(
        cls, counts: PhotonCounts, z_range_mm: tuple[float, float], parameters: SceneParameters
    ) -> "Rays":
        """Rays through a ladder over a range of depths (near, far), and one step behind it.

        A step is half a cell of total disparity, so that cameras at the ends of the grid see a surface move
        by a quarter of a cell; more where that were too many depths. A cell has pixels of all colours: with
        one, depths at which shifts of cameras are whole would tell colours apart for no reason.
        """
        grid = counts.grid
        cell_px = max(1 if counts.cfa is None else 2, -(-max(grid.shape_HW) // parameters.cells_across))
        near_px, far_px = (float(total_disparity_px(grid, z_mm)) for z_mm in z_range_mm)
        step_px = max(cell_px / 2, (near_px - far_px) / (parameters.most_labels - 2))
        count = int(np.ceil((near_px - far_px) / step_px)) + 2
        total_px = far_px + step_px * np.arange(-1, count - 1)
        return cls(counts, FocalPlanes.at_total_disparity(grid, np.maximum(total_px, far_px / 2)), cell_px)

    @cached_property
    def shape(self) -> tuple[int, int]:
        """Cells (h, w) of the film; the last ones of an axis may reach beyond it."""
        h, w = (-(-size // self.cell_px) for size in self.counts.grid.shape_HW)
        return h, w

    @cached_property
    def shifts(self) -> tuple[np.ndarray, np.ndarray]:
        """Shifts of rows (K,) and columns (L,) of cameras at the farthest plane, float64, in cells."""
        rows, cols = self.planes.exact_shifts_px
        return rows[0] / self.cell_px, cols[0] / self.cell_px

    @cached_property
    def steps(self) -> tuple[np.ndarray, np.ndarray]:
        """By how much these shifts grow from plane to plane."""
        rows, cols = (
            (shifts[-1] - shifts[0]) / (len(self.planes) - 1) for shifts in self.planes.exact_shifts_px
        )
        return rows / self.cell_px, cols / self.cell_px

    @property
    def largest_step(self) -> float:
        """By how many cells a ray moves from plane to plane, at most."""
        return float(max(np.abs(step).max() for step in self.steps))

    @cached_property
    def film(self) -> tuple[np.ndarray, np.ndarray]:
        """First and last row (K, 2), and column (L, 2), of each camera's film that count, in cells."""
        parts = []
        for size_px, shifts_px in zip(self.counts.grid.shape_HW, self.planes.exact_shifts_px, strict=True):
            first_px = np.maximum(0.0, -shifts_px.min(axis=0))
            last_px = np.maximum(first_px, size_px - np.maximum(0.0, shifts_px.max(axis=0)))
            parts.append(np.stack([first_px, last_px], axis=1) / self.cell_px)
        return parts[0], parts[1]

    @property
    def exposed_px(self) -> float:
        """Pixels of all cameras that count."""
        rows, cols = ((part[:, 1] - part[:, 0]).sum() for part in self.film)
        return float(rows * cols) * self.cell_px**2

    @cached_property
    def _inside(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Row and column in cells of each event, and whether it counts."""
        events = self.counts.events
        within = np.random.default_rng(self.seed).random((2, events.n.size))
        row, col = (events.i + within[0]) / self.cell_px, (events.j + within[1]) / self.cell_px
        rows, cols = self.film[0][events.k], self.film[1][events.l]
        return row, col, (rows[:, 0] <= row) & (row < rows[:, 1]) & (cols[:, 0] <= col) & (col < cols[:, 1])

    @cached_property
    def lines(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Rows and columns at the farthest plane, and steps to the next, (N,) float32 in half cells."""
        (row, col, inside), events = self._inside, self.counts.events
        k, l = events.k[inside], events.l[inside]
        lines = (
            row[inside] + self.shifts[0][k],
            col[inside] + self.shifts[1][l],
            self.steps[0][k],
            self.steps[1][l],
        )
        return tuple((2 * line).astype(np.float32) for line in lines)  # type: ignore[return-value]

    @cached_property
    def n(self) -> np.ndarray:
        """Photons of each event that counts (N,) float32."""
        return self.counts.events.n[self._inside[2]].astype(np.float32)

    @cached_property
    def colour(self) -> np.ndarray:
        """Their colours (N,) int32."""
        return self.counts.event_colours[self._inside[2]].astype(np.int32)

    @cached_property
    def middle_cell(self) -> np.ndarray:
        """Cell (N,) that each ray crosses at the middle depth, to which its photons' energy is assigned."""
        row, col, step_row, step_col = self.lines
        middle, (h, w) = len(self.planes) // 2, self.shape
        i = np.clip((row + middle * step_row) / 2, 0, h - 1).astype(np.int64)
        j = np.clip((col + middle * step_col) / 2, 0, w - 1).astype(np.int64)
        return i * w + j
