"""The folder of results that commands write and later commands read.

results.json             dataset, its identity and the light; versions of the software that made the results;
                         every file with size and SHA-256
sections.zarr/           z_mm, counts, coverage
segmented_<method>.zarr/ z_mm, in_focus; photon_in_focus where the method decides about single photons
depth.zarr/              z_mm, confidence; an attribute hot_pixels, as segmented_<method>.zarr
score.json               as in `Score.to_dict`
*.png, report.html       pictures and the report

New results are written completely into a temporary folder, which then takes the place of the earlier one.
"""

import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pcii.app.pipeline import Outcome, analyse
from pcii.app.report import write_report
from pcii.base import (
    InputError,
    Report,
    locked,
    named_in_errors,
    new_folder_safely,
    silent,
    temporaries_of,
    write_json_safely,
)
from pcii.depth import DEFAULT_METHOD
from pcii.evaluation import identity_of
from pcii.sections import reconstruct
from pcii.store import (
    DEPTH_LABELS,
    RESULTS,
    RESULTS_FOLDER,
    SECTIONS_LABELS,
    SEGMENTED_LABELS,
    Dataset,
    Files,
    entries,
    list_files,
    lists_part,
    own_software,
    read_array,
    read_part,
    unlisted_files,
    write_arrays_safely,
)
from pcii.types import DepthMap, FocalPlanes, Sections, Segmented

SECTIONS, DEPTH, SCORE, REPORT = "sections.zarr", "depth.zarr", "score.json", "report.html"


def run(
    dataset: Dataset,
    out: Path,
    planes: FocalPlanes,
    z_range_mm: tuple[float, float],
    methods: Sequence[str] = (),
    depth_method: str = DEFAULT_METHOD,
    report: Report = silent,
) -> Outcome:
    """Analyse `dataset`, and write all results with a report into `out`, in the place of earlier ones.

    Raises `InputError` as `writing` and `analyse` do.
    """
    with writing(out, dataset, whole=True) as folder:
        outcome = analyse(dataset, planes, z_range_mm, methods, depth_method, report)
        for each in (outcome.sections, *outcome.focus, outcome.depth):
            save_result(folder, each)
        write_json_safely(folder / SCORE, outcome.score.to_dict())
        write_report(folder / REPORT, outcome)
    return outcome


@contextmanager
def writing(out: Path, dataset: Dataset, *, whole: bool = False) -> Iterator[Path]:
    """An empty folder to write results into, which are moved to `out` when the block ends without an error.

    They replace earlier results of the same names or, if they are `whole`, all earlier ones. Raises
    `InputError` if another command is writing there, for the dataset itself, and for a folder that has
    something else, or results of another dataset or light.
    """
    target = out.resolve()
    if target == dataset.path.resolve():
        raise InputError(f"{out}: this is the dataset itself; name another folder for the results")
    lock = target.with_name(f".{target.name}.lock")
    with locked(lock, out), named_in_errors(out), ExitStack() as at_end:
        at_end.callback(lock.unlink, missing_ok=True)
        for folder in temporaries_of(target.parent, target.name):  # of a command that was killed
            shutil.rmtree(folder, ignore_errors=True)
        files, versions = _results_of(out, dataset)
        if files and (extra := unlisted_files(target, [RESULTS, *files])):
            raise InputError(f"{out}: holds {extra[0]}, which is no result; move it away")
        with new_folder_safely(target) as folder:
            yield folder
            new_parts = sorted(entry.name for entry in folder.iterdir())
            files = {n: entry for n, entry in files.items() if not whole and n.split("/")[0] not in new_parts}
            for name in files:
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(target / name, folder / name)
            content = _origin(dataset) | {
                "versions": _all_versions({} if whole else versions, own_software()),
                "files": dict(sorted((files | list_files(folder, new_parts)).items())),
            }
            RESULTS_FOLDER.write(folder, content)


def _origin(dataset: Dataset) -> dict[str, Any]:
    """Dataset and light that results belong to, as in results.json."""
    light = dataset.choice and dataset.choice.stored
    return {"dataset": dataset.name, "identity": identity_of(dataset.manifest), "light": light}


