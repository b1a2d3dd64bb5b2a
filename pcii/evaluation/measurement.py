"""What an evaluation measures, and its measuring: methods are run, timed and scored against the truth.

Every dataset at every light by every method is a task, and all tasks are checked before any work.
"""

import time
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from datetime import UTC, datetime
from statistics import median
from typing import TYPE_CHECKING, Any

from pcii.base import Executor, InputError, Report
from pcii.depth import check_range_mm, estimate_depth
from pcii.evaluation.method_names import NamedMethod, estimator_of, methods_for, software_of
from pcii.evaluation.rows import Key, Row, RowFile, leaves
from pcii.metrics import object_bounds, score
from pcii.removal import segment
from pcii.sections import depth_range_of, has_depths, planes_of, reconstruct
from pcii.store import TRUTH, Dataset, differences, hash_json, machine
from pcii.types import FULL_LIGHT, DepthMap, Light, PhotonCounts, Sections, Segmented, Views

if TYPE_CHECKING:
    from pcii.store import DatasetManifest

LIGHTS = ("photons.budget", "photons.nested")
"""Settings that say in which light a scene is seen, and nothing of the scene; it is the `budget` of a row."""


@dataclass(frozen=True)
class Task:
    """A dataset, light and method to score; `z_mm` are depths instead of those of the dataset, if any."""

    dataset: Dataset
    light: Light
    method: NamedMethod
    z_mm: tuple[float, ...] = ()

    @property
    def key(self) -> Key:
        """Key of its row."""
        return identity_of(self.dataset.manifest), self.light.stored, self.method.name, self.z_mm

    @property
    def data(self) -> Dataset:
        """The dataset in this light, opened at each access, so that tasks keep nothing in memory."""
        return self.dataset.at_light(self.light)


def tasks_of(
    datasets: Sequence[Dataset],
    methods: Sequence[NamedMethod],
    lights: Sequence[Light] = (),
    z_mm: Sequence[float] = (),
) -> list[Task]:
    """The tasks, dataset by dataset, each dataset once, at the depths `z_mm` or else those of its recipe.

    Without `methods` all that can take the data; without `lights` all that a dataset has. Raises `InputError`
    for a dataset without truth, two views, depths or a named light, and for a named method that can take none
    of its data.
    """
    tasks: dict[str, list[Task]] = {}
    for dataset in datasets:
        if not dataset.has(TRUTH):
            raise InputError(
                f"{dataset.path}: has no truth to score with: images of others, or left out by its recipe"
            )
        if dataset.grid.view_count < 2:
            raise InputError(f"{dataset.path}: one view has no depth; at least 2 cameras are needed")
        lights_of_dataset = [dataset.at_light(light).light for light in lights] or dataset.lights
        if not lights_of_dataset:
            raise InputError(f"{dataset.path}: has neither photon counts nor radiance to score methods on")
        tasks_of_dataset = [
            Task(dataset, light, method, tuple(map(float, z_mm)))
            for light in dict.fromkeys(lights_of_dataset)
            for method in methods or _methods_for(dataset, light, z_mm)
            if method.takes(full_light=light == FULL_LIGHT)
        ]
        _check_methods(dataset, methods, tasks_of_dataset)
        _check_depths(dataset, tasks_of_dataset, z_mm)
        tasks.setdefault(identity_of(dataset.manifest), tasks_of_dataset)
    return [task for tasks_of_dataset in tasks.values() for task in tasks_of_dataset]


def _methods_for(dataset: Dataset, light: Light, z_mm: Sequence[float]) -> list[NamedMethod]:
    # Removal is of sections at depths that are named.
    has_planes = has_depths(dataset, z_mm)
    names = methods_for(full_light=light == FULL_LIGHT)
    return [NamedMethod(name) for name in names if has_planes or estimator_of(name)]


def _check_methods(dataset: Dataset, methods: Sequence[NamedMethod], tasks: Sequence[Task]) -> None:
    names = {task.method.name for task in tasks}
    for method in methods:
        if method.name not in names:
            takes_counts = method.takes(full_light=False)
            need, offer = ("photon counts", "radiance") if takes_counts else ("radiance", "photon counts")
            raise InputError(
                f"method: {method.name!r} needs {need}, and of {dataset.path} {offer} would be scored; use "
                f"{', '.join(methods_for(full_light=takes_counts))}"
            )


def _check_depths(dataset: Dataset, tasks: Sequence[Task], z_mm: Sequence[float]) -> None:
    """Raise `InputError` if methods need depths and none are named, or if they cannot be searched."""
    of_depth = [estimator_of(task.method.name) is not None for task in tasks]
    if z_mm or not all(of_depth):
        planes_of(dataset, z_mm)
    if any(of_depth):
        try:
            check_range_mm(dataset.grid, depth_range_of(dataset, z_mm))
        except InputError as fault:
            raise InputError(f"{dataset.path}: {fault}") from None


