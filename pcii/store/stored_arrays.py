"""Arrays on disk: labelled groups (Zarr v3, zstd and crc32c), images (EXR), and an archive of groups.

Each array of a group has its axes, unit and meaning with it; it is read only if it is as it would be written
here.
"""

import io
import shutil
import zipfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base import InputError, new_folder_safely, visible, write_bytes_safely
from pcii.store.folders import REMEDY

CHUNK_ELEMENTS = 1 << 20
"""One chunk is at most this many elements: a view, or a million events."""
DTYPES = ("bool", "uint8", "uint16", "uint32", "int16", "int32", "int64", "float32", "float64")
ARRAYS = "arrays.zip"
WORTH_ZIP = 0.9
"""An image is compressed if it then takes at most this share of its bytes."""


@dataclass(frozen=True)
class Label:
    """Description stored with an array: the names of its axes, its meaning, its unit ("1" for none)."""

    dims: tuple[str, ...]
    meaning: str
    unit: str = "1"


VIEW_AXES = ("camera_row", "camera_col", "row", "col")
CAMERA_AXES = VIEW_AXES[:2]
MAP_AXES = VIEW_AXES[2:]

COUNTS_LABELS = {
    "k": Label(("event",), "row of the camera, from the top"),
    "l": Label(("event",), "column of the camera, from the left"),
    "i": Label(("event",), "row of the pixel, from the top"),
    "j": Label(("event",), "column of the pixel, from the left"),
    "n": Label(("event",), "photons that the pixel counted", "photons"),
    "dense": Label(VIEW_AXES, "photons that each pixel counted", "photons"),
    "frame": Label(("photon",), "frame, from 0, that counted it; in the order of the events"),
}
PHOTON_TRUTH_LABELS = {
    "object_id": Label(
        ("photon",),
        "key of the manifest's objects that the photon's path hit first; 0 for the "
        "backdrop, -1 for a count without a photon",
    ),
    "z_mm": Label(("photon",), "planar depth of the first hit; +inf for none", "mm"),
}
_MAPS = {
    "z_mm": Label(MAP_AXES, "planar depth; +inf where nothing is hit", "mm"),
    "object_id": Label(
        MAP_AXES, "key of the manifest's objects; 0 for the backdrop and where nothing is hit"
    ),
    "normal": Label(
        (*MAP_AXES, "axis"),
        "unit normal of the surface in world axes (X right, Y down, Z forward), towards the camera; "
        "0 where nothing is hit",
    ),
    "coverage": Label(
        MAP_AXES, "share of the pixel's square that belongs to the object (or to none) that its centre hits"
    ),
}
TRUTH_LABELS = {
    **_MAPS,
    **{
        f"view_{name}": Label((*CAMERA_AXES, *label.dims), f"of every camera: {label.meaning}", label.unit)
        for name, label in _MAPS.items()
    },
    "in_focus": Label(
        ("plane", *MAP_AXES), "blur half-extent of at most 1 px at each depth of in_focus_z_mm"
    ),
    "visible_views": Label(MAP_AXES, "cameras that see the point; 0 where nothing is hit", "cameras"),
    "camera_position_mm": Label((*CAMERA_AXES, "axis"), "where the cameras really are", "mm"),
    "camera_rotation": Label(
        (*CAMERA_AXES, "axis", "direction"), "its columns are the cameras' right, down and forward directions"
    ),
}
PLANE_AXES = ("plane", *MAP_AXES)
_Z_MM = Label(("plane",), "planar depth of each section", "mm")
SECTIONS_LABELS = {
    "z_mm": _Z_MM,
    "counts": Label((*PLANE_AXES, "channel"), "sum of the samples that meet at each voxel", "photons"),
    "coverage": Label((*PLANE_AXES, "channel"), "how many samples that was", "samples"),
}
SEGMENTED_LABELS = {
    "z_mm": _Z_MM,
    "in_focus": Label(PLANE_AXES, "whether the voxel is in focus"),
    "photon_in_focus": Label(
        ("plane", "event"),
        "whether the photons of each event, in (k, l, i, j) order, come from what is in focus",
    ),
}
DEPTH_LABELS = {
    "z_mm": Label(MAP_AXES, "planar depth at the virtual centre; NaN where there is no answer", "mm"),
    "confidence": Label(MAP_AXES, "from 0 (no answer) to 1"),
}


def write_arrays_safely(
    folder: Path,
    arrays: Mapping[str, np.ndarray],
    labels: Mapping[str, Label],
    attributes: Mapping[str, Any] | None = None,
) -> None:
    """Write a group of arrays atomically. `labels` has one for each array."""
    with new_group_safely(folder, attributes or {}) as group:
        for name, array in arrays.items():
            stored = new_array(group, name, array.shape, array.dtype, labels[name])
            if array.size:
                stored[...] = array


@contextmanager
def new_group_safely(folder: Path, attributes: Mapping[str, Any]) -> Iterator[Any]:
    """A new Zarr v3 group to write to, which becomes `folder` when the block ends without an exception."""
    import zarr

    with new_folder_safely(folder) as temporary:
        yield zarr.open_group(temporary, mode="w", zarr_format=3, attributes=dict(attributes))


def new_array(group: Any, name: str, shape: tuple[int, ...], dtype: Any, label: Label) -> Any:
    """An empty array in a group, to be filled by whole leading steps; chunks of zeros are written, too."""
    from zarr.codecs import Crc32cCodec, ZstdCodec

    return group.create_array(
        name,
        shape=shape,
        dtype=dtype,
        chunks=chunk_shape(shape),
        compressors=[ZstdCodec(level=3), Crc32cCodec()],
        dimension_names=label.dims,
        # The last two names are those of the CF conventions, which xarray and its plots use.
        attributes={
            "unit": label.unit,
            "meaning": label.meaning,
            "units": label.unit,
            "long_name": label.meaning,
        },
        config={"write_empty_chunks": True},
    )


