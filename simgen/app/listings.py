"""Lists of the scenes and recipes that ship or stand in the working directory."""

from dataclasses import dataclass

from pcii.base.errors import InputError
from simgen.base.file_lookup import recipe_roots
from simgen.base.strict_models import shorten
from simgen.spec.scene_lookup import drawn_scenes, load_scene, scene_names
from simgen.spec.sweeps import load_sweep

LONGEST_FAULT = 100
MOST_NAMED = 6
"""A line names so many objects of a scene."""


@dataclass(frozen=True)
class ListedScene:
    """A scene by name. `fault` says what is wrong with its file."""

    name: str
    title: str | None
    objects: tuple[str, ...] | None
    is_drawn: bool
    fault: str | None = None

    def line(self) -> str:
        """One line for people."""
        if self.fault is not None:
            return f"{self.name:20} not valid: {shorten(self.fault, LONGEST_FAULT)}"
        if self.is_drawn:
            return f"{self.name:20} {self.title} (drawn by number)"
        names = list(self.objects or ())
        if len(names) > MOST_NAMED:
            names = [*names[: MOST_NAMED - 1], f"{len(names) - MOST_NAMED + 1} more"]
        return f"{self.name:20} {self.title} ({', '.join(names) or 'no objects'})"


@dataclass(frozen=True)
class ListedRecipe:
    """A recipe by name; of one that makes several datasets the first. `fault` says what is wrong with it."""

    name: str
    title: str | None
    scene: str | None
    datasets: int | None
    views: tuple[int, int] | None
    pixels: tuple[int, int] | None
    fault: str | None = None

    def line(self) -> str:
        """One line for people."""
        if self.fault is not None or self.views is None or self.pixels is None:
            return f"{self.name:20} not valid: {shorten(self.fault or '', LONGEST_FAULT)}"
        size = f"{self.views[0]} x {self.views[1]} views of {self.pixels[0]} x {self.pixels[1]}"
        several = f"; {self.datasets} datasets" if self.datasets != 1 else ""
        return f"{self.name:20} {self.title or self.scene} ({size}{several})"


def list_scenes() -> list[ListedScene]:
    """Every scene by name, then those that Python functions draw."""
    return [_listed_scene(name) for name in scene_names()] + [
        ListedScene(name, f"Made by {package}", None, True) for name, package in drawn_scenes().items()
    ]


def _listed_scene(name: str) -> ListedScene:
    try:
        scene, _ = load_scene(name)
    except InputError as fault:
        return ListedScene(name, None, None, False, str(fault))
    return ListedScene(name, scene.title, tuple(thing.name for thing in scene.objects), False)


def list_recipes() -> list[ListedRecipe]:
    """Every recipe by name."""
    names = {file.stem for root in recipe_roots() for file in root.glob("*.toml")}
    return [_listed_recipe(name) for name in sorted(names)]


def _listed_recipe(name: str) -> ListedRecipe:
    try:
        sweep = load_sweep(f"{name}.toml")
        recipe = sweep.recipe(0)
    except InputError as fault:
        return ListedRecipe(name, None, None, None, None, None, str(fault))
    grid = recipe.grid
    return ListedRecipe(
        name,
        recipe.title,
        recipe.scene,
        len(sweep),
        (grid.rows, grid.cols),
        (grid.height, grid.width),
    )
