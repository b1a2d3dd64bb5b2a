"""Candidates drawn and traced all at once in the renderer's arrays, for compiled backends.

What leaves is NumPy.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from pcii.core.bayer import colour_cells
from simgen.photons.candidates import Accepted, FilmPoints, Setup, chances, nothing, require_finite
from simgen.photons.disparity_layers import Samples
from simgen.photons.majorant import NEXT_LAYERS, Majorant
from simgen.renderer.backend import doubles, floats, gathered, load_drjit, opaque, signed, unsigned
from simgen.renderer.path_tracing import FirstHits, film_rays, hit_first, radiance_along
from simgen.renderer.wavelengths import Light, light_of, of_colour
from simgen.sensor.photon_table import PhotonTable

LEAST_GUESS = 1e-30
PATH_SEED_MASK = 0x9E3779B9
"""Flips 20 of the 32 bits (2^32 over the golden ratio, which has no pattern) of the seed that candidates are
drawn with: their paths get random numbers of their own."""


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
        places = majorant.layer, majorant.row, majorant.col, majorant.side_px
        self.layer, self.row, self.col, self.side_px = (signed(mi, part) for part in places)
        self.bound = floats(mi, majorant.bound)
        self.radiance_ratio_bound = floats(mi, majorant.radiance_ratio_bound)
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
            low = dr.select(beyond, dr.minimum(middle + 1, high), low)
            high = dr.select(beyond, high, middle)
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
            row = (candidates.row + shift_row) // layers.tile_px
            col = (candidates.col + shift_col) // layers.tile_px
            listed = gathered(self.entry_of, (layer * self.rows + row) * self.cols + col, candidates.inside)
            owner = dr.select(listed < 0, owner, listed)
        return owner

    def _shifts(self, layer: Any, k: Any, l: Any, active: Any = True) -> tuple[Any, Any]:
        """Rows and columns by which a layer's tiles are moved in each of these views."""
        mi, grid = self.setup.render_scene.mi, self.setup.grid
        down = gathered(self.row_shift, layer * grid.rows + mi.Int32(k), active)
        return down, gathered(self.col_shift, layer * grid.cols + mi.Int32(l), active)


Record = TypeVar("Record", Candidates, FirstHits)


