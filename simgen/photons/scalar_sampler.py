"""Candidates one after the other, for scalar mode: drawn in NumPy, traced by one call of the renderer each.

A call takes about a microsecond, less than a guess of the radiance would: every candidate whose first hit
belongs to the tile that it was drawn for is followed.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from pcii.base import LUMINANCE
from simgen.base import take_rows
from simgen.photons.candidates import (
    Accepted,
    Candidates,
    CandidateSampler,
    FilmPoints,
    cells_of,
    is_on_film,
    pixels_of,
)
from simgen.photons.majorant import Samples
from simgen.renderer import rows_of
from simgen.sensor import PhotonTable

PATHS = 4
"""Paths of a candidate, whose mean is compared with the bound: the less it varies, the more are kept."""
GUESS = 1e-9
"""What majorants take for a guess: the same of every candidate, and less than any bound."""


class ScalarSampler(CandidateSampler):
    """The `CandidateSampler` of scalar mode, which guesses no radiance."""

    paths_each, max_dark_candidates = PATHS, 1 << 17

    def try_candidates(self, group: np.ndarray, view: np.ndarray | None, seed: int) -> Accepted:
        rng = np.random.default_rng(seed)
        candidates, chance = self._draw(rng, group, view), rng.random(group.size)
        candidate = np.flatnonzero(candidates.inside)
        candidates = _take(candidates, candidate)
        object_id, z_mm = self._first_hits(candidates)
        followed = self.majorant.owner_of(self._samples(candidates, z_mm)) == candidates.entry
        candidates, candidate = _take(candidates, followed), candidate[followed]
        object_id, z_mm = object_id[followed], z_mm[followed]
        light = self._follow(candidates, rng)
        self.require_finite(light.sum(axis=1), candidates, object_id)
        radiance = light[np.arange(len(light)), candidates.colour]
        place = candidates.entry, candidates.colour
        bound = self.majorant.bound[place]
        floor = 0.0 if self.below is None else self.below.bound[place]
        ratio = radiance / bound
        accepted = np.flatnonzero(chance[candidate] * bound < np.minimum(radiance, bound) - floor)
        exceeding = np.flatnonzero(ratio > 1)
        photon = _take(candidates, accepted)
        origin = {"object_id": object_id[accepted], "z_mm": z_mm[accepted]}
        return Accepted(
            PhotonTable(*photon[:4], np.ones_like(photon.k), **origin),
            candidate[accepted],
            ratio,
            self._samples(_take(candidates, exceeding), z_mm[exceeding], light[exceeding]),
        )

    def trace(self, points: FilmPoints, follow: int, seed: int) -> Samples:
        rng = np.random.default_rng(seed)
        points = take_rows(points, slice(follow))
        k, l = np.divmod(points.view, self.capture.grid.cols)
        places = *pixels_of(points), points.row - 0.5, points.col - 0.5
        colour, inside = self.colours[cells_of(points)], np.ones(k.size, dtype=bool)
        lens_point = self._lens_points(rng, k.size)
        candidates = Candidates(k, l, *places, np.zeros_like(k), colour, inside, lens_point)
        colours = [colour]
        if self.capture.render_scene.filters is not None:  # once in each colour
            colours = [np.full_like(colour, number) for number in range(self.capture.channels)]
        turns = (candidates._replace(colour=one) for one in colours)
        light = np.sum([self._follow(turn, rng) for turn in turns], axis=0)
        object_id, z_mm = self._first_hits(candidates)
        self.require_finite(light.sum(axis=1), candidates, object_id)
        return self._samples(candidates, z_mm, light)

    def _draw(self, rng: np.random.Generator, group: np.ndarray, view: np.ndarray | None) -> Candidates:
        """Tile and cell by the bound, the rest evenly."""
        grid, majorant = self.capture.grid, self.majorant
        if view is None:
            view = rng.integers(0, grid.view_count, group.size)
        target = rng.random(group.size)
        entry, cell = np.empty((2, group.size), dtype=np.int64)
        for number, (cells, running) in enumerate(zip(self.capture.cell_groups, self.running, strict=True)):
            here = group == number
            place = np.searchsorted(running, target[here] * running[-1], side="right")
            entry[here], which = np.divmod(np.minimum(place, running.size - 1), cells.size)
            cell[here] = cells[which]
        side, layer = majorant.side_px[entry], majorant.layer[entry]
        k, l = np.divmod(view, grid.cols)
        # One number gives the pixel (its whole part) and the place within the pixel (the rest).
        down, right = rng.random((2, group.size)) * (side // 2)
        row = majorant.row[entry] * side + 2 * down.astype(np.int64) + (cell >> 1)
        col = majorant.col[entry] * side + 2 * right.astype(np.int64) + (cell & 1)
        row -= np.where(layer < 0, 0, majorant.layers.row_shift[layer, k])
        col -= np.where(layer < 0, 0, majorant.layers.col_shift[layer, l])
        row_px, col_px = row + down % 1 - 0.5, col + right % 1 - 0.5
        inside, lens_point = is_on_film(grid, row, col), self._lens_points(rng, group.size)
        return Candidates(k, l, row, col, row_px, col_px, entry, self.colours[cell], inside, lens_point)

    def _lens_points(self, rng: np.random.Generator, number: int) -> np.ndarray:
        """Points (2, N) of the lens in mm; 0 without one."""
        if self.capture.rig.lens is None:
            return np.zeros((2, number))
        return self.capture.rig.lens_points(rng.random((2, number)))

    def _first_hits(self, candidates: Candidates) -> tuple[np.ndarray, np.ndarray]:
        """Object id int16 and planar depth float32 (+inf a miss) of what each hits first."""
        render_scene, intersect = self.capture.render_scene, self.capture.render_scene.scene.ray_intersect
        ids, size = render_scene.objects_by_shape(), candidates.k.size
        object_id, z_mm = np.zeros(size, np.int16), np.full(size, np.inf, np.float32)
        for number, ray in enumerate(self._rays(candidates)):
            hit = intersect(ray)
            if hit.is_valid():
                object_id[number] = ids[(hit.instance or hit.shape).id()]
                z_mm[number] = render_scene.frame.z_mm(hit.p)
        return object_id, z_mm

    def _follow(self, candidates: Candidates, rng: np.random.Generator) -> np.ndarray:
        """Radiance (N, C) of each, the mean of `PATHS` paths; in spectral mode of its own colour, else 0.

        What the first hit shines itself is left out.
        """
        render_scene = self.capture.render_scene
        sampler = render_scene.mi.load_dict({"type": "independent"})
        integrate, scene = render_scene.scene.integrator().sample, render_scene.scene
        # Mitsuba's sampler takes 32 bits. Each candidate has its own, so that chance makes paths of single
        # candidates the same and never those of a whole draw.
        path_seeds = rng.integers(1 << 32, size=candidates.k.size).tolist()

        def radiance(ray: Any, path_seed: int) -> np.ndarray:
            """Mean of all paths, less what shines at the first hit; no less than 0 for rounding."""
            sampler.seed(path_seed, 1)
            total = np.array(sum(integrate(scene, sampler, ray)[0] for _ in range(PATHS))) / PATHS
            if not (render_scene.shining or render_scene.hides_surroundings):
                return total
            hit = scene.ray_intersect(ray)
            if not hit.is_valid():
                return 0 * total if render_scene.hides_surroundings else total
            lamp = hit.emitter(scene)
            return total if lamp is None else np.maximum(total - np.array(lamp.eval(hit)), 0)

        if render_scene.filters is None:
            rays, kind = self._rays(candidates), np.dtype((np.float64, 3))
            rgb = np.fromiter(map(radiance, rays, path_seeds), kind, candidates.k.size)
            return rgb if self.capture.cfa is not None else (rgb @ LUMINANCE)[:, None]
        wavelength_nm, weight = render_scene.filters.draw(candidates.colour, rng.random(candidates.k.size))
        light = np.zeros((candidates.k.size, self.capture.channels))
        for number, (ray, path_seed) in enumerate(zip(self._rays(candidates), path_seeds, strict=True)):
            ray.wavelengths = wavelength_nm[number].tolist()
            light[number, candidates.colour[number]] = weight[number] @ radiance(ray, path_seed)
        return light

    def _rays(self, candidates: Candidates) -> Iterator[Any]:
        """The renderer's rays."""
        mi, frame, one = self.capture.render_scene.mi, self.capture.render_scene.frame, candidates
        rays = self.capture.rig.rays(one.k, one.l, one.row_px, one.col_px, one.lens_point)
        for row in rows_of(np.concatenate([frame.points(rays[0]), frame.directions(rays[1])], axis=1)):
            yield mi.RayDifferential3f(mi.Point3f(row[:3]), mi.Vector3f(row[3:]))

    def _samples(self, candidates: Candidates, z_mm: np.ndarray, light: np.ndarray | None = None) -> Samples:
        guess = np.full((candidates.k.size, self.capture.channels), GUESS)
        return Samples(*candidates[:4], z_mm, guess, guess if light is None else light)


def _take(candidates: Candidates, which: np.ndarray) -> Candidates:
    """Some of them, by mask or index."""
    return Candidates(*(column[..., which] for column in candidates[:-1]))
