"""Spectra of lights, surfaces and cameras, on one set of wavelengths; measured ones from colour-science.

Notation: N wavelengths, `WAVELENGTH_NM` (N,). A light's spectrum tells its radiance in cd/m^2 of white
light of equal energy at each wavelength (cd/m^2, the numbers that the renderer's own white has), so that
its integral with the CIE luminosity function, divided by that function's own, is its luminance.
"""

import csv
import warnings
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base.errors import InputError
from simgen.base.srgb import FROM_XYZ, LUMINANCE
from simgen.base.strict_models import LONGEST_PART, shorten, suggestion

WAVELENGTH_NM = np.arange(380.0, 781.0)
PEAK_NM = 555.0
"""Where a lumen is 1/683 W."""
DAYLIGHT = "D65"
"""The white of sRGB."""
PATCHES = "ColorChecker N Ohta"
MOST_CSV_BYTES = 1 << 20
HEAD = ("wavelength_nm", "R", "G", "B")


def integral(values: np.ndarray) -> Any:
    """Over the wavelengths, along the last axis; linear in between."""
    return np.trapezoid(values, WAVELENGTH_NM, axis=-1)


def resampled(wavelength_nm: Any, values: Any, *, outside: float | None = None) -> np.ndarray:
    """A table's values at `WAVELENGTH_NM`, linear in between; beyond its ends `outside`, or its last one."""
    return np.interp(WAVELENGTH_NM, wavelength_nm, values, left=outside, right=outside)


def _measured(table: Any, *, outside: float | None = None) -> np.ndarray:
    """One of colour-science's tables at `WAVELENGTH_NM`, (N,) or (C, N), interpolated as the CIE recommends.

    That is Sprague's way where steps are even (CIE 167:2005), which linear ones miss by up to 0.4 %. What
    it overshoots below 0 is cut. Beyond a table's ends it is `outside`, or stays what it was there.
    """
    shape = _colour().SpectralShape(WAVELENGTH_NM[0], WAVELENGTH_NM[-1], 1)
    beyond = {"method": "Constant", "left": outside, "right": outside}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it says that it interpolates
        aligned = table.copy().align(shape, extrapolator_kwargs=beyond)
    return np.clip(aligned.values.T, 0, None)


def illuminant_names() -> list[str]:
    """Names of the illuminants that are told at all wavelengths."""
    tables = _colour().SDS_ILLUMINANTS.items()
    return [name for name, table in tables if _is_told_at_all(table)]


def camera_names() -> list[str]:
    """Names of the cameras that colour-science has."""
    return list(_colour().MSDS_CAMERA_SENSITIVITIES)


def _is_told_at_all(table: Any) -> bool:
    return bool(table.wavelengths[0] <= WAVELENGTH_NM[0] and table.wavelengths[-1] >= WAVELENGTH_NM[-1])


def known_illuminant(name: str) -> str:
    """The name, if there is such an illuminant, else `InputError`; of D65 this is known without colour."""
    if name != DAYLIGHT:
        illuminant(name)
    return name


@cache
def illuminant(name: str) -> np.ndarray:
    """Spectrum (N,) of a CIE illuminant at luminance 1.

    Raises `InputError` for one that is not known, or not at all of the wavelengths.
    """
    table = _colour().SDS_ILLUMINANTS
    if name not in table:
        raise InputError(f"there is no illuminant {name!r}{suggestion(name, illuminant_names())}")
    if not _is_told_at_all(table[name]):
        told_nm = table[name].wavelengths
        raise InputError(
            f"illuminant {name!r} is only told from {told_nm[0]:g} to {told_nm[-1]:g} nm, and 380 to 780 nm "
            "are needed; use another, such as D55 or A"
        )
    power = _measured(table[name])
    luminosity = observer()[1]
    return power * (integral(luminosity) / integral(power * luminosity))


def tint(name: str) -> np.ndarray:
    """Linear sRGB (3,) of a CIE illuminant at luminance 1; channels outside the gamut are cut to 0."""
    if name == DAYLIGHT:  # also spares the second that colour takes to load
        return np.ones(3)
    rgb = np.clip(FROM_XYZ @ integral(observer() * illuminant(name)), 0, None)
    return rgb / (LUMINANCE @ rgb)


