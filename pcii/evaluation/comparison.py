"""Methods compared over many datasets: `pcii.evaluate`.

Every dataset at every light by every method is a task, and all tasks are checked before any work. Methods are
run, timed and scored against the truth.
"""

import re
import time
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

from pcii.base import THIS_PROCESS, Executor, InputError, Report, silent
from pcii.depth import check_range_mm, estimate_depth
from pcii.evaluation import summary
from pcii.evaluation.evaluation_page import write_evaluation
from pcii.evaluation.method_names import (
    Method,
    NamedMethod,
    estimator_of,
    methods_for,
    named_methods,
    software_of,
)
from pcii.evaluation.rows import Key, Row, RowFile, frame_of, key_of, leaves, origin_of, writing_rows
from pcii.figures import draw_accuracy, in_style
from pcii.metrics import object_bounds, score
from pcii.removal import segment
from pcii.sections import depth_range_of, has_depths, planes_of, reconstruct
from pcii.store import (
    COUNTS,
    MANIFEST,
    MARKER,
    RADIANCE,
    TRUTH,
    Dataset,
    differences,
    hash_json,
    is_collection,
    machine,
    open_dataset,
    read_index,
)
from pcii.types import FULL_LIGHT, DepthMap, Light, PhotonCounts, Sections, Segmented, Views

if TYPE_CHECKING:
    import numpy as np
    from pandas import DataFrame

    from pcii.store import DatasetManifest

SEED = re.compile(r"(.*_)?seed_\d+")
LIGHTS = ("photons.budget", "photons.nested")
"""Settings that say in which light a scene is seen, and nothing of the scene; it is the `budget` of a row."""


@dataclass(frozen=True)
class Evaluation:
    """What was measured of methods on datasets.

    `frame` has a row for each dataset, light, method and plane, or depth map; `pcii.evaluation.rows` lists
    its columns. `made_again` is a sentence for each change, of software or of suggested depths, for which
    earlier rows were measured again. `origin` says what measured the rows: versions, machines and days.
    """

    folder: Path
    frame: "DataFrame"
    origin: dict[str, Any]
    made_again: tuple[str, ...] = ()

    def means(self, by: Sequence[str] = summary.CELL) -> "DataFrame":
        """Means of every measure over datasets, with their 95 % intervals: see `summary.means`.

        Methods are joined by yardsticks, which look at no photon: see `summary.YARDSTICKS`.
        """
        return summary.means(summary.with_yardsticks(self.frame), by)

    def ranks(self, measure: str = "iou", over: summary.Over | None = None) -> "DataFrame":
        """Methods by their mean over scenes, or of one scene over datasets, compared with the best one.

        `over` says which: "scenes" or "datasets". See `summary.ranks`.
        """
        return summary.ranks(summary.with_yardsticks(self.frame), measure, over)

    def plot(self, measure: str = "iou", axes: Any = None, *, style: str = "screen") -> "np.ndarray":
        """Draw a measure against photons per view, and against seconds, and return Matplotlib's axes (N,).

        `measure` is "iou", "pixel_iou", "false_share", "within_1px", "within_3px", "quadratic_score" or
        "median_px". Bars are 95 % intervals, over scenes or, of one scene, over its datasets.
        `style="paper"` is for print:
        `evaluation.plot("iou", style="paper")[0].figure.savefig("iou.pdf")`, or .svg. Raises `InputError` for
        another measure or style, a measure that no method has, and other axes or another number of them.
        """
        if measure not in summary.AXES:
            raise InputError(f"measure: expected one of {', '.join(summary.AXES)}, got {measure!r}")
        cells = summary.accuracies(summary.over_scenes(self.means()), measure)
        methods, is_share = sorted(cells["method"].unique()), summary.kind_of(measure) != "positive"
        with in_style(style):
            panels = draw_accuracy(axes, cells, methods, summary.AXES[measure], is_share=is_share)
        if not len(panels):
            raise InputError(f"measure: no method has {measure!r}")
        return panels


def evaluate(
    datasets: Sequence[str | Path],
    out: str | Path,
    *,
    methods: Sequence[Method] = (),
    budgets: Sequence[float | str] = (),
    z_mm: Sequence[float] = (),
    executor: Executor = THIS_PROCESS,
    report: Report = silent,
) -> Evaluation:
    """Score methods on datasets and compare them; returns all that the folder `out` holds.

    `datasets` are dataset folders, collections, or folders of dataset folders. `methods` are those of
    `pcii.removal_methods()`, and those of `pcii.depth_methods()` as "depth:NAME"; "depth" is the default one
    of depth; "module:function" or "file.py:function"; or functions: of removal, or of depth as pairs
    ("depth:NAME", function), which are measured every time, since their source is not known.
    Without, all that can take the data. `budgets` default to all that each dataset has; among them
    "full-light", its radiance, which some methods of depth take. `z_mm` are depths to look at instead of
    those that recipes name. `executor` does the work.

    Rows are added to out/rows.jsonl as they are measured, and rows already in it are not measured again
    unless other software made them (see `pcii.store.provenance`), or a dataset was made again with other
    depths to look at. evaluation.html, means.csv and
    evaluation.json summarise the last row of each. The seconds of a row are the wall time of the method
    alone, after a warm-up call at the first dataset of each light; where several processes work at a time,
    each is slower. Raises `InputError` for a dataset without truth, depths, or counts and
    radiance, for an unknown method or budget, for a named method that cannot take the data of a dataset, and
    while another process evaluates into the same folder.
    """
    folder = Path(out)
    named = named_methods(methods)
    lights = [Light.parse(budget) for budget in budgets]
    tasks = tasks_of([open_dataset(path) for path in find_datasets(datasets)], named, lights, z_mm)
    with writing_rows(folder) as file:
        made_again = measure(EvaluationJob(tasks), file, executor, report)
        # Scenes in the order of the datasets, those of earlier runs last.
        order = {task.key: number for number, task in enumerate(tasks)}
        rows = sorted(file.rows.values(), key=lambda row: order.get(key_of(row), len(order)))
        evaluation = Evaluation(folder, frame_of(rows), origin_of(rows), made_again)
        write_evaluation(folder, evaluation.frame, evaluation.origin)
    return evaluation


