"""Commands about scenes and recipes: list, describe, check, look at."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from pcii.base.command_output import answer, answer_json, say, say_next

Json = Annotated[bool, Parameter(name="--json")]
Out = Annotated[Path, Parameter(name=("--out", "-o"))]
Overrides = Annotated[tuple[str, ...], Parameter(name="--set")]


def scenes(*, json: Json = False) -> None:
    """List the scenes that ship or stand in the working directory's `scenes/`, one line each.

    Of drawn scenes a number says which one is meant: `--scene 17`.

    Examples of use:

        simgen scenes
        simgen scenes --json

    Parameters
    ----------
    json
        Print the same as JSON.
    """
    from simgen.app.listings import list_scenes

    listed = list_scenes()
    if json:
        answer_json([asdict(scene) for scene in listed])
        return
    for scene in listed:
        answer(scene.line())
    say_next("simgen", "preview", "two_objects", "-o", "two_objects.png")


def recipes(*, json: Json = False) -> None:
    """List the recipes that ship or stand in the working directory's `data_recipes/`, one line each.

    Examples of use:

        simgen recipes
        simgen recipes --json

    Parameters
    ----------
    json
        Print the same as JSON.
    """
    from simgen.app.listings import list_recipes

    listed = list_recipes()
    if json:
        answer_json([asdict(recipe) for recipe in listed])
        return
    for recipe in listed:
        answer(recipe.line())
    say_next("simgen", "generate", "small", "-o", "out/small")


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
    from simgen.base.strict_models import schema_of
    from simgen.spec.recipe import Recipe
    from simgen.spec.scene import Scene

    answer_json(schema_of(Scene if what == "scene" else Recipe))


def check(
    target: str,
    *,
    set: Overrides = (),
    scene: int | None = None,
    trust_python: bool = False,
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
    set
        Override one value of the recipe, such as photons.budget=300; may be repeated.
    scene
        Which scene of those that a Python function draws; the first unless you say.
    trust_python
        Run the Python function that a recipe file names as its scene: only if you trust its author.
    json
        Print the findings as JSON.
    """
    from simgen.check.targets import lint

    line, findings = lint(target, set, scene, trust_python=trust_python)
    bad = sum(finding.verdict == "bad" for finding in findings)
    if json:
        answer_json([asdict(finding) for finding in findings])
    else:
        warnings = sum(finding.verdict == "warn" for finding in findings)
        answer(line)
        for finding in findings:
            answer(finding.line())
        answer(f"{bad} bad, {warnings} to be warned of, {len(findings)} findings in all")
        if not bad:
            _say_next_after_check(target, set, scene)
    return 1 if bad else 0


def preview(
    target: str,
    *,
    out: Out,
    set: Overrides = (),
    scene: int | None = None,
    trust_python: bool = False,
    samples_per_pixel: int = 32,
) -> None:
    """Draw a scene or recipe from the virtual centre, with its depth and its objects, in one picture.

    In full light and in sRGB, whatever the recipe's camera and photons. Of a field with several values the
    first is drawn.

    Examples of use:

        simgen preview two_objects -o look.png
        simgen preview drawn_room --scene 17 -o look.png

    Parameters
    ----------
    target
        A recipe, or a scene, which is looked at with the paper's field of view; by name or path.
    out
        The picture to write, .png or .jpg, in a folder that exists.
    set
        Override one value of the recipe, such as grid.pixel_mm=0.02; may be repeated.
    scene
        Which scene of those that a Python function draws.
    trust_python
        Run the Python function that a recipe file names as its scene: only if you trust its author.
    samples_per_pixel
        Light paths per pixel; more is slower and less noisy.
    """
    from simgen.app.picture_parts import check_picture_path
    from simgen.app.preview_picture import draw_preview
    from simgen.check.targets import load_target
    from simgen.spec.recipe import recipe_file
    from simgen.spec.scene_lookup import is_scene

    check_picture_path(out)
    draw_preview(load_target(target, set, scene, trust_python=trust_python), samples_per_pixel).write(out)
    say(f"{out}")
    if is_scene(target) and scene is None:
        name = _name_of(target)
        if recipe_file(name) is None:
            say_next("simgen", "new-recipe", name, "--scene", target)
        else:
            say_next("simgen", "generate", name, "-o", f"out/{name}")


def _say_next_after_check(target: str, overrides: tuple[str, ...], scene: int | None) -> None:
    """Of a scene: look at it. Of a recipe: make it."""
    from simgen.spec.scene_lookup import is_drawn, is_scene

    name = _name_of(target)
    if not is_scene(target):
        values = [word for text in overrides for word in ("--set", text)]
        say_next("simgen", "generate", target, "-o", f"out/{name}", *values)
        return
    if scene is None and is_drawn(target):
        scene = 0
    number = [] if scene is None else ["--scene", scene]
    say_next("simgen", "preview", target, *number, "-o", f"{name}.png")


def _name_of(target: str) -> str:
    """What a scene or recipe is called: the name of its folder or file."""
    path = Path(target)
    return path.resolve().parent.name if path.name == "scene.toml" else path.name.removesuffix(".toml")
