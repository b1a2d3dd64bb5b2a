"""What `pcii import` was told to read, read, and how to mend it if the views do not fit together."""

from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from pathlib import Path

import numpy as np

from pcii.base.errors import InputError
from pcii.base.progress import Report
from pcii.base.short_form import listed
from pcii.core.bayer import mosaic
from pcii.core.camera_grid import CameraGrid
from pcii.core.images import Views
from pcii.core.photon_counts import PhotonCounts
from pcii.core.truth import Truth
from pcii.importing.array_files import import_arrays
from pcii.importing.camera_order import Optics, ViewOrder
from pcii.importing.count_frames import import_counts
from pcii.importing.exported_files import exported_file, import_exported
from pcii.importing.grid_check import GridCheck, check_grid
from pcii.importing.hci_scenes import PARAMETERS, import_hci
from pcii.importing.image_folders import import_images, is_picture
from pcii.importing.lens_arrays import LensArray, import_lens_array
from pcii.importing.light_encoding import Encoding

FINEST_PIXEL_MM = 2e-4
"""No sensor has smaller pixels: a third of a wavelength of light."""
FLAGS = {order.name: f"--{order.name.replace('_', '-')}" for order in fields(ViewOrder)}


@dataclass(frozen=True)
class Request:
    """Where images are and what was said about them; None and False for what was not said."""

    source: Path
    optics: Optics | None
    order: ViewOrder
    pattern: str | None = None
    grid: tuple[int, int] | None = None
    array: str | None = None
    lenses: LensArray | None = None
    counts: bool = False
    encoding: Encoding | None = None
    cfa: str | None = None


@dataclass(frozen=True, eq=False)
class Imported:
    """Images as they were read, with what the source says of them; `beside` them it may have other ones."""

    images: Views | PhotonCounts
    origin: str
    truth: Truth | None = None
    z_range_mm: tuple[float, float] | None = None
    notes: list[str] = field(default_factory=list)
    beside: tuple[Views | PhotonCounts, ...] = ()
    z_mm: tuple[float, ...] = ()
    photon_budget: float | None = None

    def view_of(self) -> Callable[[int, int], np.ndarray]:
        """A function that returns the light (H, W) of a view, all colours together."""
        images = self.images
        if isinstance(images, PhotonCounts):
            return images.view
        return lambda k, l: images.view(k, l).mean(axis=2)


def read(asked: Request, report: Report) -> Imported:
    """Read the images; raises `InputError` for what does not go together or is missing."""
    source, name = asked.source, asked.source.resolve().name
    if not source.exists():
        raise InputError(f"{source}: there is no such file or folder")
    if asked.counts and asked.encoding is not None:
        raise InputError("--counts: photon counts are linear; leave out --linear, --srgb and --gamma")
    if asked.pattern is None and asked.lenses is None and (source / PARAMETERS).is_file():
        return _hci(asked, report)
    if asked == Request(source, None, ViewOrder()) and (file := exported_file(source)) is not None:
        found = import_exported(file)
        notes = ["with the truth of the virtual centre"] if found.truth is not None else []
        if found.z_mm:
            notes.append(f"with depths to look at: {listed(found.z_mm)} mm")
        first, *others = found.images
        return Imported(
            first,
            f"{file.name}, exported from a dataset",
            found.truth,
            found.z_range_mm,
            notes,
            tuple(others),
            found.z_mm,
            found.photon_budget,
        )
    if source.is_dir() and asked.lenses is not None:
        raise InputError(f"{source}: --lens-array is for one picture, and this is a folder")
    if source.is_dir() and asked.pattern is None:
        raise InputError(f'{source}: say how files are named with --pattern, such as "{{col}}_{{row}}.png"')
    if not source.is_dir() and asked.pattern is not None:
        raise InputError(f"{source}: --pattern is for a folder, and this is a file")
    if asked.optics is None:
        raise InputError("--pitch-mm, --focal-mm: are needed, and --sensor-mm or --pixel-mm")
    if asked.counts:
        if asked.lenses is not None:
            raise InputError("--counts: does not go with --lens-array; cut the frames into an array")
        images = import_counts(
            source,
            asked.optics,
            pattern=asked.pattern,
            grid=_stored(asked),
            array=asked.array,
            order=asked.order,
            cfa=asked.cfa,
            report=report,
        )
        return Imported(images, f"photon counts of {name}")
    kind = _kind(asked.encoding)
    if asked.lenses is not None:
        views = import_lens_array(
            source, asked.lenses, asked.optics, order=asked.order, encoding=asked.encoding
        )
        origin = f"{name}, a picture of {asked.lenses.rows} x {asked.lenses.cols} lenses, {kind}"
    elif asked.pattern is not None or is_picture(source):
        views = import_images(
            source,
            asked.pattern,
            asked.optics,
            grid=_stored(asked),
            order=asked.order,
            encoding=asked.encoding,
            report=report,
        )
        what = f"pages of {name}" if asked.pattern is None else f"pictures of {name}, {asked.pattern}"
        origin = f"{views.grid.view_count} {what}, {kind}"
    else:
        views = import_arrays(
            source, asked.optics, array=asked.array, order=asked.order, encoding=asked.encoding
        )
        origin = f"array of {name}, {kind}"
    return _with_pattern(Imported(views, origin), asked.cfa)


