"""Spectral mode against integration by colour-science: rendered views, thinned photons, exposures."""

from typing import Any

import numpy as np
import pytest
from lit_scenes import SCALAR, build_scene, card, thinned
from photon_statistics import counted

from pcii.types import colour_index
from simgen.dataset import capture_of
from simgen.renderer import RenderScene, render_view
from simgen.spec import Recipe
from simgen.spectral import colour_science, patch_names

# colour-science says that it interpolates.
pytestmark = [pytest.mark.renders, pytest.mark.filterwarnings("ignore:Aligning")]
CAMERAS = ("Nikon 5100 (NPL)", "Sigma SDMerill (NPL)")
LUX, PIXEL_MM, F_NUMBER, TIME_S = 500.0, 0.25, 4.0, 2e-7
ACROSS, DOWN, SIDE_PX = 6, 4, 12
FILM = {"rows": 1, "cols": 1, "height": DOWN * SIDE_PX, "width": ACROSS * SIDE_PX, "pixel_mm": PIXEL_MM}


def recipe(camera: str | None) -> Recipe:
    values = {"scene": "chart", "grid": FILM, "sensor": {"camera": camera}, "photons": {"scope": "exposure"}}
    return Recipe.model_validate(values | {"exposure": {"f_number": F_NUMBER, "time_s": TIME_S}})


def chart(lamp: str, camera: str | None) -> tuple[RenderScene, Recipe]:
    """A ColorChecker that fills the view, each patch `SIDE_PX` pixels wide, evenly lit by `LUX`."""
    side_mm, cards = SIDE_PX * PIXEL_MM * 500 / 50, list[dict[str, Any]]()
    for number, name in enumerate(patch_names()):
        down, right = divmod(number, ACROSS)
        at_mm = (right - (ACROSS - 1) / 2) * side_mm, (down - (DOWN - 1) / 2) * side_mm
        cards.append(card(500, side_mm, {"reflectance": name}, f"patch{number}", at_mm=at_mm))
    light = {"type": "uniform", "luminance_cd_m2": 1.0, "illuminant": lamp}
    level = {"illuminance_lux": LUX, "z_mm": 500}
    return build_scene(cards, [light], camera=camera, level=level), recipe(camera)


def by_patch(image: np.ndarray) -> np.ndarray:
    """Means (24, C) over the inner pixels of the patches of (H, W, C)."""
    blocks = image.reshape(DOWN, SIDE_PX, ACROSS, SIDE_PX, -1)[:, 2:-2, :, 2:-2]
    return blocks.mean(axis=(1, 3)).reshape(24, -1)


def integrated(camera: str, lamp: str) -> np.ndarray:
    """Raw channels (24, 3) of the patches, up to one factor: colour-science's own integration."""
    colour = colour_science()
    curves = colour.MSDS_CAMERA_SENSITIVITIES[camera]
    shape = colour.SpectralShape(380, 780, 1)
    curves = curves.copy().align(shape, extrapolator_kwargs={"method": "Constant", "left": 0, "right": 0})
    chart = colour.SDS_COLOURCHECKERS["ColorChecker N Ohta"].values()
    light = colour.SDS_ILLUMINANTS[lamp].copy().align(shape)
    options = {"cmfs": curves, "illuminant": light, "method": "Integration"}
    return np.array([colour.sd_to_XYZ(one, **options) for one in chart])


@pytest.mark.parametrize(("camera", "lamp"), list(zip(CAMERAS, ("D65", "A"), strict=True)))
def test_raw_channels_of_a_colour_chart_are_those_of_spectral_integration(camera: str, lamp: str) -> None:
    built, made = chart(lamp, camera)
    grid, samples = made.grid.camera_grid(), 512
    view = render_view(built, grid, 0, 0, samples_per_pixel=samples, seed=5).astype(np.float64)
    found, expected = by_patch(view), integrated(camera, lamp)
    # Ratios to the green of the white patch, so that exposure does not matter. 33 000 paths a patch
    # leave 0.15 to 0.6 % of noise.
    found, expected = found / found[18, 1], expected / expected[18, 1]
    np.testing.assert_allclose(found, expected, rtol=0.01)
    # The fault: the other lamp's light.
    other = integrated(camera, {"D65": "A", "A": "D65"}[lamp])
    assert (abs(found / (other / other[18, 1]) - 1) > 0.01).mean() > 0.8


