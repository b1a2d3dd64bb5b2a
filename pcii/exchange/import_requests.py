"""Requests to import: a reader for each kind of source, whose parameters are the options that go with it.

The options of a group stand as one parameter, a dataclass. An option that the reader of a source does not
take is refused.
"""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from pcii.base.errors import InputError
from pcii.base.progress import Report
from pcii.exchange.count_arrays import import_arrays, import_counts
from pcii.exchange.hci_scenes import PARAMETERS, import_hci
from pcii.exchange.image_folders import Optics, Tell, ViewOrder, import_images, is_picture
from pcii.exchange.lens_arrays import LensArray, import_lens_array
from pcii.exchange.photon_cubes import import_packed_frames
from pcii.exchange.pixel_files import Encoding, check_encoding
from pcii.exchange.posed_views import import_cubes, import_posed_pictures
from pcii.exchange.transforms_file import read_transforms, transforms_in
from pcii.types.images import Views
from pcii.types.photon_counts import PhotonCounts
from pcii.types.truth import Truth

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

    def optics(self) -> Optics:
        """The cameras' optics; `InputError` if a length is missing."""
        options = values_of(_part(Cameras, self))
        lengths = {name: value for name, value in options.items() if value is not None}
        sides = lengths.keys() & {"sensor_mm", "pixel_mm"}
        missing = [f"--{name.replace('_', '-')}" for name in ("pitch_mm", "focal_mm") if name not in lengths]
        missing += ["--sensor-mm or --pixel-mm"] * (not sides)
        if missing:
            names = ", ".join(missing)
            raise InputError(f"{names}: missing; cameras need pitch, focal length and pixel size")
        return Optics(**lengths)


@dataclass(frozen=True, kw_only=True)
class Film:
    """The one length of the cameras of a transforms.json that tells the others."""

    focal_mm: float | None = None
    sensor_mm: float | None = None
    pixel_mm: float | None = None


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


@dataclass(frozen=True, kw_only=True)
class PictureLight:
    """How numbers stand for light."""

    srgb: bool = False
    """Numbers are sRGB: the default for whole numbers in pictures."""
    linear: bool = False
    """Numbers are proportional to light: the default for floats."""
    gamma: float | None = None
    """Light is the number (from 0 to 1) to the power of this."""

    def encoding(self) -> Encoding | None:
        """How numbers stand for light; None for the usual way. `InputError` for two ways."""
        if self.srgb + self.linear + (self.gamma is not None) > 1:
            raise InputError("--srgb, --linear, --gamma: give one of them")
        check_encoding(self.gamma)
        return "srgb" if self.srgb else "linear" if self.linear else self.gamma


@dataclass(frozen=True, kw_only=True)
class CountOptions(Cameras, ViewOrder):
    """What goes with all photon counts."""

    counts: bool = False
    cfa: str | None = None

    def keywords(self) -> dict[str, Any]:
        """The arguments of a reader of counts."""
        return {"optics": self.optics(), "order": _part(ViewOrder, self), "cfa": self.cfa}


@dataclass(frozen=True, kw_only=True)
class LightOptions(Cameras, ViewOrder, PictureLight):
    """What goes with all radiance whose cameras the source does not state."""

    cfa: str | None = None

    def keywords(self) -> dict[str, Any]:
        """The arguments of a reader of radiance."""
        order = _part(ViewOrder, self)
        return {"optics": self.optics(), "order": order, "encoding": self.encoding(), "cfa": self.cfa}


def values_of(group: Any) -> dict[str, Any]:
    """The options of a group by name."""
    return {field.name: getattr(group, field.name) for field in fields(group)}


def _part(kind: type[Any], options: Any) -> Any:
    """The options that a group has in common with others."""
    return kind(**{field.name: getattr(options, field.name) for field in fields(kind)})


@dataclass(frozen=True)
class Source:
    """Where images are, who is told of progress, and who of what is left out."""

    path: Path
    report: Report
    tell: Tell

    @property
    def name(self) -> str:
        """The name of the file or folder, for the origin of a dataset."""
        return self.path.resolve().name

    @property
    def listeners(self) -> dict[str, Any]:
        """Arguments that all readers of several files take."""
        return {"report": self.report, "tell": self.tell}


