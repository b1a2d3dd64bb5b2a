"""Every scene and recipe that ships: it loads, shows what it names, and is in the gallery."""

import importlib.util
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any, get_args

import numpy as np
import OpenEXR
import pytest
from PIL import Image

from simgen.cameras import coarser
from simgen.check import load_target
from simgen.renderer import backend, build
from simgen.spec import Grid, Light, Material, Scene, Shape, Spectrum, Texture, load_recipe, load_scene
from simgen.truth import FirstHits, first_hits_at_centre, first_hits_of_view

ROOT = Path(__file__).resolve().parents[2]
SCENES = sorted(file.parent.name for file in (ROOT / "scenes").glob("*/scene.toml"))
RECIPES = sorted(file.stem for file in (ROOT / "data_recipes").glob("*.toml"))
# The bird takes its time.
SCRIPTS = sorted({*ROOT.glob("scenes/*/build_*.py")} - {*ROOT.glob("scenes/two_objects/*")})
GRID = coarser(Grid().camera_grid(), 128)
BEYOND_THE_FILM = {
    "chess": {"board", "rug", "curtain"},
    "cornell_box": {"floor", "ceiling", "left-wall", "right-wall"},
    "desk": {"desk", "wall"},
    "outdoors": {"ground"},
    "room": {"table", "wall"},
    "set_table": {"table", "wall"},
    "shelf": {"board", "wall"},
}
HIDDEN = {"chess": {"lamp"}, "set_table": {"lamp"}}
"""A lamp may hang out of view."""
MOST_PICTURE_BYTES, MOST_ASSET_BYTES = 60_000, 130_000


@cache
def scene_of(name: str) -> Scene:
    return load_scene(str(ROOT / "scenes" / name))


@cache
def seen(name: str) -> tuple[FirstHits, list[FirstHits], dict[int, str]]:
    """First hits at the virtual centre and at two opposite corners, and the objects' names."""
    built = build(backend.load(), scene_of(name), ROOT / "scenes" / name, 3)
    corners = [first_hits_of_view(built, GRID, k, k) for k in (0, GRID.rows - 1)]
    return first_hits_at_centre(built, GRID), corners, dict(built.names)


@pytest.fixture(autouse=True, scope="module")
def scenes_are_given_up() -> Iterator[None]:
    """The renderer compiles its kernels anew where other scenes are in memory than in the last run."""
    yield
    seen.cache_clear()


def script(file: Path) -> ModuleType:
    spec: Any = importlib.util.spec_from_file_location(f"{file.parent.name}_{file.stem}", file)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.renders
@pytest.mark.parametrize("name", SCENES)
def test_the_virtual_centre_sees_every_object_and_no_film_cuts_it(name: str) -> None:
    centre, corners, names = seen(name)
    for number, thing in names.items():
        assert (centre.object_id == number).any() == (thing not in HIDDEN.get(name, ())), thing
        if thing in BEYOND_THE_FILM.get(name, set()) | HIDDEN.get(name, set()):
            continue
        for hits in (centre, *corners):
            mask = hits.object_id == number
            border = np.concatenate([mask[[0, -1]].ravel(), mask[:, [0, -1]].ravel()])
            assert mask.any(), thing
            assert not border.any(), thing


def kinds(union: Any) -> set[str]:
    members = get_args(get_args(union)[0]) or get_args(union)  # with and without Annotated
    return {member.model_fields["type"].default for member in members}


def test_the_scenes_show_all_that_scenes_can_hold() -> None:
    scenes = [scene_of(name) for name in SCENES]
    things = [thing for scene in scenes for thing in scene.objects]
    textures = [thing.material.texture for thing in things]
    assert {thing.shape.type for thing in things} == kinds(Shape)
    finishes = Material.model_fields["finish"].annotation
    assert {thing.material.finish.type for thing in things} == kinds(finishes)
    assert {getattr(texture, "type", None) for texture in textures} - {None} == kinds(Texture)
    assert {light.type for scene in scenes for light in scene.lights} == kinds(Light)
    assert {type(thing.material.reflectance) for thing in things} >= {tuple, str, Spectrum}
    assert all(scene.title and len(scene.description) > 80 for scene in scenes)


