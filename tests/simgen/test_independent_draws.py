"""Datasets of one seed have noise of their own: of other scenes, budgets, cameras and sensors."""

from pathlib import Path
from typing import Any

from simgen.dataset import prepare
from simgen.spec import Recipe

SCENE = """title = "An evenly lit wall"
lights = [{ type = "uniform", luminance_cd_m2 = 100.0 }]
backdrop = { z_mm = %s, reflectance = [0.8, 0.8, 0.8] }
"""


def test_what_makes_another_draw_of_photons_and_what_does_not(tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text(SCENE % "500")

    def seed_of(**changes: Any) -> int:
        recipe = {"scene": str(tmp_path), "seed": 11, "photons": {"budget": 100}} | changes
        return prepare(Recipe.model_validate(recipe), None).seed

    before = seed_of()
    assert seed_of(products={"radiance": "rgb"}, title="other words", analysis={"z_mm": [500]}) == before
    assert seed_of(photons={"budget": 100, "nested": [10, 50]}) == before
    others = [
        seed_of(seed=12),
        seed_of(photons={"budget": 101}),
        seed_of(grid={"rows": 9}),
        seed_of(sensor={"dark_counts": 1e-3}),
        seed_of(render={"max_depth": 4}),
    ]
    (tmp_path / "scene.toml").write_text("planes_mm = [500]\n" + (SCENE % "500").replace("wall", "plane"))
    assert seed_of() == before
    (tmp_path / "scene.toml").write_text(SCENE % "501")
    assert len({before, *others, seed_of()}) == 7