@dataclass(frozen=True, eq=False)
class Imported:
    """Images as they were read, with what the source says of them."""

    images: Views | PhotonCounts
    origin: str
    truth: Truth | None = None
    view_z_mm: np.ndarray | None = None
    z_range_mm: Pair = None
    states_cameras: bool = False
    """Whether the source itself states the cameras, which are then not questioned."""
    counted: bool = False
    """Whether views are counted one by one, not stored by row and column."""


def read_pictures(source: Source, *, pattern: str | None, grid: WholePair, light: LightOptions) -> Imported:
    """Pictures of a folder by --pattern, or pages of a TIFF file."""
    views = import_images(source.path, pattern, grid=grid, **light.keywords(), **source.listeners)
    what = "pages" if pattern is None else "pictures"
    origin = f"{views.grid.view_count} {what} of {source.name}{_curve(light)}"
    return Imported(views, origin, counted=_is_counted(pattern, True))


def read_lens_array(source: Source, *, lenses: Lenses, light: LightOptions) -> Imported:
    """One picture of a lens array."""
    if lenses.lens_array is None or lenses.lens_pitch_px is None:
        raise InputError("--lens-pitch-px: missing; a lens array needs the distance from lens to lens")
    (x, y), pixel_mm = lenses.lens_pitch_px, light.pixel_mm
    if light.pitch_mm is None and pixel_mm is not None:
        light = replace(light, pitch_mm=(x * pixel_mm, y * pixel_mm))
    (rows, cols), offset = lenses.lens_array, lenses.lens_offset_px or (0.0, 0.0)
    array = LensArray(rows=rows, cols=cols, pitch_px=(x, y), offset_px=offset, inverted=lenses.inverted)
    views = import_lens_array(source.path, array, **light.keywords())
    return Imported(views, f"{source.name}, a picture of {rows} x {cols} lenses{_curve(light)}")


def read_array(source: Source, *, array: str | None, grid: WholePair, light: LightOptions) -> Imported:
    """An array of light in a .npy or .npz file."""
    views = import_arrays(source.path, array=array, grid=grid, **light.keywords())
    return Imported(views, f"array of {source.name}{_curve(light)}", counted=grid is not None)


def read_count_files(
    source: Source, *, pattern: str | None, grid: WholePair, frames: WholePair, photons: CountOptions
) -> Imported:
    """Photon counts in files by --pattern, or in pages of a TIFF file."""
    options: dict[str, Any] = {"pattern": pattern, "grid": grid, "frames": frames, **photons.keywords()}
    counts = import_counts(source.path, **options, **source.listeners)
    return Imported(counts, f"photon counts of {source.name}", counted=_is_counted(pattern, True))


def read_count_array(
    source: Source, *, array: str | None, grid: WholePair, frames: WholePair, photons: CountOptions
) -> Imported:
    """An array of photon counts in a .npy or .npz file."""
    options: dict[str, Any] = {"array": array, "grid": grid, "frames": frames, **photons.keywords()}
    counts = import_counts(source.path, **options, **source.listeners)
    return Imported(counts, f"photon counts of {source.name}", counted=grid is not None)


def read_packed_frames(
    source: Source,
    *,
    bitpack: bool,
    pattern: str | None,
    grid: WholePair,
    width: int | None,
    frames: WholePair,
    photons: CountOptions,
) -> Imported:
    """Frames of packed bits in .npy files."""
    options: dict[str, Any] = {"grid": grid, "width": width, "frames": frames, **photons.keywords()}
    counts = import_packed_frames(source.path, pattern=pattern, **options, **source.listeners)
    is_counted = _is_counted(pattern, grid is not None)
    return Imported(counts, f"photon counts of {source.name}", counted=is_counted)