def identity_of(manifest: "DatasetManifest") -> str:
    """Identity of a dataset: that in its manifest, else a hash of its files' hashes."""
    return manifest.identity or hash_json(manifest.files)


def _dataset_fields(dataset: Dataset, z_mm: Sequence[float]) -> Row:
    """The fields of a row that describe its dataset, seen at the depths `z_mm` if there are any.

    `recipe` is a hash of the dataset's recipe without its seed and its light, and of its scene: seeds and
    amounts of light of one scene share it.
    """
    manifest, identity = dataset.manifest, identity_of(dataset.manifest)
    settings = {name: value for name, value in leaves(manifest.recipe) if name not in ("seed", *LIGHTS)}
    content = {"recipe": settings, "scene": manifest.get("scene")}
    recipe = (hash_json(content) if settings else identity)[:16]
    fields: Row = {
        "dataset": dataset.name,
        "identity": identity,
        "recipe": recipe,
        "title": manifest.title or dataset.name,
        "seed": manifest.recipe.get("seed"),
        "settings": {name: value for name, value in settings.items() if name != "title"},
    }
    if z_mm:
        fields["z_mm"] = fields["settings"]["analysis.z_mm"] = [*z_mm]
        fields["recipe"] = hash_json([recipe, *z_mm])[:16]
    return fields


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
        self._full_light_sections: tuple[str, Sections] | None = None
        """Identity of the last dataset with bounds, and the sections of its radiance."""

    def __call__(self, piece: int) -> Row:
        """The row of a task; raises `InputError` for a dataset that is damaged."""
        task = self.tasks[piece]
        name = task.method.name
        if name not in self._software:  # that of this process, which may be on another machine
            self._software[name] = software_of(task.method)
        data = task.data
        images, truth = data.counts_or_views, data.truth
        seconds, estimate = self.estimate(task, data)
        row = _dataset_fields(data, task.z_mm) | {
            "budget": task.light.stored,
            "photons_per_view": data.counts.total / data.grid.view_count if data.has_counts else None,
            "method": name,
            "seconds": None if seconds is None else round(seconds, 6),
            "software": self._software[name],
            "date": f"{datetime.now(UTC):%Y-%m-%d}",
            "machine": machine(),
        }
        if isinstance(estimate, DepthMap):
            depth = dict(score(None, estimate, truth, grid=data.grid).depth)
            return row | {"depth": depth} | self._bound(task, data, images)
        result = score(estimate, None, truth)
        planes = [
            {name: value for name, value in plane.items() if name != "method"} for plane in result.planes
        ]
        return row | {"planes": planes, "objects": [dict(entry) for entry in result.objects]}

    def estimate(self, task: Task, data: Dataset) -> tuple[float | None, Segmented | DepthMap]:
        """Seconds and result of a task on its `data`; the first call of a method at a light is a warm-up."""
        estimator, images = estimator_of(task.method.name), data.counts_or_views

        def work() -> Any:
            z_range_mm = depth_range_of(data, task.z_mm)
            if estimator is not None:
                method = task.method.function or estimator
                planes = planes_of(data, task.z_mm) if has_depths(data, task.z_mm) else None
                return estimate_depth(images, z_range_mm, z_mm=planes, method=method)
            assert isinstance(images, PhotonCounts)
            method = task.method.function or task.method.name
            planes = planes_of(data, task.z_mm)
            return segment(images, planes, z_range_mm=z_range_mm, method=method)

        if (task.light, task.method.name) not in self._warm:
            work()
            self._warm.add((task.light, task.method.name))
        start = time.perf_counter()
        result = work()
        return time.perf_counter() - start, result

    def full_light_of(self, task: Task) -> Dataset:
        """The dataset from whose radiance the texture of a task's objects is known, if it has any."""
        return task.dataset

    def _bound(self, task: Task, data: Dataset, images: PhotonCounts | Views) -> Row:
        """`bound_px`, the median of the objects, if there is radiance from which their textures are known."""
        full_light, truth, z_mm = self.full_light_of(task), data.truth, task.z_mm
        views = full_light.views
        if not isinstance(images, PhotonCounts) or views is None or not has_depths(data, z_mm):
            return {}
        assert truth is not None
        planes, identity = planes_of(data, z_mm), identity_of(full_light.manifest)
        if self._full_light_sections is None or self._full_light_sections[0] != identity:
            self._full_light_sections = identity, reconstruct(views, planes)
        # By their origin where that is known, so no sections are needed to count photons.
        sections = None if truth.photons is not None else reconstruct(images, planes)
        bounds = object_bounds(truth, self._full_light_sections[1], sections)
        sigmas_px = [each["depth_sigma_px"] for each in bounds if each["depth_sigma_px"] is not None]
        return {"bound_px": median(sigmas_px)} if sigmas_px else {}
