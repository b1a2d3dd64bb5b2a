"""What identifies a dataset: all that may change its bytes, and nothing else."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w

from pcii.store import provenance
from simgen.dataset import prepare
from simgen.spec import Recipe

Table = dict[str, Any]

CARD = {"type": "card", "width_mm": 20.0, "height_mm": 30.0}
SCENE: Table = {
    "title": "one of each kind of file",
    "objects": [
        {"name": "picture", "position_mm": [0, 0, 500], "shape": CARD, "material": {"texture": "a.png"}},
        {"name": "mesh", "position_mm": [0, 0, 600], "shape": {"type": "mesh", "file": "a.ply"}},
    ],
    "lights": [{"type": "environment", "file": "a.exr", "luminance_cd_m2": 100.0}],
    "planes_mm": [540.0, 620.0],
}
SCENE["objects"][1]["material"] = {"reflectance": "dark skin"}
PLAIN = {"title": "even light", "lights": [{"type": "uniform", "luminance_cd_m2": 100.0}]}
RECIPE: Table = {
    "scene": "here",
    "grid": {"rows": 2, "cols": 3, "height": 4, "width": 5, "errors": {}},
    "sensor": {"camera": "a.csv", "bits": 8, "hot_pixels": "a.npy"},
    "photons": {"budget": 500.0, "nested": [100.0, 200.0]},
    "analysis": {"z_mm": [500.0], "z_range_mm": [400.0, 700.0]},
}
CHANGES: list[tuple[str, Any]] = [
    ("title", "other words"),
    ("seed", 1),
    ("grid.errors.pitch_error", 0.001),
    ("sensor.bits", 9),
    ("photons.nested", [100.0]),
    ("analysis.z_mm", [501.0]),
    ("products.view_truth", ["z_mm"]),
    ("render.samples_per_pixel", 17),
]


@pytest.fixture
def near(tmp_path: Path) -> Path:
    """Folder of a recipe and of its scene with files."""
    (tmp_path / "here").mkdir()
    for name in ("a.png", "a.ply", "a.exr"):
        (tmp_path / "here" / name).write_bytes(b"nobody decodes this, and every byte counts")
    np.save(tmp_path / "a.npy", np.ones((4, 5)))
    (tmp_path / "a.csv").write_text("wavelength_nm,R,G,B\n400,0,0,1\n550,0,1,0\n700,1,0,0\n")
    return tmp_path


def identity(near: Path, recipe: Table, scene: Table | None = None) -> str:
    if scene is not None:
        (near / "here" / "scene.toml").write_text(tomli_w.dumps(scene))
    return prepare(Recipe.model_validate(recipe), near).identity


def changed(values: Table, field: str, value: Any) -> Table:
    """The values with another one at a dotted field."""
    first, _, rest = field.partition(".")
    return values | {first: changed(values.get(first, {}), rest, value) if rest else value}


@pytest.mark.parametrize(("field", "value"), CHANGES)
def test_every_table_of_a_recipe_is_part_of_the_identity(near: Path, field: str, value: Any) -> None:
    before = identity(near, RECIPE, SCENE)
    assert identity(near, changed(RECIPE, field, value)) != before


def test_a_scenes_values_are_part_of_the_identity_and_terms_of_use_are_not(near: Path) -> None:
    before = identity(near, RECIPE, SCENE)
    assert identity(near, changed(RECIPE, "publication.licence", "CC0-1.0")) == before
    assert identity(near, RECIPE, SCENE | {"title": "other words"}) != before
    unscored = SCENE | {"objects": [thing | {"scored": False} for thing in SCENE["objects"]]}
    seeds = {prepare(Recipe.model_validate(RECIPE), near).seed}
    assert identity(near, RECIPE, unscored) != before
    assert seeds == {prepare(Recipe.model_validate(RECIPE), near).seed}  # of the same photons
    lamp = SCENE["lights"][0] | {"luminance_cd_m2": 100.1}
    assert identity(near, RECIPE, SCENE | {"lights": [lamp]}) != before


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
    assert (
        identity(near, long, PLAIN | {"objects": [], "backdrop": {"half_width_mm": 5e3, "z_mm": 900.0}})
        == before
    )