def chunk_shape(shape: Iterable[int]) -> tuple[int, ...]:
    """Shape of a chunk: whole trailing axes (a view) up to the chunk size, single steps of leading axes.

    >>> chunk_shape((10, 10, 1024, 1024)), chunk_shape((5_000_000,))
    ((1, 1, 1024, 1024), (1048576,))
    """
    chunks: list[int] = []
    elements_left = CHUNK_ELEMENTS
    for size in reversed(tuple(shape)):
        chunks.insert(0, max(1, min(size, elements_left)))
        elements_left //= max(1, size)
    return tuple(chunks)


def read_array(
    root: Path, name: str, files: Mapping[str, bytes], label: Label, sizes: Mapping[str, int]
) -> np.ndarray:
    """The array `name` (group/array) of the folder `root`, of the content of its `files` by their paths.

    `sizes` are the lengths of the axes of `label` by name, as far as they are known. Raises `InputError` for
    an array that `new_array` does not write.
    """
    import zarr
    from zarr.core.buffer.cpu import Buffer
    from zarr.storage import MemoryStore

    array_files = {file: content for file, content in files.items() if file.startswith(f"{name}/")}
    try:
        store = MemoryStore({file: Buffer.from_bytes(content) for file, content in array_files.items()})
        stored = zarr.open_array(store, path=name, mode="r", zarr_format=3)
        expected = tuple(sizes.get(dim, size) for dim, size in zip(label.dims, stored.shape, strict=True))
        if stored.shape != expected or stored.chunks != chunk_shape(expected):
            raise ValueError(f"expected a shape of {expected}, got {stored.shape}")
        if stored.dtype.name not in DTYPES:
            raise ValueError(f"expected one of {', '.join(DTYPES)}, got {stored.dtype}")
        chunks = sum(file.startswith(f"{name}/c") for file in array_files)
        if chunks != stored.nchunks:  # Zarr reads a missing chunk as zeros
            raise ValueError(f"expected {stored.nchunks} chunks, the manifest lists {chunks}")
        return np.asarray(stored[...])
    except Exception as fault:  # decoders raise various exceptions for damaged content
        raise InputError(f"{root / name}: cannot be read ({visible(str(fault))}); {REMEDY}") from None


def write_exr_safely(path: Path, image: np.ndarray) -> None:
    """Write an image (H, W, C), C = 1 or 3, as float32 EXR, atomically; with ZIP compression if that pays.

    Every sixteenth row shows whether it does. Radiance of few samples is noise, of which ZIP saves 1 %, and
    takes four times as long to write and half as long again to read.
    """
    import OpenEXR

    rows = np.asarray(image[::16], np.float32)
    is_compressible = len(_exr(rows, OpenEXR.ZIP_COMPRESSION)) < WORTH_ZIP * rows.nbytes
    compression = OpenEXR.ZIP_COMPRESSION if is_compressible else OpenEXR.NO_COMPRESSION
    write_bytes_safely(path, _exr(image, compression))


def _exr(image: np.ndarray, compression: object) -> bytes:
    """Content of a float32 EXR file of an image (H, W, C)."""
    import OpenEXR

    names = ("Y",) if image.shape[2] == 1 else ("R", "G", "B")
    planes = {name: np.ascontiguousarray(image[..., c], np.float32) for c, name in enumerate(names)}
    content = io.BytesIO()  # the library takes no path whose name is not valid text
    with OpenEXR.File({"compression": compression, "type": OpenEXR.scanlineimage}, planes) as file:
        file.write(content)
    return content.getvalue()


def read_exr(path: Path, shape: tuple[int, ...] | None = None, content: bytes | None = None) -> np.ndarray:
    """A float32 image (H, W, C) from an EXR file with the channels Y, or R, G, B, or from its `content`.

    Raises `InputError` if it cannot be read or its shape is not `shape`, if given; the shape is checked in
    the header, before memory is allocated for the pixels.
    """
    import OpenEXR

    stored = io.BytesIO(path.read_bytes() if content is None else content)
    try:
        with OpenEXR.File(stored, header_only=True) as file:
            (left, top), (right, bottom) = (map(int, corner) for corner in file.header()["dataWindow"])
            has_y = any(channel.name == "Y" for channel in file.header()["channels"])
        names = ("Y",) if has_y else ("R", "G", "B")
        size = (bottom - top + 1, right - left + 1, len(names))
        if shape is not None and size != tuple(shape):
            raise InputError(f"{path}: expected an image {tuple(shape)}, got {size}")
        stored.seek(0)
        with OpenEXR.File(stored, separate_channels=True) as file:
            channels = file.channels()
            return np.stack([np.array(channels[name].pixels) for name in names], axis=-1)
    except InputError:
        raise
    except (KeyError, RuntimeError, TypeError, ValueError) as fault:
        raise InputError(f"{path}: cannot be read as an EXR image ({fault})") from None


def pack_arrays(root: Path, parts: Iterable[str]) -> list[str]:
    """Move the named folders of `root` into its archive; the paths of the files in it."""
    parts, content = list(parts), io.BytesIO()
    paths = [path for part in parts for path in sorted((root / part).rglob("*")) if path.is_file()]
    names = [path.relative_to(root).as_posix() for path in paths]
    with zipfile.ZipFile(content, "w") as archive:
        for name in names:
            archive.writestr(zipfile.ZipInfo(name), (root / name).read_bytes())
    write_bytes_safely(root / ARRAYS, content.getvalue())
    for part in parts:
        shutil.rmtree(root / part, ignore_errors=True)
    return names
