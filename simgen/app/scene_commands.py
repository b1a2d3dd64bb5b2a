"""Commands about scenes: list, describe, check, look at, draw."""

import json
import sys
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from pcii.base.command_line import say


def scenes() -> None:
    """List the scenes that ship or stand in the working directory's `scenes/`, one line each.

    Of a distribution of scenes a number says which one is meant: `--scene 17`.

    Example:  simgen scenes
    """
    from simgen.spec.scene import is_drawn, load_scene, scene_names
    from simgen.spec.scene_generators import generators

    for name in scene_names():
        drawn = is_drawn(name)
        scene, _ = load_scene(name, number=0 if drawn else None)
        things = ", ".join(thing.name for thing in scene.objects) or "no objects"
        say(f"{name:20} {scene.title} ({'a distribution' if drawn else things})")
    for name, line in generators().items():
        say(f"{name:20} {line.removesuffix('.')} (a distribution)")


def schema(what: Literal["scene", "recipe"]) -> None:
    """Print the JSON Schema of scene or recipe files, for completion in editors.

    Example:  simgen schema recipe > recipe.schema.json
    """
    from simgen.base.strict_models import schema_of
    from simgen.spec.distribution_schema import scene_schema
    from simgen.spec.recipe import Recipe

    json.dump(scene_schema() if what == "scene" else schema_of(Recipe), sys.stdout, indent=2)
    say("")


def check(
    target: str,
    *,
    set: Annotated[tuple[str, ...], Parameter(name="--set")] = (),
    scene: int | None = None,
    json_: Annotated[bool, Parameter(name="--json", negative=())] = False,
) -> int:
    """Validate and lint a scene or recipe without rendering: one line a finding, in seconds.

    Disparities, blur between objects, what is hidden or cut, colours that shifts leave out, photons per
    object and voxel, size, memory and time. Leaves with exit code 0 if nothing is bad, 1 if something
    is, 2 for a file that is not valid.

    Examples:

        simgen check two_objects

        simgen check paper --set grid.pitch_mm=[2.5,2.5]

        simgen check drawn_solids --scene 17

    Parameters
    ----------
    target
        A recipe, or a scene, which is looked at with the paper's camera grid; by name or path.
    set
        Override one value of the recipe, such as photons.budget=300; may be repeated.
    scene
        Which draw of a distribution of scenes; without it the first 20 are looked at, less closely.
    json_
        Print the findings as JSON.
    """
    from dataclasses import asdict

    from simgen.check.linter import lint

    line, findings = lint(target, set, scene)
    bad = sum(finding.verdict == "bad" for finding in findings)
    if json_:
        say(json.dumps([asdict(finding) for finding in findings], indent=2))
    else:
        warnings = sum(finding.verdict == "warn" for finding in findings)
        say(line)
        for finding in findings:
            say(finding.line())
        say(f"{bad} bad, {warnings} to be warned of, {len(findings)} findings in all")
    return 1 if bad else 0


def preview(
    target: str,
    *,
    out: Annotated[Path, Parameter(name=("--out", "-o"))],
    set: Annotated[tuple[str, ...], Parameter(name="--set")] = (),
    scene: int | None = None,
    samples_per_pixel: int = 32,
) -> None:
    """Draw a scene or recipe from the virtual centre, with its depth and its objects, in one picture.

    In full light and in sRGB, whatever the recipe's camera and photons.

    Examples:

        simgen preview two_objects -o look.png

        simgen preview drawn_solids --scene 17 -o look.png

    Parameters
    ----------
    target
        A recipe, or a scene, which is looked at with the paper's field of view; by name or path.
    out
        The picture to write, .png or .jpg, in a folder that exists.
    set
        Override one value of the recipe, such as grid.pixel_mm=0.02; may be repeated.
    scene
        Which draw of a distribution of scenes.
    samples_per_pixel
        Light paths per pixel; more is slower and less noisy.
    """
    from simgen.figures.preview_picture import write_preview

    write_preview(target, out, samples_per_pixel, overrides=set, scene_number=scene)
    say(f"{out}")


def draw(
    target: str,
    *,
    scene: int,
    out: Annotated[Path, Parameter(name=("--out", "-o"))],
) -> None:
    """Write one draw of a distribution of scenes as a scene of its own, with the files that it names.

    Example:  simgen draw drawn_solids --scene 17 -o scenes/mine

    Parameters
    ----------
    target
        The distribution, by name or path.
    scene
        Which draw of it.
    out
        Folder for scene.toml, new or empty.
    """
    from simgen.app.draw_files import write_drawn_scene

    say(f"{write_drawn_scene(target, scene, out)}")
