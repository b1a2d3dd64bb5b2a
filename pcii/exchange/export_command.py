"""The command `export` of `pcii` and `simgen`."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from pcii.base.command_line import say
from pcii.base.progress import Stages
from pcii.exchange.export_formats import Format, export_dataset


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
