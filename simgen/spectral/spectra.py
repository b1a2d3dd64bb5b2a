"""Spectra of lights and surfaces and sensitivities of cameras, on one set of wavelengths; measured ones from
colour-science.

Notation: N wavelengths, `WAVELENGTH_NM` (N,). A light's spectrum is its radiance in cd/m^2 of white
light of equal energy at each wavelength (cd/m^2, the numbers that the renderer's white has), so that
its integral with the CIE luminosity function, divided by that function's integral, is its luminance.
"""

import csv
import warnings
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base import LUMINANCE, InputError, linear_to_srgb
from simgen.base import asset, cached, not_installed, suggestion

FROM_XYZ = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])
"""From CIE XYZ to linear sRGB."""
WAVELENGTH_NM = np.arange(380.0, 781.0)
DAYLIGHT = "D65"
"""The white of sRGB."""
CHART = "ColorChecker N Ohta"
OBSERVER = "CIE 1931 2 Degree Standard Observer"
CSV_HEAD = ["wavelength_nm", "R", "G", "B"]
KINDS = OBSERVERS, ILLUMINANTS, PATCHES = "observers", "illuminants", "patches"


def srgb_of(linear: np.ndarray) -> list[float]:
    """Linear values (3,), cut to 0 to 1, as sRGB of six digits."""
    return [round(float(part), 6) for part in linear_to_srgb(linear)]


def integral(values: np.ndarray) -> Any:
    """Over the wavelengths, along the last axis; linear in between."""
    return np.trapezoid(values, WAVELENGTH_NM, axis=-1)


def _measured(table: Any, *, outside: float | None = None) -> np.ndarray:
    """One of colour-science's tables at `WAVELENGTH_NM`, (N,) or (C, N), interpolated as the CIE recommends.

    That is Sprague's way where steps are even (CIE 167:2005), which linear ones miss by up to 0.4 %. What
    it overshoots below 0 is cut. Beyond a table's ends it is `outside`, or stays what it was there.
    """
    shape = colour_science().SpectralShape(WAVELENGTH_NM[0], WAVELENGTH_NM[-1], 1)
    beyond = {"method": "Constant", "left": outside, "right": outside}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it says that it interpolates
        aligned = table.copy().align(shape, extrapolator_kwargs=beyond)
    return np.clip(aligned.values.T, 0, None)


@cache
def _standard() -> dict[str, dict[str, np.ndarray]]:
    """Spectra at `WAVELENGTH_NM` by kind and name; kept on the machine, since colour takes long to load."""
    try:
        depends_on = version("colour-science"), version("scipy"), Path(__file__).read_text()
    except PackageNotFoundError:
        raise not_installed(["colour-science"]) from None

    def as_arrays(values: dict[str, dict[str, Any]]) -> dict[str, dict[str, np.ndarray]]:
        return {kind: {name: np.array(values[kind][name]) for name in values[kind]} for kind in KINDS}

    return cached("spectra", depends_on, _from_colour_science, as_arrays)


def _from_colour_science() -> dict[str, dict[str, Any]]:
    colour, (first_nm, last_nm) = colour_science(), WAVELENGTH_NM[[0, -1]]
    tables = {
        OBSERVERS: {OBSERVER: colour.MSDS_CMFS[OBSERVER]},
        ILLUMINANTS: {
            name: table
            for name, table in colour.SDS_ILLUMINANTS.items()
            if table.wavelengths[0] <= first_nm and table.wavelengths[-1] >= last_nm
        },
        # Without the densities that follow the names of the grey ones.
        PATCHES: {name.split(" (")[0]: one for name, one in colour.SDS_COLOURCHECKERS[CHART].items()},
    }
    return {
        kind: {name: _measured(table).tolist() for name, table in of_kind.items()}
        for kind, of_kind in tables.items()
    }


def illuminant_names() -> list[str]:
    """Names of the illuminants that are known at all wavelengths."""
    return list(_standard()[ILLUMINANTS])


def known_illuminant(name: str) -> str:
    """The name, if there is such an illuminant, else `InputError`; D65 is not even looked up."""
    if name != DAYLIGHT:
        illuminant(name)
    return name


@cache
def illuminant(name: str) -> np.ndarray:
    """Spectrum (N,) of a CIE illuminant at luminance 1; `InputError` unless all of it is known."""
    power = _standard()[ILLUMINANTS].get(name)
    if power is None:
        hint = suggestion(name, illuminant_names())
        raise InputError(f"there is no illuminant {name!r} from 380 to 780 nm{hint}")
    luminosity = observer()[1]
    return power * (integral(luminosity) / integral(power * luminosity))


