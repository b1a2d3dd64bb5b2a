"""The command `pcii import`: images made by others become a dataset.

The parameters of a reader are its options. `optics`, `order`, `lenses`, `encoding` and `stored` stand for
several options, which a dataclass lists. An option that the reader of a source does not take is refused.
"""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter

from pcii.app.pipeline import depths_text, surface_depths
from pcii.app.step_commands import Depths, Out
from pcii.base import InputError, Stages, results_folder, say, say_next
from pcii.evidence import CameraFit, check_grid, without_hot_pixels
from pcii.exchange import (
    AS_COUNTED,
    AS_STORED,
    NO_DEPTH,
    PARAMETERS,
    TRANSFORMS,
    VIEWS,
    DepthFile,
    Encoding,
    FrameFormat,
    KnownViews,
    LensArray,
    Note,
    Optics,
    TransformsFile,
    ViewOrder,
    import_arrays,
    import_counts,
    import_hci,
    import_images,
    import_interlaced,
    import_lens_array,
    import_posed_cubes,
    import_posed_pictures,
    kind_of,
    read_transforms,
)
from pcii.sections import warn_of_saturation
from pcii.store import check_free, save_dataset
from pcii.types import FocalPlanes, PhotonCounts, Views, depth_of_total_disparity_mm, limit_photons

MOVING_SHARE = 0.25
"""A point whose total disparity is this share of a view's longer side is elsewhere in each view, so that what
is at the same pixel in most of them is a fault of the sensor, or at infinity."""
COLMAP_FILES = ("cameras.bin", "cameras.txt", "sparse/0/cameras.bin", "sparse/0/cameras.txt")
WholePair = tuple[int, int] | None
Pair = tuple[float, float] | None


@dataclass(frozen=True, kw_only=True)
class Cameras:
    """Where cameras stand and how they see."""

    pitch_mm: Pair = None
    """Distance between neighbouring cameras, x and y. Of a lens array: its lens pitch in pixels, by
    default."""
    focal_mm: float | None = None
    """Focal length: from the pinhole to the sensor."""
    sensor_mm: float | None = None
    """Width of the sensor that a whole picture shows."""
    pixel_mm: float | None = None
    """Side of a pixel, instead of --sensor-mm."""
    shear_px: Pair = None
    """Disparity, x and y, that was taken out of the pictures of a converging grid."""


@dataclass(frozen=True, kw_only=True)
class Lenses:
    """Where lenses are in a picture of a lens array."""

    lens_array: WholePair = None
    """Rows and columns of lenses whose images one picture holds side by side."""
    lens_pitch_px: Pair = None
    """Distance from lens to lens in the picture, x and y; need not be whole."""
    lens_offset_px: Pair = None
    """Left upper corner of the first lens image, x and y. Default: 0 0."""
    inverted: bool = False
    """Each lens image is upside down, as a sensor right behind the lenses sees it."""
    interlaced: WholePair = None
    """Rows and columns of views of which a picture has a pixel each in every block, as under a micro lens."""


@dataclass(frozen=True, kw_only=True)
class PictureLight:
    """How numbers stand for light."""

    srgb: bool = False
    """Numbers are sRGB: the default for whole numbers in pictures."""
    linear: bool = False
    """Numbers are proportional to light: the default for floats."""
    gamma: float | None = None
    """Light is the number (from 0 to 1) to the power of this."""


READERS: dict[Callable[..., Any], tuple[str, tuple[str, ...]]] = {
    import_images: ("pictures", ()),
    import_lens_array: ("a picture of a lens array", ()),
    import_interlaced: ("a picture of interlaced views", ()),
    import_arrays: ("an array of light", ()),
    import_counts: ("photon counts", ("counts",)),
    import_hci: ("a scene of the HCI 4D light field benchmark", ()),
    import_posed_pictures: ("pictures with a transforms.json", ()),
    import_posed_cubes: ("photon cubes with a transforms.json", ("counts",)),
}
"""What a reader reads, and the flags that it meets by its nature."""
FLAT = Parameter(name="*")
CAMERAS, LENSES, LIGHT = Cameras(), Lenses(), PictureLight()