class WavefrontSampler:
    """The `CandidateSampler` of compiled backends; `ambient` is a guess of the light from all around.

    A candidate is rejected in two steps: by its first hit, whose guess times `radiance_ratio_bound` of the
    tile may be less than the bound, and if it survives that, by its path's radiance compared with that
    product.
    """

    paths_each, max_dark_candidates = 1, 1 << 20

    def __init__(
        self,
        setup: Setup,
        majorant: Majorant,
        groups: Sequence[np.ndarray],
        ambient: np.ndarray,
        below: Majorant | None,
    ) -> None:
        self.setup, self.majorant, self.below = setup, majorant, below
        self.light = light_of(setup.render_scene, setup.cfa)
        self.arrays = MajorantArrays(setup, majorant, groups, below)
        self.mass = self.arrays.mass
        self.ambient = [opaque(setup.render_scene.mi.Float, part) for part in ambient]

    def try_candidates(self, group: np.ndarray, view: np.ndarray | None, seed: int) -> Accepted:
        """See `candidates`."""
        setup = self.setup
        if group.size == 0:
            return nothing(setup.channels)
        mi, dr = setup.render_scene.mi, load_drjit()
        sampler = _sampler(mi, seed, group.size)
        candidates = self.arrays.draw(sampler, unsigned(mi, group), _views(setup, sampler, view), self.light)
        first, threshold, chance = self._hit_first(candidates), sampler.next_1d(), sampler.next_1d()
        where = candidates.entry * setup.channels + candidates.colour
        bound = dr.gather(mi.Float, self.arrays.bound, where)
        guess = self._in_own_colour(first.guess, candidates)
        most, floor = self.arrays.limits(where, candidates.colour, guess)
        promising = candidates.inside & (threshold * bound < most - floor)
        promising &= mi.UInt32(self.arrays.owner_of(candidates, first.z_mm)) == candidates.entry
        dr.eval(promising, most, floor, chance)
        rest = dr.compress(promising)
        if len(rest) == 0:
            return nothing(setup.channels)
        candidates, first = _take(candidates, rest), _take(first, rest)
        light = self._follow(candidates, first, seed)
        most, floor = dr.gather(mi.Float, most, rest), dr.gather(mi.Float, floor, rest)
        radiance = self._in_own_colour(light, candidates)
        is_kept = dr.gather(mi.Float, chance, rest) * (most - floor) < radiance - floor
        ratio = radiance / most
        dr.eval(is_kept, ratio)
        kept, over = dr.compress(is_kept), dr.compress(ratio > 1)
        photon, hit = _take(candidates, kept), _take(first, kept)
        candidate = dr.gather(mi.UInt32, rest, kept)
        dr.eval(vars(photon), hit.shape, hit.z_mm, candidate)
        self._require_finite(ratio, first)
        exceeding = nothing(setup.channels).exceeding
        if len(over):
            exceeding = self._exceeding(candidates, first, light, over)
        k, l, i, j = (np.array(part) for part in (photon.k, photon.l, photon.row, photon.col))
        object_id = setup.render_scene.object_of_shape[np.array(hit.shape)]
        origin = {"object_id": object_id, "z_mm": np.array(hit.z_mm)}
        photons = PhotonTable(k, l, i, j, np.ones(len(kept), np.int64), **origin)
        return Accepted(photons, np.array(candidate), np.array(ratio), exceeding)

    def trace(self, points: FilmPoints, follow: int, seed: int) -> Samples:
        """See `candidates`."""
        setup = self.setup
        mi, dr = setup.render_scene.mi, load_drjit()
        view = points.view
        candidates = self.arrays.at(_sampler(mi, seed, view.size), view, points.row, points.col, self.light)
        some = dr.arange(mi.UInt32, min(follow, view.size))
        guess, light = [0.0] * setup.channels, [0.0] * setup.channels
        z_mm = None
        for turn, colour in enumerate(self.light.colours_to_follow(candidates.colour)):
            recoloured = replace(candidates, colour=colour)
            first = self._hit_first(recoloured)
            followed, first_of_followed = _take(recoloured, some), _take(first, some)
            found = self._follow(followed, first_of_followed, seed + turn)
            self._require_finite(dr.sum(found), first_of_followed)
            part = self.light.per_colour(first.guess, colour, candidates.wavelength_sample)
            guess = [old + new for old, new in zip(guess, part, strict=True)]
            part = self.light.per_colour(found, followed.colour, followed.wavelength_sample)
            light = [old + new for old, new in zip(light, part, strict=True)]
            dr.eval(guess, light)
            z_mm = first.z_mm
        return _samples(candidates, z_mm, guess, light)

    # Pilots and candidates are traced by the same two kernels, which know nothing of where rays come from and
    # what becomes of them: kernels that do would be compiled for each, and those of a scene are large.

    def _hit_first(self, candidates: Candidates) -> FirstHits:
        dr = load_drjit()
        dr.make_opaque(vars(candidates))
        ambient = self.light.spread(self.ambient, candidates.colour, candidates.wavelength_sample)
        first = hit_first(self.setup.render_scene, self._rays(candidates), candidates.inside, ambient)
        dr.eval(vars(first))
        return first

    def _rays(self, candidates: Candidates) -> Any:
        at = candidates.k, candidates.l, candidates.row_px, candidates.col_px, candidates.lens_point
        ray = film_rays(self.setup.render_scene, self.setup.rig, *at)
        return self.light.aim(ray, candidates.colour, candidates.wavelength_sample)

    def _follow(self, candidates: Candidates, first: FirstHits, seed: int) -> Any:
        """Radiance along one path from each first hit, as rays carry it."""
        render_scene, dr = self.setup.render_scene, load_drjit()
        dr.make_opaque(vars(candidates), vars(first))
        # Not the candidates' numbers, which decided which of them are followed.
        sampler = _sampler(render_scene.mi, seed ^ PATH_SEED_MASK, len(candidates.k))
        rays = self._rays(candidates)
        light = radiance_along(render_scene, rays, first.record, sampler, self.setup.max_depth)
        dr.eval(light)
        return light

    def _require_finite(self, radiance: Any, first: FirstHits) -> None:
        """`InputError` for radiance that is not finite, with the object that was hit first."""
        values = np.array(radiance)
        if not np.isfinite(values).all():
            require_finite(self.setup, values, self.setup.render_scene.object_of_shape[np.array(first.shape)])

    def _in_own_colour(self, radiance: Any, candidates: Candidates) -> Any:
        """What each candidate's pixel gets of radiance that rays carry."""
        return of_colour(
            self.light.per_colour(radiance, candidates.colour, candidates.wavelength_sample),
            candidates.colour,
        )

    def _exceeding(self, candidates: Candidates, first: FirstHits, light: Any, over: Any) -> Samples:
        dr = load_drjit()
        candidates, first = _take(candidates, over), _take(first, over)
        guess, light_over = (
            self.light.per_colour(radiance, candidates.colour, candidates.wavelength_sample)
            for radiance in (first.guess, gathered(light, over))
        )
        dr.eval(vars(candidates), first.z_mm, guess, light_over)
        return _samples(candidates, first.z_mm, guess, light_over)


def _sampler(mi: Any, seed: int, size: int) -> Any:
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(seed, size)
    return sampler


def _views(setup: Setup, sampler: Any, view: np.ndarray | None) -> Any:
    """The candidates' views, drawn evenly if they are not given."""
    mi, count = setup.render_scene.mi, setup.grid.view_count
    if view is not None:
        return unsigned(mi, view)
    return load_drjit().minimum(mi.UInt32(sampler.next_1d() * count), count - 1)


def _take(record: Record, index: Any) -> Record:
    """Some elements of each of a record's arrays."""
    known = {name: array for name, array in vars(record).items() if array is not None}
    return replace(record, **{name: gathered(array, index) for name, array in known.items()})


def _samples(candidates: Candidates, z_mm: Any, guess: list[Any], light: list[Any]) -> Samples:
    """Candidates as NumPy, of which the first were followed and found `light`."""
    # Of other colours than their own wavelengths tell nothing, and 0 / 0 would be no number.
    guesses = np.maximum([np.array(part) for part in guess], LEAST_GUESS, dtype=np.float64).T
    known = np.full((len(candidates.k), len(guess)), np.nan)
    known[: len(light[0])] = np.stack([np.array(part) for part in light], axis=1)
    return Samples(
        **{name: np.array(getattr(candidates, name)).astype(np.int64) for name in ("k", "l", "row", "col")},
        z_mm=np.array(z_mm),
        guess=guesses,
        light=known,
    )
