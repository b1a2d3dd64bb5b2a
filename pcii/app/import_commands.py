"""The command `pcii import`: images made by others become a dataset."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from pcii.app.command_options import Depths, Out
from pcii.base.command_output import answer, results_folder, say, say_next
from pcii.base.errors import InputError
from pcii.base.progress import Stages
from pcii.exchange.camera_fit import CameraFit, check_grid
from pcii.exchange.image_folders import ViewOrder
from pcii.exchange.import_requests import (
    Cameras,
    Lenses,
    Pair,
    PictureLight,
    Source,
    WholePair,
    read,
    values_of,
)
from pcii.store.dataset_writer import check_depth_range, held_dataset, save_dataset
from pcii.types.arrays import check_z_mm
from pcii.types.images import Views
from pcii.types.photon_counts import PhotonCounts
from pcii.types.photon_limit import Light, limit_photons

FLAT = Parameter(name="*")
CAMERAS, ORDER, LENSES, LIGHT = Cameras(), ViewOrder(), Lenses(), PictureLight()


@dataclass(frozen=True, kw_only=True)
class Texts:
    """What the dataset says of itself."""

    title: str | None = None
    """Title of reports."""
    licence: str | None = None
    """Licence of the images."""
    citation: str | None = None
    """Whom to cite for the images."""


TEXTS = Texts()


def import_dataset(
    source: Path,
    *,
    out: Out,
    pattern: str | None = None,
    grid: WholePair = None,
    array: str | None = None,
    counts: bool = False,
    bitpack: bool = False,
    width: int | None = None,
    frames: WholePair = None,
    cameras: Annotated[Cameras, FLAT] = CAMERAS,
    order: Annotated[ViewOrder, FLAT] = ORDER,
    lenses: Annotated[Lenses, FLAT] = LENSES,
    light: Annotated[PictureLight, FLAT] = LIGHT,
    cfa: str | None = None,
    photons: float | None = None,
    seed: int = 1,
    z_mm: Depths = (),
    z_range_mm: Pair = None,
    texts: Annotated[Texts, FLAT] = TEXTS,
) -> None:
    """Make a dataset of images that others made: pictures, arrays, lens arrays, photon counts.

    Says at which depths things are sharpest, and warns if the views fit together better in another order or
    with a shift.

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
        .npy or .npz file: (K, L, H, W), (K, L, H, W, C), or with --counts (K, L, N, H, W).
    out
        Folder for the dataset: new or empty.
    pattern
        Names of the files of a folder, with {row} and {col}, or with {index} that counts along the rows; *
        stands for any text.
    grid
        Rows and columns of cameras, for {index}, for pages, and for arrays whose first axis counts the views.
        Default: square.
    array
        Name of the array in an .npz file that has several.
    counts
        The files hold photon counts; pages of the TIFF file of a view are frames, which are added up.
    bitpack
        Frames in .npy files are of bits, packed along the width as numpy.packbits does.
    width
        Pixels in a row of packed frames. Default: all bits.
    frames
        First and last frame to add up, counted from 0. Default: all.
    cfa
        Bayer pattern: GRBG, RGGB, BGGR or GBRG; none for a sensor without colours. Of RGB pictures each pixel
        keeps one colour; grey ones are mosaics already.
    photons
        Draw photon counts with so many expected in each view.
    seed
        Seed of these counts.
    z_mm
        Depth to look at in mm, or start:stop:step, kept as a suggestion; repeat for more. Default: where
        things are sharpest.
    z_range_mm
        Nearest and farthest depth of the scene in mm, kept as a suggestion.
    """
    depths = check_z_mm(z_mm).tolist() if z_mm else None
    if z_range_mm is not None:
        check_depth_range(z_range_mm)
    if photons is not None:
        Light(photons)
    options: dict[str, Any] = {
        "pattern": pattern,
        "grid": grid,
        "array": array,
        "counts": counts,
        "bitpack": bitpack,
        "width": width,
        "frames": frames,
        "cfa": None if cfa is not None and cfa.lower() == "none" else cfa,
    }
    for group in (cameras, order, lenses, light):
        options |= values_of(group)
    held_dataset(out, None, content=False)
    notes: list[str] = []
    with Stages() as report:
        imported = read(Source(source, report, notes.append), options)
        images: list[Views | PhotonCounts] = [imported.images]
        drawn = ""
        if photons is not None:
            if isinstance(imported.images, PhotonCounts):
                raise InputError(f"--photons: is for pictures, and {source} has photon counts already")
            images.append(limit_photons(imported.images, photons, seed=seed))
            drawn = f"; {photons:g} photons expected in each view, seed {seed}"
        z_range = z_range_mm or imported.z_range_mm
        fit = check_grid(imported.images, z_range, order=order, counted=imported.counted)
        dataset = save_dataset(
            out,
            images,
            imported.truth,
            view_z_mm=imported.view_z_mm,
            z_mm=depths or [float(f"{z:.3g}") for z in fit.z_mm] or None,
            z_range_mm=z_range,
            photon_budget=photons,
            title=texts.title or source.resolve().name,
            licence=texts.licence,
            citation=texts.citation,
            origin=imported.origin + drawn,
        )
    K, L, H, W = dataset.grid.shape_KLHW
    bayer = dataset.cfa or "no"
    say(f"{dataset.path}: {K} x {L} views of {H} x {W} px, {bayer} Bayer pattern; {imported.origin}{drawn}")
    for note in notes:
        (answer if note.startswith("warning") else say)(note)
    advice = None if imported.states_cameras else _advice(fit, imported.images, order, lenses)
    if advice is not None:
        answer(f"warning: {advice}; then delete {out} and import again")
        return
    _say_depths(fit, imported.images)
    say_next("pcii", "run", out, "-o", results_folder(out))


def _advice(fit: CameraFit, images: Views | PhotonCounts, order: ViewOrder, lenses: Lenses) -> str | None:
    """What would make the views fit the cameras, in words of options; None if they do."""
    sentences = []
    if fit.order is not None:
        changed = {n: value for n, value in values_of(fit.order).items() if value != getattr(order, n)}
        if (
            lenses.lens_array is not None
            and set(changed) == {"flip_rows", "flip_cols"}
            and order == ViewOrder()
        ):
            changed = {"inverted": not lenses.inverted}
        flags = {
            value: [f"--{n.replace('_', '-')}" for n, v in changed.items() if v is value]
            for value in (True, False)
        }
        words = [f"with {' '.join(flags[True])}"] * bool(flags[True])
        words += [f"without {' '.join(flags[False])}"] * bool(flags[False])
        sentences.append(f"the views fit together far better {' and '.join(words)}")
        if set(changed) == {"flip_rows", "flip_cols"}:
            sentences.append("or, if pictures were shifted so that something stands still, with --shear-px")
    if fit.shear_px is not None:
        x, y = fit.shear_px
        sentences.append(
            "things are sharp at disparities below 0, as of pictures that were shifted so that something "
            f"stands still: give that shift as --shear-px; {x:g} {y:g} or more brings all in front"
        )
    if fit.outside_mm is not None:
        sentences.append(
            f"most is sharp at about {_three_digits(fit.outside_mm)} mm, outside of --z-range-mm; correct "
            "--pitch-mm, --focal-mm or the size of pixels, or the range"
        )
    return "; ".join(sentences) or None


def _say_depths(fit: CameraFit, images: Views | PhotonCounts) -> None:
    """Say where things are sharp; where nothing is, what was looked at and the next step."""
    is_counts = isinstance(images, PhotonCounts)
    if fit.z_mm:
        say(f"sharpest at {', '.join(map(_three_digits, fit.z_mm))} mm")
    elif fit.nearest_mm is None:
        why = "photons are too few" if is_counts else "there is one view, or views are too small"
        say(f"cannot judge whether views fit their cameras: {why}; name depths to `pcii run` by --z-mm")
    else:
        why = "if photons are not too few" if is_counts else "if there is texture"
        say(
            f"nothing is clearly sharp from {_three_digits(fit.nearest_mm)} mm to infinity; {why}, correct "
            "the order of views, --pitch-mm, --focal-mm or the size of pixels, else name depths to `pcii "
            "run` by --z-mm"
        )


def _three_digits(z_mm: float) -> str:
    """A depth without an exponent: 1870, not 1.87e+03."""
    return f"{float(f'{z_mm:.3g}'):g}"
