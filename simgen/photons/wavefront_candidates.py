"""A majorant in the renderer's arrays: many candidates drawn from it at once, and whose tile a path is on."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pcii.core.bayer import colour_cells
from simgen.photons.candidates import Setup, chances
from simgen.photons.majorant import NEXT_LAYERS, Majorant
from simgen.renderer.backend import load_drjit
from simgen.renderer.device_arrays import doubles, floats, gathered, opaque, signed, unsigned
from simgen.renderer.wavelengths import Light


@dataclass(frozen=True)
class Candidates:
    """Candidates as the renderer holds them: camera, pixel, film point, entry, colour, wavelengths, lens."""

    k: Any
    l: Any
    row: Any
    col: Any
    row_px: Any
    col_px: Any
    entry: Any
    colour: Any
    wavelength_sample: Any
    inside: Any
    lens_point: Any


class MajorantArrays:
    """A majorant and the chances of groups of Bayer cells under it, uploaded once for all kernels.

    `mass` (G,) is the sum of the bounds of the pixels of each group in one view.
    """

    def __init__(
        self, setup: Setup, majorant: Majorant, groups: Sequence[np.ndarray], below: Majorant | None
    ) -> None:
        self.setup, self.majorant = setup, majorant
        mi, layers = setup.render_scene.mi, majorant.layers
        of_groups = [chances(setup, majorant, below, cells) for cells in groups]
        sizes = np.array([one.running.size for one in of_groups])
        ends = np.cumsum(sizes)
        self.mass = np.array([one.running[-1] for one in of_groups])
        self.running = doubles(mi, np.concatenate([one.running for one in of_groups]))
        self.start, self.stop = unsigned(mi, ends - sizes), unsigned(mi, ends - 1)
        # Numbers that change from pilot to pilot are passed as data: as constants they would be
        # compiled into the kernel, and each pilot would wait for its own.
        self.steps = 6 * -(-int(sizes.max()).bit_length() // 6)
        self.group_mass = doubles(mi, self.mass)
        self.entry = unsigned(mi, np.concatenate([one.entry for one in of_groups]))
        self.cell = unsigned(mi, np.concatenate([one.cell for one in of_groups]))
        self.colour = unsigned(mi, colour_cells(setup.cfa).ravel())
        self.layer, self.row, self.col = (
            signed(mi, part) for part in (majorant.layer, majorant.row, majorant.col)
        )
        self.side_px = signed(mi, majorant.side_px)
        self.bound, self.radiance_ratio_bound = (
            floats(mi, majorant.bound),
            floats(mi, majorant.radiance_ratio_bound),
        )
        # Without an earlier majorant the same kernel runs, with a bound of 0 everywhere.
        nowhere = np.zeros_like(majorant.bound)
        self.bound_below = floats(mi, nowhere if below is None else below.bound)
        self.ratio_bound_below = floats(mi, nowhere if below is None else below.radiance_ratio_bound)
        self.dim = floats(mi, majorant.dim)
        self.entry_of = signed(mi, majorant.entry_of)
        self.layer_at = signed(mi, layers.layer_at)
        self.nearness_mm = opaque(mi.Float, layers.disparity_mm / layers.step_px)
        self.last_step = opaque(mi.Float, layers.layer_at.size - 1)
        self.last_layer = opaque(mi.Int32, len(layers.row_shift) - 1)
        self.rows, self.cols = opaque(mi.Int32, layers.rows), opaque(mi.Int32, layers.cols)
        self.row_shift, self.col_shift = signed(mi, layers.row_shift), signed(mi, layers.col_shift)

    def draw(self, sampler: Any, group: Any, view: Any, light: Light) -> Candidates:
        """One candidate for each of these groups and views: tile and cell by the bound, the rest evenly."""
        mi, dr = self.setup.render_scene.mi, load_drjit()
        grid = self.setup.grid
        # Two draws make one fine enough for tiles that are chosen once in a hundred million.
        fine = dr.floor(sampler.next_1d() * 2**22) + mi.Float64(sampler.next_1d())
        target = mi.Float64(fine) * 2**-22 * dr.gather(mi.Float64, self.group_mass, group)
        low, high = dr.gather(mi.UInt32, self.start, group), dr.gather(mi.UInt32, self.stop, group)
        for _ in range(self.steps):
            middle = (low + high) >> 1
            beyond = dr.gather(mi.Float64, self.running, middle) <= target
            low, high = (
                dr.select(beyond, dr.minimum(middle + 1, high), low),
                dr.select(beyond, high, middle),
            )
        entry, cell = dr.gather(mi.UInt32, self.entry, low), dr.gather(mi.UInt32, self.cell, low)
        side = dr.gather(mi.Int32, self.side_px, entry)
        k, l = view // grid.cols, view % grid.cols
        layer = dr.gather(mi.Int32, self.layer, entry)
        film = layer < 0
        layer = dr.maximum(layer, 0)
        shift_row, shift_col = (dr.select(film, 0, shift) for shift in self._shifts(layer, k, l))
        # One number gives the pixel (its whole part) and the place within the pixel (the rest).
        down, right = sampler.next_1d() * mi.Float(side // 2), sampler.next_1d() * mi.Float(side // 2)
        row = dr.gather(mi.Int32, self.row, entry) * side + 2 * mi.Int32(down) + mi.Int32(cell >> 1)
        col = dr.gather(mi.Int32, self.col, entry) * side + 2 * mi.Int32(right) + mi.Int32(cell & 1)
        row, col = row - shift_row, col - shift_col
        inside = (row >= 0) & (row < grid.height) & (col >= 0) & (col < grid.width)
        row_px = mi.Float(row) + (down - dr.floor(down)) - 0.5
        col_px = mi.Float(col) + (right - dr.floor(right)) - 0.5
        colour = dr.gather(mi.UInt32, self.colour, cell)
        wavelength_sample = light.wavelength_samples(sampler, len(group))
        lens_point = self._lens_point(sampler)
        return Candidates(
            k, l, row, col, row_px, col_px, entry, colour, wavelength_sample, inside, lens_point
        )

    def limits(self, where: Any, colour: Any, guess: Any) -> tuple[Any, Any]:
        """What a path's radiance is at most, and what it was under the earlier majorant.

        `where` is the index of its entry and colour, `guess` the radiance that is guessed of its first hit.
        """
        mi, dr = self.setup.render_scene.mi, load_drjit()
        dim = dr.gather(mi.Float, self.dim, colour)

        def limit(bound: Any, radiance_ratio_bound: Any) -> Any:
            by_guess = dr.maximum(dr.gather(mi.Float, radiance_ratio_bound, where) * guess, dim)
            return dr.minimum(dr.gather(mi.Float, bound, where), by_guess)

        above = limit(self.bound, self.radiance_ratio_bound)
        return above, limit(self.bound_below, self.ratio_bound_below)

    def at(self, sampler: Any, view: np.ndarray, i: np.ndarray, j: np.ndarray, light: Light) -> Candidates:
        """Candidates (N,) of no entry at given views and places: rows and columns in [0, H) and [0, W)."""
        mi, dr = self.setup.render_scene.mi, load_drjit()
        k, l = np.divmod(view, self.setup.grid.cols)
        row, col = i.astype(np.int64), j.astype(np.int64)
        colour = gathered(self.colour, unsigned(mi, row % 2 * 2 + col % 2))
        return Candidates(
            *(unsigned(mi, camera) for camera in (k, l)),
            *(signed(mi, pixel) for pixel in (row, col)),
            *(floats(mi, place - 0.5) for place in (i, j)),
            entry=dr.zeros(mi.UInt32, view.size),
            colour=colour,
            wavelength_sample=light.wavelength_samples(sampler, view.size),
            inside=dr.full(mi.Bool, True, view.size),
            lens_point=self._lens_point(sampler),
        )

    def _lens_point(self, sampler: Any) -> Any:
        if self.setup.rig.lens is None:
            return None
        radius_mm = self.setup.rig.lens.aperture_mm / 2
        mi = self.setup.render_scene.mi
        return radius_mm * mi.warp.square_to_uniform_disk_concentric(sampler.next_2d())

    def owner_of(self, candidates: Candidates, z_mm: Any) -> Any:
        """The entry that each candidate's path, which hits something at depth `z_mm`, belongs to."""
        mi, dr, layers = self.setup.render_scene.mi, load_drjit(), self.majorant.layers
        # As `DisparityLayers.layer_of`: what lies in the cameras' own plane is in the nearest layer.
        z_mm = dr.maximum(z_mm, self.nearness_mm / (self.last_step + 1))
        nearness = dr.minimum(self.nearness_mm / z_mm, self.last_step)
        nearest = dr.gather(mi.Int32, self.layer_at, mi.UInt32(dr.round(nearness)))
        coarse_px, across = self.majorant.coarse_px, self.majorant.coarse_cols
        owner = candidates.row // coarse_px * across + candidates.col // coarse_px
        for aside in reversed(NEXT_LAYERS):
            layer = dr.clip(nearest + aside, 0, self.last_layer)
            shift_row, shift_col = self._shifts(layer, candidates.k, candidates.l, candidates.inside)
            row, col = (
                (candidates.row + shift_row) // layers.tile_px,
                (candidates.col + shift_col) // layers.tile_px,
            )
            listed = gathered(self.entry_of, (layer * self.rows + row) * self.cols + col, candidates.inside)
            owner = dr.select(listed < 0, owner, listed)
        return owner

    def _shifts(self, layer: Any, k: Any, l: Any, active: Any = True) -> tuple[Any, Any]:
        """Rows and columns by which a layer's tiles are moved in each of these views."""
        mi, grid = self.setup.render_scene.mi, self.setup.grid
        down = gathered(self.row_shift, layer * grid.rows + mi.Int32(k), active)
        return down, gathered(self.col_shift, layer * grid.cols + mi.Int32(l), active)
