"""Spectral sensitivities of cameras: of those that colour-science has, or from a CSV file."""

import csv
from pathlib import Path

import numpy as np

from pcii.base.errors import InputError
from simgen.base.strict_models import LONGEST_PART, shorten, suggestion
from simgen.spectral.spectra import colour_science, measured, resampled

MOST_CSV_BYTES = 1 << 20
HEAD = ("wavelength_nm", "R", "G", "B")


def camera_names() -> list[str]:
    """Names of the cameras that colour-science has."""
    return list(colour_science().MSDS_CAMERA_SENSITIVITIES)


def sensitivity(camera: str, recipe_folder: Path) -> np.ndarray:
    """Relative sensitivities (3, N) of R, G and B to light's power, or (1, N); the highest value is 1.

    `camera` is one that colour-science ships, or a CSV file (in `recipe_folder`): the head
    wavelength_nm,R,G,B, or wavelength_nm and a name of one curve, then rows of numbers. Raises `InputError`.
    """
    if camera.lower().endswith(".csv"):
        wavelength_nm, curves = _read_csv(recipe_folder / camera)
        rows = np.array([resampled(wavelength_nm, row, outside=0.0) for row in curves.T])
    else:
        table = colour_science().MSDS_CAMERA_SENSITIVITIES
        if camera not in table:
            raise InputError(f"sensor.camera: there is no camera {camera!r}{suggestion(camera, list(table))}")
        rows = measured(table[camera], outside=0.0)
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
