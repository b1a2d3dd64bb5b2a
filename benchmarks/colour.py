"""How right colours are in spectral mode, what RGB mode gets wrong, and the time that both take.

A ColorChecker in even light is rendered and compared with integration by colour-science: the camera's raw
channels, and the colours (CIEDE2000) that the matrix makes of them which fits these patches best.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.photons import setup_of, thinned
from benchmarks.timing import timed
from pcii.core.camera_grid import CameraGrid
from simgen.renderer import backend
from simgen.renderer.mitsuba_scene import build
from simgen.renderer.radiance import render_view
from simgen.spec.recipe import load_recipe
from simgen.spec.scene import Scene
from simgen.spectral.camera_curves import sensitivity
from simgen.spectral.spectra import PATCHES, illuminant, integral, patch, patch_names

CAMERAS = ("Nikon 5100 (NPL)", "Sigma SDMerill (NPL)")
LAMPS = ("D65", "A")
ACROSS, DOWN, SIDE_PX, BORDER_PX = 6, 4, 16, 2
SAMPLES = 4096
WHITE, GREEN = 18, 1
"""The patch and the channel that all raw channels are told relative to."""


@dataclass(frozen=True)
class Chart:
    """Channels (24, C) of the patches, and the standard error of each that rendering leaves."""

    channels: np.ndarray
    error: np.ndarray


def render_chart(lamp: str, camera: str | None) -> Chart:
    """The chart fills the view, evenly lit; in the camera's raw channels, or in linear sRGB without one."""
    mi = backend.load(spectral=camera is not None)
    curves = None if camera is None else sensitivity(camera, Path())
    grid = CameraGrid(
        rows=1,
        cols=1,
        pitch_mm=(1.0, 1.0),
        focal_mm=50.0,
        pixel_mm=0.2,
        height=DOWN * SIDE_PX,
        width=ACROSS * SIDE_PX,
    )
    built = build(mi, _chart(lamp, SIDE_PX * grid.pixel_mm * 10), Path(), 2, curves)
    view = render_view(built, grid, 0, 0, samples_per_pixel=SAMPLES, seed=1).astype(np.float64)
    inner = slice(BORDER_PX, -BORDER_PX)
    pixels = view.reshape(DOWN, SIDE_PX, ACROSS, SIDE_PX, -1)[:, inner, :, inner]
    number = (SIDE_PX - 2 * BORDER_PX) ** 2
    mean, spread = pixels.mean(axis=(1, 3)), pixels.std(axis=(1, 3)) / np.sqrt(number)
    return Chart(mean.reshape(24, -1), spread.reshape(24, -1))