def _hci(asked: Request, report: Report) -> Imported:
    if asked.optics is not None or asked.order != ViewOrder() or asked.counts:
        raise InputError(
            f"{asked.source / PARAMETERS}: tells the cameras; leave out their options, or give --pattern"
        )
    scene = import_hci(asked.source, encoding=asked.encoding, report=report)
    origin = f"{asked.source.resolve().name}, in the format of the HCI 4D light field benchmark"
    notes = [f"without truth: {scene.without_truth}"] if scene.without_truth else []
    if scene.truth is not None:
        notes.append("with the true depth of the virtual centre")
    return _with_pattern(Imported(scene.views, origin, scene.truth, scene.z_range_mm, notes), asked.cfa)


def _stored(asked: Request) -> tuple[int, int] | None:
    """The grid in which files are numbered, of which --grid gives the rows and columns of cameras."""
    if asked.grid is None or not asked.order.swap_axes:
        return asked.grid
    return asked.grid[1], asked.grid[0]


def _kind(encoding: Encoding | None) -> str:
    if isinstance(encoding, float | int):
        return f"decoded by gamma {encoding:g}"
    named = {None: "decoded as is usual for their type", "srgb": "decoded from sRGB", "linear": "linear"}
    return named[encoding]


def _with_pattern(imported: Imported, cfa: str | None) -> Imported:
    """The views as a sensor with a Bayer pattern sees them; grey ones are taken for its mosaics."""
    views = imported.images
    if cfa is None or isinstance(views, PhotonCounts):
        return imported
    radiance = np.asarray(views.radiance)
    if radiance.shape[4] == 3:
        radiance = mosaic(radiance, cfa)[..., None]
        origin = f"{imported.origin}; of each pixel the colour of a {cfa} pattern"
    else:
        origin = f"{imported.origin}; mosaics of the pattern {cfa}"
    return replace(imported, images=Views(radiance, views.grid, cfa), origin=origin)


def checked(
    imported: Imported, asked: Request, z_range_mm: tuple[float, float] | None
) -> tuple[tuple[float, ...], str | None]:
    """Depths at which things are sharpest, and a warning with what mends it, or None.

    Cameras that the source itself specifies are not questioned; if it specifies depths, none are searched.
    """
    if imported.z_mm:
        return (), None
    counted = is_picture(asked.source) if asked.pattern is None else "{index" in asked.pattern
    found = check_grid(
        imported.view_of(), imported.images.grid, z_range_mm, order=asked.order, counted=counted
    )
    return found.z_mm, _warning(found, asked, imported, z_range_mm) if asked.optics is not None else None


def _warning(
    found: GridCheck, asked: Request, imported: Imported, z_range_mm: tuple[float, float] | None
) -> str | None:
    if found.order is not None:
        return f"the views fit together far better {_mend(found.order, asked)}"
    across, down = imported.images.grid.pitch_mm
    if found.pitches_exchanged:
        return f"the views fit together far better with --pitch-mm {down:g} {across:g}"
    if found.outside_mm is not None and z_range_mm is not None:
        near, far = z_range_mm
        z, end = found.outside_mm, near if found.outside_mm < near else far
        factor = end / z
        return (
            f"most is sharp at about {z:.3g} mm, outside of {near:g} to {far:g} mm; if nothing is there, "
            f"--pitch-mm is wrong, and {across * factor:.2g} {down * factor:.2g} would bring it to "
            f"{end:g} mm (or --focal-mm or the size of pixels is wrong by this factor)"
        )
    wrong_unit = _wrong_unit(found, imported.images.grid)
    if wrong_unit is None and found.in_no_order and isinstance(imported.images, Views):
        return (  # not of photons, which may be too few to say
            "the views fit together no better than in a random order; unless they have no texture, correct "
            "their order, --pitch-mm, --focal-mm or the size of pixels"
        )
    return wrong_unit


def _wrong_unit(found: GridCheck, grid: CameraGrid) -> str | None:
    """What tells that a length was given in metres or micrometres."""
    if grid.pixel_mm < FINEST_PIXEL_MM:
        return (
            f"a pixel would be {grid.pixel_mm:.3g} mm, less than a third of a wavelength of light; "
            "lengths are in mm, not in m"
        )
    if found.z_mm and found.z_mm[-1] < grid.focal_mm / 10:
        return (
            f"things are sharp up to {found.z_mm[-1]:.3g} mm away, nearer than a tenth of the focal length; "
            "--pitch-mm, --focal-mm and --sensor-mm or --pixel-mm are all in mm"
        )
    return None


def _mend(order: ViewOrder, asked: Request) -> str:
    """Options to add and to leave out for another order."""
    changed = {name for name in FLAGS if getattr(order, name) != getattr(asked.order, name)}
    options = [(flag, not getattr(asked.order, name)) for name, flag in FLAGS.items() if name in changed]
    if asked.lenses is not None and changed == {"flip_rows", "flip_cols"} and asked.order == ViewOrder():
        options = [("--inverted", not asked.lenses.inverted)]
    added = " ".join(flag for flag, is_new in options if is_new)
    dropped = " ".join(flag for flag, is_new in options if not is_new)
    return " and ".join([f"with {added}"] * bool(added) + [f"without {dropped}"] * bool(dropped))
