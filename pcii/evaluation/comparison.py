"""Methods compared over many datasets: `pcii.evaluate`."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pcii.base import THIS_PROCESS, Executor, InputError, Report, silent
from pcii.evaluation import summary
from pcii.evaluation.evaluation_page import AXES, ERRORS, accuracies, write_evaluation
from pcii.evaluation.measurement import EvaluationJob, measure, tasks_of
from pcii.evaluation.method_names import Method, named_methods
from pcii.evaluation.rows import frame_of, key_of, origin_of, writing_rows
from pcii.figures import draw_accuracy, in_style, known_places, several_axes
from pcii.store import COUNTS, MANIFEST, MARKER, RADIANCE, TRUTH, is_collection, open_dataset, read_index
from pcii.types import Light

if TYPE_CHECKING:
    import numpy as np
    from pandas import DataFrame

SEED = re.compile(r"(.*_)?seed_\d+")


@dataclass(frozen=True)
class Evaluation:
    """What was measured of methods on datasets.

    `frame` has a row for each dataset, light, method and plane, or depth map; `pcii.evaluation.rows` lists
    its columns. `made_again` is a sentence for each change of software for which earlier rows were measured
    again. `origin` says what measured the rows: versions, machines and days.
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
        if measure not in AXES:
            raise InputError(f"measure: expected one of {', '.join(AXES)}, got {measure!r}")
        cells = accuracies(summary.over_scenes(self.means()), measure)
        if not (places := known_places(cells)):
            raise InputError(f"measure: no method has {measure!r}")
        methods = sorted(cells["method"].unique())
        with in_style(style):
            panels = several_axes(axes, len(places))
            draw_accuracy(panels, cells, methods, AXES[measure], is_share=measure not in ERRORS)
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
    unless other software made them (see `pcii.store.provenance`). evaluation.html, means.csv and
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
