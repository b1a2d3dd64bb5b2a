"""Scores of a method on the public benchmark: of one that is run here, or of maps that were made elsewhere.

Both are an evaluation with a submission.json beside it, which says whose they are, and small pictures.
Photons, frames and full light of a scene are datasets of their own, and one scene in the frame.
"""

import json
import resource
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base.errors import InputError
from pcii.base.executor import THIS_PROCESS, Executor
from pcii.base.progress import Report, silent
from pcii.base.safe_files import write_bytes_safely, write_json_safely
from pcii.evaluation.comparison import Evaluation
from pcii.evaluation.measurement import EvaluationJob, measure
from pcii.evaluation.method_names import depth_name, estimator_of, named_method
from pcii.evaluation.pages import write_evaluation
from pcii.evaluation.provenance import origin_of
from pcii.evaluation.rows import Row, frame_of, writing_rows
from pcii.evaluation.submissions import SUBMISSION, read_maps, read_submission, tasks_of_submission
from pcii.evaluation.tasks import Task, lights_of, tasks_of
from pcii.figures.exposure import block_px
from pcii.figures.pictures import depth_image, photo_bytes
from pcii.figures.plots import depth_limits_mm
from pcii.metrics.true_masks import TrueFocus
from pcii.sections.reconstruction import reconstruct
from pcii.store.collection import (
    BENCHMARK_FIELDS,
    Collection,
    Half,
    is_collection,
    open_collection,
    read_collection,
)
from pcii.store.dataset import FULL_LIGHT, Dataset, budget_of
from pcii.store.suggested_depths import planes_of
from pcii.types.estimates import DepthMap, Segmented
from pcii.types.truth import Truth

TYPICAL_PHOTONS = 1000.0
"""Photons per view at which scenes and times are compared, and pictures made: those of the paper."""
PICTURES = "pictures"
"""Folder of the pictures in that of a submission."""
MAX_PICTURE_PX = 176
"""Longer side of one map: six pairs stand side by side on the page, and two on a phone."""
GAP_PX = 4
"""Between the truth and the result."""


@dataclass(frozen=True)
class BenchmarkHalf:
    """The datasets of one half of a benchmark: its name, and by dataset the scene and that in full light.

    `first_draws` are the datasets that are the first draw of a scene's photons.
    """

    benchmark: str
    half: Half
    datasets: Sequence[Dataset]
    full_light: Mapping[str, Dataset]
    first_draws: Mapping[str, str]


def open_benchmark(path: Path, half: Half) -> BenchmarkHalf:
    """Open one half of a benchmark; `InputError` for a folder that is none, and if a dataset is damaged."""
    fault = InputError(f"{path}: is no benchmark; make one with `simgen benchmark make`")
    if not is_collection(path):
        raise fault
    about = read_collection(path)
    if about.fields != [*BENCHMARK_FIELDS]:
        raise fault
    collection = open_collection(path)
    chosen: Collection = collection[[row["values"]["half"] == half for row in collection.rows]]
    if not len(chosen):
        raise InputError(f"{path}: has no dataset of the {half} half; `simgen benchmark make` makes it")
    datasets = list(chosen)
    scenes = {row["path"]: row["values"]["name"] for row in chosen.rows}
    lights = {row["path"]: row["values"]["light"] for row in chosen.rows}
    lit = {scenes[each.name]: each for each in datasets if lights[each.name] == FULL_LIGHT}
    first_draws: dict[str, str] = {}
    for name, scene in scenes.items():
        if lights[name] == "photons" and scene not in first_draws.values():
            first_draws[name] = scene
    full_light = {name: lit[scene] for name, scene in scenes.items() if scene in lit}
    return BenchmarkHalf(about.recipe["name"], half, datasets, full_light, first_draws)


class BenchmarkJob(EvaluationJob):
    """The job of scoring `tasks` of half a benchmark, with a picture of each scene at `TYPICAL_PHOTONS`.

    Methods are run; with `maps`, a folder of results that were made elsewhere, those are read instead.
    """

    def __init__(
        self, tasks: Sequence[Task], out: Path, data: BenchmarkHalf, maps: Path | None = None
    ) -> None:
        super().__init__(tasks)
        self.out, self.maps = out.resolve(), maps
        self.full_light, self.first_draws = data.full_light, data.first_draws

    def full_light_of(self, task: Task) -> Dataset:
        """The dataset in full light of the same scene."""
        return self.full_light.get(task.dataset.name, task.dataset)

    def estimate(self, task: Task, data: Dataset) -> tuple[float | None, Segmented | DepthMap]:
        """Seconds (None of maps) and result of a task, whose picture is written if the page may show it."""
        if self.maps is None:
            seconds, estimate = super().estimate(task, data)
        else:
            seconds, estimate = None, read_maps(self.maps, task)
            if not isinstance(estimate, DepthMap):
                sections = reconstruct(data.counts, planes_of(data, ()))
                estimate = Segmented(estimate, task.method.name, sections)
        scene = self.first_draws.get(task.dataset.name)
        if scene is not None and task.light == TYPICAL_PHOTONS and data.truth is not None:
            measure = "bad_1px" if isinstance(estimate, DepthMap) else "iou"
            picture = photo_bytes(_picture_of(estimate, data.truth))
            write_bytes_safely(self.out / picture_name(measure, scene), picture)
        return seconds, estimate


