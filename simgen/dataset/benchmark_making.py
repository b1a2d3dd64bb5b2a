"""Making the public benchmark: all of its datasets as one collection, and their certificate."""

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from pcii.base.errors import InputError
from pcii.base.executor import THIS_PROCESS, Executor
from pcii.base.progress import Report, silent
from pcii.base.safe_files import write_json_safely
from pcii.store.benchmark_layout import (
    CERTIFICATE,
    Content,
    Definition,
    Verdict,
    compare,
    content_of,
    published_certificate,
)
from pcii.store.collection import BENCHMARK_FIELDS, IN_FRAMES, Half, open_collection
from pcii.store.folders import hash_json
from simgen.base.file_lookup import find_all
from simgen.base.strict_models import read_toml, suggestion, validate
from simgen.dataset.dataset_collection import generate_collection
from simgen.dataset.dataset_folder import versions
from simgen.renderer import backend
from simgen.spec.recipe import Recipe, load_recipe


def benchmark_files() -> dict[str, Path]:
    """Files of the benchmarks that ship, by name."""
    return {file.stem: file for file in find_all("data_recipes/benchmarks/*.toml")}


def load_definition(name_or_path: str) -> tuple[Definition, Path]:
    """A benchmark by name or path of its file, and that file; `InputError` if it is missing or wrong."""
    files = benchmark_files()
    file = files.get(name_or_path, Path(name_or_path))
    if not file.is_file():
        raise InputError(f"benchmark: there is no {name_or_path!r}{suggestion(name_or_path, list(files))}")
    return validate(Definition, read_toml(file), str(file)), file


class BenchmarkSeries:
    """The datasets of a benchmark as a series of one collection; with `scenes`, those of these names only."""

    fields = BENCHMARK_FIELDS

    def __init__(
        self, definition: Definition, recipe_folder: Path, scenes: tuple[str, ...] | None = None
    ) -> None:
        self.definition, self.recipe_folder = definition, recipe_folder
        self.base = definition.model_dump(mode="json")
        self.datasets = definition.datasets(scenes)

    def __len__(self) -> int:
        return len(self.datasets)

    def values(self, number: int) -> Mapping[str, Any]:
        """What distinguishes a dataset from the others."""
        return self.datasets[number].values

    def folder(self, number: int) -> str:
        """Name of a dataset's folder."""
        return self.datasets[number].folder

    def recipe(self, number: int) -> Recipe:
        """The recipe of a dataset; `InputError` if the definition makes none."""
        scene, light, seed = self.datasets[number]
        definition = self.definition
        is_brighter = scene.brighter and seed == definition.seeds[0]
        brighter = definition.brighter_photons_per_view if is_brighter else ()
        *fewer, most = *definition.photons_per_view, *brighter
        settings = [
            *definition.set,
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
            settings += [f"sensor.frames={definition.frames}", "sensor.bits=1", "products.frames=true"]
        return load_recipe(scene.recipe, settings)[0]


def make_benchmark(
    definition: Definition,
    file: Path,
    out: Path,
    *,
    half: Half | None = None,
    names: tuple[str, ...] = (),
    executor: Executor = THIS_PROCESS,
    report: Report = silent,
) -> list[str]:
    """Make the datasets of a benchmark in the folder `out`, or go on with them; faults of those that failed.

    `file` is that of the definition; `half` and `names` choose scenes, and others may follow in the same
    folder. Raises `InputError` for a name that is not there, for a half that has none of these scenes, and as
    `generate_collection` does.
    """
    known = [scene.name for scene in definition.scene]
    for name in names:
        if name not in known:
            raise InputError(f"scene: {definition.name} has no {name!r}{suggestion(name, known)}")
    of_half = [scene.name for scene in definition.scene if half in (None, scene.half)]
    scenes = tuple(name for name in of_half if not names or name in names)
    if not scenes:
        raise InputError(f"scene: none of these scenes is in the {half} half")
    series = BenchmarkSeries(definition, file.parent.parent, scenes)
    return generate_collection(series, out, executor, report)


def certify(definition: Definition, file: Path, out: Path, report: Report = silent) -> Verdict:
    """Compare all datasets in `out` with the published ones, and write the certificate there."""
    own: dict[str, Content] = {}
    collection = open_collection(out)
    for row, dataset in zip(collection.rows, collection, strict=True):
        own[row["path"]] = content_of(dataset)
        report("certificate", len(own), len(collection))
    verdict = compare(own, published_certificate(file).get("datasets", {}))
    document = {
        "benchmark": definition.name,
        "definition_sha256": hash_json(definition.model_dump(mode="json")),
        "verdict": verdict.sentence(),
        "backend": backend.describe(),
        "versions": versions(),
        **asdict(verdict),
        "datasets": own,
    }
    write_json_safely(out / CERTIFICATE, document)
    return verdict