def find_datasets(paths: Sequence[str | Path]) -> list[Path]:
    """Dataset folders among `paths` and, for other folders, in them; `InputError` where there is none.

    Unfinished datasets are included, and folders that are called seed_<n> or have a part of a dataset, so
    that opening them reports what is missing.
    """
    folders: list[Path] = []
    for path in map(Path, paths):
        if _is_begun(path):
            folders.append(path)
        elif not path.is_dir():
            raise InputError(f"{path}: there is no such dataset folder")
        elif is_collection(path):
            folders += [path / row["path"] for row in read_index(path)]
        else:
            inside = [each for each in path.iterdir() if SEED.fullmatch(each.name) or _is_begun(each)]
            if not inside:
                raise InputError(f"{path}: neither a finished dataset nor a folder of datasets")
            folders += sorted(inside, key=lambda each: (len(each.name), each.name))
    if not folders:
        raise InputError("datasets: name at least one dataset folder")
    return folders


def _is_begun(folder: Path) -> bool:
    return any((folder / part).exists() for part in (MANIFEST, MARKER, COUNTS, TRUTH, RADIANCE))


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
    """Raise `InputError` for a named method that has no task, since it cannot take the data."""
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
    if not settings:  # of images of others the identity does not say where to look
        fields["analysis"] = {**dataset.analysis}
    if z_mm:
        fields["z_mm"] = fields["settings"]["analysis.z_mm"] = [*z_mm]
        fields["recipe"] = hash_json([recipe, *z_mm])[:16]
    return fields


def measure(job: "EvaluationJob", file: RowFile, executor: Executor, report: Report) -> tuple[str, ...]:
    """Add the rows of a job's tasks to those in the file, but for those that are there and still count.

    Returns a sentence for each reason why rows are measured again: other software made them, or the dataset
    suggested other depths. Raises `InputError` for a task that fails.
    """
    tasks = job.tasks
    software = {task.method.name: software_of(task.method) for task in tasks}
    pieces: list[int] = []
    methods_by_change: dict[str, list[str]] = {}
    for number, task in enumerate(tasks):
        row, now = file.rows.get(task.key), software[task.method.name]
        has_moved = row is not None and row.get("analysis", task.dataset.analysis) != task.dataset.analysis
        if row is None or now is None or row.get("software") != now or has_moved:
            pieces.append(number)
            if row is not None:
                moved = "their datasets suggest other depths"
                change = moved if has_moved else differences(row.get("software"), now)
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
    """The job of measuring `tasks`: each piece is the row of one.

    `full_light` has, by the names of datasets, those from whose radiance the textures of their objects are
    known; by default it is their own.
    """

    def __init__(self, tasks: Sequence[Task], full_light: Mapping[str, Dataset] | None = None) -> None:
        self.tasks, self.full_light = tasks, full_light or {}
        self._warm: set[tuple[Light, str]] = set()
        self._software: dict[str, dict[str, str] | None] = {}
        """By method: that of this process, which may be on another machine, when it first runs the method."""
        self._full_light_sections: tuple[str, Sections] | None = None
        """Identity of the last dataset with bounds, and the sections of its radiance."""

    def __call__(self, piece: int) -> Row:
        """The row of a task; raises `InputError` for a dataset that is damaged."""
        task = self.tasks[piece]
        name = task.method.name
        if name not in self._software:
            self._software[name] = software_of(task.method)
        data = task.dataset.at_light(task.light)  # opened anew, so that tasks keep nothing in memory
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
        planes = [{key: plane[key] for key in plane if key != "method"} for plane in result.planes]
        return row | {"planes": planes, "objects": [dict(entry) for entry in result.objects]}

    def estimate(self, task: Task, data: Dataset) -> tuple[float | None, Segmented | DepthMap]:
        """Seconds and result of a task on its `data`; the first call of a method at a light is a warm-up."""
        estimator, images = estimator_of(task.method.name), data.counts_or_views
        method: Any = task.method.function or estimator or task.method.name

        def work() -> Any:
            z_range_mm = depth_range_of(data, task.z_mm)
            planes = planes_of(data, task.z_mm) if has_depths(data, task.z_mm) else None
            if estimator is not None:
                return estimate_depth(images, z_range_mm, z_mm=planes, method=method)
            assert isinstance(images, PhotonCounts)
            assert planes is not None
            return segment(images, planes, z_range_mm=z_range_mm, method=method)

        if (task.light, task.method.name) not in self._warm:
            work()
            self._warm.add((task.light, task.method.name))
        start = time.perf_counter()
        result = work()
        return time.perf_counter() - start, result

    def _bound(self, task: Task, data: Dataset, images: PhotonCounts | Views) -> Row:
        """`bound_px`, the median of the objects, if there is radiance from which their textures are known."""
        full_light = self.full_light.get(task.dataset.name, task.dataset)
        truth, z_mm = data.truth, task.z_mm
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
