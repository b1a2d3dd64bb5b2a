"""The public benchmark: its definition, all of its datasets made as one collection, and their certificate.

The definition is one TOML file, and what it holds never changes under one name: other scenes, cameras or
light make another benchmark. On the same kind of machine the datasets have the bytes that were published.
Others (of another vector width, say) round otherwise, so that some light paths end elsewhere and the
photons are other draws of the same light. Then photons are compared in tiles of the film: with a and b
photons in a tile the sum of (a - b)^2 / (a + b) has a chi-square distribution, with as many degrees of
freedom as there are tiles with photons. Radiance in other bytes is not compared.
"""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, StringConstraints, model_validator

from pcii.base import THIS_PROCESS, Executor, InputError, Report, silent, write_json_safely
from pcii.store import (
    BENCHMARK_FIELDS,
    CERTIFICATE,
    CROISSANT,
    IN_FRAMES,
    INDEX,
    MANIFEST,
    RADIANCE,
    Dataset,
    Half,
    Terms,
    hash_file,
    hash_json,
    open_collection,
    read_index,
    write_card,
    write_licence,
)
from simgen.base import Positive, Strict, find_all, read_toml, suggestion, validate
from simgen.dataset.dataset_collection import generate_collection
from simgen.dataset.prepared import versions
from simgen.renderer import backend
from simgen.spec import Publication, Recipe, load_recipe

Kind = Literal["separate", "touching", "cluttered", "room", "leaning", "glossy", "nothing"]
Name = Annotated[str, StringConstraints(pattern=r"^[a-z0-9]+(-[a-z0-9]+)*$", max_length=40)]
TILE_PX = 64
MIN_P = 1e-4
"""The share of benchmarks of the same light that are taken for other ones, by any of their datasets."""
Content = Mapping[str, Any]
"""Of a dataset: a hash of its files, and its photons in each view and each tile."""
CROISSANT_CONTEXT: dict[str, Any] = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    "sc": "https://schema.org/",
    "cr": "http://mlcommons.org/croissant/",
    "dct": "http://purl.org/dc/terms/",
    "conformsTo": "dct:conformsTo",
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    **{
        term: f"cr:{term}"
        for term in ["citeAs", "extract", "field", "fileSet", "includes", "jsonPath", "recordSet", "source"]
    },
}
"""Of the context that Croissant prescribes what is used here."""
CROISSANT_FIELDS = {
    "title": ("sc:Text", "$.title"),
    "scene": ("sc:Text", "$.recipe.scene"),
    "seed": ("sc:Integer", "$.recipe.seed"),
    "identity": ("sc:Text", "$.identity"),
}
"""Of a Croissant record: type, and where a manifest has it."""


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
    photons_per_view: tuple[Positive, ...]
    """From the least light to the most; all photons of less light are among those of more."""
    brighter_photons_per_view: tuple[Positive, ...] = ()
    """More light, of the first seed: images differ little from draw to draw, and take most of the time."""
    seeds: tuple[Annotated[int, Field(ge=0)], ...]
    """Draws of the photons of each scene."""
    frames: Annotated[int, Field(ge=1)]
    """Binary frames into which the exposure is divided, of the scenes that have them."""
    set: tuple[str, ...] = ()
    """Values that differ from the recipes of all scenes."""
    scene: tuple[Scene, ...]
    publication: Annotated[Publication, Field(exclude=True)] = Publication()
    """Terms of all data: no part of what the definition's hash is of, since they change no data."""

    @model_validator(mode="after")
    def _is_whole(self) -> Self:
        if len({scene.name for scene in self.scene}) < len(self.scene):
            raise ValueError("scene: expected a name of its own for each scene")
        photons = [*self.photons_per_view, *self.brighter_photons_per_view]
        if not self.photons_per_view or photons != sorted({*photons}):
            raise ValueError("photons_per_view: expected growing numbers, and larger ones of brighter light")
        if not self.seeds or len({*self.seeds}) < len(self.seeds):
            raise ValueError("seeds: expected at least one, each once")
        return self


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


def load_definition(name_or_path: str) -> tuple[Definition, Path]:
    """A benchmark by name or path of its file, and that file; `InputError` if it is missing or wrong."""
    files = {file.stem: file for file in find_all("data_recipes/benchmarks/*.toml")}
    file = files.get(name_or_path, Path(name_or_path))
    if not file.is_file():
        raise InputError(f"benchmark: there is no {name_or_path!r}{suggestion(name_or_path, list(files))}")
    return validate(Definition, read_toml(file), str(file)), file


