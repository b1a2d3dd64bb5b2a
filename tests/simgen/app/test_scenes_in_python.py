"""Scenes made in Python are seen as those of files: the same photons, views and pictures as of a dataset."""

import ast
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tiny import TINY_RECIPE

import pcii
import simgen
from pcii.core.photon_events import Readout
from simgen.spec.recipe import Recipe

GRID = Recipe.model_validate(TINY_RECIPE).grid.camera_grid()
SCENE = simgen.Scene(
    title="A glass ball before a card",
    objects=(
        simgen.SceneObject(
            name="ball",
            position_mm=(0, 0, 500),
            shape=simgen.Sphere(radius_mm=60),
            material=simgen.Material(finish=simgen.Glass()),
        ),
        simgen.SceneObject(
            name="card",
            position_mm=(0, 0, 620),
            shape=simgen.Card(width_mm=400, height_mm=300),
            material=simgen.Material(texture=simgen.Checks(rows=6, columns=8)),
        ),
    ),
    lights=(simgen.UniformLight(luminance_cd_m2=100),),
)
LENS = simgen.Lens(aperture_mm=6, focus_mm=560)
ERRORS = {"position_sd_mm": [0.5, 0.5, 0.1], "rotation_sd_deg": [0.1, 0.1, 0.2], "pitch_error": 0.01}
SENSOR = {"cfa": "RGGB", "dark_counts": 0.01, "dead_pixel_share": 0.1, "frames": 3, "bits": 1}


def dataset_of(out: Path, scene: simgen.Scene, **tables: Any) -> pcii.Dataset:
    """The dataset of a scene on disk, seen by `GRID`."""
    folder = scene.save(out / "scene").parent
    grid = TINY_RECIPE["grid"] | tables.pop("grid", {})
    recipe = Recipe.model_validate({"scene": str(folder), "grid": grid, **tables})
    simgen.generate(simgen.RecipeFile(recipe, out), out / "made")
    return pcii.open_dataset(out / "made")


def test_every_name_is_where_type_checkers_look_for_it() -> None:
    found: dict[str, Any] = {}
    for node in ast.walk(ast.parse(Path(simgen.__file__).read_text())):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("simgen."):
            found |= {
                alias.name: getattr(import_module(node.module or ""), alias.name) for alias in node.names
            }
    assert sorted(found) == sorted(simgen.__all__)
    for name, thing in found.items():
        assert getattr(simgen, name) is thing, name


def test_a_scene_of_values_is_that_of_the_file(tmp_path: Path) -> None:
    values: dict[str, Any] = {
        "title": "A picture",
        "lights": [{"type": "uniform", "luminance_cd_m2": 10}],
        "objects": [
            {
                "name": "card",
                "position_mm": [0, 0, 500],
                "shape": {"type": "card", "width_mm": 20, "height_mm": 20},
                "material": {"texture": "a.png"},
            }
        ],
    }
    (tmp_path / "a.png").write_bytes(b"")
    scene = simgen.load_scene(values, folder=tmp_path)
    assert scene == simgen.load_scene(scene.save(tmp_path))
    assert simgen.load_scene("two_objects").folder == simgen.load_scene("two_objects").change().folder
    wrong: Any
    for wrong, said in (
        ((values,), r"^scene: object 'card', material.texture: 'a.png' is looked for in .*; give folder=$"),
        ((values, 3), r"^number: these are values of one scene"),
        ((values | {"titel": "x"},), r"^scene: unknown key 'titel'; did you mean 'title'\?$"),
        ((3,), r"^scene: expected a name, a path or a dict, got int$"),
    ):
        with pytest.raises(pcii.InputError, match=said):
            simgen.load_scene(*wrong)
    with pytest.raises(pcii.InputError, match=r"scene: object 'card', .*: there is no file 'a.png' in"):
        simgen.load_scene(values, folder=tmp_path / "none")
    with pytest.raises(pcii.InputError, match=r"^folder: a scene by name or path has its own"):
        simgen.load_scene("two_objects", folder=tmp_path)


@pytest.mark.renders
def test_photons_by_lens_errors_and_sensor_are_those_of_the_dataset(tmp_path: Path) -> None:
    dataset = dataset_of(
        tmp_path,
        SCENE,
        seed=3,
        grid={"lens": LENS, "errors": ERRORS},
        sensor=SENSOR,
        photons={"budget": 300},
        render={"max_depth": 6},
        products={"frames": True},
    )
    options: dict[str, Any] = {"budget": 300, "seed": 3, "lens": LENS.model_dump(), "max_depth": 6}
    for errors, sensor in (
        (ERRORS, SENSOR),
        (simgen.CalibrationErrors.model_validate(ERRORS), simgen.Sensor.model_validate(SENSOR)),
    ):
        counts, truth = simgen.draw_photons(SCENE, GRID, errors=errors, sensor=sensor, **options)
        assert (counts.grid, counts.cfa) == (dataset.grid, "RGGB")
        for name in "klijn":
            np.testing.assert_array_equal(getattr(counts.events, name), getattr(dataset.counts.events, name))
        assert counts.readout == dataset.counts.readout == Readout(3, 1)
        assert counts.frame is not None
        assert dataset.counts.frame is not None
        np.testing.assert_array_equal(counts.frame, dataset.counts.frame)
        assert dataset.truth is not None
        np.testing.assert_array_equal(truth.z_mm, dataset.truth.z_mm)
        assert truth.photons is not None
        assert dataset.truth.photons is not None
        for name in ("k", "l", "i", "j", "object_id", "z_mm"):
            known = getattr(dataset.truth.photons, name)
            np.testing.assert_array_equal(getattr(truth.photons, name), known)
    others, _ = simgen.draw_photons(SCENE, GRID, errors=ERRORS, sensor=SENSOR | {"dark_counts": 0}, **options)
    assert others.total < counts.total
    without = {name: value for name, value in SENSOR.items() if name not in ("frames", "bits")}
    photons, _ = simgen.draw_photons(SCENE, GRID, errors=ERRORS, sensor=without, **options)
    assert (counts.dense <= photons.dense).all()  # the same photons, read out in another way
    assert counts.total < photons.total


