"""Requests to import images: the kind of source, the options that go with it, and what is read."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from pcii.base.errors import InputError
from pcii.base.progress import Report
from pcii.base.short_form import listed
from pcii.core.bayer import mosaic
from pcii.core.images import Views
from pcii.core.photon_counts import PhotonCounts
from pcii.core.truth import Truth
from pcii.frames.cube_folders import read_cube_folder
from pcii.importing.array_files import import_arrays
from pcii.importing.camera_order import Optics, ViewOrder
from pcii.importing.count_frames import import_counts, import_cube, notes_on_frames
from pcii.importing.exported_files import exported_file, import_exported
from pcii.importing.hci_scenes import PARAMETERS, import_hci
from pcii.importing.image_folders import import_images, is_picture
from pcii.importing.lens_arrays import LensArray, import_lens_array
from pcii.importing.light_encoding import Encoding
from pcii.importing.posed_pictures import import_posed_pictures, transforms_in
from pcii.transforms.film_sizes import FilmSize
from pcii.transforms.transforms_file import TransformsFile, read_transforms

WholePair = tuple[int, int] | None


@dataclass(frozen=True, kw_only=True)
class ViewOptions:
    """Where views are, and in which order."""

    pattern: str | None = None
    """Names of the files of a folder, with {row} and {col}, or with {index} that counts along the rows."""
    grid: WholePair = None
    """Rows and columns of cameras, for {index} and for pages. Default: square."""
    array: str | None = None
    """Name of the array in an .npz file that has several."""
    counts: bool = False
    """The files hold photon counts; pages of the TIFF file of a view are frames, which are added up."""
    bitpack: bool = False
    """Frames in .npy files are of bits, packed along the width as numpy.packbits does."""
    width: int | None = None
    """Pixels in a row of packed frames. Default: all bits."""
    frames: WholePair = None
    """First and last frame to add up, counted from 0. Default: all."""
    serpentine: bool = False
    """Every other row is stored backwards, as a stage takes them that moves to and fro."""
    swap_axes: bool = False
    """Rows and columns are exchanged; {index} and pages count down the columns."""
    flip_rows: bool = False
    """Rows are counted from the bottom."""
    flip_cols: bool = False
    """Columns are counted from the right."""

    @property
    def of_frames(self) -> bool:
        """Whether something is said of frames of counts."""
        return self.bitpack or self.width is not None or self.frames is not None

    @property
    def order(self) -> ViewOrder:
        """In which order views are stored."""
        return ViewOrder(
            serpentine=self.serpentine,
            swap_axes=self.swap_axes,
            flip_rows=self.flip_rows,
            flip_cols=self.flip_cols,
        )

    @property
    def stored_grid(self) -> WholePair:
        """The grid in which files are numbered, of which `grid` gives the rows and columns of cameras."""
        if self.grid is None or not self.swap_axes:
            return self.grid
        return self.grid[1], self.grid[0]


@dataclass(frozen=True)
class Request:
    """Where images are, and the options given for them; None and False for those that were not given."""

    source: Path
    views: ViewOptions = ViewOptions()
    optics: Optics | None = None
    lenses: LensArray | None = None
    encoding: Encoding | None = None
    cfa: str | None = None
    film: FilmSize | None = None
    """One length of the cameras of a transforms.json, which tells all others."""

    @property
    def transforms(self) -> Path | None:
        """The transforms.json to read; None if the source is another, or options say how to read it."""
        return transforms_in(self.source) if self.views.pattern is None and self.lenses is None else None


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
    view_z_mm: np.ndarray | None = None
    radiance_unit: str | None = None

    def view_of(self) -> Callable[[int, int], np.ndarray]:
        """A function that returns the light (H, W) of a view, all colours together."""
        images = self.images
        if isinstance(images, PhotonCounts):
            return images.view
        return lambda k, l: images.view(k, l).mean(axis=2)


def read(asked: Request, report: Report) -> Imported:
    """Read the images; raises `InputError` for what does not go together or is missing."""
    source, views = asked.source, asked.views
    if not source.exists():
        raise InputError(f"{source}: there is no such file or folder")
    if views.counts and asked.encoding is not None:
        raise InputError("--counts: photon counts are linear; leave out --linear, --srgb and --gamma")
    if asked.transforms is None and not views.counts and views.of_frames:
        raise InputError("--bitpack, --width, --frames: are for --counts")
    if asked.transforms is not None:
        file = read_transforms(asked.transforms)
        if file.is_bitpacked:
            return _cube(asked, file, report)
        return _with_pattern(_posed(asked, file, report), asked.cfa)
    if views.pattern is None and asked.lenses is None and (source / PARAMETERS).is_file():
        return _with_pattern(_hci(asked, report), asked.cfa)
    if asked == Request(source) and (file := exported_file(source)) is not None:
        return _exported(file)
    if source.is_dir() and asked.lenses is not None:
        raise InputError(f"{source}: --lens-array is for one picture, and this is a folder")
    if source.is_dir() and views.pattern is None:
        raise InputError(f'{source}: say how files are named with --pattern, such as "{{col}}_{{row}}.png"')
    if not source.is_dir() and views.pattern is not None:
        raise InputError(f"{source}: --pattern is for a folder, and this is a file")
    if asked.optics is None:
        raise InputError("--pitch-mm, --focal-mm: are needed, and --sensor-mm or --pixel-mm")
    if views.counts and asked.lenses is not None:
        raise InputError("--counts: does not go with --lens-array; cut the frames into an array")
    if views.counts:
        return _counts(asked, asked.optics, report)
    return _with_pattern(_light(asked, asked.optics, report), asked.cfa)


def _hci(asked: Request, report: Report) -> Imported:
    if asked.optics is not None or asked.views.order != ViewOrder() or asked.views.counts:
        raise InputError(
            f"{asked.source / PARAMETERS}: tells the cameras; leave out their options, or give --pattern"
        )
    scene = import_hci(asked.source, encoding=asked.encoding, report=report)
    origin = f"{asked.source.resolve().name}, in the format of the HCI 4D light field benchmark"
    notes = [f"without truth: {scene.without_truth}"] if scene.without_truth else []
    if scene.truth is not None:
        notes.append("with the true depth of the virtual centre")
    return Imported(scene.views, origin, scene.truth, scene.z_range_mm, notes)


def _posed(asked: Request, file: TransformsFile, report: Report) -> Imported:
    path = file.path
    if asked.optics is not None or asked.views != ViewOptions():
        raise InputError(f"{path}: tells the cameras; leave out options of grid and order, or give --pattern")
    found = import_posed_pictures(file, film=asked.film, encoding=asked.encoding, report=report)
    if isinstance(found.images, PhotonCounts) and asked.cfa is not None:
        raise InputError(f"{path}: tells photon counts and their Bayer pattern; leave out --cfa")
    what = "photons" if isinstance(found.images, PhotonCounts) else "pictures"
    origin = f"{found.images.grid.view_count} {what} of {path.resolve().parent.name}, placed by {path.name}"
    return Imported(
        found.images,
        origin,
        found.truth,
        notes=found.notes,
        view_z_mm=found.view_z_mm,
        radiance_unit=found.radiance_unit,
    )


def _cube(asked: Request, file: TransformsFile, report: Report) -> Imported:
    told = ViewOptions(counts=asked.views.counts, frames=asked.views.frames)
    if asked.views != told or asked.encoding is not None:
        raise InputError(
            f"{file.path}: is of photon cubes and tells cameras and width; leave out options of views and "
            "light other than --frames, or give --pattern"
        )
    if asked.cfa is not None and "cfa" in file.document:
        raise InputError(f"{file.path}: tells the Bayer pattern; leave out --cfa")
    folder = read_cube_folder(file, asked.film)
    counts = import_cube(folder, cfa=asked.cfa, frames=asked.views.frames, report=report)
    budget, name = folder.photon_budget, file.path.resolve().parent.name
    if budget is not None:
        budget *= counts.readout.frames / folder.frames
    notes = [*folder.notes, *notes_on_frames(counts, file.width)]
    return Imported(counts, f"photon cubes of {name}", notes=notes, photon_budget=budget)


def _exported(file: Path) -> Imported:
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


def _counts(asked: Request, optics: Optics, report: Report) -> Imported:
    views = asked.views
    images = import_counts(
        asked.source,
        optics,
        pattern=views.pattern,
        grid=views.stored_grid,
        array=views.array,
        order=views.order,
        cfa=asked.cfa,
        bitpack=views.bitpack,
        width=views.width,
        frames=views.frames,
        report=report,
    )
    notes = notes_on_frames(images, views.width)
    return Imported(images, f"photon counts of {asked.source.resolve().name}", notes=notes)


def _light(asked: Request, optics: Optics, report: Report) -> Imported:
    """Radiance of a picture of a lens array, of pictures or pages, or of an array."""
    source, options, name = asked.source, asked.views, asked.source.resolve().name
    order, encoding = options.order, asked.encoding
    if asked.lenses is not None:
        views = import_lens_array(source, asked.lenses, optics, order=order, encoding=encoding)
        origin = f"{name}, a picture of {asked.lenses.rows} x {asked.lenses.cols} lenses"
    elif options.pattern is not None or is_picture(source):
        views = import_images(
            source,
            options.pattern,
            optics,
            grid=options.stored_grid,
            order=order,
            encoding=encoding,
            report=report,
        )
        what = f"pages of {name}" if options.pattern is None else f"pictures of {name}, {options.pattern}"
        origin = f"{views.grid.view_count} {what}"
    else:
        views = import_arrays(source, optics, array=options.array, order=order, encoding=encoding)
        origin = f"array of {name}"
    return Imported(views, f"{origin}, {_kind(encoding)}")


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
