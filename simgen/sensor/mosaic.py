"""Colours that a sensor's pixels take, and photon counts drawn from expected ones.

Expected photons are those of `pcii.core.photon_limit`: the budget shared out over the recipe's `scope`.
"""

import math
from pathlib import Path

import numpy as np

from pcii.base.errors import InputError
from pcii.core.bayer import colour_index
from simgen.spec.recipe import Exposure, Photons, Sensor
from simgen.spectral.camera_curves import sensitivity

PHOTONS_PER_LUMEN_SECOND = 555e-9 / (683 * 6.62607015e-34 * 299792458)
"""Photons of 555 nm; CODATA values of h and c, SI value of the luminous efficacy."""


def photons_per_radiance(exposure: Exposure, pixel_mm: float) -> float:
    """Photons that arrive at a pixel during the exposure for each cd/m^2 that it looks at."""
    illuminance_per_luminance = math.pi / (4 * exposure.f_number**2)
    pixel_m2 = (pixel_mm * 1e-3) ** 2
    return PHOTONS_PER_LUMEN_SECOND * illuminance_per_luminance * pixel_m2 * exposure.time_s


def sensitivities(sensor: Sensor, recipe_folder: Path) -> np.ndarray | None:
    """Relative sensitivities (C, N) of the sensor's camera by wavelength, None in RGB mode.

    A file of sensitivities is looked up in `recipe_folder`. A monochrome sensor takes G, or the one curve
    that there is. Raises `InputError` for a camera that is not known or has too few curves.
    """
    if sensor.camera is None:
        return None
    curves = sensitivity(sensor.camera, recipe_folder)
    if sensor.bayer is None:
        return curves[len(curves) // 2 :][:1]
    if len(curves) == 1:
        raise InputError(
            f"sensor.camera: {sensor.camera!r} has one curve, and a Bayer sensor needs three; "
            "set sensor.cfa to 'none'"
        )
    return curves


def fixed_totals(photons: Photons, energies: np.ndarray, rng: np.random.Generator) -> np.ndarray | None:
    """Photons of each view (V, C or 1) for multinomial statistics, None for Poisson.

    `energies` (V, C or 1) are those of `scope_energies`. With scope "scene" the budget is shared
    among the views at random in proportion to their light; else each scope gets it exactly. A scope
    without light gets none.
    """
    if photons.statistics == "poisson":
        return None
    budget = round(photons.budget)
    if photons.scope == "scene":
        total = energies.sum()
        share = rng.multinomial(budget, energies[:, 0] / total) if total > 0 else energies[:, 0] * 0
        return share[:, None].astype(np.int64)
    return np.where(energies > 0, budget, 0)


def draw_counts(
    rates: np.ndarray, cfa: str | None, rng: np.random.Generator, totals: np.ndarray | None
) -> np.ndarray:
    """Photon counts (H, W), int64: Poisson with mean `rates`, or multinomial with fixed `totals`.

    `totals` holds one number for the view, or one for each colour.
    """
    if totals is None:
        return rng.poisson(rates)
    counts = np.zeros(rates.shape, dtype=np.int64)
    by_colour = totals.size > 1
    colours = (
        colour_index(rates.shape[0], rates.shape[1], cfa) if by_colour else np.zeros(rates.shape, np.uint8)
    )
    for group, total in enumerate(totals):
        here = colours == group
        if total > 0:
            counts[here] = rng.multinomial(total, rates[here] / rates[here].sum())
    return counts
