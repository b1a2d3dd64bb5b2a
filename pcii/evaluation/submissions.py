"""Results of the benchmark that were made elsewhere: a folder of maps of depth and masks, checked as read.

    submission.json                   whose they are: see `Submission`
    ramp_photons_1/1000/depth.npz     z_mm (H, W) in mm, not finite where there is no answer, and, if there is
                                      one, confidence (H, W) from 0 to 1
                       /masks.npz     in_focus (Z, H, W), 0 or 1, at the depths of the dataset, in their order

The first folder is that of the dataset; the second says from how many photons per view, or "full-light".
"""

import math
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, TypeVar
from zipfile import ZIP_DEFLATED, ZIP_STORED, ZipFile

import numpy as np
from numpy.lib import format as npy_format
from pydantic import BaseModel, ConfigDict, StringConstraints, ValidationError

from pcii.base.errors import InputError
from pcii.evaluation.method_names import NamedMethod, depth_name, estimator_of, named_method
from pcii.evaluation.tasks import Task
from pcii.store.collection import Half
from pcii.store.dataset import Dataset
from pcii.store.manifests import first_fault
from pcii.store.suggested_depths import planes_of
from pcii.types.estimates import DepthMap
from pcii.types.photon_limit import FULL_LIGHT

SUBMISSION = "submission.json"
DEPTH_MAP, MASKS = "depth.npz", "masks.npz"
MIN_MM, MAX_MM = 1e-3, 1e12
"""Nearest and farthest depth of an answer: errors of others overflow."""
MAX_OVERHEAD_BYTES = 1 << 16
"""Size of a submission.json at most, and of what an .npz file has beside its numbers."""
MAX_NUMBER_BYTES = 16
"""Those of a long double."""
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


class ScoredSubmission(Submission):
    """What the submission.json of a folder of scores says."""

    half: Half
    made: Text
    command_name: Text | None = None


AnySubmission = TypeVar("AnySubmission", bound=Submission)


def read_submission(folder: Path, benchmark: str) -> Submission:
    """What submission.json says; `InputError` if it is missing, wrong, or of another benchmark."""
    submission, file = _read_as(Submission, folder), folder / SUBMISSION
    if submission.benchmark != benchmark:
        raise InputError(f"{file}: benchmark: is {submission.benchmark!r}, but the data are of {benchmark!r}")
    named_method((submission.method, _read_as_maps))  # raises `InputError` for a name that is taken
    return submission


def read_scores(folder: Path) -> dict[str, Any]:
    """What submission.json says in a folder of scores; raises `InputError` if it is missing or wrong."""
    return _read_as(ScoredSubmission, folder).model_dump(exclude_none=True)


def _read_as(model: type[AnySubmission], folder: Path) -> AnySubmission:
    file = folder / SUBMISSION
    _check_file(folder, file, MAX_OVERHEAD_BYTES)
    try:
        return model.model_validate_json(file.read_bytes())
    except ValidationError as fault:
        names = ", ".join(model.model_fields)
        raise InputError(f"{file}: {first_fault(fault)}; expected a JSON object of {names}") from None


def _check_file(folder: Path, file: Path, max_bytes: int) -> None:
    """Raise `InputError` for what is no file of this folder, or a larger one."""
    if not (file.is_file() and file.resolve().is_relative_to(folder.resolve())):
        raise InputError(f"{file}: expected a file in this folder; it is missing, a link, or no file")
    if file.stat().st_size > max_bytes:
        raise InputError(f"{file}: larger than the {max_bytes} bytes that such a file has at most")


def _read_as_maps(*_: Any) -> Any:
    raise AssertionError("maps are read, not computed")


