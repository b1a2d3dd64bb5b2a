"""Colours and spectra as Mitsuba's textures, in the variant that is set."""

from typing import Any

import numpy as np

from pcii.base.srgb import srgb_to_linear
from simgen.spec.materials import Reflectance, Spectrum
from simgen.spectral.spectra import WAVELENGTH_NM, illuminant, linear_srgb, patch, resampled, tint


def is_spectral(mi: Any) -> bool:
    """Whether rays carry wavelengths; else linear sRGB."""
    return "spectral" in mi.variant()


def reflectance_plugin(mi: Any, reflectance: Reflectance) -> dict[str, Any]:
    """One reflectance all over. In a spectral variant sRGB is turned into a smooth spectrum by Mitsuba."""
    if isinstance(reflectance, tuple):
        return {"type": "rgb", "value": srgb_to_linear(np.array(reflectance)).tolist()}
    values = spectrum_of(reflectance)
    return (
        spectrum_plugin(values) if is_spectral(mi) else {"type": "rgb", "value": linear_srgb(values).tolist()}
    )


def spectrum_of(reflectance: str | Spectrum) -> np.ndarray:
    """A reflectance (N,) that is given as a spectrum or as the name of a patch."""
    if isinstance(reflectance, str):
        return patch(reflectance)
    return resampled(reflectance.wavelength_nm, reflectance.value)


def radiance_plugin(mi: Any, luminance_cd_m2: float, name: str) -> dict[str, Any]:
    """Light of a CIE illuminant's spectrum, or of its colour, of this luminance in cd/m^2."""
    if is_spectral(mi):
        return spectrum_plugin(luminance_cd_m2 * illuminant(name))
    return {"type": "rgb", "value": (luminance_cd_m2 * tint(name)).tolist()}


def spectrum_plugin(values: np.ndarray) -> dict[str, Any]:
    """Values (N,) at evenly spaced wavelengths."""
    return {
        "type": "regular",
        "wavelength_min": float(WAVELENGTH_NM[0]),
        "wavelength_max": float(WAVELENGTH_NM[-1]),
        "values": ", ".join(map(repr, values.tolist())),
    }
