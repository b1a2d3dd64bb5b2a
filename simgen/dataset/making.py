"""Making a benchmark: all of its datasets as one collection, and the certificate of what they are."""

import json
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from pcii.base.errors import InputError
from pcii.base.executor import ALONE, Executor
from pcii.base.progress import Report, silent
from pcii.io.collection import open_collection
from pcii.io.collection_layout import Half
from pcii.io.evaluation_layout import read_evaluation
from pcii.store.hashes import hash_json
from pcii.store.safe_files import write_json_safely
from simgen.base.strict_models import suggestion
from simgen.dataset.benchmark_datasets import BenchmarkDatasets
from simgen.dataset.certificate import Content, Verdict, compare, content_of
from simgen.dataset.dataset_collection import generate_collection
from simgen.dataset.dataset_folder import versions
from simgen.dataset.definition import Definition
from simgen.renderer import backend

METHOD = "brightness"
"""In focus is what is bright: the simplest method of removal."""
PHOTONS_PER_VIEW = 1000.0
TOLERANCE = 0.02
"""Means that are closer say nothing: the interval of three draws may be narrow by chance."""
Scores = Mapping[str, Mapping[str, Any]]
"""By scene: `mean` IoU over seeds and its 95 % `interval`."""
CERTIFICATE = "certificate.json"


def reference_scores(benchmark: Path, halves: Iterable[Half]) -> dict[str, Mapping[str, Any]]:
    """IoU of `METHOD` on each scene of these halves; `InputError` if `pcii benchmark run` fails."""
    found: dict[str, Mapping[str, Any]] = {}
    for half in halves:
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / "scores"
            words = ["benchmark", "run", METHOD, "--budget", f"{PHOTONS_PER_VIEW:g}", "--half", half]
            run = "import sys; from pcii.app.commands import main; sys.exit(main())"
            command = [sys.executable, "-c", run, *words, "--data", str(benchmark), "-o", str(out)]
            if subprocess.run(command, stdout=subprocess.DEVNULL).returncode:
                raise InputError(f"certificate: `pcii {' '.join(words)}` failed, as said above")
            for group in read_evaluation(out)["groups"]:
                (result,) = group["results"]
                if (iou := result["object"]["iou"]) is not None and iou["interval"] is not None:
                    found[group["title"]] = {"mean": iou["mean"], "interval": iou["interval"]}
    return found


def differing_scores(own: Scores, published: Scores) -> list[str]:
    """A sentence for each scene whose interval has nothing in common with the published one."""
    problems = []
    for scene in own.keys() & published.keys():
        (low, high), (least, most) = (scores[scene]["interval"] for scores in (own, published))
        apart = abs(own[scene]["mean"] - published[scene]["mean"])
        if (high < least or most < low) and apart > TOLERANCE:
            means = f"{own[scene]['mean']:.3f} instead of {published[scene]['mean']:.3f}"
            problems.append(f"{scene}: the method {METHOD!r} has an IoU of {means} there")
    return sorted(problems)


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
