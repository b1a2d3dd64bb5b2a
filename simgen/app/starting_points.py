"""Scenes and recipes to start from: commented files that work as they are written."""

import json
import os
import re
import shutil
from collections.abc import Mapping
from pathlib import Path

from pcii.base.errors import InputError
from pcii.store.safe_files import new_folder_safely, write_bytes_safely
from simgen.base.file_lookup import scene_roots
from simgen.base.strict_models import LONGEST_PART, shorten, suggestion
from simgen.check.scene_probe import probe_scene
from simgen.check.targets import load_target
from simgen.spec.recipe import recipe_file
from simgen.spec.scene import NAME
from simgen.spec.scene_lookup import drawn_scenes, is_drawn, is_scene, load_scene, scene_names

TEMPLATES = Path(__file__).resolve().parent / "templates"
ONE_PLANE_MM = 10.0
"""Objects whose depths differ by less get one section."""
FALLBACK_SCENE = "two_objects"


def write_new_scene(name: str, shipped: str | None = None) -> Path:
    """Write scenes/`name`/scene.toml in the working directory, and return its path.

    A commented scene of two objects or, with `shipped`, a copy of a scene's folder. Raises `InputError` for a
    name that is taken or no name, and for a scene that is no file to copy.
    """
    _check_name(name)
    folder = Path("scenes") / name
    if folder.exists():
        raise InputError(f"{folder}: is there already; choose another name")
    if is_scene(name):
        raise InputError(f"{name!r} is the name of a scene that ships; choose another")
    source = None if shipped is None else _scene_to_copy(shipped, name)
    folder.parent.mkdir(exist_ok=True)
    with new_folder_safely(folder) as new:
        if source is None:
            text = _filled("scene.toml", {"NAME": name})
        else:
            shutil.copytree(source, new, dirs_exist_ok=True, ignore=shutil.ignore_patterns("__pycache__"))
            text = f"# {name}: begun as a copy of the scene {shipped}.\n\n"
            text += (new / "scene.toml").read_text(encoding="utf-8")
        (new / "scene.toml").write_text(text, encoding="utf-8")
    return folder / "scene.toml"


def write_new_recipe(name: str, scene: str | None = None) -> Path:
    """Write data_recipes/`name`.toml in the working directory, and return its path.

    A commented recipe of `scene`, by default of the scene `name` or, if there is none, of `FALLBACK_SCENE`.
    Of drawn scenes it is the first. Raises `InputError` for a name that is taken or no name,
    and for a scene that is missing or wrong.
    """
    _check_name(name)
    path = Path("data_recipes") / f"{name}.toml"
    if path.exists():
        raise InputError(f"{path}: is there already; choose another name")
    if recipe_file(name) is not None:
        raise InputError(f"{name!r} is the name of a recipe that ships; choose another")
    chosen = scene or (name if is_scene(name) else FALLBACK_SCENE)
    named = chosen if Path(chosen).name == chosen else os.path.relpath(chosen, path.parent)
    number = 0 if is_drawn(chosen) else None
    z_mm = "# z_mm = [540, 620]            # sections; default: planes_mm of the scene"
    if not load_scene(chosen, number=number)[0].planes_mm:
        z_mm = f"z_mm = {json.dumps(_depths_mm(chosen, number))}"
    quoted = json.dumps(named)
    if number is not None:
        quoted += f"\nscene_number = {number}               # which scene of those that it draws"
    text = _filled("recipe.toml", {"SCENE": quoted, "NAME": name, "FILE": str(path), "Z_MM": z_mm})
    path.parent.mkdir(exist_ok=True)
    write_bytes_safely(path, text.encode())
    return path


def _filled(template: str, words: Mapping[str, str]) -> str:
    """A template with its placeholders, which are in capitals, replaced."""
    text = (TEMPLATES / template).read_text(encoding="utf-8")
    return re.sub("|".join(map(re.escape, words)), lambda found: words[found[0]], text)


def _check_name(name: str) -> None:
    if not re.fullmatch(NAME, name):
        shown = shorten(repr(name), LONGEST_PART)
        raise InputError(
            f"NAME: expected a letter, then letters, digits, _ and -, such as my-scene, not {shown}"
        )


def _scene_to_copy(shipped: str, name: str) -> Path:
    """Folder of a scene by name; `InputError` for one that is a Python function, or is not there."""
    for root in scene_roots():
        if (root / shipped / "scene.toml").is_file() and shipped in scene_names():
            return root / shipped
    if shipped in drawn_scenes():
        raise InputError(
            f"--from: {shipped!r} is drawn by Python, not a file; write one of its scenes by "
            f"simgen.load_scene({shipped!r}, 0).save('scenes/{name}') in Python"
        )
    shown = shorten(repr(shipped), LONGEST_PART)
    raise InputError(f"--from: there is no scene {shown}{suggestion(shipped, scene_names())}")


def _depths_mm(scene: str, number: int | None) -> list[float]:
    """Depths of what the virtual centre sees: of each object, or else of the backdrop; in whole mm."""
    facts = probe_scene(load_target(scene, scene_number=number))
    middles = sorted(thing.middle_mm for thing in facts.seen) or [facts.backdrop_mm or 600.0]
    depths = [round(middles[0])]
    for middle in middles:
        if middle - depths[-1] >= ONE_PLANE_MM:
            depths.append(round(middle))
    return [float(depth) for depth in depths]
