"""The formats that a dataset can be written in, by name, and the folder that is written."""

from collections.abc import Callable
from pathlib import Path
from typing import Literal, get_args

from pcii.base.errors import InputError
from pcii.base.safe_files import named_in_errors, new_folder_safely
from pcii.exporting.event_archive import write_events
from pcii.exporting.exr_parts import write_exr_parts
from pcii.exporting.hci_layout import write_hci
from pcii.exporting.sub_aperture_images import write_sub_aperture_images
from pcii.io.dataset import Dataset, open_dataset

Format = Literal["hci", "saii", "events", "exr"]
WRITERS: dict[Format, Callable[[Dataset, Path], None]] = {
    "hci": write_hci,
    "saii": write_sub_aperture_images,
    "events": write_events,
    "exr": write_exr_parts,
}
assert set(WRITERS) == set(get_args(Format))


def export_dataset(dataset: Dataset | str | Path, format: Format, out: str | Path) -> Path:
    """Write a dataset to the new or empty folder `out` for other tools; the folder.

    `format` is "hci" (the layout of the HCI 4D light field benchmark), "saii" (sub-aperture images as PNG,
    `row_col.png`), "events" (one NumPy archive) or "exr" (one OpenEXR file with a part for each view); see
    docs/exchange.md. The folder is there as a whole or not at all. Raises `InputError` for another format, a
    folder that holds something or is part of the dataset, and a dataset that lacks what the format needs.
    """
    data = dataset if isinstance(dataset, Dataset) else open_dataset(dataset)
    if format not in WRITERS:
        raise InputError(f"format: there is no {format!r}; use one of {', '.join(WRITERS)}")
    folder = Path(out)
    _check_free(folder, data)
    folder.parent.mkdir(parents=True, exist_ok=True)
    with named_in_errors(folder), new_folder_safely(folder) as temporary:
        WRITERS[format](data, temporary)
    return folder


def _check_free(folder: Path, dataset: Dataset) -> None:
    """Raise `InputError` unless the folder is new or empty, and no part of the dataset."""
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: this is a file; name a folder for the export")
    if folder.is_dir() and any(folder.iterdir()):
        raise InputError(f"{folder}: holds something else; name a new or empty folder")
    if folder.resolve().is_relative_to(dataset.path.resolve()):
        raise InputError(f"{folder}: is in the dataset, which lists all its files; name a folder elsewhere")