def tasks_of_submission(folder: Path, datasets: Sequence[Dataset], method: str) -> list[Task]:
    """The tasks that a submission has results of.

    Whatever light it has masks or depth of, it has them of all datasets that have this light: else raises
    `InputError`, as for files that are no result of a dataset and its light. Warns of other files.
    """
    possible = {
        folder / dataset.name / str(light) / file: Task(dataset, light, NamedMethod(name, _read_as_maps))
        for dataset in datasets
        for light in dataset.lights
        for file, name in ((MASKS, method), (DEPTH_MAP, depth_name(method)))
        if file == DEPTH_MAP or light != FULL_LIGHT
    }
    present = {*folder.glob("*/*/[!.]*")}
    for file in sorted(present):
        if file not in possible:
            raise InputError(
                f"{file}: is no result of this half; expected files DATASET/LIGHT/{DEPTH_MAP} or {MASKS}"
            )
    tasks = {file: possible[file] for file in possible if file in present}
    others = [*folder.glob("[!.]*"), *folder.glob("*/[!.]*")]
    names = [str(file.relative_to(folder)) for file in sorted(others) if not file.is_dir()]
    if unused := ", ".join(name for name in names if name != SUBMISSION):
        warnings.warn(f"{folder}: not used: {unused}", stacklevel=2)
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
        return _read_depth(folder, inside / DEPTH_MAP, shape)
    file, shapes = inside / MASKS, {"in_focus": (len(planes_of(task.dataset, ()).z_mm), *shape)}
    masks = _read_arrays(folder, file, shapes)["in_focus"]
    if not np.isin(masks, (0, 1)).all():
        raise InputError(f"{file}: in_focus: expected 0 and 1, or bool")
    return masks.astype(bool)


def _read_depth(folder: Path, file: Path, shape: tuple[int, int]) -> DepthMap:
    arrays = _read_arrays(folder, file, {"z_mm": shape, "confidence": shape})
    has_answer = np.isfinite(arrays["z_mm"])
    z_mm = np.where(has_answer, arrays["z_mm"], np.nan).astype(np.float64)
    if ((z_mm < MIN_MM) | (z_mm > MAX_MM)).any():
        span = f"from {MIN_MM:g} to {MAX_MM:g} mm"
        raise InputError(f"{file}: z_mm: depths are {span}; give NaN where there is no answer")
    confidence = arrays.get("confidence", has_answer)
    if not ((confidence >= 0) & (confidence <= 1)).all():
        raise InputError(f"{file}: confidence: expected numbers from 0 to 1, also where there is no depth")
    return DepthMap(z_mm, np.where(has_answer, confidence, 0.0).astype(np.float64))


def _read_arrays(folder: Path, file: Path, shapes: Mapping[str, tuple[int, ...]]) -> dict[str, np.ndarray]:
    """Arrays of an .npz file with these shapes, the first of which is needed; else raises `InputError`."""
    numbers = sum(math.prod(shape) for shape in shapes.values())
    _check_file(folder, file, MAX_OVERHEAD_BYTES + MAX_NUMBER_BYTES * numbers)
    needed, *_ = shapes
    described = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
    expected = f"expected numbers {described}, of which {needed} is needed"
    try:
        with ZipFile(file) as archive:
            members = {name.removesuffix(".npy"): name for name in archive.namelist()}
            if unused := members.keys() - shapes:
                raise InputError(f"{file}: {min(unused)!r} is not used; {expected}")
            arrays = {name: _read_array(archive, members[name], shapes[name]) for name in members}
    except InputError:
        raise
    except Exception:  # damaged archives and headers raise various exceptions
        raise InputError(f"{file}: damaged, or no .npz file as numpy.savez writes it") from None
    arrays = {name: array for name, array in arrays.items() if array is not None}
    if len(arrays) < len(members) or needed not in arrays:
        raise InputError(f"{file}: {expected}")
    return arrays


def _read_array(archive: ZipFile, name: str, shape: tuple[int, ...]) -> np.ndarray | None:
    """An array of an archive; None if it is none of numbers with this shape.

    Its header is read first, since memory is taken as the header says. Other compression than that of NumPy
    can unpack a few bytes to gigabytes in one step.
    """
    if archive.getinfo(name).compress_type not in (ZIP_STORED, ZIP_DEFLATED):
        raise ValueError("compressed by another method")
    with archive.open(name) as member:
        if npy_format.read_magic(member) != (1, 0):  # in others headers may have gigabytes
            raise ValueError("a header for more than numbers")
        stored_shape, _, dtype = npy_format.read_array_header_1_0(member)
    if stored_shape != shape or dtype.kind not in "fiub":
        return None
    with archive.open(name) as member:
        array = npy_format.read_array(member, allow_pickle=False)
        if member.read(1):  # and at its end the checksum is compared
            raise ValueError("more than an array")
    return array
