"""Candidates in the renderer's arrays, one lane each, for compiled backends; what leaves is NumPy."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from pcii.core.bayer import colour_cells
from simgen.photons.candidates import Accepted, Setup, chances, nothing
from simgen.photons.majorant import NEXT_LAYERS, Majorant, Samples
from simgen.renderer.backend import load_drjit
from simgen.renderer.mitsuba_camera import film_rays
from simgen.renderer.path_tracing import FirstHits, hit_first, radiance_along
from simgen.renderer.wavelengths import light_of, of_colour
from simgen.sensor.photon_table import PhotonTable

LEAST_GUESS = 1e-30


@dataclass(frozen=True)
class _Lanes:
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


Record = TypeVar("Record", _Lanes, FirstHits)


class LanePool:
    """The `CandidateSampler` of compiled backends; `ambient` is a guess of the light from all around.

    A candidate is rejected in two steps: by its first hit, whose guess times `radiance_ratio_bound` of the
    tile may be less than the bound, and if it survives that, by its path's radiance compared with that
    product.
    """

    paths_each, max_dark_candidates = 1, 1 << 20

    def __init__(
        self, setup: Setup, majorant: Majorant, groups: Sequence[np.ndarray], ambient: np.ndarray
    ) -> None:
        self.setup, self.majorant = setup, majorant
        self.light = light_of(setup.render_scene, setup.cfa)
        mi, frame = setup.render_scene.mi, majorant.frame
        of_groups = [chances(setup, majorant, cells) for cells in groups]
        sizes = np.array([own.running.size for own in of_groups])
        ends = np.cumsum(sizes)
        self.mass = np.array([own.running[-1] for own in of_groups])
        self.running = _doubles(mi, np.concatenate([own.running for own in of_groups]))
        self.start, self.stop = _unsigned(mi, ends - sizes), _unsigned(mi, ends - 1)
        # Numbers that change from pilot to pilot are passed as data: as constants they would be
        # compiled into the kernel, and each pilot would wait for its own.
        self.steps = 6 * -(-int(sizes.max()).bit_length() // 6)
        self.group_mass = _doubles(mi, self.mass)
        self.entry = _unsigned(mi, np.concatenate([own.entry for own in of_groups]))
        self.cell = _unsigned(mi, np.concatenate([own.cell for own in of_groups]))
        self.colour = _unsigned(mi, colour_cells(setup.cfa).ravel())
        self.layer, self.row, self.col = (
            _signed(mi, part) for part in (majorant.layer, majorant.row, majorant.col)
        )
        self.side_px = _signed(mi, majorant.side_px)
        self.bound, self.radiance_ratio_bound = (
            _floats(mi, majorant.bound),
            _floats(mi, majorant.radiance_ratio_bound),
        )
        self.dim = _floats(mi, majorant.dim)
        self.ambient = [_opaque(mi.Float, part) for part in ambient]
        self.entry_of = _signed(mi, majorant.entry_of)
        self.layer_at = _signed(mi, frame.layer_at)
        self.nearness_mm = _opaque(mi.Float, frame.disparity_mm / frame.step_px)
        self.last_step = _opaque(mi.Float, frame.layer_at.size - 1)
        self.last_layer = _opaque(mi.Int32, len(frame.row_shift) - 1)
        self.rows, self.cols = _opaque(mi.Int32, frame.rows), _opaque(mi.Int32, frame.cols)
        self.row_shift, self.col_shift = _signed(mi, frame.row_shift), _signed(mi, frame.col_shift)

    def try_candidates(self, group: np.ndarray, view: np.ndarray | None, seed: int) -> Accepted:
        """See `candidates`."""
        setup = self.setup
        if group.size == 0:
            return nothing(setup.channels)
        mi, dr = setup.render_scene.mi, load_drjit()
        sampler = _sampler(mi, seed, group.size)
        lanes, first = self._first_seen(sampler, _unsigned(mi, group), view)
        where = lanes.entry * setup.channels + lanes.colour
        bound, radiance_ratio_bound = (
            dr.gather(mi.Float, self.bound, where),
            dr.gather(mi.Float, self.radiance_ratio_bound, where),
        )
        guess = self._seen(first.guess, lanes)
        most = dr.minimum(
            bound, dr.maximum(radiance_ratio_bound * guess, dr.gather(mi.Float, self.dim, lanes.colour))
        )
        promising = lanes.inside & (sampler.next_1d() * bound < most)
        promising &= mi.UInt32(self._owner(lanes, first.z_mm)) == lanes.entry
        chance = sampler.next_1d()
        dr.eval(promising, vars(lanes), vars(first), most, chance)
        rest = dr.compress(promising)
        if len(rest) == 0:
            return nothing(setup.channels)
        lanes, first = _take(dr, lanes, rest), _take(dr, first, rest)
        light = self._follow(lanes, first, seed)
        ratio = self._seen(light, lanes) / dr.gather(mi.Float, most, rest)
        multiplicity = mi.UInt32(ratio + dr.gather(mi.Float, chance, rest))
        dr.eval(multiplicity, ratio, light)
        kept, over = dr.compress(multiplicity > 0), dr.compress(ratio > 1)
        photon, hit = _take(dr, lanes, kept), _take(dr, first, kept)
        candidate, multiplicity = dr.gather(mi.UInt32, rest, kept), dr.gather(mi.UInt32, multiplicity, kept)
        dr.eval(vars(photon), hit.shape, hit.z_mm, candidate, multiplicity)
        return Accepted(
            photons=PhotonTable(
                k=np.array(photon.k),
                l=np.array(photon.l),
                i=np.array(photon.row),
                j=np.array(photon.col),
                n=np.array(multiplicity),
                object_id=setup.render_scene.object_of_shape[np.array(hit.shape)],
                z_mm=np.array(hit.z_mm),
            ),
            candidate=np.array(candidate),
            ratio=np.array(ratio),
            over=self._exceeding(lanes, first, light, over) if len(over) else nothing(setup.channels).over,
        )

    def look_around(self, number: int, follow: int, seed: int) -> Samples:
        """See `candidates`."""
        setup = self.setup
        mi, dr = setup.render_scene.mi, load_drjit()
        sampler = _sampler(mi, seed, number)
        lanes = self._draw(sampler, dr.zeros(mi.UInt32, number), _views(setup, sampler, None))
        dr.eval(vars(lanes))
        lanes = _take(dr, lanes, dr.compress(lanes.inside))
        some = dr.arange(mi.UInt32, min(follow, len(lanes.k)))
        guess, light = [0.0] * setup.channels, [0.0] * setup.channels
        z_mm = None
        for look, colour in enumerate(self.light.looks(lanes.colour)):
            own = replace(lanes, colour=colour)
            first = self._hit_first(own)
            dr.eval(vars(first))
            followed = _take(dr, own, some)
            found = self._follow(followed, _take(dr, first, some), seed + look)
            seen = self.light.seen(first.guess, colour, lanes.wavelength_sample)
            guess = [old + new for old, new in zip(guess, seen, strict=True)]
            seen = self.light.seen(found, followed.colour, followed.wavelength_sample)
            light = [old + new for old, new in zip(light, seen, strict=True)]
            dr.eval(guess, light)
            z_mm = first.z_mm
        return _samples(lanes, z_mm, guess, light)

    def _first_seen(self, sampler: Any, group: Any, view: np.ndarray | None) -> tuple[_Lanes, FirstHits]:
        """A candidate for each lane, and what it hits first."""
        lanes = self._draw(sampler, group, _views(self.setup, sampler, view))
        return lanes, self._hit_first(lanes)

    def _hit_first(self, lanes: _Lanes) -> FirstHits:
        ambient = self.light.spread(self.ambient, lanes.colour, lanes.wavelength_sample)
        return hit_first(self.setup.render_scene, self._rays(lanes), lanes.inside, ambient)

    def _rays(self, lanes: _Lanes) -> Any:
        at = lanes.k, lanes.l, lanes.row_px, lanes.col_px, lanes.lens_point
        ray = film_rays(self.setup.render_scene, self.setup.rig, *at)
        return self.light.aim(ray, lanes.colour, lanes.wavelength_sample)

    def _follow(self, lanes: _Lanes, first: FirstHits, seed: int) -> Any:
        """Radiance along one path from each first hit, as rays carry it."""
        # Another sampler than the candidates', whose numbers decided which lanes are here.
        sampler = _sampler(self.setup.render_scene.mi, seed ^ 0x9E3779B9, len(lanes.k))
        return radiance_along(
            self.setup.render_scene, self._rays(lanes), first.record, sampler, self.setup.max_depth
        )

    def _seen(self, radiance: Any, lanes: _Lanes) -> Any:
        """What each lane's pixel sees of it."""
        return of_colour(self.light.seen(radiance, lanes.colour, lanes.wavelength_sample), lanes.colour)

    def _exceeding(self, lanes: _Lanes, first: FirstHits, light: Any, over: Any) -> Samples:
        dr = load_drjit()
        lanes, first = _take(dr, lanes, over), _take(dr, first, over)
        guess, brought = (
            self.light.seen(one, lanes.colour, lanes.wavelength_sample)
            for one in (first.guess, _at(dr, light, over))
        )
        dr.eval(vars(lanes), first.z_mm, guess, brought)
        return _samples(lanes, first.z_mm, guess, brought)

    def _draw(self, sampler: Any, group: Any, view: Any) -> _Lanes:
        """One candidate for each lane's group and view: tile and cell by the bound, the rest evenly."""
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
        wavelength_sample = self.light.wavelength_samples(sampler, len(group))
        lens_point = None
        if self.setup.rig.lens is not None:
            radius_mm = self.setup.rig.lens.aperture_mm / 2
            lens_point = radius_mm * mi.warp.square_to_uniform_disk_concentric(sampler.next_2d())
        return _Lanes(k, l, row, col, row_px, col_px, entry, colour, wavelength_sample, inside, lens_point)

    def _owner(self, lanes: _Lanes, z_mm: Any) -> Any:
        """The entry that each lane's path belongs to (see `majorant`)."""
        mi, dr, frame = self.setup.render_scene.mi, load_drjit(), self.majorant.frame
        nearness = dr.minimum(self.nearness_mm / z_mm, self.last_step)
        own = dr.gather(mi.Int32, self.layer_at, mi.UInt32(dr.round(nearness)))
        coarse_px, across = self.majorant.coarse_px, self.majorant.coarse_cols
        owner = lanes.row // coarse_px * across + lanes.col // coarse_px
        for aside in reversed(NEXT_LAYERS):
            layer = dr.clip(own + aside, 0, self.last_layer)
            shift_row, shift_col = self._shifts(layer, lanes.k, lanes.l, lanes.inside)
            row, col = (lanes.row + shift_row) // frame.tile_px, (lanes.col + shift_col) // frame.tile_px
            listed = _at(dr, self.entry_of, (layer * self.rows + row) * self.cols + col, lanes.inside)
            owner = dr.select(listed < 0, owner, listed)
        return owner

    def _shifts(self, layer: Any, k: Any, l: Any, active: Any = True) -> tuple[Any, Any]:
        """Rows and columns by which a layer's tiles are moved in each lane's view."""
        mi, dr, grid = self.setup.render_scene.mi, load_drjit(), self.setup.grid
        down = _at(dr, self.row_shift, layer * grid.rows + mi.Int32(k), active)
        return down, _at(dr, self.col_shift, layer * grid.cols + mi.Int32(l), active)


