"""The command `pcii import`: images made by others become a dataset."""

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
    NO_DEPTH,
    Cameras,
    DepthFile,
    FrameFormat,
    Lenses,
    Note,
    Pair,
    PictureLight,
    ViewOrder,
    WholePair,
    read,
)
from pcii.sections import warn_of_saturation
from pcii.store import check_free, save_dataset
from pcii.types import FocalPlanes, PhotonCounts, Views, depth_of_total_disparity_mm, limit_photons

MOVING_SHARE = 0.25
"""A point whose total disparity is this share of a view's longer side is elsewhere in each view, so that what
is at the same pixel in most of them is a fault of the sensor, or at infinity."""
FLAT = Parameter(name="*")
CAMERAS, ORDER, LENSES, LIGHT = Cameras(), ViewOrder(), Lenses(), PictureLight()


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
    order: Annotated[ViewOrder, FLAT] = ORDER,
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
    for group in (cameras, order, lenses, light, stored):
        options |= vars(group)
    options["frames"] = frames
    check_free(out, "dataset")
    notes: list[str] = []
    with Stages() as report:
        imported = read(source, options, report=report, note=notes.append)
        images: list[Views | PhotonCounts] = [imported.images]
        origin = imported.origin
        if photons is not None:
            if isinstance(imported.images, PhotonCounts):
                raise InputError(f"--photons: is for pictures, and {source} has photon counts already")
            images.append(limit_photons(imported.images, photons, seed=seed or 1))
            origin += f"; {photons:g} photons expected in each view, seed {seed or 1}"
        z_range = z_range_mm or imported.z_range_mm
        truth = true_depth.truth_for(imported.images.grid, notes.append) or imported.truth
        fit = check_grid(_without_hot_pixels(imported.images, notes.append), z_range, order=order)
        surfaces: tuple[float, ...] = ()
        is_counted = isinstance(imported.images, PhotonCounts)
        if is_counted and not z_mm and z_range is not None and imported.images.grid.view_count > 1:
            # In the noise of few photons contrast is no sure sign.
            surfaces, sentence = surface_depths(imported.images, z_range)
            notes += [sentence] * bool(surfaces)
        dataset = save_dataset(
            out,
            images,
            truth,
            z_mm=z_mm or [float(f"{z:.3g}") for z in surfaces or fit.z_mm] or None,
            z_range_mm=z_range,
            photon_budget=photons,
            title=source.resolve().name,
            origin=origin,
        )
    K, L, H, W = dataset.grid.shape_KLHW
    channels = images[0].channel_count if isinstance(images[0], Views) else 1
    sensor = f"{dataset.cfa} Bayer pattern" if dataset.cfa else "mono" if channels == 1 else "RGB"
    say(f"{dataset.path}: {K} x {L} views of {H} x {W} px, {sensor}; {origin}")
    for note in notes:
        say(note)
    # With wrong numbers of the cameras, which a warning names, no order of views is right.
    is_judged = not imported.states_cameras and not any(note.startswith("warning:") for note in notes)
    advice = _advice(fit, order, lenses, z_range) if is_judged else None
    if advice is not None:
        say(f"warning: {advice}; then delete {out} and import again")
        return
    if not surfaces:
        _say_depths(fit, is_counted=is_counted)
    say_next("pcii", "run", out, "-o", results_folder(out))


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
        flags = {value: [n for n in changes if changes[n] is value] for value in (True, False)}
        words = [
            f"{word} --{' --'.join(names).replace('_', '-')}"
            for word, names in (("with", flags[True]), ("without", flags[False]))
            if names
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


def _say_depths(fit: CameraFit, *, is_counted: bool) -> None:
    """Say where things are sharp; where nothing is, what was looked at and the next step."""
    if fit.z_mm:
        say(f"sharpest at {depths_text(fit.z_mm)} mm")
    elif fit.nearest_mm is None:
        say("too few views, pixels or photons to judge the cameras by; name depths to `pcii run` by --z-mm")
    else:
        say(
            f"nothing is clearly sharp from {depths_text([fit.nearest_mm])} mm to infinity; "
            f"{'in little light --z-range-mm finds more; else ' if is_counted else ''}correct the order of "
            "views, --pitch-mm, --focal-mm or the size of pixels, or name depths to `pcii run` by --z-mm"
        )
