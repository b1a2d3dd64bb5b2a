"""Commands about scenes and recipes: list, write, check, look at."""

import os
import re
import shutil
from collections.abc import Callable
from dataclasses import asdict
from json import dumps
from pathlib import Path
from string import Template
from typing import Annotated, Literal

from cyclopts import Parameter

from pcii.base import InputError, answer_json, new_folder_safely, say, say_next, write_bytes_safely

TEMPLATES = Path(__file__).resolve().parent / "templates"
Json = Annotated[bool, Parameter(name="--json", help="Print the result as JSON.")]
Out = Annotated[Path, Parameter(name=("--out", "-o"))]
Overrides = Annotated[
    tuple[str, ...],
    Parameter(
        name="--set", help="Override one value of the recipe, such as photons.budget=300; may be repeated."
    ),
]
TrustPython = Annotated[
    bool,
    Parameter(help="Run the Python function that a recipe file names as its scene, if you trust its author."),
]


def scenes() -> None:
    """List scenes, then recipes: what ships or stands in the working directory's `scenes/`, `data_recipes/`.

    Of drawn scenes a number says which one is meant: `--scene 17`.

    Example of use:

        simgen scenes
    """
    from simgen.base import check_installed
    from simgen.spec import drawn_scenes, load_scene, load_sweep, recipe_names, scene_names

    def title_of_recipe(name: str) -> str:
        recipe = load_sweep(f"{name}.toml").recipe(0)
        return recipe.title or recipe.scene

    check_installed()  # or else some scenes would be listed as not valid
    for name in scene_names():
        _say_title(name, lambda name: load_scene(name).title)
    for name, package in drawn_scenes().items():
        say(f"{name:20} Made by {package} (drawn by number)")
    say("\nRecipes, of which `simgen generate` makes datasets:")
    for name in recipe_names():
        _say_title(name, title_of_recipe)
    say_next("simgen", "preview", "two_objects", "-o", "two_objects.png")


def _say_title(name: str, title_of: Callable[[str], str]) -> None:
    """A name and its title, or what is wrong with its file."""
    from simgen.base import shorten

    try:
        say(f"{name:20} {title_of(name)}")
    except InputError as fault:
        say(f"{name:20} not valid: {shorten(str(fault), 100)}")


def schema(what: Literal["scene", "recipe"]) -> None:
    """Print the JSON Schema of scene or recipe files, for completion in editors.

    Examples of use:

        simgen schema scene > scene.schema.json
        simgen schema recipe > recipe.schema.json

    Parameters
    ----------
    what
        Which kind of file.
    """
    from simgen.spec import Recipe, Scene

    values = (Scene if what == "scene" else Recipe).model_json_schema()
    for table in values["$defs"].values():  # by its `type` an editor tells which of several tables is meant
        if "const" in table["properties"].get("type", {}):
            table["required"] = ["type", *table.get("required", [])]
    answer_json({"$schema": "https://json-schema.org/draft/2020-12/schema"} | values)


def check(
    target: str,
    *,
    set: Overrides = (),
    scene: int | None = None,
    trust_python: TrustPython = False,
    json: Json = False,
) -> int:
    """Validate and lint a scene or recipe without rendering: one line a finding, in seconds.

    Disparities, blur between objects, what is hidden or cut, colours that shifts leave out, photons per
    object and voxel, size, memory and time. Leaves with exit code 0 if nothing is bad, 1 if something
    is, 2 for a file that is not valid. Of a field with several values the first is looked at.

    Examples of use:

        simgen check two_objects
        simgen check paper --set grid.pitch_mm=[2.5,2.5]
        simgen check drawn_room --scene 17

    Parameters
    ----------
    target
        A recipe, or a scene, which is looked at with the paper's camera grid; by name or path.
    scene
        Which scene of those that a Python function draws; the first unless you say.
    """
    from simgen.check import lint

    line, findings = lint(target, set, scene, trust_python=trust_python)
    bad, warnings = (sum(one.verdict == verdict for one in findings) for verdict in ("bad", "warn"))
    if json:
        answer_json([asdict(finding) for finding in findings])
    else:
        say(line)
        for finding in findings:
            say(finding.line())
        say(f"{bad} bad, {warnings} to be warned of, {len(findings)} findings in all")
        if not bad:
            number = [] if scene is None else ["--scene", scene]
            values = [f"--set={text}" for text in set]
            say_next("simgen", "preview", target, *number, *values, "-o", f"{Path(target).stem}.png")
    return 1 if bad else 0


def preview(
    target: str,
    *,
    out: Out,
    set: Overrides = (),
    scene: int | None = None,
    trust_python: TrustPython = False,
    samples_per_pixel: int = 32,
) -> None:
    """Draw a scene or recipe from the virtual centre, with its depth and its objects, in one picture.

    In full light and in sRGB, whatever the recipe's camera and photons. Of a field with several values the
    first is drawn.

    Examples of use:

        simgen preview two_objects -o two_objects.png
        simgen preview drawn_room --scene 17 -o drawn_room.png

    Parameters
    ----------
    target
        A recipe, or a scene, which is looked at with the paper's field of view; by name or path.
    out
        The picture to write, .png or .jpg, in a folder that exists.
    scene
        Which scene of those that a Python function draws.
    samples_per_pixel
        Light paths per pixel; more is slower and less noisy.
    """
    from simgen.app.pictures import preview
    from simgen.spec import is_scene

    preview(target, out, samples_per_pixel, scene, overrides=set, trust_python=trust_python)
    say(f"{out}")
    if is_scene(target):
        say_next("simgen", "new-recipe", "mine", "--scene", target)
    else:
        values = [f"--set={text}" for text in set]
        say_next("simgen", "generate", target, *values, "-o", f"out/{Path(target).stem}")


