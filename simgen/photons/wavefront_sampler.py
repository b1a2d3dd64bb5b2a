"""Candidates traced all at once in the renderer's arrays, for compiled backends; what leaves is NumPy."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from simgen.photons.candidates import Accepted, FilmPoints, Setup, nothing, require_finite
from simgen.photons.disparity_layers import Samples
from simgen.photons.majorant import Majorant
from simgen.photons.wavefront_candidates import Candidates, MajorantArrays
from simgen.renderer.backend import load_drjit
from simgen.renderer.device_arrays import gathered, opaque, unsigned
from simgen.renderer.mitsuba_camera import film_rays
from simgen.renderer.path_tracing import FirstHits, hit_first, radiance_along
from simgen.renderer.wavelengths import light_of, of_colour
from simgen.sensor.photon_table import PhotonTable

LEAST_GUESS = 1e-30
PATH_SEED_MASK = 0x9E3779B9
"""Flips 20 of the 32 bits (2^32 over the golden ratio, which has no pattern) of the seed that candidates are
drawn with: their paths get random numbers of their own."""
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
        return Accepted(
            photons=PhotonTable(
                k=np.array(photon.k),
                l=np.array(photon.l),
                i=np.array(photon.row),
                j=np.array(photon.col),
                n=np.ones(len(kept), dtype=np.int64),
                object_id=setup.render_scene.object_of_shape[np.array(hit.shape)],
                z_mm=np.array(hit.z_mm),
            ),
            candidate=np.array(candidate),
            ratio=np.array(ratio),
            over=self._exceeding(candidates, first, light, over)
            if len(over)
            else nothing(setup.channels).over,
        )

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
