"""The tables of docs/numerical_limits.md are what the calls in them give, with warnings as errors."""

import re
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
import tifffile

import pcii
import simgen

PAGE = Path(__file__).resolve().parent.parent / "docs" / "numerical_limits.md"


def inputs_of(
    call: str,
    folder: Path,
    level: float = 3.0,
    spot: float | None = None,
    side_px: int = 32,
    z_mm: float = 500.0,
    x: float = 0.0,
) -> dict[str, Any]:
    """What a call is made with, by name; films have this level, and in the middle the `spot`, if any."""

    def film(*shape: int) -> np.ndarray:
        found = np.full(shape, level)
        if spot is not None:
            found.flat[found.size // 2] = spot
        return found

    grid = pcii.CameraGrid(
        rows=3, cols=3, pitch_mm=(5, 5), focal_mm=50, pixel_mm=0.25, height=side_px, width=side_px
    )
    photons, light = np.minimum(film(*grid.shape_KLHW), 2.0**41), film(*grid.shape_KLHW, 1)
    photons = photons.astype(np.int64) if np.isfinite(photons).all() else photons
    k, l, i, j = np.indices(grid.shape_KLHW).reshape(4, -1)
    truth = pcii.Truth(np.full(grid.shape_HW, 500.0), np.ones(grid.shape_HW, int), {1: "wall"})
    optics = pcii.Optics(pitch_mm=(5, 5), focal_mm=50, pixel_mm=0.25)
    # At 1000 px of disparity the range is so short that it is not too many px to be searched.
    z_range_mm = (0.99, 1.0) if z_mm == 1 else (z_mm, 900.0)
    n, image, rng = photons.ravel(), film(*grid.shape_HW), np.random.default_rng(1)
    names = {name: getattr(pcii, name) for name in pcii.__all__} | locals()
    names |= {"simgen": simgen, "folder": folder / "data", "pictures": folder}
    words = re.findall(r"\w+", call)
    if "views" in words:
        names["views"] = pcii.Views(light, grid)
    if "counts" in words:
        names["counts"] = pcii.PhotonCounts.from_dense(photons, grid)
    if "pictures" in words:
        for row, col in np.ndindex(3, 3):
            tifffile.imwrite(folder / f"{row}_{col}.tif", light[row, col, ..., 0])
    return names


COLUMNS: dict[str, tuple[dict[str, Any], ...]] = {
    "no photons, black": ({"level": 0.0},),
    "one photon, one bright pixel": ({"level": 0.0, "spot": 1.0},),
    "bright": ({"level": 2.0**40},),
    "too bright": ({"level": 1e308},),
    "NaN or infinity": ({"spot": np.nan}, {"spot": np.inf}, {"spot": -np.inf}),
    "negative": ({"spot": -1.0},),
    "1 × 1": ({"side_px": 1},),
    "depth not above 0": tuple({"z_mm": z} for z in (0.0, -1.0, np.nan, np.inf)),
    "shifts beyond the image": ({"z_mm": 1.0},),
    "x is 0": ({"x": 0.0},),
    "10^12": ({"x": 1e12},),
    "10^300": ({"x": 1e300},),
    "x is NaN or infinity": ({"x": np.nan}, {"x": np.inf}, {"x": -np.inf}),
    "below 0": ({"x": -1.0}, {"x": -1e12}),
}
"""The inputs of each column, by its title."""


def rows() -> Iterator[Any]:
    """Each call of the tables, with what it gives by the title of the column."""
    titles: list[str] = []
    for line in PAGE.read_text(encoding="utf-8").splitlines():
        first, *cells = (cell.strip() for cell in line.strip("|").split("|"))
        if line.startswith("| call"):
            titles = cells
        for call in re.findall("`([^`]+)`", first) if line.startswith("| `") else ():
            yield pytest.param(call, dict(zip(titles, cells, strict=True)), id=call)


@pytest.mark.parametrize(("call", "answers"), list(rows()))
def test_a_call_gives_what_the_page_says(call: str, answers: dict[str, str]) -> None:
    found = {title: [answer_of(call, **inputs) for inputs in COLUMNS[title]] for title in answers}
    assert {title: " or ".join(dict.fromkeys(each)) for title, each in found.items()} == answers


def answer_of(call: str, **inputs: Any) -> str:
    """Whether a call gives finite numbers, NaN or infinity among them, or an error that names an argument."""
    with TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            arrays = list(numbers_in(eval(call, inputs_of(call, Path(folder), **inputs))))
        except pcii.InputError as fault:
            return "refused" if re.match(r"[^:]+: .", str(fault)) else f"refused without a name: {fault}"
    return "value" if all(np.isfinite(array).all() for array in arrays) else "NaN"


def numbers_in(result: Any) -> Iterator[np.ndarray]:
    """All arrays of real numbers in a result, however deep."""
    if isinstance(result, pcii.Sections):
        yield result.estimate
    if is_dataclass(result) and not isinstance(result, type):
        result = [getattr(result, field.name) for field in fields(result)]
    if isinstance(result, Mapping):
        result = list(result.values())
    if isinstance(result, list | tuple):
        for part in result:
            yield from numbers_in(part)
    elif isinstance(result, np.ndarray | float | int) and np.asarray(result).dtype.kind in "fiub":
        yield np.asarray(result)
