"""Commands that write scenes and recipes: to start from, or from another program's file."""

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from pcii.base.command_output import say, say_next
from simgen.app.scene_commands import Out


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
        Copy this scene, one of `simgen scenes`, with its files.
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
    unit: Literal["mm", "cm", "m", "in", "ft"] = "m",
    place_at_mm: tuple[float, float, float] | None = None,
    fit_mm: float | None = None,
    emission_unit: Literal["nit", "watt"] = "nit",
) -> None:
    """Make a scene of a glTF file (.glb, .gltf), as Blender and others export it, or a Mitsuba scene (.xml).

    Objects keep their names. The scene stands before a camera of the file, or where you say. What cannot
    be represented is listed.

    Examples of use:

        simgen import-scene room.glb -o scenes/room
        simgen import-scene duck.glb -o scenes/duck --place-at-mm 0 0 600 --fit-mm 150
        simgen import-scene blender.glb -o scenes/blender --emission-unit watt

    Parameters
    ----------
    file
        The file; others that it names must lie in its folder or below.
    out
        Folder for scene.toml, meshes and pictures; it must not be there yet.
    camera
        The camera of the file that becomes the virtual centre, if it has several.
    unit
        The file's unit of length.
    place_at_mm
        X, Y and Z of the middle of the scene, upright, instead of a camera.
    fit_mm
        Length of the longest side of the scene's bounding box, whatever the unit.
    emission_unit
        What emission of 1 means in a glTF file: 1 cd/m² (nit), or 1 W/(sr m²), which is 683 cd/m² (watt).
        Choose watt for files that Blender exported in its lighting mode Standard.
    """
    from simgen.importing.scene_import import import_scene

    for line in import_scene(
        file,
        out,
        camera=camera,
        unit=unit,
        place_at_mm=place_at_mm,
        fit_mm=fit_mm,
        emission_unit=emission_unit,
    ).lines():
        say(line)
    say_next("simgen", "preview", out, "-o", f"{out.name}.png")