class BenchmarkSeries:
    """The datasets of a benchmark as a series of one collection; with `scenes`, those of these names only.

    `datasets` are a scene, the name of its light and the seed of its photons; those of a scene follow each
    other.
    """

    fields = BENCHMARK_FIELDS

    def __init__(
        self, definition: Definition, recipe_folder: Path, scenes: tuple[str, ...] | None = None
    ) -> None:
        self.definition, self.recipe_folder = definition, recipe_folder
        self.base = definition.model_dump(mode="json")
        self.datasets: list[tuple[Scene, str, int]] = []
        first = definition.seeds[0]
        for scene in definition.scene:
            if scenes is None or scene.name in scenes:
                self.datasets += [(scene, "photons", seed) for seed in definition.seeds]
                if scene.frames:
                    self.datasets.append((scene, "frames", first))
                self.datasets.append((scene, "full-light", first))

    def __len__(self) -> int:
        return len(self.datasets)

    def values(self, number: int) -> Mapping[str, Any]:
        """What distinguishes a dataset from the others."""
        scene, light, seed = self.datasets[number]
        return dict(zip(self.fields, (scene.name, scene.kind, scene.half, light, seed), strict=True))

    def folder(self, number: int) -> str:
        """Name of a dataset's folder."""
        scene, light, seed = self.datasets[number]
        return f"{scene.name}_{light}" + ("" if light == "full-light" else f"_{seed}")

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
    faults = generate_collection(series, out, executor, report)
    terms = definition.publication.terms()
    # Of the datasets too, which may be passed on alone.
    for folder in (out, *(out / row["path"] for row in read_index(out))):
        write_card(folder, terms)
        if terms.licence:
            write_licence(folder, terms)
    write_json_safely(out / CROISSANT, _croissant(definition, terms, hash_file(out / INDEX)))
    return faults


def _croissant(definition: Definition, terms: Terms, index_sha256: str) -> dict[str, Any]:
    """Croissant metadata of the collection (mlcommons.org/croissant, 1.0), which catalogues of datasets read.

    Records are the datasets, as their manifests describe them; their arrays are Zarr, which Croissant has no
    way to read. What the terms leave open is left out.
    """

    def node(kind: str, name: str, **members: Any) -> dict[str, Any]:
        return {"@type": kind, "@id": name, "name": name, **members}

    file_sets = {
        "manifests": (f"*/{MANIFEST}", "application/json"),
        "arrays": ("*/*.zarr/**", "application/vnd.zarr"),
        "radiance": (f"*/{RADIANCE}/*.exr", "image/x-exr"),
    }
    stated = {
        "license": terms.licence and terms.address,
        "url": terms.url,
        "citeAs": terms.citation,
        "creator": [{"@type": "sc:Organization", "name": creator} for creator in terms.creators],
    }
    fields = [
        node(
            "cr:Field",
            f"datasets/{field}",
            dataType=kind,
            source={"fileSet": {"@id": "manifests"}, "extract": {"jsonPath": place}},
        )
        for field, (kind, place) in CROISSANT_FIELDS.items()
    ]
    index = {"contentUrl": INDEX, "encodingFormat": "application/jsonlines", "sha256": index_sha256}
    return {
        "@context": CROISSANT_CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": "http://mlcommons.org/croissant/1.0",
        "name": definition.name,
        "description": definition.title,
        **{key: value for key, value in stated.items() if value},
        "distribution": [
            node("cr:FileObject", "index", **index),
            *(
                node("cr:FileSet", key, includes=pattern, encodingFormat=kind)
                for key, (pattern, kind) in file_sets.items()
            ),
        ],
        "recordSet": [node("cr:RecordSet", "datasets", field=fields)],
    }


def _content_of(dataset: Dataset) -> Content:
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


def compare(datasets: Mapping[str, Content], published: Mapping[str, Content]) -> Verdict:
    """Compare datasets by name with the published ones: their bytes, and photons where those differ."""
    problems = [f"{name}: is not in the published benchmark" for name in datasets if name not in published]
    pairs = {name: (content, published[name]) for name, content in datasets.items() if name in published}
    others = {name: pair for name, pair in pairs.items() if pair[0]["sha256"] != pair[1]["sha256"]}
    tests = {name: _photons_p(*pair) for name, pair in others.items() if "tiles" in pair[0]}
    corrected = {name: min(1.0, p * len(tests)) for name, p in tests.items()}
    problems += [
        f"{name}: its photons lie elsewhere than the published ones (p = {p:.2g})"
        for name, p in corrected.items()
        if p < MIN_P
    ]
    least_p = min(corrected.values(), default=1.0)
    return Verdict(len(datasets), len(pairs) - len(others), least_p, tuple(problems))


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


def certify(definition: Definition, file: Path, out: Path, report: Report = silent) -> Verdict:
    """Compare all datasets in `out` with the published ones, and write the certificate there."""
    contents: dict[str, Content] = {}
    collection = open_collection(out)
    for row, dataset in zip(collection.rows, collection, strict=True):
        contents[row["path"]] = _content_of(dataset)
        report("certificate", len(contents), len(collection))
    published = file.with_suffix(f".{CERTIFICATE}")  # that of the published datasets, if they are
    known = json.loads(published.read_text())["datasets"] if published.is_file() else {}
    verdict = compare(contents, known)
    document = {
        "benchmark": definition.name,
        "definition_sha256": hash_json(definition.model_dump(mode="json")),
        "verdict": verdict.sentence(),
        "backend": backend.describe(),
        "versions": versions(),
        **asdict(verdict),
        "datasets": contents,
    }
    write_json_safely(out / CERTIFICATE, document)
    return verdict
