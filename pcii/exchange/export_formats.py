"""The formats that datasets can be written in, by name, and the folder that is written."""

from collections.abc import Callable
from pathlib import Path
from typing import Literal

from pcii.base.errors import InputError
from pcii.base.progress import Report, silent
from pcii.exchange.export_hci import write_hci
from pcii.exchange.export_photons import write_events, write_photon_cubes
from pcii.exchange.export_pictures import write_nerfstudio
from pcii.io.collection import Collection, open_collection
from pcii.io.collection_layout import is_collection
from pcii.io.dataset import Dataset, open_dataset
from pcii.store.folder_kind import check_free
from pcii.store.safe_files import named_in_errors, new_folder_safely

Format = Literal["hci", "nerfstudio", "photoncube", "events"]
WRITERS: dict[Format, Callable[[Dataset, Path], None]] = {
    "hci": write_hci,
    "nerfstudio": write_nerfstudio,
    "photoncube": write_photon_cubes,
    "events": write_events,
}


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
    "photoncube" (binary frames as packed bits, and poses) or "events" (one NumPy archive); docs/exchange.md
    describes them. The folder is there as a whole or not at all. Raises `InputError` for another format, a
    folder that holds something or is part of the dataset, and a dataset that lacks what the format needs.
    """
    if format not in WRITERS:
        raise InputError(f"format: there is no {format!r}; use one of {', '.join(WRITERS)}")
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

    def write(one: Dataset, place: Path) -> None:
        WRITERS[format](one if budget is None else one.at_budget(budget), place)

    with named_in_errors(folder), new_folder_safely(folder) as temporary:
        if isinstance(dataset, Dataset):
            write(dataset, temporary)
            return folder
        for number, one in enumerate(dataset, start=1):
            place = temporary / one.path.name
            place.mkdir()
            write(one, place)
            report("datasets", number, len(dataset))
    return folder
