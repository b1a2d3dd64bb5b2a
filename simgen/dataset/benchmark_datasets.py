"""The datasets of a benchmark, in order: of each scene its photons by seed, binary frames, and full light."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

from pcii.io.collection_layout import BENCHMARK_FIELDS, IN_FRAMES
from simgen.dataset.definition import Definition, Scene
from simgen.spec.recipe import Recipe, load_recipe

Light = Literal["photons", "frames", "full-light"]


@dataclass(frozen=True)
class BenchmarkDatasets:
    """The datasets of a benchmark as a series of one collection; with `scenes`, those of these names only."""

    definition: Definition
    recipe_folder: Path
    scenes: tuple[str, ...] = ()

    @cached_property
    def pieces(self) -> tuple[tuple[Scene, Light, int], ...]:
        """Scene, light and seed of each dataset; those of one scene follow each other."""
        first = self.definition.seeds[0]
        found: list[tuple[Scene, Light, int]] = []
        for scene in self.definition.scene:
            if self.scenes and scene.name not in self.scenes:
                continue
            for seed in self.definition.seeds:
                found.append((scene, "photons", seed))
            if scene.frames:
                found.append((scene, "frames", first))
            found.append((scene, "full-light", first))
        return tuple(found)

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of what distinguishes the datasets."""
        return BENCHMARK_FIELDS

    @property
    def base(self) -> dict[str, Any]:
        """What all of them follow from."""
        return self.definition.model_dump(mode="json")

    def __len__(self) -> int:
        return len(self.pieces)

    def values(self, number: int) -> Mapping[str, Any]:
        """What distinguishes a dataset from the others."""
        scene, light, seed = self.pieces[number]
        return dict(zip(BENCHMARK_FIELDS, (scene.name, scene.kind, scene.half, light, seed), strict=True))

    def folder(self, number: int) -> str:
        """Name of a dataset's folder."""
        scene, light, seed = self.pieces[number]
        return f"{scene.name}_full-light" if light == "full-light" else f"{scene.name}_{light}_{seed}"

    def recipe(self, number: int) -> Recipe:
        """The recipe of a dataset; `InputError` if the definition makes none."""
        scene, light, seed = self.pieces[number]
        first = self.definition.seeds[0]
        brighter = self.definition.brighter_photons_per_view if seed == first and scene.brighter else ()
        *fewer, most = *self.definition.photons_per_view, *brighter
        settings = [
            *self.definition.set,
            *scene.set,
            f"title={scene.name}{IN_FRAMES * (light == 'frames')}",
            f"seed={seed}",
            "photons.scope=view",
            f"photons.budget={most}",
            f"photons.nested={fewer}",
            "products.visibility=false",
            "products.view_truth=false",
            f"products.counts={'false' if light == 'full-light' else 'true'}",
            f"products.radiance={'mosaic' if light == 'full-light' else 'none'}",
        ]
        if light == "frames":
            settings += [f"sensor.frames={self.definition.frames}", "sensor.bits=1", "products.frames=true"]
        return load_recipe(scene.recipe, settings)[0]
