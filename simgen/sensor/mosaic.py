"""From radiance to photon counts: Bayer mosaic, normalisation to a photon budget, photon statistics.

Muniraj et al. 2017, Eq. 1: the irradiance is normalised to unit energy and multiplied by the photon
budget n; each pixel's count is Poisson with that mean. Eq. 1 normalises each colour; over what the
budget is counted is the recipe's `scope`.
"""

from pathlib import Path

import numpy as np

from pcii.base.errors import InputError
from pcii.core.bayer import channel_count, colour_index, mosaic
from simgen.base.srgb import LUMINANCE
from simgen.spec.recipe import Photons, Sensor
from simgen.spectral.camera_curves import sensitivity


def sense(radiance: np.ndarray, cfa: str | None) -> np.ndarray:
    """What the sensor's pixels see of radiance (H, W, C): (H, W), same units.

    A Bayer pixel keeps its own colour; a monochrome one the luminance of linear sRGB, or the one channel that
    its camera has.
    """
    if cfa is not None:
        return mosaic(radiance, cfa)
    if radiance.shape[2] == 1:
        return radiance[..., 0]
    return (radiance @ LUMINANCE).astype(radiance.dtype)


def sensitivities(sensor: Sensor, near: Path) -> np.ndarray | None:
    """Relative sensitivities (C, N) of the sensor's camera by wavelength, None in RGB mode.

    A file of sensitivities is looked up in the folder `near`. A monochrome sensor takes G, or the one curve
    that there is. Raises `InputError` for a camera that is not known or has too few curves.
    """
    if sensor.camera is None:
        return None
    curves = sensitivity(sensor.camera, near)
    if sensor.bayer is None:
        return curves[len(curves) // 2 :][:1]
    if len(curves) == 1:
        raise InputError(
            f"sensor.camera: {sensor.camera!r} has one curve, and a Bayer sensor needs three; "
            "set sensor.cfa to 'none'"
        )
    return curves


def scope_energies(raw: np.ndarray, cfa: str | None, scope: str) -> np.ndarray:
    """Energy of one view's mosaic, over which its scope is normalised: (C,) for channel, else (1,).

    Sums are float64: float32 sums of a million pixels are wrong in the third digit.
    """
    if scope != "channel":
        return np.array([raw.sum(dtype=np.float64)])
    colours = colour_index(raw.shape[0], raw.shape[1], cfa)
    return np.bincount(colours.ravel(), raw.ravel(), minlength=channel_count(cfa))


def photon_rates(raw: np.ndarray, cfa: str | None, photons: Photons, energies: np.ndarray) -> np.ndarray:
    """Expected photons per pixel, (H, W) float64: the budget shared out in proportion to `raw`.

    `energies` are those of `scope_energies`, for scope "scene" summed over all views. A scope with
    no light at all gets no photons. Raises `InputError` if radiance is not finite.
    """
    if not np.all(np.isfinite(energies)):
        raise InputError("radiance: the rendered view holds NaN or infinity")
    share = np.divide(photons.budget, energies, out=np.zeros_like(energies), where=energies > 0)
    if photons.scope != "channel":
        return raw * share[0]
    return raw * share[colour_index(raw.shape[0], raw.shape[1], cfa)]


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
