"""Methods compared over many datasets: each dataset, budget and method is scored and timed once."""

import pickle
import re
from collections import defaultdict
from collections.abc import Mapping, Sequence
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from pcii.base.errors import InputError
from pcii.base.executor import THIS_PROCESS, Executor
from pcii.base.progress import Report, silent
from pcii.base.safe_files import named_in_errors
from pcii.depth.methods import estimate_depth
from pcii.evaluation.evaluation_pages import write_evaluation
from pcii.evaluation.method_names import Function, Method, estimator_of, named_functions
from pcii.evaluation.provenance import machine, software_of
from pcii.evaluation.rows import (
    Budget,
    Key,
    Row,
    all_rows,
    append_row,
    claim_rows,
    described,
    identity_of,
    key_of,
)
from pcii.evaluation.summary import summarise
from pcii.evaluation.tasks import Task, tasks_of
from pcii.evaluation.timing import timed
from pcii.metrics.bounds import object_bounds
from pcii.metrics.scoring import score
from pcii.removal.methods import segment
from pcii.sections.reconstruction import reconstruct
from pcii.store.collection import is_collection, read_index
from pcii.store.dataset import Dataset, open_dataset
from pcii.store.dataset_layout import MANIFEST, MARKER
from pcii.store.software import differences
from pcii.store.suggested_depths import depth_range_of, planes_of
from pcii.types.estimates import DepthMap, Segmented
from pcii.types.images import Views
from pcii.types.photon_counts import PhotonCounts
from pcii.types.section_stack import Sections


def evaluate(
    datasets: Sequence[str | Path],
    out: str | Path,
    *,
    methods: Sequence[Method] = (),
    budgets: Sequence[float | str] = (),
    z_mm: Sequence[float] = (),
    executor: Executor = THIS_PROCESS,
    report: Report = silent,
) -> dict[str, Any]:
    """Score methods on datasets and compare them; returns the figures of evaluation.json (`summarise`).

    `datasets` are dataset folders, collections, or folders of dataset folders. `methods` are those of
    `pcii.removal_methods()`, and those of `pcii.depth_methods()` as "depth:NAME"; "depth" is the default one
    of depth; or functions of one's own: of removal, or of depth as pairs ("depth:NAME", function), which are
    measured every time, since nobody knows what they follow from. Without, all that can take the data.
    `budgets` default to all that each dataset has; among them "full-light", its radiance, which some methods
    of depth take. `z_mm` are depths to look at instead of those that recipes name. `executor` does the work.

    Rows are added to out/rows.jsonl as they are measured, and rows already in it are not measured again
    unless other software made them (see `pcii.store.software`): `again` in the result says how many
    were, of which methods, and why. evaluation.json, .html and .md summarise the last row of each. The
    seconds of a row are the wall time of the method alone, after a warm-up call, in a call in which no code
    was compiled or imported; where several processes work at a time, each is slower. Raises `InputError` for
    a dataset without truth, depths, or counts and radiance, for an unknown method or budget, and for a named
    method that cannot take the data of a dataset:

    >>> evaluate(["out/no-such-dataset"], "out/compared")
    Traceback (most recent call last):
    pcii.base.errors.InputError: out/no-such-dataset: there is no such dataset folder

    With datasets of `simgen generate RECIPE -o out/twenty --seeds 20`, the mean IoU of the first method is
    `evaluate(["out/twenty"], "out/compared")["groups"][0]["results"][0]["object"]["iou"]["mean"]`.
    """
    folder = Path(out)
    named = named_functions(methods)
    if executor != THIS_PROCESS:
        _check_sendable(named)
    tasks = tasks_of([open_dataset(path) for path in find_datasets(datasets)], named, budgets, z_mm)
    again = measure(EvaluationJob(tasks, folder.resolve()), executor, report)
    report("pages", 0, 1)
    with all_rows(folder) as rows, named_in_errors(folder):
        result = summarise(rows) | {"again": again}
        write_evaluation(folder, result)
    report("pages", 1, 1)
    return result


def measure(job: "EvaluationJob", executor: Executor, report: Report) -> list[dict[str, Any]]:
    """Add the rows of a job's tasks to those in its folder, but for those that are there and still count.

    Returns which had to be made again, and why. Raises `InputError` for what `claim_rows` refuses, and for a
    task that fails.
    """
    claim_rows(job.out)
    with all_rows(job.out) as rows:
        made_by = {key_of(row): row.get("software") for row in rows}
    tasks = job.tasks
    software = {task.method: _software(task) for task in {task.method: task for task in tasks}.values()}
    remaining = [
        number
        for number, task in enumerate(tasks)
        if task.function or made_by.get(task.key) != software[task.method]
    ]
    if len(remaining) < len(tasks):
        kept = len(tasks) - len(remaining)
        report("scores of an earlier run", kept, kept)
    again = _again([tasks[number] for number in remaining], made_by, software)
    for entry in again:
        report(f"scores to make again, since {entry['why']}", entry["rows"], entry["rows"])
    if remaining:
        report("scores", 0, len(remaining))
    with closing(executor.run(job, remaining, report)) as work:
        for finished, _ in enumerate(work, start=1):
            report("scores", finished, len(remaining))
    return again


def _software(task: Task) -> dict[str, str] | None:
    """What the row of a task follows from; of a function nobody knows."""
    return None if task.function else software_of(task.method)


