"""Commands that write files to start from: a scene, a recipe, one draw of a distribution of scenes."""

from typing import Annotated

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


def draw(target: str, *, scene: int, out: Out) -> None:
    """Write one draw of a distribution of scenes as a scene of its own, with the files that it names.

    Example of use:

        simgen draw drawn_solids --scene 17 -o scenes/mine

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
    say_next("simgen", "check", out)
