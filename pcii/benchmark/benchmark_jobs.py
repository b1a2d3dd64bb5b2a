"""The work of scoring a method on a benchmark: rows as of any evaluation, pictures, and bounds.

Photons and full light of a scene are datasets of their own here, so the textures from which the bounds on
depth follow are those of another dataset.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from pcii.benchmark.submission_pictures import TYPICAL_PHOTONS, picture_name, picture_of
from pcii.benchmark.submitted_maps import light_folder, submitted_depth, submitted_masks
from pcii.core.estimates import DepthMap, Segmented
from pcii.evaluation.comparison import EvaluationJob
from pcii.evaluation.method_names import estimator_of
from pcii.evaluation.tasks import Task
from pcii.figures.pictures import photo_bytes
from pcii.io.dataset import Dataset
from pcii.io.suggested_depths import planes_of
from pcii.sections.reconstruction import reconstruct
from pcii.store.safe_files import write_bytes_safely


class BenchmarkJob(EvaluationJob):
    """The job of running methods on `tasks`, with a picture of each scene's result at `TYPICAL_PHOTONS`.

    `full_light` has the dataset in full light of the same scene for each dataset's name; `pictured` the
    names of the datasets of which pictures are made, with the names of their scenes.
    """

    def __init__(
        self,
        tasks: Sequence[Task],
        out: Path,
        full_light: Mapping[str, Dataset],
        pictured: Mapping[str, str],
    ) -> None:
        super().__init__(tasks, out)
        self.full_light_by_name, self.pictured = full_light, pictured

    def full_light_of(self, task: Task) -> Dataset:
        """The dataset in full light of the same scene."""
        return self.full_light_by_name.get(task.dataset.name, task.dataset)

    def result(self, task: Task, data: Dataset) -> tuple[float | None, Segmented | DepthMap]:
        """Seconds and result of a task on its `data`."""
        return super().estimated(task, data)

    def estimated(self, task: Task, data: Dataset) -> tuple[float | None, Segmented | DepthMap]:
        """The same, whose picture is written if it is one that the page may show."""
        seconds, estimate = self.result(task, data)
        scene = self.pictured.get(task.dataset.name)
        if scene is not None and task.budget == TYPICAL_PHOTONS and data.truth is not None:
            file = self.out / picture_name("depth" if isinstance(estimate, DepthMap) else "object", scene)
            file.parent.mkdir(exist_ok=True)
            write_bytes_safely(file, photo_bytes(picture_of(estimate, data.truth, data.grid)))
        return seconds, estimate


class SubmissionJob(BenchmarkJob):
    """The job of scoring maps in a folder: each task reads what there is instead of calling a method."""

    def __init__(
        self,
        tasks: Sequence[Task],
        out: Path,
        full_light: Mapping[str, Dataset],
        pictured: Mapping[str, str],
        folder: Path,
    ) -> None:
        super().__init__(tasks, out, full_light, pictured)
        self.folder = folder

    def result(self, task: Task, data: Dataset) -> tuple[float | None, Segmented | DepthMap]:
        """The result of a task, of which nobody measured the time."""
        given = given_maps(self.folder, task)
        if isinstance(given, DepthMap):
            return None, given
        return None, Segmented(given, task.method, reconstruct(data.counts, planes_of(data, ())))


def given_maps(folder: Path, task: Task) -> np.ndarray | DepthMap:
    """Depth, or masks (Z, H, W) bool, of a task in a submission; `InputError`, naming the file."""
    inside = folder / task.dataset.name / light_folder(task.budget)
    if estimator_of(task.method) is not None:
        return submitted_depth(inside, task.dataset)
    return submitted_masks(inside, task.dataset)
