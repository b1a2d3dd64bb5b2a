"""Absolute exposure: photons of a uniformly lit sensor are those of the calculation by hand."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from lit_scenes import build_scene
from photon_statistics import counted

from pcii.base import silent
from pcii.types import colour_index, sense
from simgen.dataset import capture_of, draw_from_views
from simgen.photons import Plan, plan_counts, thin_photons
from simgen.renderer import RenderScene, render_view
from simgen.sensor import PhotonTable, photons_per_radiance
from simgen.spec import Exposure, Recipe

LUMINANCE_CD_M2, F_NUMBER, TIME_S, PIXEL_MM = 100.0, 4.0, 2e-6, 0.02
BY_HAND = math.pi / (4 * 4.0**2) * (20e-6) ** 2 * 2e-6 * 100 * 4.09e15
"""Photons per pixel: 16 of 555 nm. The 4.09e15 in a lumen second are rounded to 1 in 1000."""
Draw = Callable[[Recipe, RenderScene], PhotonTable]


def recipe(**changes: object) -> Recipe:
    values = {
        "scene": "made up",
        "seed": 1,
        "grid": {"rows": 1, "cols": 2, "height": 64, "width": 80, "pixel_mm": PIXEL_MM},
        "photons": {"scope": "exposure"},
        "exposure": {"f_number": F_NUMBER, "time_s": TIME_S},
    }
    return Recipe.model_validate(values | changes)


@pytest.fixture(scope="module")
def lit_evenly() -> RenderScene:
    return build_scene([], [{"type": "uniform", "luminance_cd_m2": LUMINANCE_CD_M2}])


def planned(thins: bool) -> Plan:
    return Plan(thins=thins, samples=1, photons_per_view=0.0, noise=0.0, normaliser_error=0.0)


def thinned(made: Recipe, built: RenderScene) -> PhotonTable:
    return thin_photons(capture_of(made, built, made.seed), planned(True))[0]


def dense(made: Recipe, built: RenderScene) -> PhotonTable:
    grid = made.grid.camera_grid()

    def view_of(k: int, l: int) -> tuple[np.ndarray, np.ndarray]:
        image = render_view(built, grid, k, l, samples_per_pixel=1, seed=1)
        return sense(image, made.cfa), np.zeros(3)

    capture = capture_of(made, built, made.seed)
    return draw_from_views(capture, view_of, planned(False), silent)[0]


def test_photons_per_radiance_are_those_by_hand() -> None:
    found = photons_per_radiance(Exposure(f_number=F_NUMBER, time_s=TIME_S), PIXEL_MM)
    assert LUMINANCE_CD_M2 * found == pytest.approx(BY_HAND, rel=1e-3)


@pytest.mark.renders
@pytest.mark.parametrize("draw", [thinned, dense])
@pytest.mark.parametrize("cfa", ["GRBG", "none"])
def test_an_even_light_gives_the_photons_by_hand(lit_evenly: RenderScene, draw: Draw, cfa: str) -> None:
    made = recipe(sensor={"cfa": cfa})
    counts = counted(draw(made, lit_evenly), made.grid.camera_grid())
    # 4 standard errors of mean and variance of n Poisson numbers, and what was rounded by hand.
    n = counts.size
    allowed = 4 * np.sqrt(BY_HAND / n) + 1e-3 * BY_HAND
    assert abs(counts.mean() - BY_HAND) < allowed
    assert abs(counts.var() - BY_HAND) < 4 * np.sqrt((BY_HAND + 2 * BY_HAND**2) / n)
    # The faults: pi is left out, a pixel's side taken for its area, an f-number off by a per cent.
    for wrong in (BY_HAND / math.pi, BY_HAND / 20e-6, BY_HAND * 1.01**2):
        assert abs(counts.mean() - wrong) > allowed
    colours = colour_index(64, 80, made.cfa)
    for colour in np.unique(colours):
        part = counts[..., colours == colour]
        assert abs(part.mean() - BY_HAND) < 4 * np.sqrt(BY_HAND / part.size) + 1e-3 * BY_HAND


@pytest.mark.renders
def test_the_plan_expects_the_photons_by_hand(lit_evenly: RenderScene) -> None:
    made = plan_counts(capture_of(recipe(), lit_evenly, 1), "llvm", may_explore=lambda _: False)
    assert made.photons_per_view == pytest.approx(64 * 80 * BY_HAND, rel=1e-3)
    assert made.noise == pytest.approx(0, abs=1e-6)  # single precision: an even light has no noise
    assert made.samples == 1
