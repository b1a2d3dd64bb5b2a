"""What a camera's pixels see of a spectrum, and the wavelengths that tell most about it.

Notation: C colours of pixels, N wavelengths, s_c(w) the sensitivity of colour c. What a pixel sees of the
radiance L(w) is the integral of L s_c. It is estimated from four wavelengths for each path ("hero"
wavelengths, Wilkie et al. 2014), drawn with a density that follows s_c times the light of the scene's lamps:
no path is wasted on light that the pixel's filter stops.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from simgen.spectral.spectra import PEAK_NM, WAVELENGTH_NM, integral, observer

HEROES = 4
"""Wavelengths that the renderer's spectral variants follow along one path."""
CELLS = 512
FLOOR = 0.01
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
            often = sensitive * light
            if not often.any():  # no lamp shines where this pixel sees, but wavelengths must be drawn
                often = sensitive
            often = (often + FLOOR * often.mean()) * (sensitive > 0)
            steps = (often[1:] + often[:-1]) * np.diff(fine_nm)
            running = np.append(0, np.cumsum(steps))
            rising = np.append(True, np.diff(running) > 0)
            shares = np.linspace(0, 1, CELLS + 1) * running[-1]
            start = fine_nm[np.flatnonzero(often)[0] - 1] if often[0] == 0 else fine_nm[0]
            bound_nm = np.interp(shares, running[rising], fine_nm[rising])
            bound_nm[0] = start
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
        chosen_nm = low + width * (place - cell)
        weight = np.empty(chosen_nm.shape)
        for number, curve in enumerate(self.sensitivity):
            here = colour == number
            weight[here] = np.interp(chosen_nm[here], WAVELENGTH_NM, curve)
        return chosen_nm, weight * width * (CELLS / HEROES)


def filters_for(curves: np.ndarray, light: np.ndarray) -> Filters:
    """Filters of a camera with relative sensitivities (C, N) to power, in this light (N,).

    A pixel detects every photon where the most sensitive of these curves detects most photons, and elsewhere
    as many as the curves say: `sensor.quantum_efficiency` is the efficiency there.
    """
    to_photons = curves / WAVELENGTH_NM
    detected = to_photons / to_photons.max()
    return Filters(detected * (WAVELENGTH_NM / PEAK_NM) / integral(observer()[1]), light)