def _chart(lamp: str, side_mm: float) -> Scene:
    """Patches of this side, edge to edge, at 500 mm: ten times the focal length."""
    cards = [
        {
            "name": f"patch{number}",
            "position_mm": (
                (number % ACROSS - (ACROSS - 1) / 2) * side_mm,
                (number // ACROSS - (DOWN - 1) / 2) * side_mm,
                500.0,
            ),
            "shape": {"type": "card", "width_mm": side_mm, "height_mm": side_mm},
            "material": {"reflectance": name},
        }
        for number, name in enumerate(patch_names())
    ]
    light = {"type": "uniform", "luminance_cd_m2": 100.0, "illuminant": lamp}
    return Scene.model_validate({"title": "chart", "objects": cards, "lights": [light]})


def integrated(lamp: str, camera: str | None) -> np.ndarray:
    """Raw channels (24, 3) of the patches, or CIE XYZ without a camera, by integration in colour-science."""
    import colour

    shape = colour.SpectralShape(380, 780, 1)
    if camera is None:
        curves = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(shape)
    else:
        nothing = {"method": "Constant", "left": 0, "right": 0}
        sensitivities = colour.MSDS_CAMERA_SENSITIVITIES[camera].copy()
        curves = sensitivities.align(shape, extrapolator_kwargs=nothing)
    light = colour.SDS_ILLUMINANTS[lamp].copy().align(shape)
    patches = [one.copy().align(shape) for one in colour.SDS_COLOURCHECKERS[PATCHES].values()]
    seen = [colour.sd_to_XYZ(one, cmfs=curves, illuminant=light, method="Integration") for one in patches]
    return np.array(seen) / 100


def colours(channels: np.ndarray, lamp: str) -> np.ndarray:
    """CIE Lab (24, 3) of the chart: by least squares a matrix from white balanced channels to CIE XYZ."""
    balanced, xyz = channels / channels[WHITE], integrated(lamp, None)
    return _lab(balanced @ np.linalg.lstsq(balanced, xyz, rcond=None)[0], lamp)


def _lab(xyz: np.ndarray, lamp: str) -> np.ndarray:
    """With the lamp's own white, at luminance 1."""
    import colour

    shape = colour.SpectralShape(380, 780, 1)
    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(shape).values
    light = colour.SDS_ILLUMINANTS[lamp].copy().align(shape).values
    white = light @ observer
    return colour.XYZ_to_Lab(xyz, colour.XYZ_to_xy(white / white[1]))


def _difference(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """CIEDE2000 (24,)."""
    import colour

    return colour.delta_E(one, other, method="CIE 2000")


def table() -> Iterator[str]:
    """The tables, line by line as they are measured."""
    charts = {(lamp, camera): render_chart(lamp, camera) for camera in (None, *CAMERAS) for lamp in LAMPS}
    yield f"colours of a ColorChecker, {SAMPLES} samples, {backend.choose().line()}"
    yield ""
    yield from _raw(charts)
    yield ""
    yield from _patches(charts)
    if backend.choose().kind != "scalar":  # there it takes minutes
        yield ""
        yield from _times()


def _raw(charts: dict[tuple[str, str | None], Chart]) -> Iterator[str]:
    """Errors of spectral mode relative to the white patch's green, of RGB mode to the white patch's own."""
    yield "| raw channels: largest, mean error | spectral mode | without rendering | of that noise | " + (
        "RGB mode | RGB mode after the best matrix | its colours from the camera's: CIEDE2000 |"
    )
    yield "|---|---|---|---|---|---|---|"
    for lamp in LAMPS:
        plain = charts[lamp, None].channels
        for camera in CAMERAS:
            chart, exact = charts[lamp, camera], integrated(lamp, camera)
            found = chart.channels / chart.channels[WHITE, GREEN]
            spectral = abs(found / (exact / exact[WHITE, GREEN]) - 1)
            tables = _by_tables(lamp, camera)
            unrendered = abs(tables / tables[WHITE, GREEN] / (exact / exact[WHITE, GREEN]) - 1)
            noise = chart.error / chart.channels
            balanced = exact / exact[WHITE]
            untouched = abs(plain / plain[WHITE] / balanced - 1)
            fitted = abs(plain @ _relative_fit(plain, balanced) / balanced - 1)
            apart = _difference(colours(plain, lamp), colours(exact, lamp))
            yield (
                f"| {lamp}, {camera} | {_worst(spectral)} | {_worst(unrendered)} | {_worst(noise)} "
                f"| {_worst(untouched)} | {_worst(fitted)} | {apart.max():.1f}, {apart.mean():.1f} |"
            )


def _by_tables(lamp: str, camera: str) -> np.ndarray:
    """Raw channels (24, 3) without rendering: integrals of the tables that renderings are made from."""
    curves = sensitivity(camera, Path())
    return np.array([integral(curves * illuminant(lamp) * patch(name)) for name in patch_names()])


def _relative_fit(channels: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """The matrix (3, 3) with the least squares of relative errors."""
    columns = [np.linalg.lstsq(channels / own[:, None], np.ones(24), rcond=None)[0] for own in wanted.T]
    return np.stack(columns, axis=1)


def _worst(errors: np.ndarray) -> str:
    return f"{errors.max():.2%}, {errors.mean():.2%}"


def _patches(charts: dict[tuple[str, str | None], Chart]) -> Iterator[str]:
    """Colours after the fitted matrix against those of the patches; cameras themselves beside the mean."""
    columns = [(lamp, camera) for lamp in LAMPS for camera in (*CAMERAS, None)]
    errors, ideal = [], []
    for lamp, camera in columns:
        truth = _lab(integrated(lamp, None), lamp)
        errors.append(_difference(colours(charts[lamp, camera].channels, lamp), truth))
        itself = np.nan
        if camera is not None:
            itself = _difference(colours(integrated(lamp, camera), lamp), truth).mean()
        ideal.append(itself)
    found = np.array(errors)
    yield "| CIEDE2000 | " + " | ".join(f"{lamp}, {camera or 'RGB mode'}" for lamp, camera in columns) + " |"
    yield "|---" * (1 + len(columns)) + "|"
    for name, row in zip(patch_names(), found.T, strict=True):
        yield _row(name, row)
    yield _row("**mean**", found.mean(axis=1))
    yield _row("median", np.median(found, axis=1))
    yield _row("largest", found.max(axis=1))
    yield _row("mean of the camera itself, integrated", np.array(ideal))


def _row(name: str, values: np.ndarray) -> str:
    cells = " | ".join("" if np.isnan(value) else f"{value:.2f}" for value in values)
    return f"| {name} | {cells} |"


def _times() -> Iterator[str]:
    """Both modes on the paper's recipe."""
    view = ["grid.rows=1", "grid.cols=1", "grid.height=512", "grid.width=512", "grid.pixel_mm=0.0704"]
    seconds = []
    for spectral in ([], [f"sensor.camera={CAMERAS[0]}"]):
        setup = setup_of(load_recipe("paper", view + spectral)[0])
        dense, _ = timed(
            lambda seed, s=setup: render_view(s.render_scene, s.grid, 0, 0, samples_per_pixel=16, seed=seed)
        )
        photons, log = thinned(load_recipe("paper", spectral)[0])
        seconds.append((dense, photons, log["kept_share"]))
    plain, own = seconds
    yield "| time | RGB mode | spectral mode | ratio |"
    yield "|---|---|---|---|"
    for name, one, other in (
        ("a view of 512 x 512 pixels, 16 samples", plain[0], own[0]),
        ("100 000 photons by thinning", plain[1], own[1]),
    ):
        yield f"| {name} | {one:.2f} s | {other:.2f} s | {other / one:.1f} x |"
    yield f"| candidates that are kept | {plain[2]:.0%} | {own[2]:.0%} | |"