def _results_of(out: Path, dataset: Dataset) -> tuple[Files, Mapping[str, str]]:
    """The files of the results in `out`, and the versions that made them; `InputError` if of other data."""
    if not entries(out, "results"):
        return {}, {}
    if not (out / RESULTS).is_file():
        raise InputError(f"{out}: holds something else; name a new or empty folder")
    results, origin = RESULTS_FOLDER.read(out), _origin(dataset)
    if (results.identity, results.light) != (origin["identity"], origin["light"]):
        raise InputError(f"{out}: holds the results of another dataset or light; name a new or empty folder")
    return results.files, results.versions


def _all_versions(before: Mapping[str, str], now: Mapping[str, str]) -> dict[str, str]:
    """Versions of software that made one part or another: of some packages several, with commas between."""
    versions = {name: [*before.get(name, "").split(", "), now.get(name, "")] for name in {**before, **now}}
    return {name: ", ".join(filter(None, dict.fromkeys(each))) for name, each in versions.items()}


def save_result(folder: Path, result: Sections | Segmented | DepthMap) -> None:
    """Write counts and coverage, whose quotient are sections; masks of a method; or a depth map.

    Masks come with `photon_in_focus` if the method decides it, a depth map with its confidence.
    """
    if isinstance(result, Sections):
        arrays = {"z_mm": result.z_mm, "counts": result.counts, "coverage": result.coverage}
        pattern, labels = {} if result.cfa is None else {"cfa": result.cfa}, SECTIONS_LABELS
        if result.counts.dtype.kind == "f":
            labels = labels | {"counts": replace(labels["counts"], unit="radiance")}
        write_arrays_safely(folder / SECTIONS, arrays, labels, pattern)
    elif isinstance(result, DepthMap):
        arrays = {"z_mm": result.z_mm, "confidence": result.confidence}
        write_arrays_safely(folder / DEPTH, arrays, DEPTH_LABELS, {"hot_pixels": result.hot_pixels})
    else:
        arrays = {"z_mm": result.z_mm, "in_focus": result.in_focus}
        if result.photon_in_focus is not None:
            arrays["photon_in_focus"] = result.photon_in_focus
        path = folder / f"segmented_{result.method}.zarr"
        if path.parent != folder or path.exists():
            raise InputError(f"method: {result.method!r} is no file name, or the name of two methods")
        attributes = {"method": result.method, "hot_pixels": result.hot_pixels}
        write_arrays_safely(path, arrays, SEGMENTED_LABELS, attributes)


def load_estimates(out: Path, dataset: Dataset) -> tuple[list[Segmented], DepthMap | None]:
    """The masks of every method in a folder of results, and the depth map or None.

    The sections of the masks are reconstructed again. Raises `InputError` for a folder without either, for
    results of another dataset or light, and for files that are missing or were changed.
    """
    files = _results_of(out, dataset)[0]
    sizes = {"row": dataset.grid.height, "col": dataset.grid.width}

    def read(part: str, labels: Mapping[str, Any]) -> dict[str, np.ndarray]:
        names = [name for name in labels if lists_part(files, f"{part}/{name}")]
        contents = read_part(out, files, part)
        return {n: read_array(out, f"{part}/{n}", contents, labels[n], sizes) for n in names}

    segmented: list[Segmented] = []
    sections: dict[bytes, Sections] = {}
    for part in sorted({name.split("/")[0] for name in files if name.startswith("segmented_")}):
        arrays = read(part, SEGMENTED_LABELS)
        planes = arrays["z_mm"].tobytes()
        if planes not in sections:
            sections[planes] = reconstruct(dataset.counts, arrays["z_mm"])
        method, photons = part.removeprefix("segmented_").removesuffix(".zarr"), arrays.get("photon_in_focus")
        segmented.append(Segmented(arrays["in_focus"], method, sections[planes], photon_in_focus=photons))
    depth = None
    if lists_part(files, DEPTH):
        maps = read(DEPTH, DEPTH_LABELS)
        depth = DepthMap(maps["z_mm"], maps["confidence"])
    if not segmented and depth is None:
        raise InputError(f"{out}: has neither in-focus masks nor a depth map; make them with `pcii run`")
    return segmented, depth
