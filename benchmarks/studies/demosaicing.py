"""Demosaicing: time against the errors of colours, at full light and from few photons.

A texture in closed form and the paper's scene, rendered, through a Bayer pattern.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from itertools import product
from statistics import median
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.figures import curve, frame
from benchmarks.machine import has
from benchmarks.results import Measured, Row, Size, Study, Value, mean_of
from benchmarks.scenes import film, setup_of
from benchmarks.textures import Texture
from benchmarks.timing import median_of, ratio_of, side_by_side
from pcii.sections.demosaicing import demosaic
from pcii.types.bayer import mosaic
from simgen.renderer.radiance import render_view
from simgen.spec.recipe import load_recipe
from simgen.spectral.spectra import colour_science

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CFA = "GRBG"
OWN = "laroche-prescott"
PACKAGE = {
    "bilinear": "demosaicing_CFA_Bayer_bilinear",
    "malvar": "demosaicing_CFA_Bayer_Malvar2004",
    "menon": "demosaicing_CFA_Bayer_Menon2007",
}
"""Functions of colour-demosaicing."""
METHODS = (OWN, *(PACKAGE if has("colour-demosaicing") else ()))
BORDER_PX = 8
"""Even and larger than the reach of these functions, whose borders mix colours."""
BLOCKS = 4
"""Errors are told of so many by so many blocks of a picture, whose spread gives the interval."""
FULL_LIGHT = 0
ERRORS = "Errors by photons per pixel of brightness 1; 0 is full light"
TIMES = "Time of one image"
OPENCV = {"OpenCV, bilinear": "COLOR_BayerGB2RGB", "OpenCV, edge-aware": "COLOR_BayerGB2RGB_EA"}
"""Conversions of 16-bit mosaics. OpenCV names a pattern by its second row, from the second column on."""


SIZES: Mapping[Size, Mapping[str, Any]] = {
    "quick": {"side_px": 256, "photons": (FULL_LIGHT, 100, 10), "timed_px": 1024, "repeats": 6},
    "full": {"side_px": 512, "photons": (FULL_LIGHT, 100, 10, 1), "timed_px": 1024, "repeats": 12},
}


def measure(side_px: int, photons: Sequence[int], timed_px: int, repeats: int) -> Measured:
    """Errors on small pictures, times on one of the paper's size."""
    rows: list[Row] = []
    for name, picture in pictures(side_px).items():
        truth = np.clip(picture, 0, 1)
        for number in photons:
            seen = mosaic(truth, CFA)
            if number:
                seen = np.random.default_rng(1).poisson(number * seen) / number
            for method in METHODS:
                found = demosaiced(seen, method)
                rows.append(Row(ERRORS, method, {"picture": name, "photons": number}, errors(found, truth)))
    raw = np.random.default_rng(0).random((timed_px, timed_px))
    ways = {name: lambda _, name=name: demosaiced(raw, name) for name in METHODS}
    if has("opencv-python-headless"):
        ways |= {name: lambda _, code=code: _by_opencv(raw, code) for name, code in OPENCV.items()}
    seconds = side_by_side(ways, repeats)
    rows += [
        Row(TIMES, name, {"side_px": timed_px}, {"time_ms": median_of(taken, 1e3)})
        for name, taken in seconds.items()
    ]
    ratios = [ratio_of(f"{OWN} against {name}", seconds[name], seconds[OWN]) for name in METHODS[2:]]
    return Measured(rows, ratios, [1])


def demosaiced(raw: np.ndarray, method: str) -> np.ndarray:
    """Colours (H, W, 3) of a mosaic, by ours or on the image continued by reflection."""
    if method == OWN:
        return demosaic(raw, cfa=CFA)
    package = import_module("colour_demosaicing")
    image = getattr(package, PACKAGE[method])(np.pad(raw, BORDER_PX, mode="reflect"), CFA)
    return image[BORDER_PX:-BORDER_PX, BORDER_PX:-BORDER_PX]


def pictures(side_px: int) -> dict[str, np.ndarray]:
    """Pictures (H, W, 3) whose colours are known; 1 is bright."""
    setup = setup_of(load_recipe("paper", film(side_px))[0])
    centre = replace(setup.grid, rows=1, cols=1)
    rendered = render_view(setup.render_scene, centre, 0, 0, samples_per_pixel=256, seed=7).astype(np.float64)
    pixels = np.arange(side_px)
    return {
        "texture": Texture().seen_at(pixels, pixels),
        "two objects, rendered": rendered / np.quantile(rendered, 0.99),
    }


