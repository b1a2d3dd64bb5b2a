"""Candidates drawn and traced all at once in the renderer's arrays, for compiled backends.

What leaves is NumPy.
"""

from operator import add
from typing import Any, TypeVar

import numpy as np

from simgen.photons.candidates import (
    Accepted,
    Candidates,
    CandidateSampler,
    FilmPoints,
    cells_of,
    is_on_film,
    nothing,
    pixels_of,
)
from simgen.photons.majorant import NEXT_LAYERS, Samples
from simgen.renderer import (
    FirstHits,
    PathTracer,
    RandomNumbers,
    doubles,
    film_rays,
    floats,
    gathered,
    light_of,
    load_drjit,
    opaque,
    signed,
    streams_for,
    unsigned,
    whole,
)
from simgen.sensor import PhotonTable

LEAST_GUESS = 1e-30
Rows = TypeVar("Rows", Candidates, FirstHits)


class WavefrontSampler(CandidateSampler):
    """The `CandidateSampler` of compiled backends; the majorant is uploaded once for all kernels.

    A candidate is rejected in two steps: by its first hit, whose guess times `radiance_ratio_bound` of the
    tile may be less than the bound, and if it survives that, by its path's radiance compared with that
    product.
    """

    paths_each, max_dark_candidates = 1, 1 << 20

    def __post_init__(self) -> None:
        super().__post_init__()
        capture, majorant = self.capture, self.majorant
        self.mi = mi = capture.render_scene.mi
        self.dr, self.light = load_drjit(), light_of(capture.render_scene, capture.cfa)
        self.tracer = PathTracer(capture.render_scene)
        # Numbers that change from pilot to pilot are passed as data: as constants they would be
        # compiled into the kernel, and each pilot would wait for its own.
        self.opaque_ambient = [opaque(mi.Float, part) for part in self.ambient]
        sizes = np.array([sums.size for sums in self.running])
        ends = np.cumsum(sizes)
        self.start, self.stop = unsigned(mi, ends - sizes), unsigned(mi, ends - 1)
        self.steps = 6 * -(-int(sizes.max()).bit_length() // 6)
        self.all_running, self.group_mass = doubles(mi, np.concatenate(self.running)), doubles(mi, self.mass)
        entries, groups = np.arange(majorant.layer.size), capture.cell_groups
        self.entry = unsigned(mi, np.concatenate([entries.repeat(cells.size) for cells in groups]))
        self.cell = unsigned(mi, np.concatenate([np.tile(cells, entries.size) for cells in groups]))
        self.colour_of_cell = unsigned(mi, self.colours)
        tiles = majorant.layer, majorant.row, majorant.col, majorant.side_px, majorant.entry_of
        self.layer, self.row, self.col, self.side_px, self.entry_of = (signed(mi, part) for part in tiles)
        self.dim = floats(mi, majorant.dim)
        # Without an earlier majorant the same kernel runs, with a bound of 0 everywhere.
        below = (0 * majorant.bound,) * 2 if self.below is None else self.below.bounds
        self.bounds, self.bounds_below = (
            tuple(floats(mi, part) for part in both) for both in (majorant.bounds, below)
        )
        layers = majorant.layers
        self.layer_at = signed(mi, layers.layer_at)
        self.nearness_mm = opaque(mi.Float, layers.disparity_mm / layers.step_px)
        self.last_step = opaque(mi.Float, layers.layer_at.size - 1)
        self.last_layer = opaque(mi.Int32, len(layers.row_shift) - 1)
        self.rows, self.cols = opaque(mi.Int32, layers.rows), opaque(mi.Int32, layers.cols)
        self.row_shift, self.col_shift = signed(mi, layers.row_shift), signed(mi, layers.col_shift)

    def try_candidates(self, group: np.ndarray, view: np.ndarray | None, seed: int) -> Accepted:
        capture, mi, dr = self.capture, self.mi, self.dr
        if group.size == 0:
            return nothing(capture.channels)
        sampler = streams_for(mi, seed, group.size)
        candidates = self._draw(sampler, unsigned(mi, group), view)
        first, threshold, chance = self._hit_first(candidates), sampler.next_1d(), sampler.next_1d()
        where = candidates.entry * capture.channels + candidates.colour
        bound = dr.gather(mi.Float, self.bounds[0], where)
        guess = self.light.in_own_colour(first.guess, candidates)
        most, floor = (
            self._limit(bounds, where, candidates.colour, guess)
            for bounds in (self.bounds, self.bounds_below)
        )
        promising = candidates.inside & (threshold * bound < most - floor)
        promising &= mi.UInt32(self._owner_of(candidates, first.z_mm)) == candidates.entry
        dr.eval(promising, most, floor, chance)
        rest = dr.compress(promising)
        if len(rest) == 0:
            return nothing(capture.channels)
        candidates, first = _take(candidates, rest), _take(first, rest)
        light = self._follow(candidates, first, seed, 0)
        most, floor = dr.gather(mi.Float, most, rest), dr.gather(mi.Float, floor, rest)
        radiance = self.light.in_own_colour(light, candidates)
        is_kept = dr.gather(mi.Float, chance, rest) * (most - floor) < radiance - floor
        ratio = radiance / most
        dr.eval(is_kept, ratio)
        accepted, over = dr.compress(is_kept), dr.compress(ratio > 1)
        photon, hit = _take(candidates, accepted), _take(first, accepted)
        candidate = dr.gather(mi.UInt32, rest, accepted)
        dr.eval(*photon, hit.shape, hit.z_mm, candidate)
        self.require_finite(np.array(ratio), candidates, self._objects(first))
        exceeding = nothing(capture.channels).exceeding
        if len(over):
            candidates, first = _take(candidates, over), _take(first, over)
            both = first.guess, gathered(light, over)
            guess, light = (self.light.per_colour(radiance, candidates) for radiance in both)
            dr.eval(*candidates, first.z_mm, guess, light)
            exceeding = _samples(candidates, first.z_mm, guess, light)
        k, l, i, j = (np.array(part) for part in photon[:4])
        origin = {"object_id": self._objects(hit), "z_mm": np.array(hit.z_mm)}
        photons = PhotonTable(k, l, i, j, np.ones(len(accepted), np.int64), **origin)
        return Accepted(photons, np.array(candidate), np.array(ratio), exceeding)

    def trace(self, points: FilmPoints, follow: int, seed: int) -> Samples:
        mi, dr = self.mi, self.dr
        candidates = self._at(streams_for(mi, seed, points.view.size), points)
        some = dr.arange(mi.UInt32, min(follow, points.view.size))
        guess, light = [0.0] * self.capture.channels, [0.0] * self.capture.channels
        z_mm = None
        for turn, colour in enumerate(self.light.colours_to_follow(candidates.colour)):
            recoloured = candidates._replace(colour=colour)
            first = self._hit_first(recoloured)
            followed, first_of_followed = _take(recoloured, some), _take(first, some)
            radiance = self._follow(followed, first_of_followed, seed, turn)
            self.require_finite(np.array(dr.sum(radiance)), followed, self._objects(first_of_followed))
            guess = list(map(add, guess, self.light.per_colour(first.guess, recoloured)))
            light = list(map(add, light, self.light.per_colour(radiance, followed)))
            dr.eval(guess, light)
            z_mm = first.z_mm
        return _samples(candidates, z_mm, guess, light)

    def trace_mirrored(
        self, points: FilmPoints, above: float, seed: int
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """What is brighter than `above` and seen by mirrors alone through these points of films (N,).

        Its radiance (N,) in each pixel's own colour and the number of mirrors before it; and the object and
        depth of the first hit.
        """
        mi = self.mi
        candidates = self._at(streams_for(mi, seed, points.view.size), points)
        first = self._hit_first(candidates)
        self.dr.make_opaque(*candidates, *first)
        sampler = streams_for(mi, seed, points.view.size, part=1)
        path = self._rays(candidates), first.record, sampler, opaque(mi.Float, above)
        light, bounces = self.tracer.mirrored_radiance(*path)
        radiance = self.light.in_own_colour(light, candidates)
        self.dr.eval(radiance, bounces)
        return np.array(radiance), np.array(bounces), self._objects(first), np.array(first.z_mm)

    def _draw(self, sampler: RandomNumbers, group: Any, view_numbers: np.ndarray | None) -> Candidates:
        """One candidate for each of these groups: tile and cell by the bound, the rest evenly."""
        mi, dr, grid = self.mi, self.dr, self.capture.grid
        if view_numbers is None:
            view = dr.minimum(mi.UInt32(sampler.next_1d() * grid.view_count), grid.view_count - 1)
        else:
            view = unsigned(mi, view_numbers)
        # Two draws make one fine enough for tiles that are chosen once in a hundred million.
        fine = dr.floor(sampler.next_1d() * 2**22) + mi.Float64(sampler.next_1d())
        target = mi.Float64(fine) * 2**-22 * gathered(self.group_mass, group)
        low, high = gathered(self.start, group), gathered(self.stop, group)
        for _ in range(self.steps):
            middle = (low + high) >> 1
            beyond = gathered(self.all_running, middle) <= target
            low = dr.select(beyond, dr.minimum(middle + 1, high), low)
            high = dr.select(beyond, high, middle)
        entry, cell = gathered(self.entry, low), gathered(self.cell, low)
        side = gathered(self.side_px, entry)
        k, l = view // grid.cols, view % grid.cols
        layer = gathered(self.layer, entry)
        film = layer < 0
        layer = dr.maximum(layer, 0)
        shift_row, shift_col = (dr.select(film, 0, shift) for shift in self._shifts(layer, k, l))
        # One number gives the pixel (its whole part) and the place within the pixel (the rest).
        down, right = sampler.next_1d() * mi.Float(side // 2), sampler.next_1d() * mi.Float(side // 2)
        row = gathered(self.row, entry) * side + 2 * mi.Int32(down) + mi.Int32(cell >> 1)
        col = gathered(self.col, entry) * side + 2 * mi.Int32(right) + mi.Int32(cell & 1)
        row, col = row - shift_row, col - shift_col
        inside = is_on_film(grid, row, col)
        row_px = mi.Float(row) + (down - dr.floor(down)) - 0.5
        col_px = mi.Float(col) + (right - dr.floor(right)) - 0.5
        colour = gathered(self.colour_of_cell, cell)
        wavelength_sample = self.light.wavelength_samples(sampler, len(group))
        lens_point = self._lens_point(sampler)
        return Candidates(
            k, l, row, col, row_px, col_px, entry, colour, inside, lens_point, wavelength_sample
        )

    def _at(self, sampler: RandomNumbers, points: FilmPoints) -> Candidates:
        """Candidates of no entry at these points."""
        mi, dr, number = self.mi, self.dr, points.view.size
        k, l = np.divmod(points.view, self.capture.grid.cols)
        colour = gathered(self.colour_of_cell, unsigned(mi, cells_of(points)))
        wavelength_sample = self.light.wavelength_samples(sampler, number)
        return Candidates(
            *(unsigned(mi, camera) for camera in (k, l)),
            *(signed(mi, pixel) for pixel in pixels_of(points)),
            *(floats(mi, place - 0.5) for place in (points.row, points.col)),
            entry=dr.zeros(mi.UInt32, number),
            colour=colour,
            inside=dr.full(mi.Bool, True, number),
            lens_point=self._lens_point(sampler),
            wavelength_sample=wavelength_sample,
        )

    def _lens_point(self, sampler: RandomNumbers) -> Any:
        lens = self.capture.rig.lens
        if lens is None:
            return None
        warp = self.mi.warp.square_to_uniform_disk_concentric
        return lens.aperture_mm / 2 * warp(sampler.next_2d())

    def _limit(self, bounds: tuple[Any, Any], where: Any, colour: Any, guess: Any) -> Any:
        """What a path's radiance is at most.

        `where` is the index of its entry and colour, `guess` the radiance that is guessed of its first hit.
        """
        bound, ratio_bound = (gathered(values, where) for values in bounds)
        return self.dr.minimum(bound, self.dr.maximum(ratio_bound * guess, gathered(self.dim, colour)))

    def _owner_of(self, candidates: Candidates, z_mm: Any) -> Any:
        """The entry that each candidate's path, which hits something at depth `z_mm`, belongs to."""
        mi, dr, tile_px = self.mi, self.dr, self.majorant.layers.tile_px
        # As `DisparityLayers.layer_of`: what lies in the cameras' own plane is in the nearest layer.
        z_mm = dr.maximum(z_mm, self.nearness_mm / (self.last_step + 1))
        nearness = dr.minimum(self.nearness_mm / z_mm, self.last_step)
        nearest = gathered(self.layer_at, mi.UInt32(dr.round(nearness)))
        coarse_px, across = self.majorant.coarse_px, self.majorant.coarse_cols
        owner = candidates.row // coarse_px * across + candidates.col // coarse_px
        for aside in reversed(NEXT_LAYERS):
            layer = dr.clip(nearest + aside, 0, self.last_layer)
            shift_row, shift_col = self._shifts(layer, candidates.k, candidates.l, candidates.inside)
            row, col = (candidates.row + shift_row) // tile_px, (candidates.col + shift_col) // tile_px
            listed = gathered(self.entry_of, (layer * self.rows + row) * self.cols + col, candidates.inside)
            owner = dr.select(listed < 0, owner, listed)
        return owner

    def _shifts(self, layer: Any, k: Any, l: Any, active: Any = True) -> tuple[Any, Any]:
        """Rows and columns by which a layer's tiles are moved in each of these views."""
        mi, grid = self.mi, self.capture.grid
        down = gathered(self.row_shift, layer * grid.rows + mi.Int32(k), active)
        return down, gathered(self.col_shift, layer * grid.cols + mi.Int32(l), active)

    # Pilots and candidates are traced by the same two kernels, which know nothing of where rays come from and
    # what becomes of them: kernels that do would be compiled for each, and those of a scene are large.

    def _hit_first(self, candidates: Candidates) -> FirstHits:
        self.dr.make_opaque(*candidates)
        ambient = self.light.spread(self.opaque_ambient, candidates)
        first = self.tracer.hit_first(self._rays(candidates), candidates.inside, ambient)
        self.dr.eval(*first)
        return first

    def _follow(self, candidates: Candidates, first: FirstHits, seed: int, turn: int) -> Any:
        """Radiance along one path from each first hit, as rays carry it; each `turn` has other numbers."""
        self.dr.make_opaque(*candidates, *first)
        # Not the candidates' numbers, which decided which of them are followed.
        sampler = streams_for(self.mi, seed, len(candidates.k), part=1 + turn)
        rays, left_out = self._rays(candidates), self._left_out(candidates)
        light = self.tracer.radiance_along(rays, first.record, sampler, left_out)
        self.dr.eval(light)
        return light

    def _left_out(self, candidates: Candidates) -> tuple[Any, Any] | None:
        """Which candidates lie in cells in which images of lamps are drawn apart, and what of them."""
        cells, mi, dr, grid = self.image_cells, self.mi, self.dr, self.capture.grid
        if cells is None:
            return None
        row, col = (
            mi.UInt64(dr.floor((place + 0.5) * cells.per_px))
            for place in (candidates.row_px, candidates.col_px)
        )
        view = mi.UInt64(candidates.k) * grid.cols + mi.UInt64(candidates.l)
        number = (view * (grid.height * cells.per_px) + row) * (grid.width * cells.per_px) + col
        known = whole(mi, cells.number)
        low, high = mi.UInt32(0), mi.UInt32(cells.number.size - 1)
        for _ in range(cells.number.size.bit_length()):
            middle = (low + high) >> 1
            before = gathered(known, middle) < number
            low, high = dr.select(before, dr.minimum(middle + 1, high), low), dr.select(before, high, middle)
        return gathered(known, low) == number, opaque(mi.Float, cells.above)

    def _rays(self, candidates: Candidates) -> Any:
        at = candidates.k, candidates.l, candidates.row_px, candidates.col_px, candidates.lens_point
        ray = film_rays(self.capture.render_scene, self.capture.rig, *at)
        return self.light.aim(ray, candidates)

    def _objects(self, first: FirstHits) -> np.ndarray:
        """Object ids (N,) of what is hit first."""
        return self.capture.render_scene.object_of_shape[np.array(first.shape)]


def _take(rows: Rows, index: Any) -> Rows:
    """Some of them, by index."""
    return type(rows)(*(None if array is None else gathered(array, index) for array in rows))


def _samples(candidates: Candidates, z_mm: Any, guess: list[Any], light: list[Any]) -> Samples:
    """Candidates as NumPy, of which the first were followed and found `light`."""
    # Of other colours than their own wavelengths tell nothing, and 0 / 0 would be no number.
    guesses = np.maximum([np.array(part) for part in guess], LEAST_GUESS, dtype=np.float64).T
    known = np.full((len(candidates.k), len(guess)), np.nan)
    known[: len(light[0])] = np.stack([np.array(part) for part in light], axis=1)
    k, l, row, col = (np.array(part).astype(np.int64) for part in candidates[:4])
    return Samples(k, l, row, col, np.array(z_mm), guesses, known)