def import_dataset(
    source: Path,
    *,
    out: Out,
    pattern: str | None = None,
    grid: WholePair = None,
    axes: str | None = None,
    key: str | None = None,
    counts: bool = False,
    frames: WholePair = None,
    stored: Annotated[FrameFormat, FLAT] = AS_COUNTED,
    cameras: Annotated[Cameras, FLAT] = CAMERAS,
    order: Annotated[ViewOrder, FLAT] = AS_STORED,
    lenses: Annotated[Lenses, FLAT] = LENSES,
    light: Annotated[PictureLight, FLAT] = LIGHT,
    cfa: str | None = None,
    true_depth: Annotated[DepthFile, FLAT] = NO_DEPTH,
    photons: float | None = None,
    seed: int | None = None,
    z_mm: Depths = (),
    z_range_mm: Pair = None,
) -> None:
    """Make a dataset of images that others made: pictures, arrays, lens arrays, photon counts.

    Says at which depths things are sharpest, and warns if the views do not fit their cameras.

    Examples of use:

        pcii import photos -o out/photos --pattern "{col}_{row}.png" --pitch-mm 2 2 --focal-mm 35 \\
          --sensor-mm 36
        pcii import photos -o out/photos-dim --pattern "{col}_{row}.png" --pitch-mm 2 2 --focal-mm 35 \\
          --sensor-mm 36 --cfa GRBG --photons 1000 --z-range-mm 30 200
        pcii import cotton -o out/cotton
        pcii import frames.npy -o out/counts --counts --pitch-mm 5 5 --focal-mm 50 --pixel-mm 0.05

    Parameters
    ----------
    source
        A folder of pictures, a TIFF file with a page for each view, a folder of the HCI 4D light field
        benchmark, pictures or photon cubes with a transforms.json, a picture of a lens array, an array in a
        .npy, .npz, .mat or HDF5 file: (K, L, H, W), (K, L, H, W, C), or with --counts (K, L, N, H, W).
    out
        Folder for the dataset: new or empty.
    pattern
        Names of the files of a folder, with {row} and {col}, or with {index} that counts along the rows; of
        counts {frame} too; * stands for any text.
    grid
        Rows and columns of cameras, for {index}, for pages, and for arrays whose first axis counts the views.
        Default: square.
    axes
        Order of the axes of an array: K and L, rows and columns of cameras, or N, all views; T, frames; H and
        W, rows and columns of pixels; C, colours. Such as HWKL. Default: KLHW, KLHWC, KLTHW, or with --grid N
        in place of KL.
    key
        Name of the array in a .npz, .mat or HDF5 file. Default: the only one of at least three axes.
    counts
        The files hold photon counts; pages of the TIFF file of a view are frames, which are added up.
    frames
        First and last frame to add up, counted from 0. Default: all.
    cfa
        Bayer pattern: GRBG, RGGB, BGGR or GBRG; none for a sensor without colours. Of RGB pictures each pixel
        keeps one colour; grey ones are mosaics already.
    photons
        Draw photon counts; the number of photons expected in each view.
    seed
        Seed of these counts; 1 by default.
    z_mm
        Depth to look at in mm, or start:stop:step, kept as a suggestion; repeat for more. Default: of photon
        counts with a range where the depth map has most surfaces, else where things are sharpest.
    z_range_mm
        Nearest and farthest depth of the scene in mm, kept as a suggestion.
    """
    if seed is not None and photons is None:
        raise InputError("--seed: is for --photons N, which draws photon counts")
    options: dict[str, Any] = {"pattern": pattern, "grid": grid, "axes": axes, "key": key, "counts": counts}
    options["cfa"] = None if cfa is not None and cfa.lower() == "none" else cfa
    groups = {"optics": cameras, "order": order, "lenses": lenses, "encoding": light, "stored": stored}
    for group in groups.values():
        options |= vars(group)
    options["frames"] = frames
    check_free(out, "dataset")
    notes: list[str] = []
    with Stages() as report:
        reader, content = _choose_reader(source, options, notes.append)
        arguments = _arguments(reader, source, options, groups, {"report": report, "note": notes.append})
        read, truth = reader(content, **arguments), None
        if isinstance(read, KnownViews):
            read, truth, z_range_mm = read.views, read.truth, z_range_mm or read.z_range_mm
        truth = true_depth.truth_for(read.grid, notes.append) or truth
        images: list[Views | PhotonCounts] = [read]
        is_counted = isinstance(read, PhotonCounts)
        origin = f"{READERS[reader][0]} of {source.resolve().name}"
        if arguments.get("encoding"):
            origin += f", decoded by {arguments['encoding']}"
        if is_counted and read.readout.frames > 1:
            origin += f", {read.readout.frames} frames"
        if photons is not None:
            if is_counted:
                raise InputError(f"--photons: is for pictures, and {source} has photon counts already")
            images.append(limit_photons(read, photons, seed=seed or 1))
            origin += f"; {photons:g} photons expected in each view, seed {seed or 1}"
        fit = check_grid(_without_hot_pixels(read, notes.append), z_range_mm, order=order)
        surfaces: tuple[float, ...] = ()
        if is_counted and not z_mm and z_range_mm is not None and read.grid.view_count > 1:
            # In the noise of few photons contrast is no sure sign.
            surfaces, sentence = surface_depths(read, z_range_mm)
            notes += [sentence] * bool(surfaces)
        dataset = save_dataset(
            out,
            images,
            truth,
            z_mm=z_mm or [float(f"{z:.3g}") for z in surfaces or fit.z_mm] or None,
            z_range_mm=z_range_mm,
            photon_budget=photons,
            title=source.resolve().name,
            origin=origin,
        )
    K, L, H, W = dataset.grid.shape_KLHW
    sensor = f"{dataset.cfa} Bayer pattern" if dataset.cfa else "mono" if read.channel_count == 1 else "RGB"
    say("\n".join([f"{dataset.path}: {K} x {L} views of {H} x {W} px, {sensor}; {origin}", *notes]))
    are_cameras_stated = "optics" not in arguments  # by the source; they are not questioned
    # With wrong numbers, which a warning names, no order of views is right.
    is_judged = not are_cameras_stated and not any(note.startswith("warning:") for note in notes)
    advice = _advice(fit, order, lenses, z_range_mm) if is_judged else None
    if advice is not None:
        say(f"warning: {advice}; then delete {out} and import again")
        return
    if not surfaces:
        _say_depths(fit, is_counted=is_counted, are_cameras_stated=are_cameras_stated)
    say_next("pcii", "run", out, "-o", results_folder(out))