@pytest.mark.renders
def test_views_are_those_of_the_dataset(tmp_path: Path) -> None:
    dataset = dataset_of(
        tmp_path,
        SCENE,
        seed=3,
        grid={"lens": LENS},
        products={"radiance": "rgb", "counts": False, "truth": False},
        render={"samples_per_pixel": 3, "max_depth": 6},
    )
    told: list[tuple[str, int, int]] = []
    views = simgen.render(
        SCENE,
        GRID,
        samples_per_pixel=3,
        seed=3,
        lens=LENS,
        max_depth=6,
        report=lambda *stage: told.append(stage),
    )
    assert dataset.views is not None
    for k, l in np.ndindex(GRID.rows, GRID.cols):
        np.testing.assert_array_equal(views.view(k, l), dataset.views.view(k, l))
    assert told[-1] == ("views", 6, 6)
    other = simgen.render(SCENE, GRID, samples_per_pixel=3, seed=4, lens=LENS, max_depth=6)
    assert (np.asarray(other.radiance) != np.asarray(views.radiance)).any()


@pytest.mark.renders
def test_a_picture_of_a_scene_is_shown_by_notebooks_and_written(tmp_path: Path) -> None:
    out = tmp_path / "look.png"
    picture = simgen.preview(SCENE, out, samples_per_pixel=1)
    assert repr(picture) == "Preview(title='A glass ball before a card')"
    assert picture._repr_png_() == out.read_bytes()
    by_name = simgen.preview(SCENE.save(tmp_path / "scene"), samples_per_pixel=1)
    assert by_name._repr_png_() == picture._repr_png_()
    assert simgen.preview(SCENE.remove("ball"), samples_per_pixel=1)._repr_png_() != picture._repr_png_()
    with pytest.raises(pcii.InputError, match=r"^scene_number: this is one scene"):
        simgen.preview(SCENE, scene_number=3)
    with pytest.raises(pcii.InputError, match=r"name a .png or .jpg file"):
        simgen.preview(SCENE, tmp_path / "look.gif")


def test_what_cannot_be_seen_is_told_in_a_sentence(tmp_path: Path) -> None:
    missing = SCENE.replace("card", material=simgen.Material(texture="a.png"))
    large = pcii.CameraGrid(
        rows=1000, cols=1000, pitch_mm=(5, 5), focal_mm=50, pixel_mm=0.05, height=1000, width=1000
    )
    wrong: list[tuple[dict[str, Any], str]] = [
        (
            {"scene": tmp_path},
            r"^scene: expected a simgen.Scene, such as simgen.load_scene gives, got PosixPath$",
        ),
        ({"scene": missing}, r"^scene: object 'card', material.texture: 'a.png' is looked for"),
        ({"grid": {}}, r"^grid: expected a pcii.CameraGrid, got dict$"),
        ({"lens": {"aperture_mm": 3}}, r"'grid.lens.focus_mm' is missing$"),
        ({"errors": {"pitch": 3}}, r"unknown key 'grid.errors.pitch'; did you mean 'pitch_error'\?$"),
        ({"max_depth": 0}, r"'render.max_depth': input should be greater than or equal to 1, got 0$"),
    ]
    for arguments, said in wrong:
        both: dict[str, Any] = {"scene": SCENE, "grid": GRID} | arguments
        for call in (simgen.draw_photons, simgen.render):
            with pytest.raises(pcii.InputError, match=said):
                call(**both)
    with pytest.raises(pcii.InputError, match=r"^grid: radiance of all views takes 12 TB of memory"):
        simgen.render(SCENE, large, samples_per_pixel=1)
    for sensor, said in (
        ("GRBG", r"^sensor: expected a simgen.Sensor or a dict, got str$"),
        ({"cfa": "RGGB"}, r"^cfa: it is 'BGGR', and the sensor's 'RGGB'; give one of them$"),
        ({"dark": 1}, r"^draw_photons: unknown key 'sensor.dark'"),
    ):
        with pytest.raises(pcii.InputError, match=said):
            simgen.draw_photons(SCENE, GRID, cfa="BGGR", sensor=sensor)  # type: ignore[arg-type]
