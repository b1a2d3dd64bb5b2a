"""Methods compared over many datasets: each dataset, budget and method is scored and timed once."""

import re
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pcii.base.crew import ALONE, Crew
from pcii.base.errors import InputError
from pcii.base.progress import Report, silent
from pcii.base.safe_files import named_in_errors
from pcii.depth.methods import estimate_depth
from pcii.evaluation.evaluation_pages import write_evaluation
from pcii.evaluation.rows import (
    DEPTH,
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
from pcii.evaluation.timing import timed
from pcii.io.collection_layout import is_collection, read_index
from pcii.io.dataset import Dataset, open_dataset
from pcii.io.dataset_layout import MANIFEST, MARKER, TRUTH
from pcii.io.suggested_depths import depth_range_of, planes_of
from pcii.metrics.scoring import score
from pcii.removal.methods import removal_methods, segment


def known_methods() -> tuple[str, ...]:
    """Names of the methods that can be evaluated: those of removal, and the depth map."""
    return (*removal_methods(), DEPTH)


@dataclass(frozen=True)
class Task:
    """A dataset, photon budget and method to score."""

    dataset: Dataset
    budget: float | None
    method: str

    @property
    def key(self) -> Key:
        """Key of its row."""
        return identity_of(self.dataset.manifest), self.budget, self.method


def evaluate(
    datasets: Sequence[str | Path],
    out: str | Path,
    *,
    methods: Sequence[str] = (),
    budgets: Sequence[float] = (),
    crew: Crew = ALONE,
    report: Report = silent,
) -> dict[str, Any]:
    """Score methods on datasets and compare them; returns the figures of evaluation.json (`summarise`).

    `datasets` are dataset folders, collections, or folders of dataset folders. `methods` default to all;
    "depth" is the depth map. `budgets` default to all that each dataset has. `crew` does the work.

    Rows are added to out/rows.jsonl as they are measured, and rows already in it are not measured again;
    evaluation.json, .html and .md summarise all of them. The seconds of a row are the wall time of the method
    alone, after a warm-up call, in a call in which no code was compiled or imported; where several processes
    work at a time, each is slower. Raises `InputError` for a dataset without truth, depths or counts, or an
    unknown method or budget:

    >>> evaluate(["out/no-such-dataset"], "out/compared")
    Traceback (most recent call last):
    pcii.base.errors.InputError: out/no-such-dataset: there is no such dataset folder

    With datasets of `simgen generate RECIPE -o out/twenty --seeds 20`, the mean IoU of the first method is
    `evaluate(["out/twenty"], "out/compared")["groups"][0]["results"][0]["object"]["iou"]["mean"]`.
    """
    folder = Path(out)
    tasks = _tasks([open_dataset(path) for path in find_datasets(datasets)], _checked(methods), budgets)
    claim_rows(folder)
    with all_rows(folder) as rows:
        measured = {key_of(row) for row in rows}
    remaining = [task for task in tasks if task.key not in measured]
    with closing(crew.run(Measuring(remaining, folder.resolve()), range(len(remaining)))) as work:
        for finished, done in enumerate(work, start=1):
            if done.fault:
                raise InputError(done.fault)
            report("scores", finished, len(remaining))
    with all_rows(folder) as rows, named_in_errors(folder):
        result = summarise(rows)
        write_evaluation(folder, result)
    return result


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


def _checked(methods: Sequence[str]) -> tuple[str, ...]:
    known = known_methods()
    for name in methods:
        if name not in known:
            raise InputError(f"method: there is no method named {name!r}; use {', '.join(known)}")
    return tuple(dict.fromkeys(methods)) or known


def _tasks(datasets: Sequence[Dataset], methods: Sequence[str], budgets: Sequence[float]) -> list[Task]:
    """The tasks, dataset by dataset; raises `InputError` for what a dataset lacks before any work is done."""
    tasks: dict[str, list[Task]] = {}
    for dataset in datasets:
        if not dataset.has(TRUTH):
            raise InputError(f"{dataset.path}: has no truth to score with; its recipe left it out")
        planes_of(dataset, ())
        chosen = dict.fromkeys(budgets or dataset.budgets)
        for budget in chosen:
            dataset.at_budget(budget)
        each = [Task(dataset, budget, method) for budget in chosen for method in methods]
        tasks.setdefault(identity_of(dataset.manifest), each)
    return [task for each in tasks.values() for task in each]


class Measuring:
    """The job of measuring `tasks`: each piece adds a row to those in the folder `out`."""

    def __init__(self, tasks: Sequence[Task], out: Path) -> None:
        self.tasks, self.out = tasks, out
        self.warm: set[tuple[float | None, str]] = set()

    def __call__(self, piece: int) -> bool:
        """Measure a task and add its row; raises `InputError` for a dataset that is damaged."""
        append_row(self.out, _measured(self.tasks[piece], self.warm))
        return True

    def name(self, piece: int) -> str:
        """Dataset and method."""
        task = self.tasks[piece]
        return f"{task.dataset.path}, {task.method}"

    def use_threads(self, count: int) -> None:
        """Let compiled loops run on so many threads."""
        from pcii.base import compiled_loops

        compiled_loops.use_threads(count)


def _measured(task: Task, warm: set[tuple[float | None, str]]) -> Row:
    """The row of a task; the first call of a method at a budget is a warm-up, the second is timed."""
    data = task.dataset.at_budget(task.budget)
    counts, planes, z_range_mm = data.counts, planes_of(data, ()), depth_range_of(data)

    def work() -> Any:
        if task.method == DEPTH:
            return estimate_depth(counts, z_range_mm)
        return segment(counts, planes, method=task.method)

    if (task.budget, task.method) not in warm:
        work()
        warm.add((task.budget, task.method))
    seconds, estimate = timed(work)
    row = described(data) | {
        "budget": task.budget,
        "photons_per_view": counts.total / counts.grid.view_count,
        "method": task.method,
        "seconds": round(seconds, 6),
    }
    if task.method == DEPTH:
        return row | {"depth": dict(score(None, estimate, data.truth, grid=data.grid).depth)}
    result = score(estimate, None, data.truth)
    planes = [
        {name: value for name, value in (bound | plane).items() if name != "method"}
        for plane, bound in zip(result.planes, result.bounds["planes"], strict=True)
    ]
    return row | {"planes": planes, "objects": [dict(entry) for entry in result.objects]}
