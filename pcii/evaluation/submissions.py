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
from typing import Annotated, Any, Literal, Self, TypeVar, get_args
from zipfile import ZIP_DEFLATED, ZIP_STORED, ZipFile

import numpy as np
from numpy.lib import format as npy_format
from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    StringConstraints,
    ValidationError,
    model_validator,
)

from pcii.base import InputError, is_plain, web_address
from pcii.evaluation.measurement import Task
from pcii.evaluation.method_names import NamedMethod, check_name, depth_name, estimator_of
from pcii.sections import planes_of
from pcii.store import Dataset, Half, first_fault
from pcii.types import FULL_LIGHT, DepthMap

SUBMISSION = "submission.json"
DEPTH_MAP, MASKS = "depth.npz", "masks.npz"
MIN_MM, MAX_MM = 1e-3, 1e12
"""Nearest and farthest depth of an answer: errors of others overflow."""
MAX_OVERHEAD_BYTES = 1 << 16
"""Largest size of a submission.json, and of all but the numbers in an .npz file."""
Made = Literal["run by pcii benchmark run", "scored from maps by pcii benchmark score"]
RUN, SCORED = get_args(Made)


def _plain(text: str) -> str:
    if not is_plain(text):
        raise InputError(
            f"expected letters that are seen, single blanks and Unicode's form NFKC, got {text!a}"
        )
    return text


def _address(text: str) -> str:
    if text != web_address(text):
        raise InputError(f"expected an address such as https://example.org/method, got {text!a}")
    return text


Text = Annotated[str, StringConstraints(min_length=1)]
AnySubmission = TypeVar("AnySubmission", bound="Submission")


class Submission(BaseModel):
    """What submission.json says: the benchmark, the name of the method, and more if its authors like.

    The name is without `depth:`, and new for masks and for depth.
    """

    model_config = ConfigDict(extra="forbid")

    benchmark: Text
    method: Text
    authors: Annotated[Text, AfterValidator(_plain)] | None = None
    url: Annotated[Text, AfterValidator(_address)] | None = None
    description: Text | None = None
    trained_on: Text | None = None

    @property
    def is_run(self) -> bool:
        """Whether the method was run here, and its maps not made elsewhere."""
        return False

    @property
    def methods(self) -> tuple[str, ...]:
        """Full names of what may be scored: of the one method that was run, or of depth and masks in maps."""
        return (self.method,) if self.is_run else (depth_name(self.method), self.method)

    @model_validator(mode="after")
    def _has_good_names(self) -> Self:
        for name in self.methods:
            check_name(name, "method", may_be_known=self.is_run)
        return self


class ScoredSubmission(Submission):
    """What the submission.json of a folder of scores says; a method that was run has its full name there."""

    made: Made
    command_name: Text | None = None
    half: Half

    @property
    def is_run(self) -> bool:
        """Whether the method was run here, and its maps not made elsewhere."""
        return self.made == RUN


def read_submission(folder: Path, benchmark: str) -> Submission:
    """What submission.json says; `InputError` if it is missing, wrong, or of another benchmark."""
    submission, file = read_as(Submission, folder), folder / SUBMISSION
    if submission.benchmark != benchmark:
        raise InputError(f"{file}: benchmark: is {submission.benchmark!r}, but the data are of {benchmark!r}")
    return submission


def read_as(model: type[AnySubmission], folder: Path) -> AnySubmission:
    """What submission.json says in a folder; raises `InputError` if it is missing or wrong."""
    file = folder / SUBMISSION
    _check_file(folder, file, MAX_OVERHEAD_BYTES)
    try:
        return model.model_validate_json(file.read_bytes())
    except ValidationError as fault:
        is_of_a_value = fault.errors()[0]["type"] == "value_error"
        expected = f"; expected a JSON object of {', '.join(model.model_fields)}"
        raise InputError(f"{file}: {first_fault(fault)}{'' if is_of_a_value else expected}") from None


def _check_file(folder: Path, file: Path, max_bytes: int) -> None:
    """Raise `InputError` for what is no file of this folder, or a larger one."""
    is_inside = file.is_file() and file.resolve().is_relative_to(folder.resolve())
    if not is_inside or file.stat().st_size > max_bytes:
        raise InputError(f"{file}: expected a file of this folder, no link, of at most {max_bytes} bytes")


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
    others = sorted({*folder.glob("[!.]*"), *folder.glob("*/[!.]*")} - {folder / SUBMISSION})
    if names := ", ".join(str(file.relative_to(folder)) for file in others if not file.is_dir()):
        warnings.warn(f"{folder}: not used: {names}", stacklevel=2)
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
        raise InputError(f"{file}: z_mm: expected {MIN_MM:g} to {MAX_MM:g} mm, or NaN for no answer")
    confidence = arrays.get("confidence", has_answer)
    if not ((confidence >= 0) & (confidence <= 1)).all():
        raise InputError(f"{file}: confidence: expected numbers from 0 to 1, also where there is no depth")
    return DepthMap(z_mm, np.where(has_answer, confidence, 0.0).astype(np.float64))


def _read_arrays(folder: Path, file: Path, shapes: Mapping[str, tuple[int, ...]]) -> dict[str, np.ndarray]:
    """Arrays of an .npz file with these shapes, the first of which is needed; else raises `InputError`."""
    numbers = sum(map(math.prod, shapes.values()))
    _check_file(folder, file, MAX_OVERHEAD_BYTES + 16 * numbers)  # those of long doubles
    first, *_ = shapes
    described = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
    expected = f"expected numbers {described}, of which {first} is needed"
    try:
        with ZipFile(file) as archive:
            members = {name.removesuffix(".npy"): name for name in archive.namelist()}
            if others := members.keys() - shapes:
                raise InputError(f"{file}: {min(others)!r} is not used; {expected}")
            headers = {name: _header(archive, member) for name, member in members.items()}
            if first not in headers or any(headers[name] != (shapes[name], True) for name in headers):
                raise InputError(f"{file}: {expected}")
            return {name: _read_array(archive, members[name]) for name in members}
    except InputError:
        raise
    except Exception:  # damaged archives and headers raise various exceptions
        raise InputError(f"{file}: damaged, or no .npz file as numpy.savez writes it") from None


def _header(archive: ZipFile, name: str) -> tuple[tuple[int, ...], bool]:
    """Shape of an array, for which memory is taken when it is read, and whether it is of real numbers."""
    # Other methods than those of NumPy unpack a few bytes to gigabytes in one step.
    if archive.getinfo(name).compress_type not in (ZIP_STORED, ZIP_DEFLATED):
        raise ValueError("compressed by another method")
    with archive.open(name) as member:
        if npy_format.read_magic(member) != (1, 0):  # headers of other versions may have gigabytes
            raise ValueError("a header for more than numbers")
        shape, _, dtype = npy_format.read_array_header_1_0(member)
    return shape, dtype.kind in "fiub"


def _read_array(archive: ZipFile, name: str) -> np.ndarray:
    with archive.open(name) as member:
        array = npy_format.read_array(member, allow_pickle=False)
        if member.read(1):  # at the end the checksum is compared
            raise ValueError("more than an array")
    return array
