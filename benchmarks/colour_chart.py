"""A ColorChecker in even light: rendered, and integrated by colour-science without any rendering."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pcii.types.camera_grid import CameraGrid
from simgen.renderer import backend
from simgen.renderer.mitsuba_scene import build
from simgen.renderer.radiance import render_view
from simgen.spec.scene import Scene
from simgen.spectral.filters import sensitivity
from simgen.spectral.spectra import CHART, colour_science, patch_names

ACROSS, DOWN, SIDE_PX, BORDER_PX = 6, 4, 16, 2
WHITE = 18
"""The patch that channels are balanced by."""


@dataclass(frozen=True)
class Chart:
    """Channels (24, C) of the patches, and the standard error of each that rendering leaves."""

    channels: np.ndarray
    error: np.ndarray


def render_chart(lamp: str, camera: str | None, samples: int) -> Chart:
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
    view = render_view(built, grid, 0, 0, samples_per_pixel=samples, seed=1).astype(np.float64)
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
    colour = colour_science()

    shape = colour.SpectralShape(380, 780, 1)
    if camera is None:
        curves = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(shape)
    else:
        nothing = {"method": "Constant", "left": 0, "right": 0}
        sensitivities = colour.MSDS_CAMERA_SENSITIVITIES[camera].copy()
        curves = sensitivities.align(shape, extrapolator_kwargs=nothing)
    light = colour.SDS_ILLUMINANTS[lamp].copy().align(shape)
    patches = [one.copy().align(shape) for one in colour.SDS_COLOURCHECKERS[CHART].values()]
    seen = [colour.sd_to_XYZ(one, cmfs=curves, illuminant=light, method="Integration") for one in patches]
    return np.array(seen) / 100


def colours(channels: np.ndarray, lamp: str) -> np.ndarray:
    """CIE Lab (24, 3) of the chart: by least squares a matrix from white balanced channels to CIE XYZ."""
    balanced, xyz = channels / channels[WHITE], integrated(lamp, None)
    return lab(balanced @ np.linalg.lstsq(balanced, xyz, rcond=None)[0], lamp)


def lab(xyz: np.ndarray, lamp: str) -> np.ndarray:
    """With the lamp's own white, at luminance 1."""
    colour = colour_science()

    shape = colour.SpectralShape(380, 780, 1)
    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(shape).values
    light = colour.SDS_ILLUMINANTS[lamp].copy().align(shape).values
    white = light @ observer
    return colour.XYZ_to_Lab(xyz, colour.XYZ_to_xy(white / white[1]))


def difference(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """CIEDE2000 (24,)."""
    colour = colour_science()

    return colour.delta_E(one, other, method="CIE 2000")
