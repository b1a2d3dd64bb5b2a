"""The command `export`, the formats that it writes, and archives of events.

train-000000.tar    of a collection: 000017.npz, the events of its dataset 17, and 000017.json, its row
                    of the index; shards of a split, or "all", in an order that is drawn once for all
"""

import io
import tarfile
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import numpy as np
from cyclopts import Parameter

from pcii.base import InputError, Report, Stages, json_bytes, named_in_errors, new_folder_safely, say, silent
from pcii.exchange.hci_scenes import write_hci
from pcii.exchange.posed_exports import write_nerfstudio, write_photon_cubes
from pcii.store import COLUMNS, Collection, Dataset, check_free, is_collection, open_collection, open_dataset
from pcii.types import OPTIONAL_MAPS, Light

Format = Literal["hci", "nerfstudio", "photoncube", "events", "webdataset"]
SHARD_BYTES = 1 << 28
"""A shard is full from here on: large enough to stream, small enough that several processes have some."""


def export_dataset(
    dataset: Dataset | Collection | str | Path,
    format: Format,
    out: str | Path,
    *,
    budget: float | None = None,
    report: Report = silent,
) -> Path:
    """Write a dataset to the new or empty folder `out` for other tools, and return the folder.

    Each dataset of a collection, or of a part of one, is written to a folder in `out` that has its name.
    `budget` is a nested photon budget, whose photons are written instead of all. `format` is "hci" (the
    layout of the HCI 4D light field benchmark), "nerfstudio" (pictures and their poses, transforms.json),
    "photoncube" (binary frames as packed bits, and poses), "events" (one NumPy archive) or, of a collection,
    "webdataset" (tar files of such archives); docs/exchange.md describes them. The folder is there as a whole
    or not at all. Raises `InputError` for another format, a folder that holds something or is part of the
    dataset, and a dataset that lacks what the format needs.
    """
    if format not in get_args(Format):
        raise InputError(f"format: there is no {format!r}; use one of {', '.join(get_args(Format))}")
    if isinstance(dataset, str | Path):
        dataset = open_collection(dataset) if is_collection(Path(dataset)) else open_dataset(dataset)
    folder = Path(out)
    check_free(folder, "export")
    if folder.resolve().is_relative_to(dataset.path.resolve()):
        raise InputError(
            f"{folder}: is in {dataset.path}, which lists all its files; name a folder elsewhere"
        )
    if isinstance(dataset, Collection) and not dataset:
        raise InputError(f"{dataset.path}: the collection has no finished dataset to export")
    folder.parent.mkdir(parents=True, exist_ok=True)

    def in_light(one: Dataset) -> Dataset:
        return one if budget is None else one.at_light(Light(budget))

    with named_in_errors(folder), new_folder_safely(folder) as temporary:
        if isinstance(dataset, Dataset):
            if format == "webdataset":
                raise InputError(
                    f"{dataset.path}: webdataset is for a collection of datasets; events for one"
                )
            WRITERS[format](in_light(dataset), temporary)
        elif format == "webdataset":
            _write_shards(dataset, temporary, in_light, report)
        else:
            for number, one in enumerate(dataset, start=1):
                place = temporary / one.path.name
                place.mkdir()
                WRITERS[format](in_light(one), place)
                report("datasets", number, len(dataset))
    return folder