def errors(found: np.ndarray, truth: np.ndarray) -> dict[str, Value]:
    """Peak signal to noise over all colours, and mean CIEDE2000, with intervals from blocks."""
    squares = mean_of([float(part.mean()) for part in _blocks((found - truth) ** 2)])
    colours = mean_of([float(part.mean()) for part in _blocks(ciede2000(found, truth))])
    low, high = (None if end is None else _decibels(end) for end in (squares.high, squares.low))
    return {"cpsnr_db": Value(_decibels(squares.value), low, high), "ciede2000": colours}


def _decibels(mean_square: float) -> float:
    return float(-10 * np.log10(max(mean_square, 1e-12)))


def _blocks(pixels: np.ndarray) -> Sequence[np.ndarray]:
    bands = np.array_split(pixels, BLOCKS)
    return [part for band in bands for part in np.array_split(band, BLOCKS, axis=1)]


def ciede2000(found: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Colour difference (H, W) of two linear sRGB images, what is beyond the screen clipped."""
    colour = colour_science()

    space = colour.RGB_COLOURSPACES["sRGB"]
    one, other = (
        colour.XYZ_to_Lab(np.clip(rgb, 0, 1) @ space.matrix_RGB_to_XYZ.T, space.whitepoint)
        for rgb in (found, truth)
    )
    return np.asarray(colour.delta_E(one, other, method="CIE 2000"))


def _by_opencv(raw: np.ndarray, code: str) -> np.ndarray:
    """What OpenCV makes of a mosaic, which has to have 16 bits."""
    import cv2  # pyright: ignore[reportMissingImports]

    return cv2.cvtColor((raw * 65535).astype(np.uint16), getattr(cv2, code))


def draw(figure: "Figure", measured: Measured) -> None:
    """Both errors of each picture against time, a line for each light."""
    times = {row.name: row.values["time_ms"] for row in measured.of(TIMES)}
    shown = list(dict.fromkeys(str(row.parameters["picture"]) for row in measured.of(ERRORS)))
    lights = list(dict.fromkeys(int(row.parameters["photons"]) for row in measured.of(ERRORS)))
    panels = figure.subplots(2, len(shown), sharex=True)
    for (line, quantity), (column, picture) in product(
        enumerate(("cpsnr_db", "ciede2000")), enumerate(shown)
    ):
        axes = panels[line, column]
        for number, light in enumerate(lights):
            rows = measured.of(ERRORS, picture=picture, photons=light)
            rows = sorted(rows, key=lambda row: times[row.name].value)
            name = "full light" if light == FULL_LIGHT else f"{light} photons"
            curve(axes, rows, lambda row: times[row.name], quantity, name, number)
        frame(axes, "time_ms", quantity, picture if line == 0 else "", log="x")
        for name in METHODS:
            style = {"fontsize": 7, "rotation": 90, "va": "bottom", "color": "#5b6475"}
            axes.text(times[name].value, 0.02, name, transform=axes.get_xaxis_transform(), **style)


def reading(measured: Measured) -> str:
    """How to read it, with the time of ours and the best method at full light and in the least light."""
    own = measured.one(TIMES, OWN).values["time_ms"].value
    least = min(float(row.parameters["photons"]) for row in measured.of(ERRORS) if row.parameters["photons"])
    best = {}
    for photons in (FULL_LIGHT, least):
        rows = measured.of(ERRORS, picture="texture", photons=photons)
        best[photons] = max(rows, key=lambda row: row.values["cpsnr_db"].value)
    slowest = max(row.values["time_ms"].value for row in measured.of(TIMES))
    spread = median(
        row.values["cpsnr_db"].value for row in measured.of(ERRORS, picture="texture", photons=least)
    )
    return (
        "Which interpolation of colours is worth its time? Higher CPSNR and lower CIEDE2000 are better; on"
        f" the texture {best[FULL_LIGHT].name} is closest at full light with"
        f" {best[FULL_LIGHT].values['cpsnr_db'].value:.1f} dB, and {best[least].name} with"
        f" {best[least].values['cpsnr_db'].value:.1f} dB at {least:g} photons per pixel, where photon noise"
        f" leaves all near {spread:.1f} dB. Laroche and Prescott's takes {own:.1f} ms for an image of the"
        f" paper's size, the slowest {slowest:.0f} ms."
    )


STUDY = Study("demosaicing", "Demosaicing", SIZES, measure, draw, reading, width_in=9.0, height_in=6.0)
