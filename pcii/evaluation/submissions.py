"""Results of the benchmark that were made elsewhere: a folder of maps of depth and masks, checked as read.

    submission.json                   whose they are: see `Submission`
    ramp_photons_1/1000/depth.npz     z_mm (H, W) in mm, not finite where there is no answer, and, if there is
                                      one, confidence (H, W) from 0 to 1
                       /masks.npz     in_focus (Z, H, W), 0 or 1, at the depths of the dataset, in their order

The first folder is that of the dataset; the second says from how many photons per view, or "full-light".
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any
from zipfile import BadZipFile

import numpy as np
from pydantic import BaseModel, ConfigDict, StringConstraints, ValidationError

from pcii.base.errors import InputError
from pcii.evaluation.method_names import NamedMethod, depth_name, estimator_of, named_method
from pcii.evaluation.tasks import Task
from pcii.store.dataset import Dataset
from pcii.store.suggested_depths import planes_of
from pcii.types.estimates import DepthMap
from pcii.types.photon_limit import FULL_LIGHT

SUBMISSION = "submission.json"
DEPTH_MAP, MASKS = "depth.npz", "masks.npz"
Text = Annotated[str, StringConstraints(min_length=1)]


class Submission(BaseModel):
    """What submission.json says: the benchmark, the name of the method, and more if its authors like."""

    model_config = ConfigDict(extra="forbid")

    benchmark: Text
    method: Text
    authors: Text | None = None
    url: Text | None = None
    description: Text | None = None
    trained_on: Text | None = None


def read_submission(folder: Path, benchmark: str) -> Submission:
    """What submission.json says; `InputError` if it is missing, wrong, or of another benchmark."""
    file = folder / SUBMISSION
    try:
        submission = Submission.model_validate_json(file.read_bytes())
    except OSError:
        raise InputError(f"{file}: is missing") from None
    except ValidationError as fault:
        first = fault.errors()[0]
        field = ".".join(map(str, first["loc"]))
        names = ", ".join(Submission.model_fields)
        raise InputError(f"{file}: {field!r}: {first['msg']}; expected a JSON object of {names}") from None
    if submission.benchmark != benchmark:
        raise InputError(f"{file}: benchmark: is {submission.benchmark!r}, but the data are of {benchmark!r}")
    named_method((submission.method, _read_as_maps))  # raises `InputError` for a name that is taken
    return submission


def _read_as_maps(*_: Any) -> Any:
    raise AssertionError("maps are read, not computed")


def tasks_of_submission(folder: Path, datasets: Sequence[Dataset], method: str) -> list[Task]:
    """The tasks that a submission has results of.

    Whatever light it has masks or depth of, it has them of all datasets that have this light: else raises
    `InputError`, as for files that are no result of a dataset and its light.
    """
    possible = {
        folder / dataset.name / str(light) / file: Task(dataset, light, NamedMethod(name, _read_as_maps))
        for dataset in datasets
        for light in dataset.lights
        for file, name in ((MASKS, method), (DEPTH_MAP, depth_name(method)))
        if file == DEPTH_MAP or light != FULL_LIGHT
    }
    for file in sorted(folder.glob("*/*/[!.]*")):
        if file not in possible:
            raise InputError(
                f"{file}: is no result of this half; expected files DATASET/LIGHT/{DEPTH_MAP} or {MASKS}"
            )
    tasks = {file: task for file, task in possible.items() if file.is_file()}
    if not tasks:
        raise InputError(f"{folder}: has no results of a dataset of this half")
    kinds = {(task.light, task.method.name) for task in tasks.values()}
    for file, task in possible.items():
        if file not in tasks and (task.light, task.method.name) in kinds:
            raise InputError(f"{file}: is missing, and of this light it is needed of all datasets")
    return list(tasks.values())


def read_maps(folder: Path, task: Task) -> np.ndarray | DepthMap:
    """Depth, or masks (Z, H, W) bool, of a task in a submission; `InputError`, naming the file."""
    inside = folder / task.dataset.name / str(task.light)
    shape = task.dataset.grid.shape_HW
    if estimator_of(task.method.name) is not None:
        return _read_depth(inside / DEPTH_MAP, shape)
    file = inside / MASKS
    masks = _read_arrays(file, {"in_focus": (len(planes_of(task.dataset, ()).z_mm), *shape)})["in_focus"]
    if not np.isin(masks, (0, 1)).all():
        raise InputError(f"{file}: in_focus: expected 0 and 1, or bool")
    return masks.astype(bool)


def _read_depth(file: Path, shape: tuple[int, int]) -> DepthMap:
    arrays = _read_arrays(file, {"z_mm": shape, "confidence": shape})
    has_answer = np.isfinite(arrays["z_mm"])
    z_mm = np.where(has_answer, arrays["z_mm"], np.nan).astype(np.float64)
    if (z_mm <= 0).any():
        raise InputError(f"{file}: z_mm: depths are above 0 mm; give NaN where there is no answer")
    confidence = arrays.get("confidence", has_answer)
    if not ((confidence >= 0) & (confidence <= 1)).all():
        raise InputError(f"{file}: confidence: expected numbers from 0 to 1, also where there is no depth")
    return DepthMap(z_mm, np.where(has_answer, confidence, 0.0).astype(np.float64))


def _read_arrays(file: Path, shapes: Mapping[str, tuple[int, ...]]) -> dict[str, np.ndarray]:
    """Arrays of an .npz file with these shapes, the first of which is needed; else raises `InputError`."""
    try:
        with np.load(file, allow_pickle=False) as loaded:
            arrays = dict(loaded)
    except (BadZipFile, OSError, ValueError, KeyError, EOFError):
        raise InputError(f"{file}: damaged, or no .npz file of plain numbers") from None
    needed, *_ = shapes
    is_right = needed in arrays and all(
        shapes.get(name) == values.shape and values.dtype.kind in "fiub" for name, values in arrays.items()
    )
    if not is_right:
        expected = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
        raise InputError(f"{file}: expected numbers {expected}, of which {needed} is needed")
    return arrays
