"""Colours and spectra as Mitsuba's textures, in the variant that is set."""

from typing import Any

import numpy as np

from pcii.base.srgb import LUMINANCE, srgb_to_linear
from simgen.spec.materials import Reflectance, Spectrum
from simgen.spectral.spectra import (
    DAYLIGHT,
    WAVELENGTH_NM,
    illuminant,
    integral,
    linear_srgb,
    observer,
    patch,
    resampled,
    tint,
)

Triple = tuple[float, float, float]


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


def radiance_plugin(mi: Any, luminance_cd_m2: float, colour: str | Triple) -> dict[str, Any]:
    """Light of this luminance in cd/m^2, with a CIE illuminant's spectrum or colour, or of an sRGB colour."""
    if is_spectral(mi):
        return spectrum_plugin(luminance_cd_m2 * light_spectrum(mi, colour))
    if isinstance(colour, str):
        rgb = tint(colour)
    else:
        rgb = srgb_to_linear(np.array(colour))
        rgb /= LUMINANCE @ rgb
    return {"type": "rgb", "value": (luminance_cd_m2 * rgb).tolist()}


def light_spectrum(mi: Any, colour: str | Triple) -> np.ndarray:
    """The spectrum (N,) at luminance 1 of a CIE illuminant, or of an sRGB colour.

    A colour is daylight D65 behind a filter with the smooth spectrum of Jakob and Hanika (2019), as the
    renderer makes it of reflectances.
    """
    if isinstance(colour, str):
        return illuminant(colour)
    rgb = srgb_to_linear(np.array(colour))
    slope = np.polyval(np.array(mi.srgb_model_fetch((rgb / rgb.max()).tolist())), WAVELENGTH_NM)
    filtered = (0.5 + slope / (2 * np.sqrt(1 + slope**2))) * illuminant(DAYLIGHT)
    luminosity = observer()[1]
    return filtered * (integral(luminosity * illuminant(DAYLIGHT)) / integral(luminosity * filtered))


def spectrum_plugin(values: np.ndarray) -> dict[str, Any]:
    """Values (N,) at evenly spaced wavelengths."""
    return {
        "type": "regular",
        "wavelength_min": float(WAVELENGTH_NM[0]),
        "wavelength_max": float(WAVELENGTH_NM[-1]),
        "values": ", ".join(map(repr, values.tolist())),
    }
