"""What each ray of compiled backends carries: random numbers, and light in colours or at wavelengths.

Samplers of Mitsuba take seeds of 32 bits, which some 80 000 datasets are enough to make equal in two of them.
Random numbers here have seeds of any size, and come of arithmetic of integers alone, so that they are the
same on every machine. Light is carried as three colours, or at four wavelengths for a pixel's filter.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from pcii.base import LUMINANCE
from simgen.renderer.backend import floats, gathered, load_drjit, opaque
from simgen.renderer.mitsuba_scene import RenderScene
from simgen.spectral import CELLS, HEROES, WAVELENGTH_NM, Filters

GOLDEN = 0x9E3779B97F4A7C15
"""2^64 over the golden ratio: the step of SplitMix64."""


@dataclass
class RandomNumbers:
    """PCG32 (O'Neill 2014) in each lane; what Mitsuba asks a sampler for, and a state of Dr.Jit's loops."""

    mi: Any
    generator: Any

    def next_1d(self, active: Any = True) -> Any:
        """A number in [0, 1) in each lane; the streams of lanes that are not active stay where they are."""
        return self.generator.next_float32(active)

    def next_2d(self, active: Any = True) -> Any:
        """Two numbers in [0, 1) in each lane."""
        return self.mi.Point2f(self.next_1d(active), self.next_1d(active))


def streams_for(mi: Any, seed: int, size: int, *, part: int = 0) -> RandomNumbers:
    """Streams for `size` lanes, of this `part` of the work that `seed` is for.

    State and increment of each lane, of 64 and 63 bits, are numbers of SplitMix64 (Steele et al. 2014), which
    begins at 128 bits that seed and part decide.
    """
    begins = np.random.SeedSequence(seed, spawn_key=(part,)).generate_state(2, np.uint64)
    step = (load_drjit().arange(mi.UInt64, size) + 1) * mi.UInt64(GOLDEN)
    state, increment = (_mixed(mi, opaque(mi.UInt64, int(begin)) + step) for begin in begins)
    generator = mi.PCG32()
    generator.seed(state, increment)
    return RandomNumbers(mi, generator)


def _mixed(mi: Any, number: Any) -> Any:
    """The bits of each number mixed; every number has one that becomes it."""
    number = (number ^ (number >> 30)) * mi.UInt64(0xBF58476D1CE4E5B9)
    number = (number ^ (number >> 27)) * mi.UInt64(0x94D049BB133111EB)
    return number ^ (number >> 31)


class Light:
    """What rays carry for `pixels`: here linear sRGB, all colours at once.

    `pixels` have a `colour` (its number) and a `wavelength_sample`, which decides on wavelengths at random.
    """

    def __init__(self, mi: Any, cfa: str | None) -> None:
        self.mi, self.cfa = mi, cfa

    def wavelength_samples(self, sampler: Any, number: int) -> Any:
        """A `wavelength_sample` of each of `number` pixels; zeros where there are no wavelengths."""
        return load_drjit().zeros(self.mi.Float, number)

    def aim(self, ray: Any, pixels: Any) -> Any:
        """The ray with the wavelengths that it is followed at."""
        return ray

    def spread(self, ambient: Any, pixels: Any) -> Any:
        """Light from all around, which is `ambient` in each colour, as rays carry it."""
        return self.mi.Color3f(*ambient) if len(ambient) == 3 else self.mi.Color3f(ambient[0])

    def colours_to_follow(self, colour: Any) -> Iterator[Any]:
        """Colours to follow rays in, one after the other, so that together they show all."""
        yield colour

    def in_own_colour(self, radiance: Any, pixels: Any) -> Any:
        """What each pixel gets, in its own colour, of radiance that rays carry."""
        return _of_colour(self.per_colour(radiance, pixels), pixels.colour)

    def per_colour(self, radiance: Any, pixels: Any) -> list[Any]:
        """Radiance in each colour that these wavelengths show, 0 in the others; luminance without a CFA."""
        if self.cfa is not None:
            return list(radiance)
        return [sum(float(share) * part for share, part in zip(LUMINANCE, radiance, strict=True))]


class SpectralLight(Light):
    """Four wavelengths for each ray, drawn for its own pixel's filter."""

    def __init__(self, mi: Any, filters: Filters) -> None:
        self.mi, self.channels = mi, len(filters.sensitivity)
        self.cell_nm = mi.Float(filters.wavelength_nm.ravel())
        curves = filters.sensitivity, filters.light, filters.white
        self.sensitivity, self.light, self.white = (floats(mi, curve) for curve in curves)

    def wavelength_samples(self, sampler: Any, number: int) -> Any:
        return sampler.next_1d()

    def aim(self, ray: Any, pixels: Any) -> Any:
        ray.wavelengths, _ = self._draw(pixels)
        return ray

    def spread(self, ambient: Any, pixels: Any) -> Any:
        # It has the spectrum of most of the light.
        wavelengths_nm, _ = self._draw(pixels)
        white = gathered(self.white, pixels.colour)
        relative = load_drjit().select(white > 0, _of_colour(ambient, pixels.colour) / white, 0)
        return self.mi.Spectrum(*(self._at(self.light, here_nm, 0) * relative for here_nm in wavelengths_nm))

    def colours_to_follow(self, colour: Any) -> Iterator[Any]:
        for other in range(self.channels):
            yield load_drjit().full(self.mi.UInt32, other, len(colour))

    def per_colour(self, radiance: Any, pixels: Any) -> list[Any]:
        dr, (_, weight) = load_drjit(), self._draw(pixels)
        total = dr.sum(radiance * weight)
        return [dr.select(pixels.colour == other, total, 0) for other in range(self.channels)]

    def _draw(self, pixels: Any) -> tuple[Any, Any]:
        """Wavelengths and their weights, as `Filters.draw` has them."""
        mi, wavelengths_nm, weight = self.mi, [], []
        for hero in range(HEROES):
            place = (pixels.wavelength_sample + hero) * (CELLS / HEROES)
            cell = load_drjit().minimum(mi.UInt32(place), CELLS - 1)
            first = pixels.colour * (CELLS + 1) + cell
            low, high = gathered(self.cell_nm, first), gathered(self.cell_nm, first + 1)
            here_nm = low + (high - low) * (place - mi.Float(cell))
            curve = self._at(self.sensitivity, here_nm, pixels.colour * WAVELENGTH_NM.size)
            wavelengths_nm.append(here_nm)
            weight.append(curve * (high - low) * (CELLS / HEROES))
        return mi.Spectrum(*wavelengths_nm), mi.Spectrum(*weight)

    def _at(self, table: Any, wavelength_nm: Any, start: Any) -> Any:
        """A table's value at a wavelength; its row begins at `start`."""
        mi, dr = self.mi, load_drjit()
        place = wavelength_nm - float(WAVELENGTH_NM[0])
        cell = dr.minimum(mi.UInt32(place), WAVELENGTH_NM.size - 2)
        low, high = (gathered(table, start + cell + side) for side in (0, 1))
        return dr.lerp(low, high, place - mi.Float(cell))


def light_of(render_scene: RenderScene, cfa: str | None) -> Light:
    """How rays carry light in this scene's variant."""
    mi, filters = render_scene.mi, render_scene.filters
    return Light(mi, cfa) if filters is None else SpectralLight(mi, filters)


def _of_colour(values: Any, colour: Any) -> Any:
    """Each element's value in its own colour, of `values` in all colours."""
    first, *others = values
    if not others:
        return first
    select = load_drjit().select
    return select(colour == 0, first, select(colour == 1, *others))
