"""Scores of a method on the public benchmark: of one that is run here, or of maps that were made elsewhere.

Both are an evaluation with a submission.json, which names the authors.
Photons, frames and full light of a scene are separate datasets, and one scene in the frame.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from pcii.base import THIS_PROCESS, Executor, InputError, Report, silent, write_json_safely
from pcii.evaluation.comparison import Evaluation
from pcii.evaluation.evaluation_page import write_evaluation
from pcii.evaluation.measurement import EvaluationJob, Task, measure, tasks_of
from pcii.evaluation.method_names import named_method
from pcii.evaluation.rows import Row, frame_of, origin_of, writing_rows
from pcii.evaluation.submissions import (
    RUN,
    SCORED,
    SUBMISSION,
    ScoredSubmission,
    read_maps,
    read_submission,
    tasks_of_submission,
)
from pcii.sections import planes_of, reconstruct
from pcii.store import (
    BENCHMARK_FIELDS,
    COLLECTION_FOLDER,
    INDEX,
    Collection,
    Dataset,
    Half,
    is_collection,
    open_collection,
    validated,
)
from pcii.types import FULL_LIGHT, DepthMap, Light, Segmented

TYPICAL_PHOTONS = 1000.0
"""Photons per view at which scenes and times are compared: those of the paper."""


@dataclass(frozen=True)
class BenchmarkHalf:
    """The datasets of one half of a benchmark, and by the name of each that in full light of its scene.

    `missing` is how many of the half are not made yet.
    """

    benchmark: str
    half: Half
    datasets: Sequence[Dataset]
    full_light: Mapping[str, Dataset]
    missing: int = 0


def open_benchmark(path: Path, half: Half) -> BenchmarkHalf:
    """Open one half of a benchmark; `InputError` for another folder, and for a damaged dataset."""
    if not is_collection(path) or COLLECTION_FOLDER.read(path).fields != [*BENCHMARK_FIELDS]:
        raise InputError(f"{path}: is no benchmark; make one with `simgen benchmark make`")
    recipe = COLLECTION_FOLDER.read(path).recipe
    advice = f"the same `simgen benchmark make -o {path}` goes on with it"
    if not (path / INDEX).is_file():
        raise InputError(f"{path}: the benchmark is unfinished; {advice}")
    collection = open_collection(path)
    of_half: Collection = collection[[row["values"]["half"] == half for row in collection.rows]]
    if not len(of_half):
        raise InputError(f"{path}: has no dataset of the {half} half yet; {advice}")
    datasets = list(of_half)
    scenes = {row["path"]: row["values"]["name"] for row in of_half.rows}
    bright = {scenes[each.name]: each for each in datasets if each.light == FULL_LIGHT}
    full_light = {name: bright[scene] for name, scene in scenes.items() if scene in bright}
    scenes_of_half = [scene for scene in recipe["scene"] if scene["half"] == half]
    expected = sum(len(recipe["seeds"]) + bool(scene["frames"]) + 1 for scene in scenes_of_half)
    return BenchmarkHalf(recipe["name"], half, datasets, full_light, expected - len(datasets))


class BenchmarkJob(EvaluationJob):
    """The job of scoring `tasks` of half a benchmark.

    Methods are run; with `maps`, a folder of results that were made elsewhere, those are read instead.
    """

    def __init__(self, tasks: Sequence[Task], data: BenchmarkHalf, maps: Path | None = None) -> None:
        super().__init__(tasks)
        self.full_light, self.maps = data.full_light, maps

    def full_light_of(self, task: Task) -> Dataset:
        """The dataset in full light of the same scene."""
        return self.full_light.get(task.dataset.name, task.dataset)

    def estimate(self, task: Task, data: Dataset) -> tuple[float | None, Segmented | DepthMap]:
        """Seconds (None of maps) and result of a task."""
        if self.maps is None:
            return super().estimate(task, data)
        result = read_maps(self.maps, task)
        if isinstance(result, DepthMap):
            return None, result
        return None, Segmented(result, task.method.name, reconstruct(data.counts, planes_of(data, ())))


def run_method(
    method: str,
    data: BenchmarkHalf,
    out: Path,
    *,
    budgets: Sequence[str] = (),
    executor: Executor = THIS_PROCESS,
    report: Report = silent,
    **about: str | None,
) -> Evaluation:
    """Score a method on one half of a benchmark, in the folder `out`.

    `method` is a name, as of `pcii.evaluate`. Without `budgets` it is scored at all light that there is. Rows
    that are in the folder already are kept, as by `evaluate`. `about` are further members of
    submission.json. Raises `InputError` for a method that is not there, for what submission.json cannot have,
    for budgets that no dataset has, and as `evaluate` does.
    """
    named = named_method(method)
    members = {name: text for name, text in about.items() if text}
    members |= {"benchmark": data.benchmark, "method": named.name, "half": data.half}
    submission = validated(ScoredSubmission, members | {"made": RUN, "command_name": method})
    requested = {str(Light.parse(each)) for each in budgets}
    tasks: list[Task] = []
    for dataset in data.datasets:
        lights = [
            light
            for light in dataset.lights
            if (not requested or str(light) in requested) and named.takes(full_light=light == FULL_LIGHT)
        ]
        if lights:
            tasks += tasks_of([dataset], [named], lights)
    if not tasks:
        light = " or ".join(budgets) or "light that it takes"
        raise InputError(f"budget: no dataset of the {data.half} half that {method!r} can take has {light}")
    return _score(BenchmarkJob(tasks, data), submission, out, executor, report)


def score_submission(
    folder: Path,
    data: BenchmarkHalf,
    out: Path,
    *,
    executor: Executor = THIS_PROCESS,
    report: Report = silent,
) -> Evaluation:
    """Score the maps in a folder (see `pcii.evaluation.submissions`) on one half of a benchmark.

    Raises `InputError` for a submission with a fault, before anything is scored.
    """
    submission = read_submission(folder, data.benchmark)
    tasks = tasks_of_submission(folder, data.datasets, submission.method)
    for number, task in enumerate(tasks, start=1):
        read_maps(folder, task)
        report("checks", number, len(tasks))
    scored = ScoredSubmission(**submission.model_dump(), made=SCORED, half=data.half)
    return _score(BenchmarkJob(tasks, data, folder.resolve()), scored, out, executor, report)


def _score(
    job: BenchmarkJob, submission: ScoredSubmission, out: Path, executor: Executor, report: Report
) -> Evaluation:
    """Measure what is missing, and write the evaluation with what there is to say about the submission."""
    with writing_rows(out) as file:
        if others := {row["method"] for row in file.rows.values()}.difference(submission.methods):
            raise InputError(f"{out}: holds scores of {min(others)!r}; name another folder")
        made_again = measure(job, file, executor, report)
        write_json_safely(out / SUBMISSION, submission.model_dump(exclude_none=True))
        rows = list(file.rows.values())
        evaluation = Evaluation(out, frame_of(by_scene(rows)), origin_of(rows), made_again)
        write_evaluation(out, evaluation.frame, evaluation.origin, (SUBMISSION,))
    return evaluation


def by_scene(rows: Sequence[Row]) -> list[Row]:
    """Rows whose datasets belong to one scene of the frame if their titles are the same, in any light."""
    return [row | {"recipe": row["title"]} for row in rows]
