"""The public benchmark: its definition, the datasets that follow from it, and their certificate.

A benchmark is one TOML file. What it holds never changes under one name: other scenes, cameras or light make
another benchmark. On the same kind of machine it has the bytes that were published. Others (of another
vector width, say) round otherwise, so that some light paths end elsewhere and the photons are other draws of
the same light. Then photons are compared in tiles of the film: with a and b photons in a tile the sum of
(a - b)^2 / (a + b) has a chi-square distribution, with as many degrees of freedom as there are tiles with
photons. Radiance in other bytes is not compared.
"""

import json
from collections import Counter
from collections.abc import Container, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, StringConstraints, model_validator

from pcii.store.collection import BENCHMARK_FIELDS, Half
from pcii.store.dataset import Dataset
from pcii.store.folders import hash_json

Kind = Literal["separate", "touching", "cluttered", "room", "leaning", "glossy", "nothing"]
Light = Literal["photons", "frames", "full-light"]
Name = Annotated[str, StringConstraints(pattern=r"^[a-z0-9]+(-[a-z0-9]+)*$", max_length=40)]
Photons = Annotated[float, Field(gt=0, allow_inf_nan=False)]
CERTIFICATE = "certificate.json"
TILE_PX = 64
MIN_P = 1e-4
"""The share of benchmarks of the same light that are taken for other ones, by any of their datasets."""

Content = Mapping[str, Any]
"""Of a dataset: a hash of its files, and its photons in each view and each tile."""


class _Model(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Scene(_Model):
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


class BenchmarkDataset(NamedTuple):
    """A dataset of a benchmark: which scene, in which light, and the seed of its photons."""

    scene: Scene
    light: Light
    seed: int

    @property
    def folder(self) -> str:
        """Name of its folder."""
        name = f"{self.scene.name}_{self.light}"
        return name if self.light == "full-light" else f"{name}_{self.seed}"

    @property
    def values(self) -> dict[str, Any]:
        """What distinguishes it from the others, by `BENCHMARK_FIELDS`."""
        values = self.scene.name, self.scene.kind, self.scene.half, self.light, self.seed
        return dict(zip(BENCHMARK_FIELDS, values, strict=True))


class Definition(_Model):
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

    def datasets(self, names: Container[str] | None = None) -> list[BenchmarkDataset]:
        """The datasets, those of one scene after each other; with `names` those of these scenes only."""
        datasets: list[BenchmarkDataset] = []
        first = self.seeds[0]
        for scene in self.scene:
            if names is None or scene.name in names:
                datasets += [BenchmarkDataset(scene, "photons", seed) for seed in self.seeds]
                if scene.frames:
                    datasets.append(BenchmarkDataset(scene, "frames", first))
                datasets.append(BenchmarkDataset(scene, "full-light", first))
        return datasets


@dataclass(frozen=True)
class Verdict:
    """How the datasets compare with the published ones; `problems` is a sentence for each that differs."""

    compared: int
    same_bytes: int
    least_p: float
    """Of the chi-square tests of photons in other bytes, times the number of tests; at most 1."""
    problems: tuple[str, ...]

    def sentence(self) -> str:
        """The verdict in words."""
        if self.problems:
            return f"{len(self.problems)} of {self.compared} datasets are not those that were published"
        if self.same_bytes == self.compared:
            return f"all {self.compared} datasets have the bytes that were published"
        return (
            f"{self.same_bytes} of {self.compared} datasets have the bytes that were published; photons of "
            f"the others, of another kind of machine, are draws of the same light (p = {self.least_p:.2g})"
        )


def published_certificate(file: Path) -> dict[str, Any]:
    """The certificate of the published datasets: a file beside that of the definition; empty without one."""
    published = file.with_suffix(f".{CERTIFICATE}")
    return json.loads(published.read_text()) if published.is_file() else {}


def content_of(dataset: Dataset) -> Content:
    """What a dataset is compared by."""
    files = {name: entry["sha256"] for name, entry in dataset.manifest.files.items()}
    content: dict[str, Any] = {"sha256": hash_json(files)}
    if dataset.has_counts:
        grid, events = dataset.grid, dataset.counts.events
        across = -(-grid.width // TILE_PX)
        views = events.k.astype(np.int64) * grid.cols + events.l
        tiles = events.i.astype(np.int64) // TILE_PX * across + events.j // TILE_PX
        tile_count = -(-grid.height // TILE_PX) * across
        content["views"] = np.bincount(views, events.n, grid.view_count).astype(np.int64).tolist()
        content["tiles"] = np.bincount(tiles, events.n, tile_count).astype(np.int64).tolist()
    return content


def compare(own: Mapping[str, Content], published: Mapping[str, Content]) -> Verdict:
    """Compare datasets by name with the published ones: their bytes, and photons where those differ."""
    problems = [f"{name}: is not in the published benchmark" for name in own if name not in published]
    pairs = {name: (content, published[name]) for name, content in own.items() if name in published}
    others = {name: pair for name, pair in pairs.items() if pair[0]["sha256"] != pair[1]["sha256"]}
    tests = {name: _photons_p(*pair) for name, pair in others.items() if "tiles" in pair[0]}
    corrected = {name: min(1.0, p * len(tests)) for name, p in tests.items()}
    problems += [
        f"{name}: its photons lie elsewhere than the published ones (p = {p:.2g})"
        for name, p in corrected.items()
        if p < MIN_P
    ]
    least_p = min(corrected.values(), default=1.0)
    return Verdict(len(own), len(pairs) - len(others), least_p, tuple(problems))


def _photons_p(ours: Content, theirs: Content) -> float:
    """Probability that draws of the same light differ by more, in tiles or in the totals of views."""
    from scipy.stats import chi2

    smallest = 1.0
    for name in ("tiles", "views"):
        a, b = (np.array(content.get(name, []), np.float64) for content in (ours, theirs))
        if a.shape != b.shape:
            return 0.0
        total = a + b
        distance = float(np.divide((a - b) ** 2, total, out=np.zeros_like(total), where=total > 0).sum())
        smallest = min(smallest, 2 * float(chi2.sf(distance, np.count_nonzero(total))))
    return smallest
