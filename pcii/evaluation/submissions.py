"""Results of the benchmark that were made elsewhere: a folder of maps of depth and masks, checked as read.

    submission.json                   whose they are: see `Submission`
    ramp_photons_1/1000/depth.npz     z_mm (H, W) in mm, not finite where there is no answer, and, if there is
                                      one, confidence (H, W) from 0 to 1
                       /depth.pfm     or .exr: z_mm alone; confidence.pfm or .exr beside it
                       /masks.npz     in_focus (Z, H, W), 0 or 1, at the depths of the dataset, in their order
                       /mask_540.png  or so for each depth: in focus where it is not 0

The first folder is that of the dataset; the second says from how many photons per view, or "full-light".
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any
from zipfile import BadZipFile, ZipFile

import numpy as np
from pydantic import BaseModel, ConfigDict, StringConstraints, ValidationError

from pcii.base.errors import InputError
from pcii.evaluation.method_names import NamedMethod, depth_name, estimator_of, named_method
from pcii.evaluation.tasks import Task, lights_of
from pcii.exchange.pixel_files import decode, picture_of
from pcii.store.dataset import FULL_LIGHT, Budget, Dataset
from pcii.store.suggested_depths import planes_of
from pcii.types.estimates import DepthMap

SUBMISSION = "submission.json"
DEPTH_FILES = ("depth.npz", "depth.pfm", "depth.exr")
CONFIDENCE_FILES = ("confidence.pfm", "confidence.exr")
MASKS = "masks.npz"
MAX_HEADER_BYTES = 1 << 16
"""Of an array in an .npz file, beside eight bytes for each number."""
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
    `InputError`, as for folders that are no dataset or light, or hold no result.
    """
    names = {dataset.name for dataset in datasets}
    for entry in sorted(folder.iterdir()):
        if entry.is_dir() and entry.name not in names:
            raise InputError(f"{entry}: there is no such dataset in this half")
    tasks: list[Task] = []
    for dataset in datasets:
        lights: dict[str, Budget] = {light_folder(light): light for light in lights_of(dataset)}
        for entry in sorted((folder / dataset.name).glob("*/")):
            if entry.name not in lights:
                known = ", ".join(lights)
                raise InputError(f"{entry}: is no light of this dataset, of which there are {known}")
            kinds = [
                name for name, has in ((method, has_masks), (depth_name(method), has_depth)) if has(entry)
            ]
            if not kinds:
                raise InputError(f"{entry}: has neither a depth map (depth.npz) nor masks (masks.npz)")
            light = lights[entry.name]
            named = [NamedMethod(name, _read_as_maps) for name in kinds]
            tasks += [
                Task(dataset, light, each) for each in named if each.takes(full_light=light == FULL_LIGHT)
            ]
    if not tasks:
        raise InputError(f"{folder}: has no results of a dataset of this half")
    present = {(task.dataset.name, task.light, task.method.name) for task in tasks}
    for name, light in dict.fromkeys((task.method.name, task.light) for task in tasks):
        file = "depth.npz" if estimator_of(name) is not None else MASKS
        for dataset in datasets:
            if light in lights_of(dataset) and (dataset.name, light, name) not in present:
                inside = folder / dataset.name / light_folder(light)
                raise InputError(
                    f"{inside / file}: is missing, and of this light it is needed of all datasets"
                )
    return tasks


def read_maps(folder: Path, task: Task) -> np.ndarray | DepthMap:
    """Depth, or masks (Z, H, W) bool, of a task in a submission; `InputError`, naming the file."""
    inside = folder / task.dataset.name / light_folder(task.light)
    if estimator_of(task.method.name) is not None:
        return _read_depth(inside, task.dataset)
    return _read_masks(inside, task.dataset)


def light_folder(light: Budget) -> str:
    """What the folder of results from so many photons per view is called.

    >>> light_folder(1000.0), light_folder("full-light")
    ('1000', 'full-light')
    """
    return light if isinstance(light, str) else f"{light:.15g}"


def has_depth(folder: Path) -> bool:
    """Whether there is a map of depth in a folder of results."""
    return any((folder / name).is_file() for name in DEPTH_FILES)


def has_masks(folder: Path) -> bool:
    """Whether there are masks in a folder of results."""
    return (folder / MASKS).is_file() or any(folder.glob("mask_*.png"))