def _again(
    remaining: Sequence[Task],
    made_by: Mapping[Key, Mapping[str, str] | None],
    software: Mapping[str, Mapping[str, str] | None],
) -> list[dict[str, Any]]:
    """Which of the remaining tasks have a row already, by why that does not count any more."""
    methods: dict[str, list[str]] = defaultdict(list)
    for task in remaining:
        if task.key in made_by:
            methods[differences(made_by[task.key], software[task.method])].append(task.method)
    return [{"why": why, "rows": len(names), "methods": sorted(set(names))} for why, names in methods.items()]


def _check_sendable(methods: Mapping[str, Function | None]) -> None:
    """Raise `InputError` for a function that other processes cannot be given."""
    for name, function in methods.items():
        try:
            pickle.dumps(function)
        except Exception as fault:  # of objects of others, whatever they raise
            raise InputError(
                f"methods: {name!r} cannot be sent to other processes; define it at the top of a module, or "
                "work without workers or scheduler"
            ) from fault


def find_datasets(paths: Sequence[str | Path]) -> list[Path]:
    """Dataset folders among `paths` and, for other folders, in them; `InputError` where there is none.

    Unfinished datasets and folders seed_<n> without a manifest are included, so that opening them reports
    what is missing.
    """
    found: list[Path] = []
    for path in map(Path, paths):
        if _is_begun(path):
            found.append(path)
            continue
        if not path.is_dir():
            raise InputError(f"{path}: there is no such dataset folder")
        if is_collection(path):
            found += [path / row["path"] for row in read_index(path)]
            continue
        inside = [
            folder
            for folder in path.iterdir()
            if folder.is_dir() and (_is_begun(folder) or re.fullmatch(r"seed_\d+", folder.name))
        ]
        if not inside:
            raise InputError(f"{path}: neither a finished dataset nor a folder of datasets")
        found += sorted(inside, key=lambda folder: (len(folder.name), folder.name))
    if not found:
        raise InputError("datasets: name at least one dataset folder")
    return found


def _is_begun(folder: Path) -> bool:
    return (folder / MANIFEST).is_file() or (folder / MARKER).is_file()


class EvaluationJob:
    """The job of evaluating `tasks`: each piece adds a row to those in the folder `out`."""

    def __init__(self, tasks: Sequence[Task], out: Path) -> None:
        self.tasks, self.out = tasks, out
        self.warm: set[tuple[Budget, str]] = set()
        self.software: dict[str, dict[str, str] | None] = {}
        self.full_light: tuple[str, Sections] | None = None
        """Identity of the last dataset with bounds, and the sections of its radiance."""

    def __call__(self, piece: int) -> bool:
        """Measure a task and add its row; raises `InputError` for a dataset that is damaged."""
        append_row(self.out, self._measured(self.tasks[piece]))
        return True

    def estimated(self, task: Task, data: Dataset) -> tuple[float | None, Segmented | DepthMap]:
        """Seconds and result of a task on its `data`; the first call of a method at a budget is a warm-up."""
        estimator, seen = estimator_of(task.method), data.counts_or_views

        def work() -> Any:
            if estimator is not None:
                z_range_mm = depth_range_of(data, task.z_mm)
                return estimate_depth(seen, z_range_mm, method=task.function or estimator)
            assert isinstance(seen, PhotonCounts)
            return segment(seen, planes_of(data, task.z_mm), method=task.function or task.method)

        if (task.budget, task.method) not in self.warm:
            work()
            self.warm.add((task.budget, task.method))
        return timed(work)

    def _measured(self, task: Task) -> Row:
        """The row of a task."""
        if task.method not in self.software:  # that of this process, which may be on another machine
            self.software[task.method] = _software(task)
        data = task.data
        seen = data.counts_or_views
        seconds, estimate = self.estimated(task, data)
        photons = seen.total / seen.grid.view_count if isinstance(seen, PhotonCounts) else None
        row = described(data, task.z_mm) | {
            "budget": task.budget,
            "photons_per_view": photons,
            "method": task.method,
            "seconds": None if seconds is None else round(seconds, 6),
            "software": self.software[task.method],
            "date": f"{datetime.now(UTC):%Y-%m-%d}",
            "machine": machine(),
        }
        if isinstance(estimate, DepthMap):
            depth = dict(score(None, estimate, data.truth, grid=data.grid).depth)
            return row | {"depth": depth} | self._bounds(task, data, seen)
        result = score(estimate, None, data.truth)
        planes = [
            {name: value for name, value in (bound | plane).items() if name != "method"}
            for plane, bound in zip(result.planes, result.bounds["planes"], strict=True)
        ]
        return row | {"planes": planes, "objects": [dict(entry) for entry in result.objects]}

    def full_light_of(self, task: Task) -> Dataset:
        """The dataset from whose radiance the texture of a task's objects is known, if it has any."""
        return task.dataset

    def _bounds(self, task: Task, data: Dataset, seen: PhotonCounts | Views) -> Row:
        """`bounds` of the depth of objects from these photons, if there is radiance to know textures from."""
        lit, truth, z_mm = self.full_light_of(task), data.truth, task.z_mm
        views = lit.views
        if not isinstance(seen, PhotonCounts) or views is None or not (z_mm or data.analysis.get("z_mm")):
            return {}
        assert truth is not None
        planes, identity = planes_of(data, z_mm), identity_of(lit.manifest)
        if self.full_light is None or self.full_light[0] != identity:
            self.full_light = identity, reconstruct(views, planes)
        # By their origin where that is known, so no sections are needed to count photons.
        sections = None if truth.photons is not None else reconstruct(seen, planes)
        return {"bounds": {"objects": object_bounds(truth, self.full_light[1], sections)}}