def picture_name(measure: str, scene: str) -> str:
    """Path of a scene's picture in the folder of a submission, by what methods are compared by."""
    return f"{PICTURES}/{'object' if measure == 'iou' else 'depth'}_{scene}.webp"


def _picture_of(result: Segmented | DepthMap, truth: Truth) -> np.ndarray:
    """The truth and beside it the result, near is bright: 8-bit RGB (H, W, 3).

    Masks have the colour of their plane's depth; where they overlap that of the nearest.
    """
    if isinstance(result, DepthMap):
        true, estimate, confidence = truth.z_mm, result.z_mm, result.confidence
        of_interest = truth.object_z_mm  # a backdrop far behind would leave the objects one colour
    else:
        of_objects = TrueFocus(result.sections.planes, truth).by_object
        true, estimate = (_plane_depth(masks, result.z_mm) for masks in (of_objects, result.in_focus))
        confidence, of_interest = None, true
    limits = depth_limits_mm(of_interest) or depth_limits_mm(estimate) or (0.0, 1.0)
    step = block_px(true.shape, MAX_PICTURE_PX)
    few = np.s_[::step, ::step]  # single pixels: depths have no mean
    left = depth_image(true[few], *limits)
    right = depth_image(estimate[few], *limits, None if confidence is None else confidence[few])
    return np.hstack([left, np.full((left.shape[0], GAP_PX, 3), 255, np.uint8), right])


def _plane_depth(masks: np.ndarray, z_mm: np.ndarray) -> np.ndarray:
    """Depth (H, W) of the nearest plane whose mask (Z, H, W) has a pixel; NaN where none has."""
    depth = np.where(masks, z_mm[:, None, None], np.inf).min(axis=0)
    return np.where(np.isfinite(depth), depth, np.nan)


def run_method(
    method: str,
    data: BenchmarkHalf,
    out: Path,
    *,
    budgets: Sequence[str] = (),
    executor: Executor = THIS_PROCESS,
    report: Report = silent,
) -> Evaluation:
    """Score a method on one half of a benchmark, in the folder `out`.

    `method` is a name, as of `pcii.evaluate`. Without `budgets` it is scored at all light that there is. Rows
    that are in the folder already are kept, as by `evaluate`. Raises `InputError` for a method that is not
    there, for budgets that no dataset has, and as `evaluate` does.
    """
    named = named_method(method)
    chosen = {budget_of(each) for each in budgets}
    tasks: list[Task] = []
    for dataset in data.datasets:
        lights = [
            light
            for light in lights_of(dataset)
            if light is not None
            and (not chosen or light in chosen)
            and named.takes(full_light=light == FULL_LIGHT)
        ]
        if lights:
            tasks += tasks_of([dataset], [named], lights)
    if not tasks:
        words = " or ".join(budgets) or "light that it takes"
        raise InputError(f"budget: no dataset of the {data.half} half that {method!r} can take has {words}")
    about = {"method": named.name, "made": "run by pcii benchmark run", "command_name": named.command_name}
    return _score(BenchmarkJob(tasks, out, data), data, about, executor, report)


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
    about = submission.model_dump(exclude_none=True) | {"made": "scored from maps by pcii benchmark score"}
    return _score(BenchmarkJob(tasks, out, data, folder.resolve()), data, about, executor, report)


def _score(
    job: BenchmarkJob, data: BenchmarkHalf, about: Mapping[str, Any], executor: Executor, report: Report
) -> Evaluation:
    """Measure what is missing, and write the evaluation with what there is to say about the submission."""
    out, name = job.out, estimator_of(about["method"]) or about["method"]
    names = {about["method"]} if job.maps is None else {name, depth_name(name)}
    with writing_rows(out) as file:
        others = {row["method"] for row in file.rows.values()} - names
        if others:
            raise InputError(f"{out}: holds scores of {min(others)!r}; name another folder")
        made_again = measure(job, file, executor, report)
        entry = {"benchmark": data.benchmark, **about, "half": data.half}
        if job.maps is None:
            kinds = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
            memory_kb = max(resource.getrusage(kind).ru_maxrss for kind in kinds)
            entry["peak_memory_mb"] = round(memory_kb / 1024)
        write_json_safely(out / SUBMISSION, entry)
        rows = list(file.rows.values())
        evaluation = Evaluation(out, frame_of(by_scene(rows)), origin_of(rows), made_again)
        write_evaluation(out, evaluation.frame, evaluation.origin, (SUBMISSION, PICTURES))
    return evaluation


def by_scene(rows: Sequence[Row]) -> list[Row]:
    """Rows whose datasets belong to one scene of the frame if their titles are the same, in any light."""
    return [row | {"recipe": row["title"]} for row in rows]


def read_scores(folder: Path) -> dict[str, Any]:
    """What submission.json says in a folder of scores; `InputError` if it is damaged."""
    try:
        about = json.loads((folder / SUBMISSION).read_text(encoding="utf-8"))
        return {**about, **{name: str(about[name]) for name in ("benchmark", "half", "method", "made")}}
    except (ValueError, TypeError, KeyError, OSError):
        raise InputError(f"{folder / SUBMISSION}: damaged; score the submission again") from None
