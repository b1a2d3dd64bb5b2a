"""The formats that datasets can be written in, by name, and the folder that is written."""

from collections.abc import Callable
from pathlib import Path
from typing import Literal, get_args

from pcii.base.errors import InputError
from pcii.base.progress import Report, silent
from pcii.exporting.event_archive import write_events
from pcii.exporting.exr_parts import write_exr_parts
from pcii.exporting.hci_layout import write_hci
from pcii.exporting.nerfstudio_folder import write_nerfstudio
from pcii.exporting.photon_cubes import write_photon_cubes
from pcii.exporting.sub_aperture_images import write_sub_aperture_images
from pcii.io.collection import Collection, open_collection
from pcii.io.collection_layout import is_collection
from pcii.io.dataset import Dataset, open_dataset
from pcii.store.folder_kind import check_free
from pcii.store.safe_files import named_in_errors, new_folder_safely

Format = Literal["hci", "saii", "nerfstudio", "photoncube", "events", "exr"]
WRITERS: dict[Format, Callable[[Dataset, Path], None]] = {
    "hci": write_hci,
    "saii": write_sub_aperture_images,
    "nerfstudio": write_nerfstudio,
    "photoncube": write_photon_cubes,
    "events": write_events,
    "exr": write_exr_parts,
}
assert set(WRITERS) == set(get_args(Format))


def export_dataset(
    dataset: Dataset | Collection | str | Path,
    format: Format,
    out: str | Path,
    *,
    budget: float | None = None,
    report: Report = silent,
) -> Path:
    """Write a dataset to the new or empty folder `out` for other tools; the folder.

    Of a collection, or a part of one, each dataset is written to a folder in `out` that is named as its own.
    `budget` is a nested photon budget, whose photons are written instead of all. `format` is "hci" (the
    layout of the HCI 4D light field benchmark), "saii" (sub-aperture images as PNG, `row_col.png`),
    "nerfstudio" (pictures and their poses, transforms.json), "photoncube" (binary frames as packed bits, and
    poses), "events" (one NumPy archive) or "exr" (one OpenEXR file with a part for each view); see
    docs/exchange.md. The folder is there as a whole or not at all. Raises `InputError` for another format, a
    folder that holds something or is part of the dataset, and a dataset that lacks what the format needs.
    """
    if format not in WRITERS:
        raise InputError(f"format: there is no {format!r}; use one of {', '.join(WRITERS)}")
    if isinstance(dataset, str | Path):
        dataset = open_collection(dataset) if is_collection(Path(dataset)) else open_dataset(dataset)
    folder = Path(out)
    _check_place(folder, dataset.path)
    folder.parent.mkdir(parents=True, exist_ok=True)

    def write(data: Dataset, place: Path) -> None:
        WRITERS[format](data if budget is None else data.at_budget(budget), place)

    with named_in_errors(folder), new_folder_safely(folder) as temporary:
        if isinstance(dataset, Dataset):
            write(dataset, temporary)
            return folder
        if not dataset:
            raise InputError(f"{dataset.path}: the collection has no finished dataset to export")
        for done, data in enumerate(dataset, start=1):
            place = temporary / data.path.name
            place.mkdir()
            write(data, place)
            report("datasets", done, len(dataset))
    return folder


def _check_place(folder: Path, source: Path) -> None:
    """Raise `InputError` unless the folder is new or empty, and no part of the dataset or collection."""
    check_free(folder, "export")
    if folder.resolve().is_relative_to(source.resolve()):
        raise InputError(f"{folder}: is in {source}, which lists all its files; name a folder elsewhere")