def _choose_reader(
    source: Path, options: Mapping[str, Any], note: Note
) -> tuple[Callable[..., Any], Path | TransformsFile]:
    """The reader of a source, and what it reads: the source, or what its transforms.json says.

    Raises `InputError` for a source that is not there, and for a folder without a pattern.
    """
    if not source.exists():
        raise InputError(f"{source}: there is no such file or folder")
    pattern, is_folder = options["pattern"], source.is_dir()
    if options["lens_array"] is not None:
        if is_folder:
            raise InputError(
                f"{source}: is a folder; --lens-array is for one picture, which holds all lens images"
            )
        return import_lens_array, source
    if pattern is None:
        if (source.suffix == ".json" and not is_folder) or (source / TRANSFORMS).is_file():
            file = read_transforms(source, note=note)
            return import_posed_cubes if file.has_cubes else import_posed_pictures, file
        if (source / PARAMETERS).is_file():
            return import_hci, source
        if any((source / name).is_file() for name in COLMAP_FILES):
            raise InputError(
                f"{source}: is a model of COLMAP; if its cameras are of one plane grid, make it a "
                "transforms.json with ns-process-data of nerfstudio, or name pictures and cameras with "
                "--pattern and --pitch-mm"
            )
        if is_folder:
            raise InputError(
                f'{source}: say how files are named with --pattern, such as "{{col}}_{{row}}.png"'
            )
    if options["interlaced"] is not None:
        return import_interlaced, source
    if any(options[name] for name in ("counts", "bits", "bitpack", "frame_size")):
        return import_counts, source
    return import_images if pattern is not None or kind_of(source) in VIEWS else import_arrays, source


def _arguments(
    reader: Callable[..., Any],
    source: Path,
    options: Mapping[str, Any],
    groups: Mapping[str, Any],
    listeners: Mapping[str, Any],
) -> dict[str, Any]:
    """The arguments of a reader, from the values of all options, None or False where they were not given.

    `groups` are the parameters of readers that stand for several options. Raises `InputError` for an option
    that does not go with the source.
    """
    what, flags = READERS[reader]
    parameters = {*inspect.signature(reader).parameters}
    accepted = parameters.union(flags, *(vars(groups[name]) for name in groups.keys() & parameters))
    names = [name for name, value in options.items() if value is not None and value is not False]
    others = ", ".join(f"--{name.replace('_', '-')}" for name in names if name not in accepted)
    if others:
        raise InputError(f"{others}: not for {source}, which is read as {what}")
    builders = {"lenses": _lens_array, "optics": _optics, "encoding": _encoding}
    values = {**options, **groups, **listeners}
    values |= {name: build(options) for name, build in builders.items() if name in parameters}
    return {name: value for name, value in values.items() if name in parameters}


