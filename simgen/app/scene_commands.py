"""Commands about scenes and recipes: list, write, check, look at."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from pcii.base import answer_json, say, say_next

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
    from simgen.app.starting_points import list_recipes, list_scenes
    from simgen.base import check_installed

    check_installed()  # or else some scenes would be listed as not valid
    for line in (*list_scenes(), "", "Recipes, of which `simgen generate` makes datasets:", *list_recipes()):
        say(line)
    say_next("simgen", "preview", "two_objects", "-o", "two_objects.png")


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
    from simgen.base import schema_of
    from simgen.spec import Recipe, Scene

    answer_json(schema_of(Scene if what == "scene" else Recipe))


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
    from simgen.app.library import preview
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
    from simgen.app.starting_points import write_new_scene

    say(f"{write_new_scene(name, from_)}")
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
    from simgen.app.starting_points import write_new_recipe

    path = write_new_recipe(name, scene)
    say(f"{path}")
    say_next("simgen", "check", path)


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