def _sampler(mi: Any, seed: int, size: int) -> Any:
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(seed, size)
    return sampler


def _views(setup: Setup, sampler: Any, view: np.ndarray | None) -> Any:
    """The lanes' views, drawn evenly if they are not given."""
    mi, count = setup.render_scene.mi, setup.grid.view_count
    if view is not None:
        return _unsigned(mi, view)
    return load_drjit().minimum(mi.UInt32(sampler.next_1d() * count), count - 1)


def _at(dr: Any, array: Any, index: Any, active: Any = True) -> Any:
    return dr.gather(type(array), array, index, active)


def _take(dr: Any, lanes: Record, index: Any) -> Record:
    """Some lanes of a record of arrays."""
    known = {name: array for name, array in vars(lanes).items() if array is not None}
    return replace(lanes, **{name: _at(dr, array, index) for name, array in known.items()})


def _samples(lanes: _Lanes, z_mm: Any, guess: list[Any], light: list[Any]) -> Samples:
    """Lanes as NumPy, of which the first were followed and brought `light`."""
    # Of other colours than their own wavelengths tell nothing, and 0 / 0 would be no number.
    guesses = np.maximum([np.array(part) for part in guess], LEAST_GUESS, dtype=np.float64).T
    seen = np.full((len(lanes.k), len(guess)), np.nan)
    seen[: len(light[0])] = np.stack([np.array(part) for part in light], axis=1)
    return Samples(
        **{name: np.array(getattr(lanes, name)).astype(np.int64) for name in ("k", "l", "row", "col")},
        z_mm=np.array(z_mm),
        guess=guesses,
        light=seen,
    )


def _unsigned(mi: Any, values: np.ndarray) -> Any:
    return _upload(mi.UInt32, values, np.uint32)


def _signed(mi: Any, values: np.ndarray) -> Any:
    return _upload(mi.Int32, values, np.int32)


def _floats(mi: Any, values: np.ndarray) -> Any:
    return _upload(mi.Float, values, np.float32)


def _doubles(mi: Any, values: np.ndarray) -> Any:
    return _upload(mi.Float64, values, np.float64)


def _upload(kind: Any, values: np.ndarray, dtype: Any) -> Any:
    flat = np.ascontiguousarray(values, dtype=dtype).ravel()
    # Where NumPy happened to put a single number is compiled into the kernel, if it is handed over.
    return _opaque(kind, flat[0].item()) if flat.size == 1 else kind(flat)


def _opaque(kind: Any, value: float) -> Any:
    return load_drjit().opaque(kind, value)