def _optics(options: Mapping[str, Any]) -> Optics:
    """The cameras' optics; `InputError` if a length is missing."""
    lengths = {name: options[name] for name in vars(CAMERAS) if options[name] is not None}
    if options["lens_pitch_px"] is not None and "pixel_mm" in lengths:
        x, y = options["lens_pitch_px"]
        lengths.setdefault("pitch_mm", (x * lengths["pixel_mm"], y * lengths["pixel_mm"]))
    missing = [f"--{name.replace('_', '-')}" for name in ("pitch_mm", "focal_mm") if name not in lengths]
    missing += ["--sensor-mm or --pixel-mm"] * (not lengths.keys() & {"sensor_mm", "pixel_mm"})
    if missing:
        raise InputError(f"{', '.join(missing)}: missing; cameras need pitch, focal length and pixel size")
    return Optics(**lengths)


def _lens_array(options: Mapping[str, Any]) -> LensArray:
    """Where lenses are; `InputError` without their pitch."""
    if options["lens_pitch_px"] is None:
        raise InputError("--lens-pitch-px: missing; a lens array needs the distance from lens to lens")
    rows, cols = options["lens_array"]
    places = {"pitch_px": options["lens_pitch_px"], "offset_px": options["lens_offset_px"] or (0.0, 0.0)}
    return LensArray(rows=rows, cols=cols, inverted=options["inverted"], **places)


def _encoding(options: Mapping[str, Any]) -> Encoding | None:
    """How numbers stand for light; None for the usual way. `InputError` for two ways."""
    if options["srgb"] + options["linear"] + (options["gamma"] is not None) > 1:
        raise InputError("--srgb, --linear, --gamma: give one of them")
    return "srgb" if options["srgb"] else "linear" if options["linear"] else options["gamma"]


def _without_hot_pixels(images: Views | PhotonCounts, note: Note) -> Views | PhotonCounts:
    """Counts to judge the cameras by: hot pixels, which stand still in all views, would be sharp at infinity.

    Says how many there are. Warns of frames that are saturated.
    """
    if isinstance(images, Views) or images.grid.view_count < 2:
        return images
    warn_of_saturation(images)
    grid = images.grid
    moving_mm = depth_of_total_disparity_mm(grid, np.array([max(grid.shape_HW) * MOVING_SHARE]))
    cleaned, hot = without_hot_pixels(images, FocalPlanes.at_depths(grid, moving_mm))
    if hot:
        share = f"{hot} of {grid.height * grid.width} pixels"
        note(f"{share} are far brighter than all around them in most views: hot, or points at infinity")
    return cleaned


def _advice(fit: CameraFit, order: ViewOrder, lenses: Lenses, z_range: Pair) -> str | None:
    """Which options would make the views fit the cameras; None if they do."""
    if fit.order is not None:
        changes = {n: value for n, value in vars(fit.order).items() if value != getattr(order, n)}
        if lenses.lens_array is not None and changes.keys() == {"flip_rows", "flip_cols"}:
            changes = {"inverted": not lenses.inverted}  # each lens image is turned by 180 degrees
        words = [
            f"{word} --{' --'.join(names).replace('_', '-')}"
            for word, is_set in (("with", True), ("without", False))
            if (names := [name for name, value in changes.items() if value is is_set])
        ]
        better = f"the views fit together far better {' and '.join(words)}"
        if changes.keys() == {"flip_cols"} and fit.shear_px is not None:
            return f"{better}, or with --flip-rows: pictures that were shifted do not tell which"
        if changes.keys() == {"flip_cols"}:
            return f"{better}, unless they were shifted along x or y alone, which --shear-px states"
        return better
    if fit.shear_px is not None:
        x, y = fit.shear_px
        return f"things are sharp at disparities below 0; add a shift to --shear-px, such as {x:g} {y:g}"
    if z_range is not None and fit.z_mm and not any(z_range[0] <= z <= z_range[1] for z in fit.z_mm):
        where = f"sharpest at {depths_text(fit.z_mm)} mm, all outside of --z-range-mm"
        return f"{where}; correct the range, --pitch-mm, --focal-mm or the size of pixels"
    return None


def _say_depths(fit: CameraFit, *, is_counted: bool, are_cameras_stated: bool) -> None:
    """Say where things are sharp; where nothing is, what was looked at and the next step."""
    advice = "name depths to `pcii run` by --z-mm"
    if fit.z_mm:
        say(f"sharpest at {depths_text(fit.z_mm)} mm")
    elif fit.nearest_mm is None:
        say(f"too few views, pixels or photons to judge the cameras by; {advice}")
    else:
        if not are_cameras_stated:
            advice = f"correct the order of views, --pitch-mm, --focal-mm or the size of pixels, or {advice}"
        if is_counted:
            advice = f"in little light --z-range-mm finds more; else {advice}"
        say(f"nothing is clearly sharp from {depths_text([fit.nearest_mm])} mm to infinity; {advice}")