def _read_depth(folder: Path, dataset: Dataset) -> DepthMap:
    shape = dataset.grid.shape_HW
    files = [folder / name for name in DEPTH_FILES if (folder / name).is_file()]
    if len(files) > 1:
        raise InputError(f"{files[1]}: {files[0].name} is there too; give one of them")
    (file,) = files
    if file.suffix == ".npz":
        arrays = _read_arrays(file, {"z_mm": shape, "confidence": shape}, "z_mm")
        z_mm, confidence = arrays["z_mm"], arrays.get("confidence")
    else:
        z_mm, confidence = _read_picture(file, shape), None
        for beside in CONFIDENCE_FILES:
            if (folder / beside).is_file():
                confidence = _read_picture(folder / beside, shape)
    z_mm = np.where(np.isfinite(z_mm), z_mm, np.nan).astype(np.float64)
    if (z_mm <= 0).any():
        raise InputError(f"{file}: z_mm: depths are above 0 mm; give NaN where there is no answer")
    has_answer = np.isfinite(z_mm)
    if confidence is None:
        return DepthMap(z_mm, has_answer.astype(np.float64))
    if not ((confidence >= 0) & (confidence <= 1)).all():
        raise InputError(f"{file}: confidence: expected numbers from 0 to 1, also where there is no depth")
    return DepthMap(z_mm, np.where(has_answer, confidence, 0.0).astype(np.float64))


def _read_masks(folder: Path, dataset: Dataset) -> np.ndarray:
    """The masks (Z, H, W) bool in a folder of results; `InputError`, naming the file, for others."""
    shape, z_mm = dataset.grid.shape_HW, planes_of(dataset, ()).z_mm.tolist()
    pictures = sorted(folder.glob("mask_*.png"))
    if (folder / MASKS).is_file():
        if pictures:
            raise InputError(f"{pictures[0]}: {MASKS} is there too; give one of them")
        masks = _read_arrays(folder / MASKS, {"in_focus": (len(z_mm), *shape)}, "in_focus")["in_focus"]
        if not np.isin(masks, (0, 1)).all():
            raise InputError(f"{folder / MASKS}: in_focus: expected 0 and 1, or bool")
        return masks.astype(bool)
    expected = [folder / f"mask_{z:g}.png" for z in z_mm]
    if sorted(expected) != pictures:
        (wrong, *_) = sorted({*expected} ^ {*pictures})
        names = ", ".join(file.name for file in expected)
        raise InputError(f"{wrong}: expected the masks {names}, and no others")
    return np.stack([_read_picture(file, shape) > 0 for file in expected])


def _read_picture(file: Path, shape: tuple[int, int]) -> np.ndarray:
    """Numbers (H, W) of a picture of one channel; `InputError` for another one."""
    kinds = {".png": "PNG", ".pfm": "PFM", ".exr": "EXR"}
    picture = picture_of(file, (kinds[file.suffix],))
    if picture.shape != (*shape, 1):
        raise InputError(
            f"{file}: expected {shape[0]} x {shape[1]} px of one channel, got {picture.layout()}"
        )
    return next(decode(picture))[..., 0]


def _read_arrays(file: Path, shapes: Mapping[str, tuple[int, ...]], needed: str) -> dict[str, np.ndarray]:
    """Arrays of these shapes of an .npz file, one of which is `needed`; `InputError` for anything else."""
    try:
        with ZipFile(file) as packed:
            sizes = {info.filename.removesuffix(".npy"): info.file_size for info in packed.infolist()}
        expected = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
        fault = InputError(f"{file}: expected numbers {expected}, of which {needed} is needed")
        if not sizes.keys() <= shapes.keys() or needed not in sizes:
            raise fault
        for name, size in sizes.items():  # before anything is unpacked
            if size > 8 * np.prod(shapes[name], dtype=np.int64) + MAX_HEADER_BYTES:
                raise fault
        with np.load(file, allow_pickle=False) as loaded:
            arrays = {name: loaded[name] for name in sizes}
    except InputError:
        raise
    except (BadZipFile, OSError, ValueError, KeyError, EOFError):
        raise InputError(f"{file}: damaged, or no .npz file of plain numbers") from None
    for name, values in arrays.items():
        if values.shape != shapes[name] or values.dtype.kind not in "fiub":
            raise fault
    return arrays
