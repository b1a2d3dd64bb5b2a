"""Requests to import: which reader takes a source, and which options go with it.

The parameters of a reader are its options. `optics`, `order`, `lenses` and `encoding` stand for several
options, which a dataclass lists. An option that the reader of a source does not take is refused.
"""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from pcii.base import InputError, Report
from pcii.exchange.count_arrays import import_arrays, import_counts
from pcii.exchange.frame_formats import FrameFormat
from pcii.exchange.hci_scenes import PARAMETERS, import_hci
from pcii.exchange.image_folders import (
    KnownViews,
    LensArray,
    import_images,
    import_interlaced,
    import_lens_array,
    is_picture,
)
from pcii.exchange.pixel_files import Encoding
from pcii.exchange.posed_views import import_posed_cubes, import_posed_pictures
from pcii.exchange.stated_cameras import Note, Optics, ViewOrder
from pcii.exchange.transforms_file import read_transforms, transforms_in
from pcii.types import PhotonCounts, Truth, Views

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


@dataclass(frozen=True, eq=False)
class Imported:
    """Images as they were read, with what the source says of them."""

    images: Views | PhotonCounts
    origin: str
    states_cameras: bool
    """Whether the source itself states the cameras, which are then not questioned."""
    truth: Truth | None
    z_range_mm: Pair


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
GROUPS: dict[str, type[Any]] = {
    "optics": Cameras,
    "order": ViewOrder,
    "lenses": Lenses,
    "encoding": PictureLight,
    "stored": FrameFormat,
}
"""Parameters of readers that stand for the options of a group."""


def choose_reader(source: Path, options: Mapping[str, Any]) -> Callable[..., Any]:
    """The reader of a source; `InputError` for a source that is not there, or a folder without a pattern."""
    if not source.exists():
        raise InputError(f"{source}: there is no such file or folder")
    pattern = options["pattern"]
    is_counts = any(options[name] for name in ("counts", "bits", "bitpack", "frame_size"))
    if pattern is None and options["lens_array"] is None:
        if transforms_in(source) is not None:
            has_cubes = read_transforms(source, note=lambda sentence: None).has_cubes
            return import_posed_cubes if has_cubes else import_posed_pictures
        if (source / PARAMETERS).is_file():
            return import_hci
    if source.is_dir() and options["lens_array"] is not None:
        raise InputError(
            f"{source}: is a folder; --lens-array is for one picture, which holds all lens images"
        )
    if source.is_dir() and pattern is None:
        if any((source / name).is_file() for name in COLMAP_FILES):
            raise InputError(
                f"{source}: is a model of COLMAP; if its cameras are of one plane grid, make it a "
                "transforms.json with ns-process-data of nerfstudio, or name pictures and cameras with "
                "--pattern and --pitch-mm"
            )
        raise InputError(f'{source}: say how files are named with --pattern, such as "{{col}}_{{row}}.png"')
    if not source.is_dir() and pattern is not None:
        raise InputError(f"{source}: --pattern is for a folder, and this is a file")
    if options["lens_array"] is not None:
        return import_lens_array
    if options["interlaced"] is not None:
        return import_interlaced
    if is_counts:
        return import_counts
    return import_images if source.is_dir() or is_picture(source) else import_arrays


def read(source: Path, options: Mapping[str, Any], *, report: Report, note: Note) -> Imported:
    """Read a source with the reader that it asks for.

    `options` are the values of all options by name, None or False where they were not given. Raises
    `InputError` for one that does not go with the source.
    """
    reader = choose_reader(source, options)
    what, flags = READERS[reader]
    parameters = [*inspect.signature(reader).parameters][1:]
    accepted = {*parameters, *flags}
    for name in accepted & GROUPS.keys():
        accepted |= {field.name for field in fields(GROUPS[name])}
    names = [name for name, value in options.items() if value is not None and value is not False]
    others = ", ".join(f"--{name.replace('_', '-')}" for name in names if name not in accepted)
    if others:
        raise InputError(f"{others}: not for {source}, which is read as {what}")
    values = {"report": report, "note": note, **options}
    for name, build in (("lenses", _lens_array), ("optics", _optics), ("encoding", _encoding)):
        if name in parameters:
            values[name] = build(options)
    for name, group in (("order", ViewOrder), ("stored", FrameFormat)):
        if name in parameters:
            values[name] = group(**{field.name: options[field.name] for field in fields(group)})
    result = reader(source, **{name: values[name] for name in parameters})
    known = result if isinstance(result, KnownViews) else None
    encoding = f", decoded by {values['encoding']}" if values.get("encoding") else ""
    count = result.readout.frames if isinstance(result, PhotonCounts) else None
    frames = f", {count} frames" if count is not None and count > 1 else ""
    return Imported(
        result.views if isinstance(result, KnownViews) else result,
        f"{what} of {source.resolve().name}{encoding}{frames}",
        states_cameras="optics" not in parameters,
        truth=known and known.truth,
        z_range_mm=known and known.z_range_mm,
    )


def _optics(options: Mapping[str, Any]) -> Optics:
    """The cameras' optics; `InputError` if a length is missing."""
    lengths = {field.name: options[field.name] for field in fields(Cameras)}
    lengths = {name: value for name, value in lengths.items() if value is not None}
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
    offset_px, inverted = options["lens_offset_px"] or (0.0, 0.0), options["inverted"]
    return LensArray(
        rows=rows, cols=cols, pitch_px=options["lens_pitch_px"], offset_px=offset_px, inverted=inverted
    )


def _encoding(options: Mapping[str, Any]) -> Encoding | None:
    """How numbers stand for light; None for the usual way. `InputError` for two ways."""
    if options["srgb"] + options["linear"] + (options["gamma"] is not None) > 1:
        raise InputError("--srgb, --linear, --gamma: give one of them")
    return "srgb" if options["srgb"] else "linear" if options["linear"] else options["gamma"]