def tint(name: str) -> np.ndarray:
    """Linear sRGB (3,) of a CIE illuminant at luminance 1; channels outside the gamut are cut to 0."""
    if name == DAYLIGHT:
        return np.ones(3)
    rgb = np.clip(FROM_XYZ @ integral(observer() * illuminant(name)), 0, None)
    return rgb / (LUMINANCE @ rgb)


def observer() -> np.ndarray:
    """Colour matching functions (3, N) of the CIE 1931 2 degree standard observer."""
    return _standard()[OBSERVERS][OBSERVER]


def known_patch(name: str) -> str:
    """The name, if there is such a patch, else `InputError`."""
    patch(name)
    return name


def patch(name: str) -> np.ndarray:
    """Reflectance (N,) of a ColorChecker patch by its name, such as "dark skin" or "neutral 5"."""
    patches = _standard()[PATCHES]
    if name not in patches:
        raise InputError(f"there is no patch {name!r}{suggestion(name, list(patches))}")
    return patches[name]


def patch_names() -> list[str]:
    """Names of the 24 patches in the chart's order, row by row."""
    return list(_standard()[PATCHES])


def linear_srgb(reflectance: np.ndarray) -> np.ndarray:
    """Linear sRGB (3,) of a reflectance (N,) in daylight D65; what sRGB cannot show is cut to [0, 1]."""
    white = illuminant(DAYLIGHT)
    # White, which the four digits of its definition miss by up to 5e-4, is 1 exactly.
    ours, whites = (FROM_XYZ @ integral(observer() * white * one) for one in (reflectance, 1.0))
    return np.clip(ours / whites, 0, 1)


def camera_names() -> list[str]:
    """Names of the cameras that colour-science has."""
    return list(colour_science().MSDS_CAMERA_SENSITIVITIES)


def sensitivity(camera: str, recipe_folder: Path) -> np.ndarray:
    """Relative sensitivities (3, N) of R, G and B to light's power, or (1, N); the highest value is 1.

    `camera` is one that colour-science ships, or a CSV file (in `recipe_folder`): the head
    wavelength_nm,R,G,B, or wavelength_nm and a name of one curve, then rows of numbers. Raises `InputError`.
    """
    if camera.lower().endswith(".csv"):
        wavelength_nm, curves = _read_csv(asset(recipe_folder, camera, "sensor.camera"))
        rows = np.array([np.interp(WAVELENGTH_NM, wavelength_nm, row, left=0, right=0) for row in curves.T])
    else:
        table = colour_science().MSDS_CAMERA_SENSITIVITIES
        if camera not in table:
            raise InputError(f"sensor.camera: there is no camera {camera!r}{suggestion(camera, list(table))}")
        rows = _measured(table[camera], outside=0.0)
    if (rows.max(axis=1) <= 0).any():
        raise InputError(f"sensor.camera: a colour of {camera!r} sees no light from 380 to 780 nm")
    return rows / rows.max()


def _read_csv(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Wavelengths (M,) in nm and sensitivities (M, 3) or (M, 1)."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            head, *rows = [[cell.strip() for cell in row] for row in csv.reader(file) if row]
        table = np.array(rows, dtype=np.float64)
    except (ValueError, csv.Error):
        head, table = [], np.zeros((0, 0))
    is_head = head == CSV_HEAD or (len(head) == 2 and head[0] == CSV_HEAD[0])
    is_table = is_head and table.ndim == 2 and table.shape[1] == len(head) and np.isfinite(table).all()
    if not is_table or (table[:, 1:] < 0).any() or (np.diff(table[:, 0]) <= 0).any():
        raise InputError(
            f"{path}: expected the head {','.join(CSV_HEAD)}, or {CSV_HEAD[0]} and a name of one curve, and "
            "rows of as many numbers: growing wavelengths, and sensitivities that are finite and not negative"
        )
    return table[:, 0], table[:, 1:]


@cache
def colour_science() -> Any:
    """colour-science, which takes a second to load and leaves its own way of printing numbers."""
    options = np.get_printoptions()
    try:
        import colour
    except ModuleNotFoundError:
        raise not_installed(["colour-science"]) from None
    np.set_printoptions(**options)
    return colour
