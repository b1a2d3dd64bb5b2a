"""The command `pcii import`: images made by others become a dataset."""

from pathlib import Path

from pcii.app.command_options import Out
from pcii.app.import_options import NOTHING_SAID, ImportOptions
from pcii.base.command_output import answer, results_folder, say, say_next
from pcii.base.errors import InputError
from pcii.base.progress import Stages
from pcii.core.arrays import check_z_mm
from pcii.core.images import Views
from pcii.core.photon_counts import PhotonCounts
from pcii.core.photon_limit import check_photons, limit_photons
from pcii.importing.import_advice import checked
from pcii.importing.import_requests import Imported, read
from pcii.io.dataset import Dataset
from pcii.io.dataset_writer import check_depth_range, held_dataset, save_dataset


def import_dataset(source: Path, *, out: Out, options: ImportOptions = NOTHING_SAID) -> None:
    """Make a dataset of images that others made: pictures, arrays, lens arrays, photon counts.

    Says at which depths things are sharpest, and warns if the views fit together better in another order.

    Examples of use:

        pcii import photos -o out/mine --pattern "{col}_{row}.png" --pitch-mm 2 2 --focal-mm 35 --sensor-mm 36
        pcii import photos -o out/dim --pattern "{col}_{row}.png" --pitch-mm 2 2 --focal-mm 35 \\
          --sensor-mm 36 --cfa GRBG --photons 1000 --z-range-mm 30 200
        pcii import cotton -o out/cotton
        pcii import lenses.png -o out/lenses --lens-array 10 10 --lens-pitch-px 60.5 60.5 --focal-mm 3 \\
          --pixel-mm 0.01
        pcii import frames.npy -o out/spad --counts --pitch-mm 5 5 --focal-mm 50 --pixel-mm 0.05
        pcii import cubes -o out/spad --counts --bitpack --pattern "{row}_{col}.npy" --pitch-mm 5 5 \\
          --focal-mm 50 --pixel-mm 0.05

    Parameters
    ----------
    source
        A folder of pictures, a TIFF file with a page for each view, a folder of the HCI 4D light field
        benchmark, pictures or photon cubes with a transforms.json, a picture of a lens array, an array in a
        .npy or .npz file: (K, L, H, W), (K, L, H, W, C), or with --counts (K, L, N, H, W); or events.npz or
        views.exr of `simgen export`, which need no options.
    out
        Folder for the dataset: new or empty.
    """
    asked, photons, said = options.request(source), options.light.photons, options.dataset
    depths = check_z_mm(said.z_mm).tolist() if said.z_mm else None
    if said.z_range_mm is not None:
        check_depth_range(said.z_range_mm)
    if photons is not None:
        check_photons(photons)
        if asked.views.counts:
            raise InputError("--photons: is for pictures; these are photon counts already")
    held_dataset(out, None, content=False)
    with Stages() as report:
        imported = read(asked, report)
        given, drawn = _with_photons(source, imported, photons, options.light.seed)
        z_range = said.z_range_mm or imported.z_range_mm
        sharp, warning = checked(imported, asked, z_range)
        dataset = save_dataset(
            out,
            given,
            imported.truth,
            view_z_mm=imported.view_z_mm,
            z_mm=depths or imported.z_mm or [float(f"{z:.3g}") for z in sharp] or None,
            z_range_mm=z_range,
            photon_budget=photons or imported.photon_budget,
            radiance_unit=imported.radiance_unit,
            title=said.title or source.resolve().name,
            licence=said.licence,
            citation=said.citation,
            origin=imported.origin + drawn,
        )
    _say_what_came_in(dataset, imported, drawn, sharp)
    if warning is not None:
        answer(f"warning: {warning}; then delete {out} and import again")
    else:
        if not sharp and not imported.z_mm:
            say("nothing is clearly sharp at any depth that was looked at")
        say_next("pcii", "run", out, "-o", results_folder(out))


def _with_photons(
    source: Path, imported: Imported, photons: float | None, seed: int
) -> tuple[list[Views | PhotonCounts], str]:
    """Images and those beside them, with photon counts drawn of views if asked for, and a note of that."""
    given = [imported.images, *imported.beside]
    if photons is None:
        return given, ""
    if any(isinstance(one, PhotonCounts) for one in given):
        raise InputError(f"--photons: is for pictures, and {source} has photon counts already")
    counts = [limit_photons(one, photons, seed=seed) for one in given if isinstance(one, Views)]
    return [*given, *counts], f"; {photons:g} photons expected in each view, seed {seed}"


def _say_what_came_in(dataset: Dataset, imported: Imported, drawn: str, sharp: tuple[float, ...]) -> None:
    K, L, H, W = dataset.grid.shape_KLHW
    pattern = dataset.cfa or "no"
    say(f"{dataset.path}: {K} x {L} views of {H} x {W} px, {pattern} Bayer pattern; {imported.origin}{drawn}")
    for note in imported.notes:
        say(note)
    if sharp:
        say(f"sharpest at {', '.join(f'{z:.3g}' for z in sharp)} mm")
