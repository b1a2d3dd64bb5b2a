"""What is decided before any work: identity, noise, depths to look at, and whether it fits this machine."""

import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import tomli_w
import zarr
from command_runs import run_simgen
from tiny import TINY_RECIPE

from pcii.base import InputError
from pcii.store import TRUTH, provenance
from simgen.dataset import Prepared, check_resources, generate, peak_bytes, prepare, shortage
from simgen.photons import Plan
from simgen.spec import Analysis, Recipe

Table = dict[str, Any]
CARD = {"type": "card", "width_mm": 20.0, "height_mm": 30.0}
MESH = {"type": "mesh", "file": "a.ply"}
SCENE: Table = {
    "title": "one of each kind of file",
    "objects": [
        {"name": "picture", "position_mm": [0, 0, 500], "shape": CARD, "material": {"texture": "a.png"}},
        {"name": "mesh", "position_mm": [0, 0, 600], "shape": MESH, "material": {"reflectance": "dark skin"}},
    ],
    "lights": [{"type": "environment", "file": "a.exr", "luminance_cd_m2": 100.0}],
    "planes_mm": [540.0, 620.0],
}
PLAIN = {"title": "even light", "lights": [{"type": "uniform", "luminance_cd_m2": 100.0}]}
RECIPE: Table = {
    "scene": "here",
    "grid": {"rows": 2, "cols": 3, "height": 4, "width": 5, "errors": {}},
    "sensor": {"camera": "a.csv", "bits": 8, "hot_pixels": "a.npy"},
    "photons": {"budget": 500.0, "nested": [100.0, 200.0]},
    "analysis": {"z_mm": [500.0], "z_range_mm": [400.0, 700.0]},
}
OTHER_WORK: list[tuple[str, Any, bool]] = [
    ("title", "other words", False),
    ("photons.nested", [100.0], False),
    ("analysis.z_mm", [501.0], False),
    ("products.view_truth", ["z_mm"], False),
    ("seed", 1, True),
    ("photons.budget", 501.0, True),
    ("grid.rows", 3, True),
    ("grid.errors.pitch_error", 0.001, True),
    ("sensor.bits", 9, False),
    ("sensor.dark_counts", 1e-3, True),
    ("render.max_depth", 4, True),
]
"""Changes of a recipe, and whether its photons have noise of their own."""


@pytest.fixture
def near(tmp_path: Path) -> Path:
    """Folder of a recipe and of its scene with files."""
    (tmp_path / "here").mkdir()
    for name in ("a.png", "a.ply", "a.exr"):
        (tmp_path / "here" / name).write_bytes(b"any byte")
    np.save(tmp_path / "a.npy", np.ones((4, 5)))
    (tmp_path / "a.csv").write_text("wavelength_nm,R,G,B\n400,0,0,1\n550,0,1,0\n700,1,0,0\n")
    return tmp_path


def prepared(near: Path, recipe: Table, scene: Table | None = None) -> Prepared:
    if scene is not None:
        (near / "here" / "scene.toml").write_text(tomli_w.dumps(scene))
    return prepare(Recipe.model_validate(recipe), near)


def identity(near: Path, recipe: Table, scene: Table | None = None) -> str:
    return prepared(near, recipe, scene).identity


def changed(values: Table, field: str, value: Any) -> Table:
    """The values with another one at a dotted field."""
    first, _, rest = field.partition(".")
    return values | {first: changed(values.get(first, {}), rest, value) if rest else value}


@pytest.mark.parametrize(("field", "value", "is_another_draw"), OTHER_WORK)
def test_every_table_of_a_recipe_is_part_of_the_identity_and_some_of_the_noise(
    near: Path, field: str, value: Any, is_another_draw: bool
) -> None:
    recipe = changed(RECIPE, "sensor.hot_pixels", None)  # which would have the size of other films
    before, after = prepared(near, recipe, SCENE), prepared(near, changed(recipe, field, value))
    assert after.identity != before.identity
    assert (after.seed != before.seed) == is_another_draw


