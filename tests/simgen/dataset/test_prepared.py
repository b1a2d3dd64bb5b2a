"""Depths to look at: of a recipe, else of its scene."""

from pathlib import Path
from typing import Any

import pytest
import zarr
from tiny import TINY_RECIPE

from pcii.store import TRUTH
from simgen.dataset import generate, prepare
from simgen.spec import Analysis, Recipe

LIGHT = '[[lights]]\ntype = "uniform"\nluminance_cd_m2 = 100.0\n'


@pytest.mark.parametrize(
    ("planes_mm", "own", "expected"),
    [
        ("[]", {}, {}),
        ("[620, 540]", {}, {"z_mm": [620, 540], "z_range_mm": [480, 680]}),
        ("[80]", {}, {"z_mm": [80], "z_range_mm": [40, 140]}),
        ("[540]", {"z_range_mm": [500, 501]}, {"z_mm": [540], "z_range_mm": [500, 501]}),
        ("[540]", {"z_mm": [550]}, {"z_mm": [550]}),
    ],
)
def test_the_scenes_planes_are_looked_at_where_the_recipe_names_none(
    planes_mm: str, own: dict[str, Any], expected: dict[str, Any], tmp_path: Path
) -> None:
    (tmp_path / "scene.toml").write_text(f'title = "a"\nplanes_mm = {planes_mm}\n{LIGHT}')
    recipe = Recipe.model_validate({"scene": str(tmp_path), "analysis": own})
    assert prepare(recipe, None).recipe.analysis == Analysis.model_validate(expected)


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
