"""Scores of a method, run here, or of maps that were made elsewhere.

Both are an evaluation (`pcii.evaluation`) with a submission.json beside it, which says whose they are.
Photons, frames and full light of a scene are one scene in it, whatever their recipes.
"""

import resource
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pcii.base.command_line import MOST_COMPLAINTS
from pcii.base.errors import InputError
from pcii.base.executor import THIS_PROCESS, Executor
from pcii.base.progress import Report, silent
from pcii.base.safe_files import named_in_errors, write_json_safely
from pcii.evaluation.benchmark_collection import BenchmarkCollection
from pcii.evaluation.benchmark_jobs import BenchmarkJob, given_maps
from pcii.evaluation.comparison import measure
from pcii.evaluation.evaluation_pages import write_evaluation
from pcii.evaluation.method_names import (
    Function,
    depth_name,
    full_name,
    named_functions,
)
from pcii.evaluation.rows import Row, all_rows, by_light
from pcii.evaluation.submission_checks import SUBMISSION, read_submission, submitted_tasks
from pcii.evaluation.submission_pictures import PICTURES
from pcii.evaluation.summary import summarise
from pcii.evaluation.tables import budget_name
from pcii.evaluation.tasks import Task, lights_of, tasks_of
from pcii.store.collection import Half
from pcii.store.dataset import FULL_LIGHT, Budget, budget_of
from pcii.store.folders import ROWS


def run_method(
    method: str,
    data: BenchmarkCollection,
    out: Path,
    *,
    half: Half = "test",
    budgets: Sequence[float | str] = (),
    executor: Executor = THIS_PROCESS,
    report: Report = silent,
) -> dict[str, Any]:
    """Score a method on one half of a benchmark, in the folder `out`; the figures of `summarise`.

    `method` is a name, as of `pcii.evaluate`. Without `budgets` it is scored at all light that there is. Rows
    that are in the folder already are kept, as by `evaluate`. Raises `InputError` for a method that is not
    there, for budgets that no dataset has, and as `evaluate` does.
    """
    named = named_functions([method])
    (name,) = named
    chosen: set[Budget] = {budget_of(each) if isinstance(each, str) else each for each in budgets}
    tasks: list[Task] = []
    for dataset in data.datasets(half):
        lights = [
            each
            for each in lights_of(dataset)
            if each is not None and each in (chosen or {each}) and _takes(name, named, each)
        ]
        if lights:
            tasks += tasks_of([dataset], named, lights)
    if not tasks and chosen:
        words = ", ".join(budget_name(each) for each in sorted(chosen, key=by_light))
        raise InputError(f"budget: no dataset of the {half} half that {name!r} can take has {words}")
    # Of the last dataset's tasks the full name: "depth" is the default method of depth.
    said = {"method": tasks[-1].method if tasks else name, "made": "run by pcii benchmark run"}
    return _scored(BenchmarkJob(tasks, out.resolve(), data, half), data, half, said, executor, report)


def score_submission(
    folder: Path,
    data: BenchmarkCollection,
    out: Path,
    *,
    half: Half = "test",
    executor: Executor = THIS_PROCESS,
    report: Report = silent,
) -> dict[str, Any]:
    """Score the maps in a folder (`submitted_maps`) on one half of a benchmark; the figures of `summarise`.

    submission.json there names the method. Raises `InputError` for a submission with any fault, before
    anything is scored: it says which, the first few of them.
    """
    said = read_submission(folder, data.name) | {"made": "scored from maps by pcii benchmark score"}
    tasks, faults = submitted_tasks(folder, data.datasets(half), said["method"])
    for number, task in enumerate(tasks, start=1):
        try:
            given_maps(folder, task)
        except InputError as fault:
            faults.append(str(fault))
        report("checks", number, len(tasks))
    if not tasks and not faults:
        faults = [f"{folder}: has no results of a dataset of the {half} half"]
    if faults:
        more = f"; and {len(faults) - MOST_COMPLAINTS} more" if len(faults) > MOST_COMPLAINTS else ""
        raise InputError("; ".join(faults[:MOST_COMPLAINTS]) + more)
    return _scored(BenchmarkJob(tasks, out.resolve(), data, half, folder), data, half, said, executor, report)


def _scored(
    job: BenchmarkJob,
    data: BenchmarkCollection,
    half: Half,
    said: Mapping[str, Any],
    executor: Executor,
    report: Report,
) -> dict[str, Any]:
    out, own = job.out, {task.method for task in job.tasks}
    if (out / ROWS).is_file():
        with all_rows(out) as rows:
            others = {row["method"] for row in rows} - own - {depth_name(said["method"]), said["method"]}
        if others:
            raise InputError(f"{out}: holds scores of {sorted(others)[0]!r}; name another folder")
    again = measure(job, executor, report)
    entry = {"benchmark": data.name, **said, "half": half}
    if job.maps is None:
        memory = max(
            resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
        )
        entry["peak_memory_mb"] = round(memory / 1024)
    with all_rows(out) as rows, named_in_errors(out):
        result = summarise(by_scene(rows)) | {"again": again}
        write_json_safely(out / SUBMISSION, entry)
        write_evaluation(out, result, (SUBMISSION, PICTURES))
    return result


def by_scene(rows: Sequence[Row]) -> list[Row]:
    """Rows whose datasets belong to one group if they are of one scene, whatever their light."""
    return [row | {"recipe": row["title"]} for row in rows]


def _takes(name: str, named: Mapping[str, Function | None], light: Budget) -> bool:
    functions = [each for each, function in named.items() if function is not None]
    return full_name(name, full_light=light == FULL_LIGHT, functions=functions) is not None
