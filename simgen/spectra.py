"""Spectra of lights, surfaces and cameras, on one set of wavelengths; measured ones from colour-science.

Notation: N wavelengths, `WAVELENGTH_NM` (N,). A light's spectrum tells its radiance in cd/m^2 of white
light of equal energy at each wavelength (cd/m^2, the numbers that the renderer's own white has), so that
its integral with the CIE luminosity function, divided by that function's own, is its luminance.
"""

import csv
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from pcii.errors import InputError
from simgen.schema import suggestion
from simgen.srgb import FROM_XYZ, LUMINANCE

WAVELENGTH_NM = np.arange(380.0, 781.0)
PEAK_NM = 555.0
"""Where a lumen is 1/683 W."""
PATCHES = "ColorChecker N Ohta"
MOST_CSV_BYTES = 1 << 20


def integral(values: np.ndarray) -> Any:
    """Over the wavelengths, along the last axis; linear in between."""
    return np.trapezoid(values, WAVELENGTH_NM, axis=-1)


def resampled(wavelength_nm: Any, values: Any, *, outside: float | None = None) -> np.ndarray:
    """A table's values at `WAVELENGTH_NM`, linear in between; beyond its ends `outside`, or its last one."""
    return np.interp(WAVELENGTH_NM, wavelength_nm, values, left=outside, right=outside)


@cache
def illuminant(name: str) -> np.ndarray:
    """Spectrum (N,) of a CIE illuminant at luminance 1. Raises `InputError` for one that is not known."""
    table = _colour().SDS_ILLUMINANTS
    if name not in table:
        raise InputError(f"lights: there is no illuminant {name!r}{suggestion(name, list(table))}")
    power = resampled(table[name].wavelengths, table[name].values)
    luminosity = observer()[1]
    return power * (integral(luminosity) / integral(power * luminosity))


def tint(name: str) -> np.ndarray:
    """Linear sRGB (3,) of a CIE illuminant at luminance 1; channels outside the gamut are cut to 0."""
    if name == "D65":  # the white of sRGB; also spares the second that colour takes to load
        return np.ones(3)
    rgb = np.clip(FROM_XYZ @ integral(observer() * illuminant(name)), 0, None)
    return rgb / (LUMINANCE @ rgb)


@cache
def observer() -> np.ndarray:
    """Colour matching functions (3, N) of the CIE 1931 2 degree standard observer."""
    table = _colour().MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    return np.array([resampled(table.wavelengths, row) for row in table.values.T])


@cache
def patch(name: str) -> np.ndarray:
    """Reflectance (N,) of a ColorChecker patch by its name, such as "dark skin" or "neutral 5"."""
    table = _patches()
    if name not in table:
        raise InputError(f"reflectance: there is no patch {name!r}{suggestion(name, list(table))}")
    return resampled(table[name].wavelengths, table[name].values)


@cache
def _patches() -> dict[str, Any]:
    """The 24 by name, without the densities that are told behind those of the grey ones."""
    return {name.split(" (")[0]: one for name, one in _colour().SDS_COLOURCHECKERS[PATCHES].items()}


def patch_names() -> list[str]:
    """Names of the 24 patches in the chart's order, row by row."""
    return list(_patches())


def linear_srgb(reflectance: np.ndarray) -> np.ndarray:
    """Linear sRGB (3,) of a reflectance (N,) in daylight D65; what sRGB cannot show is cut to [0, 1]."""
    white = illuminant("D65")
    xyz = integral(observer() * white * reflectance) / integral(observer()[1] * white)
    return np.clip(FROM_XYZ @ xyz, 0, 1)


def sensitivity(camera: str, near: Path) -> np.ndarray:
    """Relative sensitivities (3, N) of R, G and B to light's power, or (1, N); the highest value is 1.

    `camera` is one that colour-science ships, or a CSV file (in the folder `near`): a head, then
    rows of wavelength_nm, R, G, B, or of wavelength_nm and one value. Raises `InputError`.
    """
    if camera.lower().endswith(".csv"):
        wavelength_nm, curves = _read_csv(near / camera)
    else:
        table = _colour().MSDS_CAMERA_SENSITIVITIES
        if camera not in table:
            raise InputError(f"sensor.camera: there is no camera {camera!r}{suggestion(camera, list(table))}")
        wavelength_nm, curves = table[camera].wavelengths, table[camera].values
    rows = np.array([resampled(wavelength_nm, row, outside=0.0) for row in np.transpose(curves)])
    if not rows.max() > 0:
        raise InputError(f"sensor.camera: {camera!r} sees no light from 380 to 780 nm")
    return rows / rows.max()


def _read_csv(path: Path) -> tuple[np.ndarray, np.ndarray]:
    try:
        if not path.is_file():
            raise InputError(f"{path}: there is no such file")
        if path.stat().st_size > MOST_CSV_BYTES:
            raise InputError(f"{path}: sensitivities take no more than {MOST_CSV_BYTES} bytes")
        with path.open(newline="", encoding="utf-8") as file:
            head, *rows = [row for row in csv.reader(file) if row]
        table = np.array(rows, dtype=np.float64)
    except (OSError, ValueError, csv.Error):
        raise InputError(
            f"{path}: cannot be read; write a head and rows of numbers: wavelength_nm, R, G, B"
        ) from None
    if table.ndim != 2 or table.shape[1] not in (2, 4) or len(head) != table.shape[1]:
        raise InputError(f"{path}: expected the columns wavelength_nm, R, G, B, or two for one curve")
    if not np.isfinite(table).all() or (table[:, 1:] < 0).any() or (np.diff(table[:, 0]) <= 0).any():
        raise InputError(f"{path}: wavelengths must grow and sensitivities be finite and not negative")
    return table[:, 0], table[:, 1:]


@cache
def _colour() -> Any:
    """colour-science, which takes a second to load and leaves its own way of printing numbers."""
    options = np.get_printoptions()
    import colour

    np.set_printoptions(**options)
    return colour
