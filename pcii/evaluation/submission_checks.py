"""What is in a folder of results that were made elsewhere, and a sentence for each of its faults."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pcii.base.errors import InputError
from pcii.base.plain_text import visible
from pcii.evaluation.method_names import depth_name, estimator_of, named_functions
from pcii.evaluation.submitted_maps import has_depth, has_masks, light_folder
from pcii.evaluation.tasks import Task, lights_of
from pcii.store.dataset import FULL_LIGHT, Budget, Dataset

SUBMISSION = "submission.json"
NEEDED = ("benchmark", "method")
TEXTS = ("authors", "url", "description", "trained_on")
"""What may be said of a submission beside the name of its method."""


def read_submission(folder: Path, benchmark: str) -> dict[str, Any]:
    """What submission.json says; `InputError` if it is missing, or of another benchmark."""
    file = folder / SUBMISSION
    form = f'expected {{"benchmark": "{benchmark}", "method": NAME}}, and if you like {", ".join(TEXTS)}'
    if not folder.is_dir():
        raise InputError(f"{folder}: there is no such folder")
    try:
        said = json.loads(file.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"{file}: is missing; {form}") from None
    except (OSError, ValueError):
        raise InputError(f"{file}: is no JSON in UTF-8; {form}") from None
    if not isinstance(said, dict):
        raise InputError(f"{file}: {form}")
    for name in NEEDED:
        if name not in said:
            raise InputError(f"{file}: {name}: is missing; {form}")
    for name, value in said.items():
        if name not in (*NEEDED, *TEXTS):
            raise InputError(f"{file}: {visible(name)}: is not known; {form}")
        if not isinstance(value, str) or not value:
            raise InputError(f"{file}: {name}: expected text")
    if said["benchmark"] != benchmark:
        other = visible(said["benchmark"])
        raise InputError(f"{file}: benchmark: is {other!r}, but the data are of {benchmark!r}")
    try:
        named_functions([(said["method"], _given_as_maps)])
    except InputError as fault:
        raise InputError(f"{file}: method: {fault}") from None
    return said


def submitted_tasks(folder: Path, datasets: Sequence[Dataset], method: str) -> tuple[list[Task], list[str]]:
    """The tasks that a submission has results of, and a sentence for each of its faults.

    Whatever light it has masks or depth of, it has them of all datasets that have this light.
    """
    by_name, faults = {dataset.name: dataset for dataset in datasets}, dict[Path, str]()
    for entry in sorted(folder.iterdir()):
        if entry.is_dir() and entry.name not in by_name:
            faults[entry] = "there is no such dataset in this half"
    tasks: list[Task] = []
    found: dict[tuple[str, Budget], list[Dataset]] = {}
    for dataset in datasets:
        lights: dict[str, Budget] = {light_folder(light): light for light in lights_of(dataset)}
        for entry in sorted((folder / dataset.name).glob("*/")):
            if entry.name not in lights:
                faults[entry] = f"is no light of this dataset, of which there are {', '.join(lights)}"
                continue
            light: Budget = lights[entry.name]
            for has, name in ((has_masks(entry), method), (has_depth(entry), depth_name(method))):
                if has and (light != FULL_LIGHT or estimator_of(name) is not None):
                    tasks.append(Task(dataset, light, name, _given_as_maps, ()))
                    found.setdefault((name, light), []).append(dataset)
            if not has_masks(entry) and not has_depth(entry):
                faults[entry] = "has neither a depth map (depth.npz) nor masks (masks.npz)"
    for (name, light), own in found.items():
        file = "depth.npz" if estimator_of(name) is not None else "masks.npz"
        for dataset in datasets:
            inside = folder / dataset.name / light_folder(light)
            if light in lights_of(dataset) and dataset not in own and inside not in faults:
                what = f"has no {file}" if inside.is_dir() else "is missing"
                faults[inside] = f"{what}, and of this light it is needed of all datasets"
    return tasks, [f"{path}: {fault}" for path, fault in faults.items()]


def _given_as_maps(*_: Any) -> Any:
    raise AssertionError("maps are read, not computed")
