"""Where scenes are found: scene.toml files by name or path, and Python functions that draw scenes by number.

A drawn scene is a function `(random) -> simgen.Scene` of a `random.Random`, whose sequence Python keeps for
all time (NumPy's may change). It is named "module:function" or "file.py:function", or registered in the
pyproject.toml of any package:

    [project.entry-points."simgen.scenes"]
    my-scenes = "my_package.scenes:draw"
"""

import importlib
import inspect
import runpy
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from random import Random

from pcii.base import InputError, package_of, registered
from simgen.base import find, find_all, read_toml, shown_value, suggestion
from simgen.spec.recipe import SEED_LIMIT
from simgen.spec.scene import Scene, scene_of

GROUP = "simgen.scenes"


def load_scene(name_or_path: str, recipe_folder: Path | None = None, number: int | None = None) -> Scene:
    """A scene by name or path, which knows its folder.

    A name is looked up in `recipe_folder`, in the working directory's `scenes/`, among the scenes that ship,
    then among those that Python functions draw; of these `number` says which scene. Raises `InputError` for
    a scene that is missing or wrong, for a number with a single scene, and for a drawn scene without one.
    """
    file = find_scene(name_or_path, recipe_folder)
    if file is None:
        return _draw(name_or_path, recipe_folder or Path(), number)
    if number is not None:
        raise InputError(f"scene_number: {file} is one scene, of which there are no draws; leave it out")
    return scene_of(read_toml(file), file.parent, str(file))


def is_drawn(name_or_path: str, recipe_folder: Path | None = None) -> bool:
    """Whether a name means a scene that a Python function draws by number."""
    return find_scene(name_or_path, recipe_folder) is None


def drawn_scenes() -> dict[str, str]:
    """Names of the drawn scenes that installed packages register, and the package of each."""
    return {name: package_of(point) for name, point in registered(GROUP, ()).items()}


def find_scene(name_or_path: str, recipe_folder: Path | None = None) -> Path | None:
    """The scene.toml that a name or path means, None for a scene that is drawn.

    Raises `InputError` with a suggestion if there is neither.
    """
    with suppress(OSError):  # of a name that is too long for a file
        for path in (folder / name_or_path for folder in (recipe_folder, Path()) if folder is not None):
            for candidate in (path, path / "scene.toml"):
                if candidate.is_file():
                    return candidate
        if shipped := find(f"scenes/{name_or_path}/scene.toml"):
            return shipped
    known = drawn_scenes()
    if ":" in name_or_path or name_or_path in known:
        return None
    hint = suggestion(name_or_path, [*scene_names(), *known])
    raise InputError(f"scene: there is no scene {shown_value(name_or_path)}{hint}")


def is_scene(name_or_path: str) -> bool:
    """Whether a name or path means a scene: a folder, a file with lights or objects, or a known name."""
    path = Path(name_or_path)
    if path.is_file():
        values = read_toml(path)
        return "scene" not in values and bool({"lights", "objects", "mitsuba"} & set(values))
    with suppress(InputError):
        find_scene(name_or_path)
        return True
    return path.is_dir()


def scene_names() -> list[str]:
    """Names of the scenes that ship or stand in the working directory, drawn ones left out."""
    return sorted({file.parent.name for file in find_all("scenes/*/scene.toml")})


def _draw(name: str, recipe_folder: Path, number: int | None) -> Scene:
    """The scene that a function draws, with its number in its title."""
    label = f"scene: {name!r}"
    if type(number) is not int or not 0 <= number < SEED_LIMIT:
        raise InputError(f"{label} is drawn by number; give a scene_number from 0 to 2^63 - 1")
    try:
        function = _function(name, recipe_folder)
        scene = function(Random(f"{function.__name__.removeprefix('drawn_')} {number}"))
    except InputError as fault:
        raise InputError(f"{label}, draw {number}: {fault}") from None
    except (Exception, SystemExit) as fault:  # somebody else's function may raise anything
        raise InputError(f"{label} cannot be drawn: {type(fault).__name__}: {fault}") from fault
    if not isinstance(scene, Scene):
        raise InputError(f"{label} must return a simgen.Scene, not {type(scene).__name__}")
    folder = scene.folder or Path(inspect.getsourcefile(function) or "").parent
    return scene.change(title=f"{scene.title} {number}", folder=folder)


def _function(name: str, recipe_folder: Path) -> Callable[[Random], Scene]:
    where, _, function = name.rpartition(":")
    if not where:
        return registered(GROUP, ())[name].load()
    if not where.endswith(".py"):
        return getattr(importlib.import_module(where), function)
    path = (recipe_folder / where).resolve()
    if not path.is_file():
        raise InputError(f"there is no file {path}")
    return runpy.run_path(str(path))[function]
