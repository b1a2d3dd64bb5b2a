"""Candidates one after the other, for scalar mode: drawn in NumPy, traced by one call of the renderer each.

A call takes about a microsecond, less than a guess of the radiance would: every candidate whose first hit
belongs to the tile that it was drawn for is followed.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pcii.base.srgb import LUMINANCE
from pcii.core.bayer import colour_cells
from simgen.photons.candidates import Accepted, FilmPoints, Setup, chances, require_finite
from simgen.photons.disparity_layers import Samples
from simgen.photons.majorant import Majorant
from simgen.renderer.intersection import objects_by_shape, rows_of
from simgen.sensor.photon_table import PhotonTable

PATHS = 4
"""Paths of a candidate, whose mean is compared with the bound: the less it varies, the more are kept."""
GUESS = 1e-9
"""What majorants take for a guess: the same of every candidate, and less than any bound."""


@dataclass(frozen=True)
class _Candidates:
    """Candidates (N,): camera, pixel, point of the film, entry of the majorant, colour, point of the lens.

    `lens_x_mm` and `lens_y_mm` are 0 without a lens.
    """

    k: np.ndarray
    l: np.ndarray
    row: np.ndarray
    col: np.ndarray
    row_px: np.ndarray
    col_px: np.ndarray
    entry: np.ndarray
    colour: np.ndarray
    lens_x_mm: np.ndarray
    lens_y_mm: np.ndarray

    def take(self, which: np.ndarray) -> "_Candidates":
        return _Candidates(**{name: column[which] for name, column in vars(self).items()})


class ScalarSampler:
    """The `CandidateSampler` of scalar mode."""

    paths_each, max_dark_candidates = PATHS, 1 << 17

    def __init__(
        self, setup: Setup, majorant: Majorant, groups: Sequence[np.ndarray], below: Majorant | None
    ) -> None:
        self.setup, self.majorant, self.below = setup, majorant, below
        self.groups = [chances(setup, majorant, below, cells) for cells in groups]
        self.mass = np.array([one.running[-1] for one in self.groups])

    def try_candidates(self, group: np.ndarray, view: np.ndarray | None, seed: int) -> Accepted:
        """See `candidates`."""
        rng = np.random.default_rng(seed)
        candidates, chance = self._draw(rng, group, view), rng.random(group.size)
        grid, row, col = self.setup.grid, candidates.row, candidates.col
        candidate = np.flatnonzero((row >= 0) & (row < grid.height) & (col >= 0) & (col < grid.width))
        candidates, chance = candidates.take(candidate), chance[candidate]
        object_id, z_mm = self._first_hits(candidates)
        followed = self.majorant.owner_of(self._samples(candidates, z_mm)) == candidates.entry
        candidates = candidates.take(followed)
        candidate, chance = candidate[followed], chance[followed]
        object_id, z_mm = object_id[followed], z_mm[followed]
        light = self._follow(candidates, rng, seed)
        require_finite(self.setup, light, object_id)
        own = light[np.arange(light.shape[0]), candidates.colour]
        bound = self.majorant.bound[candidates.entry, candidates.colour]
        floor = 0.0 if self.below is None else self.below.bound[candidates.entry, candidates.colour]
        ratio = own / bound
        kept = np.flatnonzero(chance * bound < np.minimum(own, bound) - floor)
        exceeding = np.flatnonzero(ratio > 1)
        photon, origin = candidates.take(kept), {"object_id": object_id[kept], "z_mm": z_mm[kept]}
        return Accepted(
            PhotonTable(photon.k, photon.l, photon.row, photon.col, np.ones_like(photon.k), **origin),
            candidate[kept],
            ratio,
            self._samples(candidates.take(exceeding), z_mm[exceeding], light[exceeding]),
        )

    def trace(self, points: FilmPoints, follow: int, seed: int) -> Samples:
        """See `candidates`; only those that are followed are traced."""
        rng = np.random.default_rng(seed)
        view, i, j = (part[:follow] for part in points)
        k, l = np.divmod(view, self.setup.grid.cols)
        row, col = i.astype(np.int64), j.astype(np.int64)
        colour = colour_cells(self.setup.cfa).ravel()[row % 2 * 2 + col % 2]
        lens_point = self._lens_points(rng, view.size)
        candidates = _Candidates(k, l, row, col, i - 0.5, j - 0.5, np.zeros_like(k), colour, *lens_point)
        turns = enumerate(self._in_colours(candidates))
        light = np.sum([self._follow(recoloured, rng, seed + turn) for turn, recoloured in turns], axis=0)
        object_id, z_mm = self._first_hits(candidates)
        require_finite(self.setup, light, object_id)
        return self._samples(candidates, z_mm, light)

    def _in_colours(self, candidates: _Candidates) -> Iterator[_Candidates]:
        """The candidates as often as they must be followed to show all colours."""
        if self.setup.render_scene.filters is None:
            yield candidates
            return
        for colour in range(self.setup.channels):
            yield replace(candidates, colour=np.full_like(candidates.colour, colour))

    def _draw(self, rng: np.random.Generator, group: np.ndarray, view: np.ndarray | None) -> _Candidates:
        """Tile and cell by the bound, the rest evenly."""
        grid, majorant = self.setup.grid, self.majorant
        if view is None:
            view = rng.integers(0, grid.view_count, group.size)
        target, entry = rng.random(group.size), np.empty(group.size, dtype=np.int64)
        cell = np.empty(group.size, dtype=np.int64)
        for number, chances_here in enumerate(self.groups):
            here = group == number
            running = chances_here.running
            place = np.searchsorted(running, target[here] * running[-1], side="right")
            place = np.minimum(place, running.size - 1)
            entry[here], cell[here] = chances_here.entry[place], chances_here.cell[place]
        side, layer = majorant.side_px[entry], majorant.layer[entry]
        k, l = np.divmod(view, grid.cols)
        # One number gives the pixel (its whole part) and the place within the pixel (the rest).
        down, right = rng.random((2, group.size)) * (side // 2)
        row = majorant.row[entry] * side + 2 * down.astype(np.int64) + (cell >> 1)
        col = majorant.col[entry] * side + 2 * right.astype(np.int64) + (cell & 1)
        row -= np.where(layer < 0, 0, majorant.layers.row_shift[layer, k])
        col -= np.where(layer < 0, 0, majorant.layers.col_shift[layer, l])
        row_px, col_px = row + down % 1 - 0.5, col + right % 1 - 0.5
        lens_point = self._lens_points(rng, group.size)
        colour = colour_cells(self.setup.cfa).ravel()[cell]
        return _Candidates(k, l, row, col, row_px, col_px, entry, colour, *lens_point)

    def _lens_points(self, rng: np.random.Generator, number: int) -> np.ndarray:
        if self.setup.rig.lens is None:
            return np.zeros((2, number))
        return self.setup.rig.lens_points(rng.random((2, number)))

    def _first_hits(self, candidates: _Candidates) -> tuple[np.ndarray, np.ndarray]:
        """Object id int16 and planar depth float32 (+inf a miss) of what each hits first."""
        render_scene, intersect = self.setup.render_scene, self.setup.render_scene.scene.ray_intersect
        ids, size = objects_by_shape(render_scene), candidates.k.size
        object_id, z_mm = np.zeros(size, np.int16), np.full(size, np.inf, np.float32)
        for number, ray in enumerate(self._traced(candidates)):
            hit = intersect(ray)
            if hit.is_valid():
                object_id[number] = ids[(hit.instance or hit.shape).id()]
                z_mm[number] = render_scene.frame.z_mm(hit.p)
        return object_id, z_mm

    def _follow(self, candidates: _Candidates, rng: np.random.Generator, seed: int) -> np.ndarray:
        """Radiance (N, C) of each, the mean of `PATHS` paths; in spectral mode of its own colour, else 0.

        What the first hit shines itself is left out.
        """
        render_scene = self.setup.render_scene
        sampler = render_scene.mi.load_dict({"type": "independent"})
        sampler.seed(seed, 1)
        integrate, scene = render_scene.scene.integrator().sample, render_scene.scene

        def paths(ray: Any) -> np.ndarray:
            """Mean of all paths, less what shines at the first hit; no less than 0 for rounding."""
            total = np.array(sum(integrate(scene, sampler, ray)[0] for _ in range(PATHS))) / PATHS
            if not render_scene.shining:
                return total
            hit = scene.ray_intersect(ray)
            lamp = hit.emitter(scene) if hit.is_valid() else None
            return total if lamp is None else np.maximum(total - np.array(lamp.eval(hit)), 0)

        if render_scene.filters is None:
            rgb = np.empty((candidates.k.size, 3))
            for number, ray in enumerate(self._traced(candidates)):
                rgb[number] = paths(ray)
            return rgb if self.setup.cfa is not None else (rgb @ LUMINANCE)[:, None]
        chosen_nm, weight = render_scene.filters.draw(candidates.colour, rng.random(candidates.k.size))
        light = np.zeros((candidates.k.size, self.setup.channels))
        for number, ray in enumerate(self._traced(candidates)):
            ray.wavelengths = chosen_nm[number].tolist()
            light[number, candidates.colour[number]] = weight[number] @ paths(ray)
        return light

    def _traced(self, candidates: _Candidates) -> Iterator[Any]:
        """The renderer's rays."""
        mi, lens_point = self.setup.render_scene.mi, np.stack([candidates.lens_x_mm, candidates.lens_y_mm])
        origins, directions = self.setup.rig.rays(
            candidates.k, candidates.l, candidates.row_px, candidates.col_px, lens_point
        )
        frame = self.setup.render_scene.frame
        origins, directions = frame.points(origins), frame.directions(directions)
        for ray in rows_of(np.concatenate([origins, directions], axis=1)):
            yield mi.RayDifferential3f(mi.Point3f(ray[:3]), mi.Vector3f(ray[3:]))

    def _samples(self, candidates: _Candidates, z_mm: np.ndarray, light: np.ndarray | None = None) -> Samples:
        guess = np.full((candidates.k.size, self.setup.channels), GUESS)
        place = candidates.k, candidates.l, candidates.row, candidates.col
        return Samples(*place, z_mm, guess, guess if light is None else light)