def test_a_scenes_values_are_part_of_the_identity_and_terms_of_use_are_not(near: Path) -> None:
    before = prepared(near, RECIPE, SCENE)
    assert identity(near, changed(RECIPE, "publication.licence", "CC0-1.0")) == before.identity
    lamp = SCENE["lights"][0] | {"luminance_cd_m2": 100.1}
    unscored = [thing | {"scored": False} for thing in SCENE["objects"]]
    changes = {"title": "other words", "objects": unscored, "planes_mm": [500.0], "lights": [lamp]}
    for field, value in changes.items():
        after = prepared(near, RECIPE, SCENE | {field: value})
        assert after.identity != before.identity
        assert (after.seed != before.seed) == (field == "lights")  # photons of the others are the same


def test_every_byte_of_a_scenes_files_is_part_of_the_identity(near: Path) -> None:
    before = identity(near, RECIPE, SCENE)
    for name in ("a.png", "a.ply", "a.exr"):
        file = near / "here" / name
        whole = file.read_bytes()
        for place in range(len(whole)):
            file.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
            assert identity(near, RECIPE) != before
        file.write_bytes(whole)
    (near / "here" / "unnamed.png").write_bytes(b"that the scene does not name")
    assert identity(near, RECIPE) == before
    np.save(near / "a.npy", np.ones((4, 5), np.float32))
    assert identity(near, RECIPE) == before
    np.save(near / "a.npy", np.eye(4, 5))
    other = identity(near, RECIPE)
    (near / "a.csv").write_text((near / "a.csv").read_text().replace("550,0,1,0", "550,0,1,0.01"))
    assert len({before, other, identity(near, RECIPE)}) == 3


@pytest.mark.parametrize("package", ["photon-integral-imaging", "mitsuba"])
def test_versions_are_part_of_the_identity(near: Path, monkeypatch: pytest.MonkeyPatch, package: str) -> None:
    before, original = identity(near, RECIPE, SCENE), provenance.version
    monkeypatch.setattr(provenance, "version", lambda name: "0.0.1" if name == package else original(name))
    assert identity(near, RECIPE) != before


def test_defaults_and_whole_numbers_may_be_written_out(near: Path) -> None:
    short = {"scene": "here", "photons": {"budget": 300}}
    long = {"scene": "here", "title": "", "seed": 0, "photons": {"budget": 3.0e2, "statistics": "poisson"}}
    before = identity(near, short, PLAIN | {"backdrop": {"z_mm": 900}})
    assert identity(near, long) == before
    backdrop = {"half_width_mm": 5e3, "z_mm": 900.0}
    assert identity(near, long, PLAIN | {"objects": [], "backdrop": backdrop}) == before


@pytest.mark.parametrize(
    ("planes_mm", "of_recipe", "expected"),
    [
        ([], {}, {}),
        ([620, 540], {}, {"z_mm": [620, 540], "z_range_mm": [480, 680]}),
        ([80], {}, {"z_mm": [80], "z_range_mm": [40, 140]}),
        ([540], {"z_range_mm": [500, 501]}, {"z_mm": [540], "z_range_mm": [500, 501]}),
        ([540], {"z_mm": [550]}, {"z_mm": [550]}),
    ],
)
def test_the_scenes_planes_are_looked_at_where_the_recipe_names_none(
    planes_mm: list[float], of_recipe: Table, expected: Table, near: Path
) -> None:
    found = prepared(near, {"scene": "here", "analysis": of_recipe}, PLAIN | {"planes_mm": planes_mm})
    assert found.recipe.analysis == Analysis.model_validate(expected)


