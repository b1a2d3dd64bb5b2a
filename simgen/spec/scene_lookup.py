"""Where scenes are found: by name or path, and the values of a scene, drawn where it is a distribution."""

from pathlib import Path
from typing import Any

from pcii.base.errors import InputError
from simgen.base.locations import find, scene_roots
from simgen.base.strict_models import LONGEST_PART, read_toml, shorten, suggestion
from simgen.spec.distributions import draw, is_distribution
from simgen.spec.recipe import SEED_LIMIT
from simgen.spec.scene_generators import generated, generators


def named_values(
    name_or_path: str, recipe_folder: Path | None, number: int | None
) -> tuple[dict[str, Any], Path, str]:
    """The values of one scene by name or path as TOML holds them, its folder, and what errors call it.

    `number` selects a draw from a distribution. Raises `InputError` for a scene that is missing, for a number
    with a single scene, and for a distribution without one.
    """
    file = find_scene(name_or_path, recipe_folder)
    if file is not None:
        values, source = plain_values(read_toml(file), number, str(file))
        return values, file.parent, source
    draw_number = _checked_number(number, name_or_path)
    values, folder = generated(name_or_path, draw_number)
    return values, folder, f"{name_or_path}, draw {number}"


def plain_values(values: dict[str, Any], number: int | None, source: str) -> tuple[dict[str, Any], str]:
    """The values of one scene, drawn by `number` if these are a distribution, and what errors call it.

    Raises `InputError` as `named_values` does.
    """
    if is_distribution(values):
        return draw(values, _checked_number(number, source), source), f"{source}, draw {number}"
    if number is not None:
        raise InputError(f"scene_number: {source} is one scene, of which there are no draws; leave it out")
    return values, source


def _checked_number(number: int | None, source: str) -> int:
    if number is None:
        raise InputError(
            f"scene_number: {source} is a distribution of scenes; say which draw, such as scene_number = 0 "
            "in a recipe or --scene 0"
        )
    if isinstance(number, bool) or not isinstance(number, int) or not 0 <= number < SEED_LIMIT:
        raise InputError(f"scene_number: expected a whole number from 0 to 2^63 - 1, got {number!r}")
    return number


def find_scene(name_or_path: str, recipe_folder: Path | None = None) -> Path | None:
    """The scene.toml that a name or path means, None for the name of a generator.

    Raises `InputError` with a suggestion if there is neither.
    """
    given = Path(name_or_path)
    beside = [] if recipe_folder is None else [recipe_folder / given, recipe_folder / given / "scene.toml"]
    try:
        for candidate in (*beside, given, given / "scene.toml"):
            if candidate.is_file():
                return candidate
        shipped = find(scene_roots, f"{name_or_path}/scene.toml")
    except OSError:  # a name too long for a file
        shipped = None
    if shipped is not None:
        return shipped
    known = generators()
    if name_or_path in known:
        return None
    shown = shorten(repr(name_or_path), LONGEST_PART)
    raise InputError(f"scene: there is no scene {shown}{suggestion(name_or_path, [*scene_names(), *known])}")


def is_scene(name_or_path: str) -> bool:
    """Whether a name or path means a scene: a folder, a file with lights or objects, or a known name."""
    path = Path(name_or_path)
    if path.is_file():
        values = read_toml(path)
        return "scene" not in values and bool({"lights", "objects"} & set(values))
    if path.is_dir():
        return True
    try:
        find_scene(name_or_path)
    except InputError:
        return False
    return True


def scene_names() -> list[str]:
    """Names of the scenes that ship or stand in the working directory, generators left out."""
    return sorted({file.parent.name for root in scene_roots() for file in root.glob("*/scene.toml")})