def new_scene(name: str, *, from_: Annotated[str | None, Parameter(name="--from")] = None) -> None:
    """Write scenes/NAME/scene.toml: a commented scene that works as it is written.

    Examples of use:

        simgen new-scene mine
        simgen new-scene my-desk --from desk

    Parameters
    ----------
    name
        What the scene is called: a letter, then letters, digits, _ and -.
    from_
        Copy this scene, one of `simgen scenes` or the path of a folder, with its files.
    """
    from simgen.spec import drawn_scenes, load_scene, scene_names

    _check_name(name)
    folder = Path("scenes") / name
    if folder.exists() or name in {*scene_names(), *drawn_scenes()}:
        raise InputError(f"NAME: {name!r} is the name of a scene already; choose another")
    files = None if from_ is None else load_scene(from_).folder
    folder.parent.mkdir(exist_ok=True)
    with new_folder_safely(folder) as new:
        if files is None:
            (new / "scene.toml").write_bytes(_filled("scene.toml", NAME=name))
        else:
            shutil.copytree(files, new, dirs_exist_ok=True, ignore=shutil.ignore_patterns("__pycache__"))
    say(f"{folder / 'scene.toml'}")
    say_next("simgen", "check", name)


def new_recipe(name: str, *, scene: str | None = None) -> None:
    """Write data_recipes/NAME.toml: a commented recipe that works as it is written, in seconds.

    Examples of use:

        simgen new-recipe mine
        simgen new-recipe my-desk-dim --scene my-desk

    Parameters
    ----------
    name
        What the recipe is called: a letter, then letters, digits, _ and -.
    scene
        Name or path of its scene. Default: the scene of the same name, or else two_objects.
    """
    from simgen.spec import is_drawn, is_scene, load_scene, recipe_file

    _check_name(name)
    if recipe_file(name) is not None:
        raise InputError(f"NAME: {name!r} is the name of a recipe already; choose another")
    path = Path("data_recipes") / f"{name}.toml"
    scene = scene or (name if is_scene(name) else "two_objects")
    number = 0 if is_drawn(scene) else None
    load_scene(scene, number=number)
    text = dumps(scene if Path(scene).name == scene else os.path.relpath(scene, path.parent))
    if number is not None:
        text += f"\nscene_number = {number}               # which scene of those that it draws"
    path.parent.mkdir(exist_ok=True)
    write_bytes_safely(path, _filled("recipe.toml", SCENE=text, NAME=name, FILE=str(path)))
    say(f"{path}")
    say_next("simgen", "check", path)


def _filled(template: str, **words: str) -> bytes:
    """A template with words in the place of its $NAMES."""
    return Template((TEMPLATES / template).read_text(encoding="utf-8")).substitute(words).encode()


def _check_name(name: str) -> None:
    from simgen.spec import NAME

    if not re.fullmatch(NAME, name):
        raise InputError(
            f"NAME: expected a letter, then letters, digits, _ and -, such as my-scene, not {name!r}"
        )


def import_scene(
    file: Path,
    *,
    out: Out,
    camera: str | None = None,
    unit: Literal["mm", "cm", "m", "in", "ft"] | None = None,
    up: Literal["y", "z"] = "y",
    place_at_mm: tuple[float, float, float] | None = None,
    fit_mm: float | None = None,
    emission_unit: Literal["nit", "watt"] = "nit",
    unscored: tuple[str, ...] = (),
) -> None:
    """Make a scene of a glTF file (.glb, .gltf), a mesh (.obj, .ply, .stl) or a Mitsuba scene (.xml).

    Objects keep their names. The scene stands before a camera of the file, or where you say. What cannot
    be represented is listed.

    Examples of use:

        simgen import-scene room.glb -o scenes/room
        simgen import-scene duck.glb -o scenes/duck --place-at-mm 0 0 600 --fit-mm 150
        simgen import-scene blender.glb -o scenes/blender --emission-unit watt
        simgen import-scene bracket.stl -o scenes/bracket --unit mm --up z --place-at-mm 0 0 600

    Parameters
    ----------
    file
        The file; others that it names must lie in its folder or below.
    out
        Folder for scene.toml, meshes and pictures; it must not be there yet.
    camera
        The camera of the file that becomes the virtual centre, if it has several.
    unit
        The file's unit of length. Default: metres; meshes have none.
    up
        Which axis of a mesh is up; away is then -Z, or with z up Y.
    place_at_mm
        X, Y and Z of the middle of the scene, upright, instead of a camera.
    fit_mm
        Length of the longest side of the scene's bounding box, whatever the unit.
    emission_unit
        What emission of 1 means in a glTF file: 1 cd/m² (nit), or 1 W/(sr m²), which is 683 cd/m² (watt).
        Choose watt for files that Blender exported in its lighting mode Standard.
    unscored
        Name of an object that counts in no score, such as a table or a floor; may be repeated.
    """
    from simgen.importing import import_scene

    place = {"camera": camera, "unit": unit, "up": up, "place_at_mm": place_at_mm, "fit_mm": fit_mm}
    for line in import_scene(file, out, **place, emission_unit=emission_unit, unscored=unscored).lines():
        say(line)
    say_next("simgen", "preview", out, "-o", f"{out.name}.png")


SCENE_COMMANDS = scenes, schema, check, preview, new_scene, new_recipe, import_scene