@cache
def observer() -> np.ndarray:
    """Colour matching functions (3, N) of the CIE 1931 2 degree standard observer."""
    return _measured(_colour().MSDS_CMFS["CIE 1931 2 Degree Standard Observer"])


def known_patch(name: str) -> str:
    """The name, if there is such a patch, else `InputError`."""
    patch(name)
    return name


@cache
def patch(name: str) -> np.ndarray:
    """Reflectance (N,) of a ColorChecker patch by its name, such as "dark skin" or "neutral 5"."""
    table = _patches()
    if name not in table:
        raise InputError(f"there is no patch {name!r}{suggestion(name, list(table))}")
    return _measured(table[name])


@cache
def _patches() -> dict[str, Any]:
    """The 24 by name, without the densities that are told behind those of the grey ones."""
    return {name.split(" (")[0]: one for name, one in _colour().SDS_COLOURCHECKERS[PATCHES].items()}


def patch_names() -> list[str]:
    """Names of the 24 patches in the chart's order, row by row."""
    return list(_patches())


def linear_srgb(reflectance: np.ndarray) -> np.ndarray:
    """Linear sRGB (3,) of a reflectance (N,) in daylight D65; what sRGB cannot show is cut to [0, 1]."""
    white = illuminant(DAYLIGHT)
    # White, which the four digits of its definition miss by up to 5e-4, is 1 exactly.
    ours, whites = (FROM_XYZ @ integral(observer() * white * one) for one in (reflectance, 1.0))
    return np.clip(ours / whites, 0, 1)


def sensitivity(camera: str, near: Path) -> np.ndarray:
    """Relative sensitivities (3, N) of R, G and B to light's power, or (1, N); the highest value is 1.

    `camera` is one that colour-science ships, or a CSV file (in the folder `near`): the head
    wavelength_nm,R,G,B, or wavelength_nm and a name of one curve, then rows of numbers. Raises `InputError`.
    """
    if camera.lower().endswith(".csv"):
        wavelength_nm, curves = _read_csv(near / camera)
        rows = np.array([resampled(wavelength_nm, row, outside=0.0) for row in curves.T])
    else:
        table = _colour().MSDS_CAMERA_SENSITIVITIES
        if camera not in table:
            raise InputError(f"sensor.camera: there is no camera {camera!r}{suggestion(camera, list(table))}")
        rows = _measured(table[camera], outside=0.0)
    blind = np.flatnonzero(rows.max(axis=1) <= 0)
    if blind.size:
        colour = f" in {'RGB'[blind[0]]}" if len(rows) == 3 else ""
        raise InputError(f"sensor.camera: {camera!r} sees no light from 380 to 780 nm{colour}")
    return rows / rows.max()


def _read_csv(path: Path) -> tuple[np.ndarray, np.ndarray]:
    if not path.is_file():
        raise InputError(f"sensor.camera: there is no file {path}")
    if path.stat().st_size > MOST_CSV_BYTES:
        raise InputError(f"{path}: sensitivities take no more than {MOST_CSV_BYTES} bytes")
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            head, *rows = [[cell.strip() for cell in row] for row in csv.reader(file) if row]
        table = np.array(rows, dtype=np.float64)
    except (OSError, ValueError, csv.Error):
        raise InputError(
            f"{path}: cannot be read; write a head and rows of numbers, with commas: wavelength_nm, R, G, B"
        ) from None
    if table.ndim != 2 or table.shape[1] not in (2, 4) or len(head) != table.shape[1]:
        raise InputError(f"{path}: expected the columns wavelength_nm, R, G, B, or two for one curve")
    if head[0] != HEAD[0] or (len(head) == len(HEAD) and tuple(head) != HEAD):
        raise InputError(
            f"{path}: its first line must be {','.join(HEAD)}, or {HEAD[0]} and a name of one curve; "
            f"it is {shorten(','.join(head), LONGEST_PART)}"
        )
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
