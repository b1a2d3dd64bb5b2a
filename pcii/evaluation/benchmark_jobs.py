"""The work of scoring a method on a benchmark: rows as of any evaluation, pictures, and bounds.

Photons and full light of a scene are datasets of their own here, so the textures from which the bounds on
depth follow are those of another dataset.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pcii.base.safe_files import write_bytes_safely
from pcii.evaluation.benchmark_collection import BenchmarkCollection
from pcii.evaluation.comparison import EvaluationJob
from pcii.evaluation.method_names import estimator_of
from pcii.evaluation.submission_pictures import TYPICAL_PHOTONS, picture_name, picture_of
from pcii.evaluation.submitted_maps import light_folder, submitted_depth, submitted_masks
from pcii.evaluation.tasks import Task
from pcii.figures.pictures import photo_bytes
from pcii.sections.reconstruction import reconstruct
from pcii.store.collection import Half
from pcii.store.dataset import Dataset
from pcii.store.suggested_depths import planes_of
from pcii.types.estimates import DepthMap, Segmented


class BenchmarkJob(EvaluationJob):
    """The job of scoring `tasks` of half a benchmark, with a picture of each scene at `TYPICAL_PHOTONS`.

    Methods are run; with `maps`, a folder of results that were made elsewhere, those are read instead.
    """

    def __init__(
        self,
        tasks: Sequence[Task],
        out: Path,
        data: BenchmarkCollection,
        half: Half,
        maps: Path | None = None,
    ) -> None:
        super().__init__(tasks, out)
        self.full_light_by_name, self.pictured = data.full_light(half), data.first_draws(half)
        self.maps = maps

    def full_light_of(self, task: Task) -> Dataset:
        """The dataset in full light of the same scene."""
        return self.full_light_by_name.get(task.dataset.name, task.dataset)

    def estimated(self, task: Task, data: Dataset) -> tuple[float | None, Segmented | DepthMap]:
        """Seconds (None of maps) and result of a task, whose picture is written if the page may show it."""
        if self.maps is None:
            seconds, estimate = super().estimated(task, data)
        else:
            seconds, estimate = None, given_maps(self.maps, task)
            if not isinstance(estimate, DepthMap):
                estimate = Segmented(estimate, task.method, reconstruct(data.counts, planes_of(data, ())))
        scene = self.pictured.get(task.dataset.name)
        if scene is not None and task.budget == TYPICAL_PHOTONS and data.truth is not None:
            file = self.out / picture_name("depth" if isinstance(estimate, DepthMap) else "object", scene)
            file.parent.mkdir(exist_ok=True)
            write_bytes_safely(file, photo_bytes(picture_of(estimate, data.truth, data.grid)))
        return seconds, estimate


def given_maps(folder: Path, task: Task) -> np.ndarray | DepthMap:
    """Depth, or masks (Z, H, W) bool, of a task in a submission; `InputError`, naming the file."""
    inside = folder / task.dataset.name / light_folder(task.budget)
    if estimator_of(task.method) is not None:
        return submitted_depth(inside, task.dataset)
    return submitted_masks(inside, task.dataset)
