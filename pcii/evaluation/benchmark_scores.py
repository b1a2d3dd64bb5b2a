"""Scores of a method on the public benchmark: of one that is run here, or of maps that were made elsewhere.

Both are an evaluation with a submission.json, which names the authors. Photons, frames and full light of a
scene are separate datasets, and one scene in the frame. Results made elsewhere are a folder:

    submission.json                   whose they are: see `Submission`
    ramp_photons_1/1000/depth.npz     z_mm (H, W) in mm, not finite where there is no answer, and, if there is
                                      one, confidence (H, W) from 0 to 1
                       /masks.npz     in_focus (Z, H, W), 0 or 1, at the depths of the dataset, in their order

The first folder is that of the dataset; the second says from how many photons per view, or "full-light".
"""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base import THIS_PROCESS, Executor, InputError, Report, silent, write_json_safely
from pcii.evaluation.comparison import Evaluation, EvaluationJob, Task, measure, tasks_of
from pcii.evaluation.evaluation_page import write_evaluation
from pcii.evaluation.method_names import (
    RUN,
    SCORED,
    SUBMISSION,
    NamedMethod,
    ScoredSubmission,
    Submission,
    depth_name,
    estimator_of,
    named_method,
    read_submission,
)
from pcii.evaluation.rows import by_scene, frame_of, origin_of, writing_rows
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

DEPTH_MAP, MASKS = "depth.npz", "masks.npz"
MIN_MM, MAX_MM = 1e-3, 1e12
"""Nearest and farthest depth of an answer: errors of others overflow."""


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
        super().__init__(tasks, data.full_light)
        self.maps = maps

    def estimate(self, task: Task, data: Dataset) -> tuple[float | None, Segmented | DepthMap]:
        """Seconds (None of maps) and result of a task."""
        if self.maps is None:
            return super().estimate(task, data)
        result = _read_maps(self.maps, task)
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
    """Score the maps in a folder on one half of a benchmark.

    Raises `InputError` for a submission with a fault, before anything is scored.
    """
    submission = read_submission(folder, Submission)
    if submission.benchmark != data.benchmark:
        raise InputError(
            f"{folder / SUBMISSION}: benchmark: is {submission.benchmark!r}, but the data are of "
            f"{data.benchmark!r}"
        )
    tasks = _tasks_of_submission(folder, data.datasets, submission.method)
    for number, task in enumerate(tasks, start=1):
        _read_maps(folder, task)
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


def _read_as_maps(*_: Any) -> Any:
    raise AssertionError("maps are read, not computed")


def _tasks_of_submission(folder: Path, datasets: Sequence[Dataset], method: str) -> list[Task]:
    """The tasks that a submission has results of.

    Whatever light it has masks or depth of, it has them of all datasets that have this light: else raises
    `InputError`, as for files that are no result of a dataset and its light. Warns of other files.
    """
    possible = {
        folder / dataset.name / str(light) / file: Task(dataset, light, NamedMethod(name, _read_as_maps))
        for dataset in datasets
        for light in dataset.lights
        for file, name in ((MASKS, method), (DEPTH_MAP, depth_name(method)))
        if file == DEPTH_MAP or light != FULL_LIGHT
    }
    present = {*folder.glob("*/*/[!.]*")}
    for file in sorted(present):
        if file not in possible or not file.resolve().is_relative_to(folder.resolve()):
            raise InputError(
                f"{file}: is no result of this half, or a link out of the folder; expected files "
                f"DATASET/LIGHT/{DEPTH_MAP} or {MASKS}"
            )
    tasks = {file: possible[file] for file in possible if file in present}
    others = sorted({*folder.glob("[!.]*"), *folder.glob("*/[!.]*")} - {folder / SUBMISSION})
    if names := ", ".join(str(file.relative_to(folder)) for file in others if not file.is_dir()):
        warnings.warn(f"{folder}: not used: {names}", stacklevel=2)
    if not tasks:
        raise InputError(f"{folder}: has no results of a dataset of this half")
    kinds = {(task.light, task.method.name) for task in tasks.values()}
    for file, task in possible.items():
        if file not in tasks and (task.light, task.method.name) in kinds:
            raise InputError(f"{file}: is missing, and of this light it is needed of all datasets")
    return list(tasks.values())


def _read_maps(folder: Path, task: Task) -> np.ndarray | DepthMap:
    """Depth, or masks (Z, H, W) bool, of a task in a submission; `InputError`, naming the file."""
    inside, shape = folder / task.dataset.name / str(task.light), task.dataset.grid.shape_HW
    if estimator_of(task.method.name) is not None:
        return _read_depth(inside / DEPTH_MAP, shape)
    shapes = {"in_focus": (len(planes_of(task.dataset, ()).z_mm), *shape)}
    masks = _read_arrays(inside / MASKS, shapes)["in_focus"]
    if not np.isin(masks, (0, 1)).all():
        raise InputError(f"{inside / MASKS}: in_focus: expected 0 and 1, or bool")
    return masks.astype(bool)


def _read_depth(file: Path, shape: tuple[int, int]) -> DepthMap:
    arrays = _read_arrays(file, {"z_mm": shape, "confidence": shape})
    has_answer = np.isfinite(arrays["z_mm"])
    z_mm = np.where(has_answer, arrays["z_mm"], np.nan).astype(np.float64)
    if ((z_mm < MIN_MM) | (z_mm > MAX_MM)).any():
        raise InputError(f"{file}: z_mm: expected {MIN_MM:g} to {MAX_MM:g} mm, or NaN for no answer")
    confidence = arrays.get("confidence", has_answer)
    if not ((confidence >= 0) & (confidence <= 1)).all():
        raise InputError(f"{file}: confidence: expected numbers from 0 to 1, also where there is no depth")
    return DepthMap(z_mm, np.where(has_answer, confidence, 0.0).astype(np.float64))


def _read_arrays(file: Path, shapes: Mapping[str, tuple[int, ...]]) -> dict[str, np.ndarray]:
    """Arrays of an .npz file with these shapes, the first of which is needed; else raises `InputError`."""
    first, *_ = shapes
    described = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
    try:
        with np.load(file, allow_pickle=False) as archive:
            arrays = {name: np.asarray(archive[name]) for name in archive.files}  # what is no array is bytes
    except Exception:  # damaged archives raise various exceptions, whose advice is to trust the file
        raise InputError(f"{file}: damaged, or no .npz file of numbers as numpy.savez writes it") from None
    is_right = (
        array.shape == shapes.get(name) and array.dtype.kind in "fiub" for name, array in arrays.items()
    )
    if first not in arrays or not all(is_right):
        raise InputError(f"{file}: expected numbers {described}, of which {first} is needed")
    return arrays