def read_hci(source: Source, *, light: PictureLight, cfa: str | None) -> Imported:
    """A folder of the HCI 4D light field benchmark, which states its cameras."""
    scene = import_hci(source.path, encoding=light.encoding(), cfa=cfa, **source.listeners)
    origin = f"{source.name}, in the format of the HCI 4D light field benchmark"
    return Imported(scene.views, origin, scene.truth, z_range_mm=scene.z_range_mm, states_cameras=True)


def read_posed_pictures(source: Source, *, film: Film, light: PictureLight, cfa: str | None) -> Imported:
    """Pictures that a transforms.json places."""
    file = read_transforms(transforms_in(source.path) or source.path, tell=source.tell)
    options: dict[str, Any] = {**values_of(film), "encoding": light.encoding(), "cfa": cfa}
    posed = import_posed_pictures(file, **options, **source.listeners)
    count, folder = posed.views.grid.view_count, file.path.resolve().parent.name
    origin = f"{count} pictures of {folder}, placed by {file.path.name}"
    return Imported(posed.views, origin, posed.truth, posed.view_z_mm, states_cameras=True)


def read_cubes(
    source: Source, *, counts: bool, bitpack: bool, frames: WholePair, film: Film, cfa: str | None
) -> Imported:
    """Photon cubes that a transforms.json places."""
    file = read_transforms(transforms_in(source.path) or source.path, tell=source.tell)
    images = import_cubes(file, **values_of(film), cfa=cfa, frames=frames, **source.listeners)
    return Imported(images, f"photon cubes of {file.path.resolve().parent.name}", states_cameras=True)


def _is_counted(pattern: str | None, otherwise: bool) -> bool:
    """Whether views are counted one by one."""
    return otherwise if pattern is None else "{index" in pattern


def _curve(light: PictureLight) -> str:
    """How numbers were decoded, for the origin of a dataset."""
    encoding = light.encoding()
    return f", decoded by {encoding}" if encoding is not None else ""


def choose_reader(source: Path, options: Mapping[str, Any]) -> Callable[..., Imported]:
    """The reader of a source; `InputError` for a source that is not there, or a folder without a pattern."""
    if not source.exists():
        raise InputError(f"{source}: there is no such file or folder")
    pattern, counts = options["pattern"], options["counts"]
    if pattern is None and options["lens_array"] is None:
        transforms = transforms_in(source)
        if transforms is not None:
            is_packed = read_transforms(transforms, tell=lambda sentence: None).is_bitpacked
            return read_cubes if is_packed else read_posed_pictures
        if (source / PARAMETERS).is_file():
            return read_hci
    if source.is_dir() and pattern is None:
        raise InputError(f'{source}: say how files are named with --pattern, such as "{{col}}_{{row}}.png"')
    if not source.is_dir() and pattern is not None:
        raise InputError(f"{source}: --pattern is for a folder, and this is a file")
    if options["bitpack"]:
        return read_packed_frames
    if options["lens_array"] is not None:
        return read_lens_array
    if source.is_dir() or is_picture(source):
        return read_count_files if counts else read_pictures
    return read_count_array if counts else read_array


def read(source: Source, options: Mapping[str, Any]) -> Imported:
    """Read a source with the reader that it asks for.

    `options` are the values of all options by name, None or False where they were not given. Raises
    `InputError` for one that does not go with the source.
    """
    reader = choose_reader(source.path, options)
    values: dict[str, Any] = {}
    accepted: set[str] = set()
    for name, parameter in list(inspect.signature(reader).parameters.items())[1:]:
        group: Any = parameter.annotation
        names = [field.name for field in fields(group)] if is_dataclass(group) else [name]
        part = {one: options[one] for one in names}
        values[name] = cast(Any, group)(**part) if is_dataclass(group) else options[name]
        accepted.update(names)
    names = [name for name, value in options.items() if value is not None and value is not False]
    others = ", ".join(f"--{name.replace('_', '-')}" for name in names if name not in accepted)
    if others:
        what = f"{reader.__doc__}".rstrip(".").lower()
        raise InputError(f"{others}: not for {source.path}, which is read as: {what}")
    return reader(source, **values)
