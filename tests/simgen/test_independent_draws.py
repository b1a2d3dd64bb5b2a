"""No two datasets of one seed share their noise: not of other scenes, of other draws, of other budgets."""

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lit_views import SCALAR, made
from property_settings import mostly_slow

from pcii.store import open_dataset
from simgen.base import random_streams as seeds
from simgen.dataset import capture_of, draw_from_views, generate, prepare
from simgen.photons import Plan, thin_photons
from simgen.sensor import PhotonTable
from simgen.spec import Recipe

SIDE, CAMERAS = 16, 6
VIEWS = CAMERAS**2
MOST_OF_TOTALS = 5 / np.sqrt(VIEWS)
MOST_OF_PIXELS = 5 / np.sqrt(VIEWS * SIDE**2)
"""Coefficients of independent noise are normal and one in two million exceeds 5 deviations."""
SCENE = """title = "An evenly lit wall"
lights = [{ type = "uniform", luminance_cd_m2 = 100.0 }]
backdrop = { z_mm = %s, reflectance = [0.8, 0.8, 0.8] }
"""
DRAWN = """import simgen
def wall(random):
    behind = simgen.Backdrop(z_mm=random.uniform(400, 600), reflectance=(0.8, 0.8, 0.8))
    return simgen.Scene(title="A wall", lights=[simgen.UniformLight(luminance_cd_m2=100.0)], backdrop=behind)
"""
GRID = {"rows": CAMERAS, "cols": CAMERAS, "pitch_mm": [1e-3, 1e-3]}
GRID |= {"pixel_mm": 0.3, "height": SIDE, "width": SIDE}
SENSOR = {"quantum_efficiency": [0.5, 0.5, 0.5], "dark_counts": 0.1}
RECIPE: dict[str, Any] = {"seed": 11, "grid": GRID, "sensor": SENSOR, "products": {"truth": False}}
OTHERS: list[dict[str, Any]] = [
    {"scene": "near"},
    {"scene": "far"},
    {"scene": "drawn.py:wall", "scene_number": 0},
    {"scene": "drawn.py:wall", "scene_number": 1},
    {"scene": "near", "photons": {"budget": 1.01}},
]
"""Two scenes and two draws of a third in one light, and one of them in a little more."""


def counts(folder: Path, budget: float, method: str) -> np.ndarray:
    """Counts (dataset, view, pixel) of all recipes; their own budgets are shares of `budget`."""
    for name, z_mm in {"near": "500", "far": "510"}.items():
        (folder / name).mkdir(parents=True)
        (folder / name / "scene.toml").write_text(SCENE % z_mm)
    (folder / "drawn.py").write_text(DRAWN)
    found = []
    for number, values in enumerate(OTHERS):
        own = budget * values.get("photons", {"budget": 1.0})["budget"]
        recipe = Recipe.model_validate(RECIPE | values | {"photons": {"budget": own}})
        assert generate(recipe, folder, folder / str(number))["photons"]["method"] == method
        views = open_dataset(folder / str(number)).counts
        found.append([views.view(k, l).ravel() for k, l in np.ndindex(CAMERAS, CAMERAS)])
    return np.array(found)


def alike(found: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Correlation of the totals of views, and of pixels, of each pair of datasets."""
    pairs = np.triu_indices(len(found), 1)
    totals, pixels = found.sum(axis=2), found.reshape(len(found), -1)
    return np.corrcoef(totals)[pairs], np.corrcoef(pixels)[pairs]


def first_bytes(photons: PhotonTable) -> str:
    places = np.stack([photons.k, photons.l, photons.i, photons.j, photons.n])
    return hashlib.sha256(places.astype("<i8").tobytes()).hexdigest()[:16]


@pytest.mark.renders
def test_a_seed_gives_the_same_photons_for_all_time() -> None:
    """In light that has the same radiance everywhere, 64, nothing is rounded, whatever the machine."""
    recipe = Recipe.model_validate({"scene": "-", "grid": GRID, "photons": {"budget": 100}, "seed": 1})
    lit = made([], [{"type": "uniform", "luminance_cd_m2": 64.0}])
    capture = capture_of(recipe, lit, 1 << 64 | 1)
    photons, _ = thin_photons(capture)
    assert first_bytes(photons) == ("c3dea5b3cefda539" if SCALAR else "036c2eea2ffa85b3")
    shape = capture.grid.height, capture.grid.width
    plan, noise = Plan(False, 1, 100.0), np.zeros(3)
    views, _ = draw_from_views(capture, lambda *_: np.ones(shape), lambda *_: noise, plan, lambda *_: None)
    assert first_bytes(views) == "3776c7dfc642512f"


@pytest.mark.renders
@pytest.mark.parametrize(
    ("budget", "method"), mostly_slow([(100, "thinning"), (1000, "dense")], quick=[(100, "thinning")])
)
def test_datasets_of_one_seed_have_photons_of_their_own(
    budget: float, method: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    of_totals, of_pixels = alike(counts(tmp_path / "right", budget, method))
    assert np.abs(of_totals).max() < MOST_OF_TOTALS
    assert np.abs(of_pixels).max() < MOST_OF_PIXELS
    monkeypatch.setattr(seeds, "seed_of_draw", lambda seed, drawn: seed)  # the fault: the seed alone decides
    of_totals, of_pixels = alike(counts(tmp_path / "wrong", budget, method))
    assert of_totals.min() > MOST_OF_TOTALS
    assert of_pixels.min() > MOST_OF_PIXELS


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
