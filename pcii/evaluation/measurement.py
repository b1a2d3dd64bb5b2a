"""Measuring the tasks of an evaluation: a method is run, timed and scored against the truth."""

import time
from collections.abc import Mapping, Sequence
from contextlib import closing
from datetime import UTC, datetime
from statistics import median
from typing import Any

from pcii.base.executor import Executor
from pcii.base.progress import Report
from pcii.depth.methods import estimate_depth
from pcii.evaluation.method_names import estimator_of, software_of
from pcii.evaluation.rows import Row, RowFile, describe_dataset, identity_of
from pcii.evaluation.tasks import Task
from pcii.metrics.bounds import object_bounds
from pcii.metrics.scoring import score
from pcii.removal.methods import segment
from pcii.sections.reconstruction import reconstruct
from pcii.store.dataset import Dataset
from pcii.store.software import differences, machine
from pcii.store.suggested_depths import depth_range_of, has_depths, planes_of
from pcii.types.estimates import DepthMap, Segmented
from pcii.types.images import Views
from pcii.types.photon_counts import PhotonCounts
from pcii.types.photon_limit import Light
from pcii.types.section_stack import Sections


def measure(job: "EvaluationJob", file: RowFile, executor: Executor, report: Report) -> tuple[str, ...]:
    """Add the rows of a job's tasks to those in the file, but for those that are there and still count.

    Returns a sentence for each reason why rows are measured again: other software made them. Raises
    `InputError` for a task that fails.
    """
    tasks = job.tasks
    software = {task.method.name: software_of(task.method) for task in tasks}
    pieces: list[int] = []
    methods_by_change: dict[str, list[str]] = {}
    for number, task in enumerate(tasks):
        row, now = file.rows.get(task.key), software[task.method.name]
        if row is None or now is None or row.get("software") != now:
            pieces.append(number)
            if row is not None:
                change = differences(row.get("software"), now)
                methods_by_change.setdefault(change, []).append(task.method.name)
    if len(pieces) < len(tasks):
        report("scores of an earlier run", len(tasks) - len(pieces), len(tasks) - len(pieces))
    with closing(executor.run(job, pieces)) as results:
        for done, (_, row) in enumerate(results, start=1):
            file.add(row)
            report("scores", done, len(pieces))
    return tuple(
        f"{len(names)} scores of {', '.join(sorted(set(names)))}, since {change}"
        for change, names in methods_by_change.items()
    )


class EvaluationJob:
    """The job of measuring `tasks`: each piece is the row of one."""

    def __init__(self, tasks: Sequence[Task]) -> None:
        self.tasks = tasks
        self._warm: set[tuple[Light, str]] = set()
        self._software: dict[str, Mapping[str, str] | None] = {}
        self._lit_sections: tuple[str, Sections] | None = None
        """Identity of the last dataset with bounds, and the sections of its radiance."""

    def __call__(self, piece: int) -> Row:
        """The row of a task; raises `InputError` for a dataset that is damaged."""
        task = self.tasks[piece]
        name = task.method.name
        if name not in self._software:  # that of this process, which may be on another machine
            self._software[name] = software_of(task.method)
        data = task.data
        seen, truth = data.counts_or_views, data.truth
        seconds, estimate = self.estimate(task, data)
        row = describe_dataset(data, task.z_mm) | {
            "budget": task.light.stored,
            "photons_per_view": seen.total / seen.grid.view_count if isinstance(seen, PhotonCounts) else None,
            "method": name,
            "seconds": None if seconds is None else round(seconds, 6),
            "software": self._software[name],
            "date": f"{datetime.now(UTC):%Y-%m-%d}",
            "machine": machine(),
        }
        if isinstance(estimate, DepthMap):
            depth = dict(score(None, estimate, truth, grid=data.grid).depth)
            return row | {"depth": depth} | self._bound(task, data, seen)
        result = score(estimate, None, truth)
        planes = [
            {name: value for name, value in plane.items() if name != "method"} for plane in result.planes
        ]
        return row | {"planes": planes, "objects": [dict(entry) for entry in result.objects]}

    def estimate(self, task: Task, data: Dataset) -> tuple[float | None, Segmented | DepthMap]:
        """Seconds and result of a task on its `data`; the first call of a method at a light is a warm-up."""
        estimator, seen = estimator_of(task.method.name), data.counts_or_views

        def work() -> Any:
            z_range_mm = depth_range_of(data, task.z_mm)
            if estimator is not None:
                method = task.method.function or estimator
                planes = planes_of(data, task.z_mm) if has_depths(data, task.z_mm) else None
                return estimate_depth(seen, z_range_mm, z_mm=planes, method=method)
            assert isinstance(seen, PhotonCounts)
            method = task.method.function or task.method.name
            planes = planes_of(data, task.z_mm)
            return segment(seen, planes, z_range_mm=z_range_mm, method=method)

        if (task.light, task.method.name) not in self._warm:
            work()
            self._warm.add((task.light, task.method.name))
        start = time.perf_counter()
        result = work()
        return time.perf_counter() - start, result

    def full_light_of(self, task: Task) -> Dataset:
        """The dataset from whose radiance the texture of a task's objects is known, if it has any."""
        return task.dataset

    def _bound(self, task: Task, data: Dataset, seen: PhotonCounts | Views) -> Row:
        """`bound_px`, the median of the objects, if there is radiance from which their textures are known."""
        lit, truth, z_mm = self.full_light_of(task), data.truth, task.z_mm
        views = lit.views
        if not isinstance(seen, PhotonCounts) or views is None or not has_depths(data, z_mm):
            return {}
        assert truth is not None
        planes, identity = planes_of(data, z_mm), identity_of(lit.manifest)
        if self._lit_sections is None or self._lit_sections[0] != identity:
            self._lit_sections = identity, reconstruct(views, planes)
        # By their origin where that is known, so no sections are needed to count photons.
        sections = None if truth.photons is not None else reconstruct(seen, planes)
        bounds = object_bounds(truth, self._lit_sections[1], sections)
        known = [each["depth_sigma_px"] for each in bounds if each["depth_sigma_px"] is not None]
        return {"bound_px": median(known)} if known else {}