def test_thinned_photons_of_the_chart_are_those_of_spectral_integration() -> None:
    built, made = chart("FL2", CAMERAS[0])
    grid, whole = made.grid.camera_grid(), capture_of(made, built, made.seed).photons_per_radiance or 0
    # A few hundred photons a patch one by one, or some thousand where that is cheap.
    gain = whole * (0.05 if SCALAR else 0.5)
    counts = counted(thinned(built, grid, gain, seed=2)[0], grid)[0, 0]
    colours = colour_index(grid.height, grid.width, made.cfa)
    of_colours = np.stack([counts * (colours == colour) for colour in range(3)], axis=-1)
    found = by_patch(of_colours) * (SIDE_PX - 4) ** 2
    expected = integrated(CAMERAS[0], "FL2") * np.array([0.25, 0.5, 0.25])
    expected *= found.sum() / expected.sum()
    # Chi-square of 72 Poisson numbers, one of them given away for the sum; 5 deviations of it.
    surprise = ((found - expected) ** 2 / expected).sum()
    assert abs(surprise - 71) < 5 * np.sqrt(2 * 71)
    # The fault: light of another spectrum is seen at once.
    other = integrated(CAMERAS[0], "D65") * np.array([0.25, 0.5, 0.25])
    other *= found.sum() / other.sum()
    assert ((found - other) ** 2 / other).sum() > 71 + 10 * np.sqrt(2 * 71)


@pytest.mark.parametrize("camera", [None, CAMERAS[0]])
def test_a_grey_card_gives_the_photons_by_hand(camera: str | None) -> None:
    """At 500 lux: E rho / pi cd/m^2, pi / (4 N^2) of it on the sensor, times area, time and photons."""
    built, made = chart("D65", camera)
    gain: Any = capture_of(made, built, made.seed).photons_per_radiance
    view = render_view(built, made.grid.camera_grid(), 0, 0, samples_per_pixel=256, seed=6)
    seen = by_patch(view.astype(np.float64))[21] * gain  # neutral 5
    per_lux = np.pi / (4 * F_NUMBER**2) * (PIXEL_MM * 1e-3) ** 2 * TIME_S / np.pi
    np.testing.assert_allclose(seen, photons_of_grey(camera) * per_lux * LUX, rtol=5e-3)


def photons_of_grey(camera: str | None) -> np.ndarray:
    """Photons (3,) that a lumen second of D65, reflected by neutral 5, gives pixels: by spectra, by hand."""
    colour = colour_science()
    shape = colour.SpectralShape(380, 780, 1)
    wavelength_nm = np.arange(380, 781.0)
    light = colour.SDS_ILLUMINANTS["D65"].copy().align(shape).values
    grey = colour.SDS_COLOURCHECKERS["ColorChecker N Ohta"]["neutral 5 (.70 D)"].copy().align(shape).values
    luminosity = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(shape).values[:, 1]
    if camera is None:  # photons of 555 nm, whatever the colour
        reflected = (light * grey * luminosity).sum() / (light * luminosity).sum()
        return np.full(3, reflected * 555e-9 / (683 * 6.62607015e-34 * 299792458))
    watts_per_lumen_nm = light / (683.002 * (light * luminosity).sum())
    photons_per_watt_second = wavelength_nm * 1e-9 / (6.62607015e-34 * 299792458)
    curves = colour.MSDS_CAMERA_SENSITIVITIES[camera].copy()
    curves = curves.align(shape, extrapolator_kwargs={"method": "Constant", "left": 0, "right": 0}).values
    efficiency = (curves.T / wavelength_nm) / (curves.T / wavelength_nm).max()
    return (efficiency * watts_per_lumen_nm * grey * photons_per_watt_second).sum(axis=1)