def _events_of(dataset: Dataset) -> bytes:
    """Photons, cameras and truth as a NumPy archive, whose arrays need no pickle.

    `k`, `l`, `i`, `j`, `n` (events,); `frames`, `bits` and `frame` (photons,) of a camera that has frames, if
    they are known; each field of the `CameraGrid` by its name; `cfa`, "" for monochrome.
    Where known, `analysis_z_mm` (planes,), `analysis_z_range_mm` (near, far) and `photon_budget`; and
    `truth_...` (H, W) maps of the virtual centre with `object_keys` and `object_names`, and
    `photon_object_id`, `photon_z_mm` (photons,), photon by photon in the events' order.
    """
    counts = dataset.counts
    values = {name: getattr(counts.events, name) for name in "klijn"}
    values |= asdict(dataset.grid) | {"cfa": dataset.cfa or ""}
    if not counts.readout.is_plain:
        values |= asdict(counts.readout)
    values["frame"] = counts.frame
    for name in ("z_mm", "z_range_mm"):
        values[f"analysis_{name}"] = dataset.analysis.get(name) or None
    values["photon_budget"] = dataset.light.photons
    truth = dataset.truth
    if truth is not None:
        values |= {f"truth_{name}": getattr(truth, name) for name in ("z_mm", "object_id", *OPTIONAL_MAPS)}
        values["object_keys"] = np.array(list(truth.names), dtype=np.int64)
        values["object_names"] = np.array(list(truth.names.values()), dtype=np.str_)
        if truth.photons is not None:
            values["photon_object_id"] = truth.photons.object_id
            values["photon_z_mm"] = truth.photons.z_mm
    arrays: dict[str, Any] = {name: np.asarray(value) for name, value in values.items() if value is not None}
    content = io.BytesIO()
    np.savez_compressed(content, **arrays)
    return content.getvalue()


def _write_shards(
    collection: Collection, folder: Path, in_light: Callable[[Dataset], Dataset], report: Report
) -> None:
    """Write the tar files of a collection as WebDataset reads them, each split in shards of its own.

    Datasets that follow each other are alike, so they are in an order drawn at random, the same each time.
    """
    shards_by_split = dict[str, list[Path]]()
    order = np.random.default_rng(0).permutation(len(collection))
    for done, number in enumerate(order.tolist(), start=1):
        row = collection.rows[number]
        split = row["split"] or "all"
        shards = shards_by_split.setdefault(split, [])
        if not shards or shards[-1].stat().st_size >= SHARD_BYTES:
            shards.append(folder / f"{split}-{len(shards):06d}.tar")
        described = {name: row[name] for name in (*COLUMNS, "values")}
        parts = {"npz": _events_of(in_light(collection[number])), "json": json_bytes(described)}
        with tarfile.open(shards[-1], "a", format=tarfile.USTAR_FORMAT) as shard:
            for suffix, content in parts.items():
                member = tarfile.TarInfo(f"{number:06d}.{suffix}")
                member.size = len(content)
                shard.addfile(member, io.BytesIO(content))
        report("datasets", done, len(collection))


WRITERS: dict[Format, Callable[[Dataset, Path], object]] = {
    "hci": write_hci,
    "nerfstudio": write_nerfstudio,
    "photoncube": write_photon_cubes,
    "events": lambda dataset, folder: (folder / "events.npz").write_bytes(_events_of(dataset)),
}


def export(
    dataset: Path,
    *,
    format: Format,
    out: Annotated[Path, Parameter(name=("--out", "-o"))],
    budget: float | None = None,
) -> None:
    """Write a dataset in a format that other tools read: into a new folder, as a whole or not at all.

    hci: the layout of the HCI 4D light field benchmark. nerfstudio: a PNG for each view and transforms.json
    with the poses of the cameras, as neural reconstruction reads them. photoncube: the binary frames of each
    view as packed bits, with poses. events: a NumPy archive of photons, cameras and truth. Each dataset of a
    collection is written to a folder in the new one that has its name. webdataset: tar files of such
    archives, of a collection as a whole, to stream while training.

    Examples of use:

        pcii export out/paper --format events -o out/paper-events
        pcii export out/small --format nerfstudio -o out/small-poses
        simgen export out/spad --format photoncube -o out/spad-cubes

    Parameters
    ----------
    dataset
        Folder of a dataset or of a collection.
    out
        Folder for the files: new or empty.
    budget
        Export the photons of this smaller, nested budget of the recipe.
    """
    with Stages() as report:
        folder = export_dataset(dataset, format, out, budget=budget, report=report)
    files = [file for file in folder.rglob("*") if file.is_file()]
    say(f"{folder}: {len(files)} files, {sum(file.stat().st_size for file in files) / 1e6:.1f} MB")
