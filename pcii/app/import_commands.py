"""The command `pcii import`: images made by others become a dataset."""

from pathlib import Path

from pcii.app.command_options import Depths, Out
from pcii.base.command_output import answer, results_folder, say, say_next
from pcii.base.errors import InputError
from pcii.base.progress import Stages
from pcii.core.images import Views
from pcii.core.photon_counts import PhotonCounts
from pcii.importing.camera_order import Optics, ViewOrder
from pcii.importing.lens_arrays import LensArray
from pcii.importing.light_encoding import Encoding, check_encoding

Pair = tuple[float, float] | None
WholePair = tuple[int, int] | None


def import_dataset(
    source: Path,
    *,
    out: Out,
    pattern: str | None = None,
    grid: WholePair = None,
    pitch_mm: Pair = None,
    focal_mm: float | None = None,
    sensor_mm: float | None = None,
    pixel_mm: float | None = None,
    shear_px: Pair = None,
    serpentine: bool = False,
    swap_axes: bool = False,
    flip_rows: bool = False,
    flip_cols: bool = False,
    lens_array: WholePair = None,
    lens_pitch_px: Pair = None,
    lens_offset_px: Pair = None,
    inverted: bool = False,
    array: str | None = None,
    counts: bool = False,
    srgb: bool = False,
    linear: bool = False,
    gamma: float | None = None,
    cfa: str | None = None,
    photons: float | None = None,
    seed: int = 1,
    z_mm: Depths = (),
    z_range_mm: Pair = None,
    title: str | None = None,
    licence: str | None = None,
    citation: str | None = None,
) -> None:
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

    Parameters
    ----------
    source
        A folder of pictures, a TIFF file with a page for each view, a folder of the HCI 4D light field
        benchmark, a picture of a lens array, an array in a .npy or .npz file: (K, L, H, W), (K, L, H, W, C),
        or with --counts (K, L, N, H, W); or events.npz or views.exr of `simgen export`, which need no
        options.
    out
        Folder for the dataset: new or empty.
    pattern
        Names of the files of a folder, with {row} and {col}, or with {index} that counts along the rows.
    grid
        Rows and columns of cameras, for {index} and for pages. Default: square.
    pitch_mm
        Distance between neighbouring cameras, x and y. Of a lens array: its lens pitch in pixels, by default.
    focal_mm
        Focal length: from the pinhole to the sensor.
    sensor_mm
        Width of the sensor that a whole picture shows.
    pixel_mm
        Side of a pixel, instead of --sensor-mm.
    shear_px
        Disparity, x and y, that was taken out of the pictures of a converging grid.
    serpentine
        Every other row is stored backwards, as a stage takes them that moves to and fro.
    swap_axes
        Rows and columns are exchanged; {index} and pages count down the columns.
    flip_rows
        Rows are counted from the bottom.
    flip_cols
        Columns are counted from the right.
    lens_array
        Rows and columns of lenses whose images one picture holds side by side.
    lens_pitch_px
        Distance from lens to lens in the picture, x and y; need not be whole.
    lens_offset_px
        Left upper corner of the first lens image, x and y. Default: 0 0.
    inverted
        Each lens image is upside down, as a sensor right behind the lenses sees it.
    array
        Name of the array in an .npz file that has several.
    counts
        The files hold photon counts; pages of the TIFF file of a view are frames, which are added up.
    srgb
        Numbers are sRGB: the default for whole numbers in pictures.
    linear
        Numbers are proportional to light: the default for floats.
    gamma
        Light is the number (from 0 to 1) to the power of this.
    cfa
        Bayer pattern: GRBG, RGGB, BGGR or GBRG. Of RGB pictures each pixel keeps one colour; grey ones are
        mosaics already.
    photons
        Draw photon counts with so many expected in each view.
    seed
        Seed of these counts.
    z_mm
        Depth to look at in mm, or start:stop:step, kept as a suggestion; repeat for more. Default: where
        things are sharpest.
    z_range_mm
        Nearest and farthest depth of the scene in mm, kept as a suggestion.
    title
        Title of reports.
    licence
        Licence of the images.
    citation
        Whom to cite for the images.
    """
    from pcii.app.import_source import Request, checked, read
    from pcii.core.arrays import check_z_mm
    from pcii.core.photon_limit import check_photons, limit_photons
    from pcii.io.dataset_writer import check_depth_range, held_dataset, save_dataset

    asked = Request(
        source=source,
        optics=_optics(pitch_mm, focal_mm, sensor_mm, pixel_mm, shear_px, lens_pitch_px),
        order=ViewOrder(serpentine=serpentine, swap_axes=swap_axes, flip_rows=flip_rows, flip_cols=flip_cols),
        pattern=pattern,
        grid=grid,
        array=array,
        lenses=_lenses(lens_array, lens_pitch_px, lens_offset_px, inverted),
        counts=counts,
        encoding=_encoding(srgb, linear, gamma),
        cfa=cfa,
    )
    depths = check_z_mm(z_mm).tolist() if z_mm else None
    if z_range_mm is not None:
        check_depth_range(z_range_mm)
    if photons is not None:
        check_photons(photons)
        if counts:
            raise InputError("--photons: is for pictures; these are photon counts already")
    held_dataset(out, None, content=False)
    with Stages() as report:
        imported = read(asked, report)
        images = imported.images
        origin, given = imported.origin, [images, *imported.beside]
        if photons is not None and any(isinstance(one, PhotonCounts) for one in given):
            raise InputError(f"--photons: is for pictures, and {source} has photon counts already")
        z_range = z_range_mm or imported.z_range_mm
        sharp, warning = checked(imported, asked, z_range)
        if photons is not None and isinstance(images, Views):
            given.append(limit_photons(images, photons, seed=seed))
            origin += f"; {photons:g} photons expected in each view, seed {seed}"
        dataset = save_dataset(
            out,
            given,
            imported.truth,
            z_mm=depths or imported.z_mm or [float(f"{z:.3g}") for z in sharp] or None,
            z_range_mm=z_range,
            photon_budget=photons or imported.photon_budget,
            title=title or source.resolve().name,
            licence=licence,
            citation=citation,
            origin=origin,
        )
    K, L, H, W = dataset.grid.shape_KLHW
    say(f"{out}: {K} x {L} views of {H} x {W} px, {dataset.cfa or 'no'} Bayer pattern; {origin}")
    for note in imported.notes:
        say(note)
    if sharp:
        say(f"sharpest at {', '.join(f'{z:.3g}' for z in sharp)} mm")
    elif warning is None and not imported.z_mm:
        say("nothing is clearly sharp at any depth that was looked at")
    if warning is not None:
        answer(f"warning: {warning}; then delete {out} and import again")
    else:
        say_next("pcii", "run", out, "-o", results_folder(out))


def _optics(
    pitch_mm: tuple[float, float] | None,
    focal_mm: float | None,
    sensor_mm: float | None,
    pixel_mm: float | None,
    shear_px: tuple[float, float] | None,
    lens_pitch_px: tuple[float, float] | None,
) -> Optics | None:
    """The cameras' optics; None if nothing is said of them. `InputError` if only a part is."""
    if lens_pitch_px is not None and pitch_mm is None and pixel_mm is not None:
        pitch_mm = lens_pitch_px[0] * pixel_mm, lens_pitch_px[1] * pixel_mm
    size = sensor_mm if pixel_mm is None else pixel_mm
    needed = {"--pitch-mm": pitch_mm, "--focal-mm": focal_mm, "--sensor-mm or --pixel-mm": size}
    missing = [name for name, value in needed.items() if value is None]
    if len(missing) == len(needed) and shear_px is None:
        return None
    if missing or pitch_mm is None or focal_mm is None:
        raise InputError(f"{', '.join(missing)}: missing; cameras need pitch, focal length and pixel size")
    return Optics(
        pitch_mm=pitch_mm,
        focal_mm=focal_mm,
        sensor_mm=sensor_mm,
        pixel_mm=pixel_mm,
        shear_px=shear_px or (0.0, 0.0),
    )


def _lenses(
    array: tuple[int, int] | None,
    pitch_px: tuple[float, float] | None,
    offset_px: tuple[float, float] | None,
    inverted: bool,
) -> LensArray | None:
    if array is None:
        if pitch_px is not None or offset_px is not None or inverted:
            raise InputError("--lens-pitch-px, --lens-offset-px, --inverted: are for --lens-array")
        return None
    if pitch_px is None:
        raise InputError("--lens-pitch-px: missing; a lens array needs the distance from lens to lens")
    return LensArray(
        rows=array[0], cols=array[1], pitch_px=pitch_px, offset_px=offset_px or (0.0, 0.0), inverted=inverted
    )


def _encoding(srgb: bool, linear: bool, gamma: float | None) -> Encoding | None:
    if srgb + linear + (gamma is not None) > 1:
        raise InputError("--srgb, --linear, --gamma: give one of them")
    check_encoding(gamma)
    return "srgb" if srgb else "linear" if linear else gamma
