"""What a benchmark is: its scenes, each of a kind and in one half, its amounts of light, and its seeds.

A benchmark is one TOML file, from which all of its datasets follow. What it holds never changes under one
name: other scenes, cameras or light make another benchmark.
"""

from collections import Counter
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, StringConstraints, model_validator

from pcii.base.errors import InputError
from pcii.io.collection_layout import Half
from simgen.base.file_lookup import recipe_roots
from simgen.base.strict_models import Strict, read_toml, suggestion, validate

Kind = Literal["separate", "touching", "cluttered", "room", "leaning", "glossy", "nothing"]
Name = Annotated[str, StringConstraints(pattern=r"^[a-z0-9]+(-[a-z0-9]+)*$", max_length=40)]
Photons = Annotated[float, Field(gt=0)]


class Scene(Strict):
    """A scene of the benchmark: a recipe, which gives it cameras and depths too, and what it is for."""

    name: Name
    """What datasets, tables and submissions call it."""
    kind: Kind
    """What is hard about it."""
    half: Half
    """Methods are made and tuned on the one half; what is reported is of the other."""
    recipe: str
    """Name of a recipe that ships."""
    set: tuple[str, ...] = ()
    """Values that differ from the recipe's, as `--set` takes them."""
    frames: bool = False
    """Whether its photons are given as binary frames too."""
    brighter: bool = True
    """Whether its first draw has the brighter light too."""


class Definition(Strict):
    """All that decides what is in a benchmark."""

    name: Name
    title: str
    photons_per_view: tuple[Photons, ...]
    """From the least light to the most; all photons of less light are among those of more."""
    brighter_photons_per_view: tuple[Photons, ...] = ()
    """More light, of the first seed: images differ little from draw to draw, and take most of the time."""
    seeds: tuple[Annotated[int, Field(ge=0)], ...]
    """Draws of the photons of each scene."""
    frames: Annotated[int, Field(ge=1)]
    """Binary frames into which the exposure is divided, of the scenes that have them."""
    set: tuple[str, ...] = ()
    """Values that differ from the recipes of all scenes."""
    scene: tuple[Scene, ...]

    @model_validator(mode="after")
    def _is_whole(self) -> Self:
        names = Counter(scene.name for scene in self.scene)
        twice = [name for name, times in names.items() if times > 1]
        if twice:
            raise ValueError(f"scene: {twice[0]!r} is there twice; give each scene a name of its own")
        photons = [*self.photons_per_view, *self.brighter_photons_per_view]
        if not self.photons_per_view or photons != sorted({*photons}):
            raise ValueError("photons_per_view: expected growing numbers, and larger ones of brighter light")
        if not self.seeds or len({*self.seeds}) < len(self.seeds):
            raise ValueError("seeds: expected at least one, each once")
        return self


def benchmark_files() -> dict[str, Path]:
    """Files of the benchmarks that ship, by name."""
    return {file.stem: file for root in recipe_roots() for file in sorted(root.glob("benchmarks/*.toml"))}


def load_definition(name_or_path: str) -> tuple[Definition, Path]:
    """A benchmark by name or path of its file, and that file; `InputError` if it is missing or wrong."""
    files = benchmark_files()
    file = files.get(name_or_path, Path(name_or_path))
    if not file.is_file():
        raise InputError(f"benchmark: there is no {name_or_path!r}{suggestion(name_or_path, list(files))}")
    return validate(Definition, read_toml(file), str(file)), file
