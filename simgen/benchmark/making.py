"""Making a benchmark: all of its datasets as one collection, and the certificate of what they are."""

import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from pcii.base.errors import InputError
from pcii.base.executor import ALONE, Executor
from pcii.base.progress import Report, silent
from pcii.io.collection import open_collection
from pcii.io.collection_layout import Half
from pcii.store.hashes import hash_json
from pcii.store.safe_files import write_json_safely
from simgen.base.strict_models import suggestion
from simgen.benchmark.benchmark_datasets import BenchmarkDatasets
from simgen.benchmark.certificate import Content, Verdict, compare, content_of
from simgen.benchmark.definition import Definition
from simgen.benchmark.reference_method import Scores, differing_scores, reference_scores
from simgen.collection.whole_collection import generate_collection
from simgen.dataset.software import versions
from simgen.renderer import backend

CERTIFICATE = "certificate.json"


def scenes_of(definition: Definition, half: Half | None, names: tuple[str, ...]) -> tuple[str, ...]:
    """The scenes of one half, and of these names if any are given; `InputError` for one that is not there."""
    known = [scene.name for scene in definition.scene]
    for name in names:
        if name not in known:
            raise InputError(f"scene: {definition.name} has no {name!r}{suggestion(name, known)}")
    of_half = [scene.name for scene in definition.scene if half in (None, scene.half)]
    chosen = tuple(name for name in of_half if not names or name in names)
    if not chosen:
        raise InputError(f"scene: none of these scenes is in the {half} half")
    return chosen


def make_benchmark(
    definition: Definition,
    file: Path,
    out: Path,
    *,
    half: Half | None = None,
    names: tuple[str, ...] = (),
    executor: Executor = ALONE,
    report: Report = silent,
) -> list[str]:
    """Make the datasets of a benchmark in the folder `out`, or go on with them; faults of those that failed.

    `file` is that of the definition; `half` and `names` choose scenes, and others may follow in the same
    folder. Raises `InputError` as `generate_collection` does.
    """
    datasets = BenchmarkDatasets(definition, file.parent.parent, scenes_of(definition, half, names))
    return generate_collection(datasets, out, executor, report)


def certify(definition: Definition, file: Path, out: Path, report: Report = silent) -> Verdict:
    """Compare all datasets in `out` with the published ones, and write the certificate there.

    Only where their bytes differ, or where nothing is published, a simple method is scored on them too.
    """
    own: dict[str, Content] = {}
    collection = open_collection(out)
    for row, dataset in zip(collection.rows, collection, strict=True):
        own[row["path"]] = content_of(dataset)
        report("certificate", len(own), len(collection))
    published = published_certificate(file)
    verdict = compare(own, published.get("datasets", {}))
    scores: Scores = {}
    if verdict.same_bytes < verdict.compared:
        scores = reference_scores(out, dict.fromkeys(row["values"]["half"] for row in collection.rows))
        problems = differing_scores(scores, published.get("reference_scores", {}))
        verdict = replace(verdict, problems=(*verdict.problems, *problems))
    document = {
        "benchmark": definition.name,
        "definition_sha256": hash_json(definition.model_dump(mode="json")),
        "verdict": verdict.sentence(),
        "backend": backend.describe(),
        "versions": versions(),
        **asdict(verdict),
        "reference_scores": scores,
        "datasets": own,
    }
    write_json_safely(out / CERTIFICATE, document)
    return verdict


def published_certificate(file: Path) -> dict[str, Any]:
    """The certificate of the published datasets: a file beside that of the definition; empty without one."""
    published = file.with_suffix(f".{CERTIFICATE}")
    return json.loads(published.read_text()) if published.is_file() else {}