@pytest.mark.renders
@pytest.mark.parametrize("name", RECIPES)
def test_a_recipe_looks_where_its_objects_are(name: str) -> None:
    recipe, near = load_recipe(str(ROOT / "data_recipes" / f"{name}.toml"))
    assert load_scene(recipe.scene, near).planes_mm == recipe.analysis.z_mm
    centre, _, _ = seen(recipe.scene)
    limits: Any = recipe.analysis.z_range_mm
    if not scene_of(recipe.scene).objects:
        assert limits[0] < centre.z_mm.min() < centre.z_mm.max() < limits[1]  # the wall is looked for in vain
        return
    objects = centre.z_mm[centre.object_id > 0]
    assert limits[0] <= objects.min() <= objects.max() <= limits[1]


@pytest.mark.renders
@pytest.mark.parametrize("name", SCENES)
def test_a_scene_names_planes_where_its_objects_are(name: str) -> None:
    centre, planes_mm = seen(name)[0], scene_of(name).planes_mm
    assert planes_mm
    for z_mm in planes_mm if scene_of(name).objects else ():
        assert np.abs(centre.z_mm[centre.object_id > 0] - z_mm).min() < 5  # the paper's are of whole objects


@pytest.mark.renders
def test_the_papers_objects_are_on_average_at_its_depths() -> None:
    built = build(backend.load(), scene_of("two_objects"), ROOT / "scenes" / "two_objects", 3)
    hits = first_hits_at_centre(built, coarser(Grid().camera_grid(), 512))
    mean = {name: hits.z_mm[hits.object_id == number].mean() for number, name in built.names.items()}
    # 4000 pixels each, whose depths have a standard deviation of 7 mm; 0.5 mm are 0.1 px of total disparity.
    assert mean == pytest.approx({"ball": 540, "bird": 620}, abs=0.5)


@pytest.mark.parametrize("name", SCENES)
def test_light_passes_glass_where_there_is_some(name: str) -> None:
    target = load_target(str(ROOT / "scenes" / name))
    assert target.recipe.render.max_depth == (8 if name in ("glass", "finishes") else 3)


@pytest.mark.parametrize("file", SCRIPTS, ids=lambda file: file.parent.name)
def test_scripts_make_the_files_beside_them(file: Path, tmp_path: Path) -> None:
    script(file).main(tmp_path)
    made = sorted(tmp_path.iterdir())
    assert made
    for new in made:
        old = file.parent / new.name
        assert old.stat().st_size < MOST_ASSET_BYTES
        if new.suffix == ".png":  # the same pixels: compressors differ
            with Image.open(new) as one, Image.open(old) as other:
                pixels = [np.asarray(image.convert("RGB")) for image in (one, other)]
                np.testing.assert_array_equal(pixels[0], pixels[1])
        elif new.suffix == ".exr":
            with OpenEXR.File(str(new)) as one, OpenEXR.File(str(old)) as other:
                pixels = (part.channels()["RGB"].pixels for part in (one, other))
                np.testing.assert_allclose(*pixels, rtol=1e-3)  # float16 has 11 bits
        else:
            assert new.read_bytes() == old.read_bytes()


def test_every_asset_is_made_by_a_script_and_the_gallery_is_that_of_these_scenes() -> None:
    page = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")
    assert page == script(ROOT / "docs" / "make_gallery.py").page(), "run make gallery"
    for name in SCENES:
        files = {file.name for file in (ROOT / "scenes" / name).iterdir() if file.is_file()}
        assert files == {"scene.toml"} or any(file.startswith("build_") for file in files), name
        assert f"gallery/{name}.jpg" in page
        assert 5000 < (ROOT / "docs" / "gallery" / f"{name}.jpg").stat().st_size < MOST_PICTURE_BYTES
    assert len(list((ROOT / "docs" / "gallery").iterdir())) == len(SCENES)
