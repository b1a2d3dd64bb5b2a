"""Scenes and recipes to start from: what ships or stands in the working directory, and new ones as commented
files that work as they are written."""

import json
import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from string import Template

from pcii.base import InputError, new_folder_safely, write_bytes_safely
from simgen.base import shorten
from simgen.spec import (
    NAME,
    drawn_scenes,
    is_drawn,
    is_scene,
    load_scene,
    load_sweep,
    recipe_file,
    recipe_names,
    scene_names,
)

TEMPLATES = Path(__file__).resolve().parent / "templates"


def list_scenes() -> list[str]:
    """A line for each scene by name, then for those that Python functions draw."""
    drawn = [f"{name:20} Made by {package} (drawn by number)" for name, package in drawn_scenes().items()]
    return [_line(name, lambda name: load_scene(name).title) for name in scene_names()] + drawn


def list_recipes() -> list[str]:
    """A line for each recipe by name."""
    return [_line(name, _title_of_recipe) for name in recipe_names()]


def _title_of_recipe(name: str) -> str:
    recipe = load_sweep(f"{name}.toml").recipe(0)
    return recipe.title or recipe.scene


def _line(name: str, title_of: Callable[[str], str]) -> str:
    """A name and its title, or what is wrong with its file."""
    try:
        return f"{name:20} {title_of(name)}"
    except InputError as fault:
        return f"{name:20} not valid: {shorten(str(fault), 100)}"


def write_new_scene(name: str, source: str | None = None) -> Path:
    """Write scenes/`name`/scene.toml in the working directory, and return its path.

    A commented scene of two objects or a copy of the folder of the scene `source`. Raises `InputError` for a
    name that is taken or no name, and for a scene that is missing or drawn by Python.
    """
    _check_name(name)
    folder = Path("scenes") / name
    if folder.exists() or name in {*scene_names(), *drawn_scenes()}:
        raise InputError(f"NAME: {name!r} is the name of a scene already; choose another")
    files = None if source is None else load_scene(source).folder
    folder.parent.mkdir(exist_ok=True)
    with new_folder_safely(folder) as new:
        if files is None:
            (new / "scene.toml").write_text(_filled("scene.toml", NAME=name), encoding="utf-8")
        else:
            shutil.copytree(files, new, dirs_exist_ok=True, ignore=shutil.ignore_patterns("__pycache__"))
    return folder / "scene.toml"


def write_new_recipe(name: str, scene: str | None = None) -> Path:
    """Write data_recipes/`name`.toml in the working directory, and return its path.

    A commented recipe of `scene`, by default of the scene `name` or, if there is none, of two_objects. Of
    drawn scenes it is the first. Raises `InputError` for a name that is taken or no name, and for a scene
    that is missing or wrong.
    """
    _check_name(name)
    if recipe_file(name) is not None:
        raise InputError(f"NAME: {name!r} is the name of a recipe already; choose another")
    path = Path("data_recipes") / f"{name}.toml"
    scene = scene or (name if is_scene(name) else "two_objects")
    number = 0 if is_drawn(scene) else None
    load_scene(scene, number=number)
    text = json.dumps(scene if Path(scene).name == scene else os.path.relpath(scene, path.parent))
    if number is not None:
        text += f"\nscene_number = {number}               # which scene of those that it draws"
    path.parent.mkdir(exist_ok=True)
    write_bytes_safely(path, _filled("recipe.toml", SCENE=text, NAME=name, FILE=str(path)).encode())
    return path


def _filled(template: str, **words: str) -> str:
    """A template with words in the place of its $NAMES."""
    return Template((TEMPLATES / template).read_text(encoding="utf-8")).substitute(words)


def _check_name(name: str) -> None:
    if not re.fullmatch(NAME, name):
        raise InputError(
            f"NAME: expected a letter, then letters, digits, _ and -, such as my-scene, not {name!r}"
        )
