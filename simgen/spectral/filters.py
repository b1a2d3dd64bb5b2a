"""What a camera's pixels see of a spectrum, and the wavelengths that tell most about it.

Notation: C colours of pixels, N wavelengths, s_c(w) the sensitivity of colour c. What a pixel sees of the
radiance L(w) is the integral of L s_c. It is estimated from four wavelengths for each path ("hero"
wavelengths, Wilkie et al. 2014), drawn with a density that follows s_c times the light of the scene's lamps:
no path is wasted on light that the pixel's filter stops.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from simgen.spectral.spectra import WAVELENGTH_NM, integral, observer

PEAK_NM = 555.0
"""Where a lumen is 1/683 W."""
HEROES = 4
"""Wavelengths that the renderer's spectral variants follow along one path."""
CELLS = 512
EVEN_SHARE = 0.01
"""Share of the wavelengths that are drawn evenly, for light that no lamp is known to have."""


@dataclass(frozen=True)
class Filters:
    """Sensitivities (C, N) of a camera's pixels, and the spectrum (N,) of most of the light in the scene.

    The integral of a spectrum in the unit of `spectra` with a sensitivity is in cd/m^2 of light of 555 nm
    that would give as many photons to a pixel that detects them all.
    """

    sensitivity: np.ndarray
    light: np.ndarray

    @cached_property
    def white(self) -> np.ndarray:
        """What pixels of each colour see of `light`, (C,)."""
        return integral(self.sensitivity * self.light)

    @cached_property
    def wavelength_nm(self) -> np.ndarray:
        """Bounds (C, CELLS + 1) of cells of wavelengths that are drawn equally often, float32."""
        fine_nm = np.linspace(WAVELENGTH_NM[0], WAVELENGTH_NM[-1], 4 * WAVELENGTH_NM.size)
        bounds = []
        for curve in self.sensitivity:
            sensitive, light = (np.interp(fine_nm, WAVELENGTH_NM, one) for one in (curve, self.light))
            density = sensitive * light
            if not density.any():  # no lamp shines where this pixel sees, but wavelengths must be drawn
                density = sensitive
            density = (density + EVEN_SHARE * density.mean()) * (sensitive > 0)
            steps = (density[1:] + density[:-1]) * np.diff(fine_nm)
            cumulative = np.append(0, np.cumsum(steps))
            is_rising = np.append(True, np.diff(cumulative) > 0)
            shares = np.linspace(0, 1, CELLS + 1) * cumulative[-1]
            bound_nm = np.interp(shares, cumulative[is_rising], fine_nm[is_rising])
            bound_nm[0] = fine_nm[max(np.flatnonzero(density)[0] - 1, 0)]
            bounds.append(bound_nm)
        return np.array(bounds, dtype=np.float32)

    def draw(self, colour: np.ndarray, wavelength_sample: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Wavelengths in nm (M, 4) for pixels of `colour` (M,), and the weights of what they bring.

        `wavelength_sample` (M,) are random numbers in [0, 1). The sum of radiance times weight is what the
        pixel sees, on average over `wavelength_sample`.
        """
        place = (wavelength_sample[:, None] + np.arange(HEROES)) / HEROES * CELLS
        cell = np.minimum(place.astype(np.int64), CELLS - 1)
        low = self.wavelength_nm[colour[:, None], cell].astype(np.float64)
        width = self.wavelength_nm[colour[:, None], cell + 1] - low
        drawn_nm = low + width * (place - cell)
        sensitivity = np.array([np.interp(drawn_nm, WAVELENGTH_NM, curve) for curve in self.sensitivity])
        return drawn_nm, sensitivity[colour, np.arange(len(colour))] * width * (CELLS / HEROES)


def filters_for(curves: np.ndarray, light: np.ndarray) -> Filters:
    """Filters of a camera with relative sensitivities (C, N) to power, in this light (N,).

    A pixel detects every photon where the most sensitive of these curves detects most photons, and elsewhere
    as many as the curves say: `sensor.quantum_efficiency` is the efficiency there.
    """
    to_photons = curves / WAVELENGTH_NM
    detected = to_photons / to_photons.max()
    return Filters(detected * (WAVELENGTH_NM / PEAK_NM) / integral(observer()[1]), light)
