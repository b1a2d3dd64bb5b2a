"""How right colours are in spectral mode, what RGB mode gets wrong, and the time that both take.

A ColorChecker in even light is rendered and compared with integration by colour-science: the camera's raw
channels, and the colours (CIEDE2000) that the matrix makes of them which fits these patches best.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.colour_chart import WHITE, Chart, colours, difference, integrated, lab, render_chart
from benchmarks.figures import bars
from benchmarks.results import Measured, Row, Size, Study, Value, mean_of
from benchmarks.scenes import film, setup_of
from benchmarks.timing import median_of, timed
from simgen.photons.thinning import thin_photons
from simgen.renderer import backend
from simgen.renderer.radiance import render_view
from simgen.spec.recipe import load_recipe
from simgen.spectral.filters import sensitivity
from simgen.spectral.spectra import illuminant, integral, patch, patch_names

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CAMERAS = ("Nikon 5100 (NPL)", "Sigma SDMerill (NPL)")
LAMPS = ("D65", "A")
RAW, COLOURS = (
    "Raw channels: mean error over patches and channels",
    "Colours of the chart after the best matrix",
)
PATCH, TIMES = "Colours patch by patch", "Time of both modes"
RGB_MODE, SPECTRAL_MODE = "RGB mode", "spectral mode"
DENSE, PHOTONS = "a view of 256 x 256 pixels, 16 samples", "100 000 photons by thinning"
GREEN = 1
"""The channel of the white patch that all raw channels are told relative to."""


SIZES: Mapping[Size, Mapping[str, Any]] = {
    "quick": {"samples": 512, "repeats": 6, "each_patch": False},
    "full": {"samples": 4096, "repeats": 12, "each_patch": True},
}


def measure(samples: int, repeats: int, each_patch: bool) -> Measured:
    """Errors of both modes for every camera and lamp, and times where there is a compiled backend."""
    pairs = [(lamp, camera) for camera in (None, *CAMERAS) for lamp in LAMPS]
    charts = {(lamp, camera): render_chart(lamp, camera, samples) for lamp, camera in pairs}
    rows = [_raw_row(charts, lamp, camera) for lamp in LAMPS for camera in CAMERAS]
    rows += [row for pair in pairs for row in _colour_rows(charts[pair], *pair, each=each_patch)]
    if backend.choose().kind == "scalar":  # there it takes minutes
        return Measured(rows, seeds=[1])
    return Measured([*rows, *_times(repeats)], seeds=[1])


def _raw_row(charts: dict[tuple[str, str | None], Chart], lamp: str, camera: str) -> Row:
    """Errors of spectral mode relative to the white patch's green, of RGB mode to the white patch's own."""
    chart, exact, plain = charts[lamp, camera], integrated(lamp, camera), charts[lamp, None].channels
    wanted = exact / exact[WHITE, GREEN]
    tables, balanced = _by_tables(lamp, camera), exact / exact[WHITE]
    found = {
        "spectral_mode_percent": chart.channels / chart.channels[WHITE, GREEN] / wanted - 1,
        "without_rendering_percent": tables / tables[WHITE, GREEN] / wanted - 1,
        "rendering_noise_percent": chart.error / chart.channels,
        "rgb_mode_percent": plain / plain[WHITE] / balanced - 1,
        "rgb_mode_and_matrix_percent": plain @ _relative_fit(plain, balanced) / balanced - 1,
    }
    values = {name: mean_of(100 * abs(errors).mean(axis=1)) for name, errors in found.items()}
    values["rgb_to_camera_ciede2000"] = mean_of(difference(colours(plain, lamp), colours(exact, lamp)))
    return Row(RAW, camera, {"lamp": lamp}, values)


def _by_tables(lamp: str, camera: str) -> np.ndarray:
    """Raw channels (24, 3) without rendering: integrals of the tables that renderings are made from."""
    curves = sensitivity(camera, Path())
    return np.array([integral(curves * illuminant(lamp) * patch(name)) for name in patch_names()])


def _relative_fit(channels: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """The matrix (3, 3) with the least squares of relative errors."""
    columns = [np.linalg.lstsq(channels / own[:, None], np.ones(24), rcond=None)[0] for own in wanted.T]
    return np.stack(columns, axis=1)


def _colour_rows(chart: Chart, lamp: str, camera: str | None, *, each: bool) -> list[Row]:
    """Colours after the fitted matrix against those of the patches; a camera's own, integrated, beside."""
    truth, name = lab(integrated(lamp, None), lamp), camera or RGB_MODE
    errors = difference(colours(chart.channels, lamp), truth)
    values = {"ciede2000": mean_of(errors), "largest_ciede2000": Value(float(errors.max()))}
    if camera is not None:
        values["camera_itself_ciede2000"] = mean_of(
            difference(colours(integrated(lamp, camera), lamp), truth)
        )
    rows = [Row(COLOURS, name, {"lamp": lamp}, values)]
    if each:
        patches = zip(patch_names(), errors, strict=True)
        rows += [
            Row(PATCH, p, {"lamp": lamp, "camera": name}, {"ciede2000": Value(float(e))}) for p, e in patches
        ]
    return rows