@pytest.mark.renders
def test_a_dataset_of_a_drawn_scene_has_its_planes(tmp_path: Path) -> None:
    recipe = TINY_RECIPE | {"scene": "drawn_room", "scene_number": 17, "photons": {"budget": 50}}
    manifest = generate(Recipe.model_validate(recipe), Path(), tmp_path / "data")
    planes = [480.0, 585.0, 680.0, 760.0]
    assert manifest["analysis"] == {"z_mm": planes, "z_range_mm": [420.0, 820.0]}
    assert manifest["recipe"]["analysis"] == manifest["analysis"]
    assert manifest["title"] == "Drawn: room 17"
    truth = zarr.open_group(tmp_path / "data" / TRUTH, mode="r")
    assert truth["in_focus"].shape[0] == len(planes)  # type: ignore[union-attr]


ROOM = 8e9
DEPTHS_MM = (500.0, 600.0, 3000.0)
THINS = Plan(thins=True, samples=1, photons_per_view=1e3, depths_mm=DEPTHS_MM)


def recipe(**values: Any) -> Recipe:
    return Recipe.model_validate({"scene": "two_objects", **values})


TOO_MUCH: list[tuple[Table, str]] = [
    ({"sensor": {"dark_counts": 1e6}}, "sensor.dark_counts"),
    ({"sensor": {"hot_pixel_share": 0.01, "hot_pixel_counts": 1e9}}, "sensor.hot_pixel_share"),
    ({"grid": {"rows": 10**8}}, "grid.rows"),
    ({"grid": {"height": 10**6}, "render": {"samples_per_pixel": 1}}, "grid.height"),
    ({"grid": {"shear_px": [0.0, -1e9]}}, "grid.pixel_mm"),
    ({"analysis": {"z_mm": [500.0 + n for n in range(5000)]}}, "analysis.z_mm"),
    ({"photons": {"budget": 1e6}}, "photons.budget"),
]


@pytest.mark.parametrize(("values", "field"), TOO_MUCH)
def test_what_does_not_fit_is_named_by_its_field(values: dict[str, Any], field: str) -> None:
    plan = None if field == "grid.rows" else THINS  # whose photons grow with the views
    if field == "photons.budget":
        plan = replace(THINS, photons_per_view=1e6)
    sentence: Any = shortage(recipe(**values), plan, ROOM)
    assert sentence.startswith(field)
    assert (shortage(recipe(), THINS, ROOM, map_counts=1e8) or "").startswith("sensor.hot_pixels")
    assert "this machine has 8 GB available" in sentence


def test_ordinary_recipes_fit() -> None:
    assert shortage(recipe(), THINS, ROOM) is None
    assert shortage(recipe(sensor={"hot_pixel_share": 0.01, "dark_counts": 1e-3}), THINS, ROOM) is None
    # In rendered views there are no more photons than pixels: 100 x 1024 x 1024 of 200 B.
    bright = replace(THINS, thins=False, photons_per_view=1e15)
    assert peak_bytes(recipe(), bright) == 4e8 + 200 * 100 * 1024**2


def test_a_disk_that_is_too_small_is_named_unless_views_are_there(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    wanted = recipe(products={"radiance": "rgb"})  # 100 views of 12.6 MB, of which half is written at least
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=6e8))
    with pytest.raises(InputError, match=r"products\.radiance: rendered views .* 630 MB .* has 600 MB left"):
        check_resources(wanted, None, tmp_path / "new" / "out")
    check_resources(recipe(), None, tmp_path / "out")
    (tmp_path / "radiance").mkdir()
    with (tmp_path / "radiance" / "view_00_00.exr").open("wb") as file:
        file.truncate(1 << 26)
    check_resources(wanted, None, tmp_path)


@pytest.mark.renders
def test_commands_refuse_before_any_work(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    setting, out = "sensor.dark_counts=1e6", tmp_path / "out"
    assert run_simgen("check", "paper", "--set", setting) == 1
    sentence = "sensor.dark_counts: takes some 21000 TB of memory, and this machine has"
    assert f"bad   memory      {sentence}" in capsys.readouterr().out
    assert run_simgen("generate", "paper", "--set", setting, "-o", out) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"error: {sentence}")
    assert error.count("\n") == 1
    assert not out.exists()
