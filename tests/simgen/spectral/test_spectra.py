"""Spectra of lights, surfaces and cameras, their names in scenes, and the wavelengths that are drawn."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lit_scenes import CAMERA, EVENLY, card

from pcii.base import InputError
from simgen.base import validate
from simgen.spec import Scene
from simgen.spectral import (
    WAVELENGTH_NM,
    colour_science,
    filters_for,
    illuminant,
    integral,
    linear_srgb,
    observer,
    patch,
    patch_names,
    sensitivity,
)


@pytest.mark.parametrize("name", ["D65", "A", "FL2", "E"])
def test_illuminants_have_luminance_1_and_their_own_chromaticity(name: str) -> None:
    colour = colour_science()

    xyz = integral(observer() * illuminant(name)) / integral(observer()[1])
    assert xyz[1] == pytest.approx(1, rel=1e-12)
    expected = colour.CCS_ILLUMINANTS["CIE 1931 2 Degree Standard Observer"][name]
    # The published chromaticities have four or five digits, and spectra are cut at 380 and 780 nm.
    np.testing.assert_allclose(xyz[:2] / xyz.sum(), expected, atol=2e-4)


def test_grey_patches_are_grey_and_red_is_red() -> None:
    grey = linear_srgb(patch("neutral 5"))
    np.testing.assert_allclose(grey, 10**-0.7, atol=0.01)  # its density is 0.70
    red = linear_srgb(patch("red"))
    assert red[0] > 4 * red[1] > 0
    assert len(patch_names()) == 24
    assert patch_names()[0] == "dark skin"
    # A surface that reflects everything is white.
    np.testing.assert_allclose(linear_srgb(np.ones(WAVELENGTH_NM.size)), 1, rtol=1e-12)


@pytest.mark.parametrize(("camera", "lamp"), [(CAMERA, "D65"), ("Sigma SDMerill (NPL)", "FL2")])
def test_drawn_wavelengths_give_what_a_pixel_sees(camera: str, lamp: str) -> None:
    filters = filters_for(sensitivity(camera, Path()), illuminant(lamp))
    light = illuminant(lamp) * patch("cyan")
    rng = np.random.default_rng(4)
    fine_nm = np.linspace(380, 780, 8001)
    for colour, curve in enumerate(filters.sensitivity):
        drawn_nm, weight = filters.draw(np.full(20_000, colour), rng.random(20_000))
        assert drawn_nm.min() >= 380
        assert drawn_nm.max() <= 780
        seen = (np.interp(drawn_nm, WAVELENGTH_NM, light) * weight).sum(axis=1)
        product = np.interp(fine_nm, WAVELENGTH_NM, light) * np.interp(fine_nm, WAVELENGTH_NM, curve)
        exact = np.trapezoid(product, fine_nm)
        # Four standard errors; the fault, weights that forget how wide a cell is, is off by far more.
        assert abs(seen.mean() - exact) < 4 * seen.std() / np.sqrt(seen.size)
        assert seen.std() < 0.35 * seen.mean()  # what it is for: evenly drawn wavelengths give 0.5 to 2


def test_a_perfect_detector_of_555_nm_counts_lumens() -> None:
    curve = np.exp(-(((WAVELENGTH_NM - 555) / 4) ** 2))
    filters = filters_for(curve[None], illuminant("E"))
    # It detects each photon of 555 nm: of a narrow line there a pixel sees the luminance, whose
    # integral with the luminosity function is 1 per nm there.
    line = np.where(WAVELENGTH_NM == 555, 1.0, 0.0)
    luminance = integral(observer()[1] * line) / integral(observer()[1])
    assert integral(filters.sensitivity[0] * line) == pytest.approx(luminance, rel=2e-3)


def test_sensitivities_come_from_a_csv_file_too(tmp_path: Path) -> None:
    lines = ["wavelength_nm,R,G,B"] + [f"{nm},{nm - 400},{50},{700 - nm}" for nm in range(400, 701, 10)]
    (tmp_path / "mine.csv").write_text("\n".join(lines))
    curves = sensitivity("mine.csv", tmp_path)
    at = WAVELENGTH_NM.tolist().index
    np.testing.assert_allclose(curves[:, at(550)], [0.5, 50 / 300, 0.5])
    assert (curves[:, at(399)] == 0).all()  # beyond its ends a camera sees nothing
    # As spreadsheets write it, and of one curve.
    text = "\ufeffwavelength_nm, luminosity\r\n400, 0\r\n\r\n500, 2\r\n600, 0\r\n"
    (tmp_path / "one.csv").write_text(text, encoding="utf-8")
    np.testing.assert_allclose(sensitivity("one.csv", tmp_path)[:, at(450)], [0.5])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("wavelength_nm,R,G,B\n400,1,2\n", "expected the head wavelength_nm,R,G,B"),
        ("wavelength_nm,R,G,B\n400,1,nan,2\n500,1,1,1\n", "finite"),
        ("wavelength_nm,R,G,B\n500,1,1,2\n400,1,1,1\n", "growing"),
        ("wavelength_nm,R,G,B\n400,0,1,2\n500,0,1,1\n", "sees no light from 380 to 780 nm"),
    ],
)
def test_bad_csv_files_are_refused(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "bad.csv").write_text(text)
    with pytest.raises(InputError, match=message):
        sensitivity("bad.csv", tmp_path)
    with pytest.raises(InputError, match=r"^sensor\.camera: '\.\./bad\.csv' lies outside the folder"):
        sensitivity("../bad.csv", tmp_path / "recipes")


def test_a_pixel_that_no_lamp_shines_for_is_dark_and_no_fault() -> None:
    curve = np.where(WAVELENGTH_NM <= 384, 1.0, 0.0)
    light = illuminant("LED-B4")
    assert (light[WAVELENGTH_NM <= 385] == 0).all()
    filters = filters_for(curve[None], light)
    assert filters.white[0] == 0
    drawn_nm, weight = filters.draw(np.zeros(100, dtype=np.int64), np.linspace(0, 0.99, 100))
    assert drawn_nm.min() >= 380
    assert drawn_nm.max() <= 385 + 1e-3
    # Light that no lamp is known to have would be seen.
    assert weight.sum(axis=1).mean() == pytest.approx(integral(filters.sensitivity[0]), rel=0.02)


def scene_of(reflectance: object, lamp: str) -> dict[str, Any]:
    thing = card(500, 9, {"reflectance": reflectance})
    return {"title": "test", "objects": [thing], "lights": [EVENLY | {"illuminant": lamp}]}


@pytest.mark.parametrize(
    ("reflectance", "lamp", "message"),
    [
        ("darkskin", "D65", r"^s: 'objects\[0\]\.material\.reflectance': there is no patch .* did you mean"),
        ("dark skin", "D655", r"'lights\[0\]\.illuminant': there is no illuminant .* did you mean"),
        ({"wavelength_nm": [500, 400], "value": [0.1, 0.2]}, "D65", "must grow"),
        ({"wavelength_nm": [0.4, 0.7], "value": [0.1, 0.2]}, "D65", "light has 380 to 780 nm"),
        ([0.1, 0.2], "D65", r"reflectance\[2\]' is missing"),
    ],
)
def test_spectra_of_scenes_that_are_none_are_refused_by_field(
    reflectance: object, lamp: str, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        validate(Scene, scene_of(reflectance, lamp), "s")


def test_cameras_and_lamps_that_are_not_known_are_refused() -> None:
    with pytest.raises(InputError, match="did you mean 'Nikon 5100"):
        sensitivity("Nikon 5100", Path())
    with pytest.raises(InputError, match="from 380 to 780 nm"):
        illuminant("ISO 7589 Photoflood")  # colour-science has it to 690 nm


@pytest.mark.renders
def test_colour_science_is_not_loaded_for_spectra_that_are_kept() -> None:
    patch("dark skin")  # keeps them
    script = f"""
import sys
import pathlib
from simgen.renderer import backend, mitsuba_scene
from simgen.spec.scene import Scene
world = Scene.model_validate({scene_of("dark skin", "D65")})
mitsuba_scene.build(backend.load(), world, pathlib.Path(), 2)
print("colour" in sys.modules)
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.split()[-1] == "False"