def _times(repeats: int) -> list[Row]:
    """Both modes on the paper's recipe: a dense view, and photons by thinning."""
    rows: list[Row] = []
    taken: dict[tuple[str, str], list[float]] = {}
    for mode, spectral in ((RGB_MODE, []), (SPECTRAL_MODE, [f"sensor.camera={CAMERAS[0]}"])):
        setup = setup_of(load_recipe("paper", ["grid.rows=1", "grid.cols=1", *film(256), *spectral])[0])
        taken[DENSE, mode], _ = timed(
            lambda seed, s=setup: render_view(s.render_scene, s.grid, 0, 0, samples_per_pixel=16, seed=seed),
            repeats,
        )
        recipe, _ = load_recipe("paper", spectral)
        setup = setup_of(recipe)
        taken[PHOTONS, mode], _ = timed(
            lambda n, s=setup, p=recipe.photons: thin_photons(s, p, seed=n), repeats
        )
        rows += [
            Row(TIMES, what, {"mode": mode}, {"time_ms": median_of(taken[what, mode], 1e3)})
            for what in (DENSE, PHOTONS)
        ]
    return rows


def draw(figure: "Figure", measured: Measured) -> None:
    """Colour differences of each camera and of RGB mode, by lamp."""
    panels = figure.subplots(1, len(LAMPS), sharex=True)
    for axes, lamp in zip(panels, LAMPS, strict=True):
        rows = measured.of(COLOURS, lamp=lamp)
        bars(
            axes,
            [row.name for row in rows],
            [row.values["ciede2000"] for row in rows],
            "CIEDE2000, mean of 24 patches",
        )
        axes.set_title(f"lamp {lamp}", fontsize=10)


def reading(measured: Measured) -> str:
    """How to read it, with the figures of the first camera in lamp light."""
    lamp = LAMPS[-1]
    row = measured.one(RAW, CAMERAS[0], lamp=lamp).values
    rgb, own = (
        measured.one(COLOURS, name, lamp=lamp).values["ciede2000"].value for name in (RGB_MODE, CAMERAS[0])
    )
    text = (
        "Are colours right, and what does that cost? Raw channels of the spectral mode are off by"
        f" {row['spectral_mode_percent'].value:.2f} % on average, of which rendering noise is"
        f" {row['rendering_noise_percent'].value:.2f} %, those of RGB mode by"
        f" {row['rgb_mode_percent'].value:.0f} % (lamp {lamp}, {CAMERAS[0]}). After the best matrix the"
        f" colours of the chart differ by {own:.1f} CIEDE2000 from the patches' own as that camera sees"
        f" them, and by {rgb:.1f} in RGB mode, which sees as eyes do"
    )
    if not measured.of(TIMES):
        return text + "."
    plain, spectral = (
        measured.one(TIMES, DENSE, mode=mode).values["time_ms"].value for mode in (RGB_MODE, SPECTRAL_MODE)
    )
    slower = spectral / plain
    return text + f"; a dense view takes {slower:.1f} times as long with spectra."


STUDY = Study("colour", "Colours of a chart", SIZES, measure, draw, reading, width_in=10.0, height_in=2.8)
