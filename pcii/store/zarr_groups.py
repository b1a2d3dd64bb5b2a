"""Groups of arrays on disk: Zarr v3, zstd and crc32c, each array with its axes, unit and meaning.

Files may be untrusted. An array is read only if its metadata are such as are written here, and if every
chunk exists, is listed, has the right hash and will have the right size once unpacked: Zarr itself would
read a missing chunk as zeros, and unpack 65 kB into as many bytes as its header asks for.
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base.errors import InputError
from pcii.base.plain_text import visible
from pcii.base.safe_files import new_folder_safely
from pcii.store.file_list import check_file
from pcii.store.sealed_json import parse_json, read_small
from pcii.types.array_labels import Label

CHUNK_ELEMENTS = 1 << 20
"""One chunk is at most this many elements: a view, or a million events."""
LARGEST_METADATA_BYTES = 1 << 16
METADATA = "zarr.json"
DTYPES = ("bool", "uint8", "uint16", "uint32", "int16", "int32", "int64", "float32", "float64")
ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"


def write_arrays_safely(
    folder: Path,
    arrays: Mapping[str, np.ndarray],
    labels: Mapping[str, Label],
    attributes: Mapping[str, Any] | None = None,
) -> None:
    """Write a group of arrays atomically. `labels` has one for each array."""
    with new_folder_safely(folder) as temporary:
        write_arrays(temporary, arrays, labels, attributes)


def write_arrays(
    folder: Path,
    arrays: Mapping[str, np.ndarray],
    labels: Mapping[str, Label],
    attributes: Mapping[str, Any] | None = None,
) -> None:
    """Write a group of arrays to a new folder, for callers that see to atomic writing themselves."""
    group = _new_group(folder, attributes or {})
    for name, array in arrays.items():
        stored = new_array(group, name, array.shape, array.dtype, labels[name])
        if array.size:
            stored[...] = array


@contextmanager
def new_group_safely(folder: Path, attributes: Mapping[str, Any]) -> Iterator[Any]:
    """A new Zarr v3 group to write to, which becomes `folder` when the block ends without an exception."""
    with new_folder_safely(folder) as temporary:
        yield _new_group(temporary, attributes)


def _new_group(folder: Path, attributes: Mapping[str, Any]) -> Any:
    import zarr

    return zarr.open_group(folder, mode="w", zarr_format=3, attributes=dict(attributes))


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
        attributes={"unit": label.unit, "meaning": label.meaning, **label.conventional},
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
    root: Path,
    name: str,
    files: Mapping[str, Mapping[str, Any]],
    label: Label,
    sizes: Mapping[str, int],
    remedy: str,
) -> np.ndarray:
    """The array `name` (group/array) of the folder `root`, whose `files` have these sizes and hashes.

    `sizes` are the lengths of the axes of `label` by name, as far as they are known. Raises `InputError`,
    which ends in `remedy`, for a missing or changed file, and for metadata other than `new_array` writes.
    """
    import zarr

    path, prefix = root / name, f"{name}/"
    metadata = f"{prefix}{METADATA}"
    if metadata not in files:
        raise InputError(f"{path}: the manifest lists no such array; {remedy}")
    for listed, entry in files.items():
        if listed.startswith(prefix):
            check_file(root, listed, entry, remedy, content=True)
    shape, dtype = _shape_and_dtype(path / METADATA, label, sizes, remedy)
    chunk = chunk_shape(shape)
    steps = [-(-size // step) for size, step in zip(shape, chunk, strict=True)]
    if math.prod(steps) != sum(
        listed.startswith(f"{prefix}c/") or listed == f"{prefix}c" for listed in files
    ):
        raise InputError(
            f"{path}: {math.prod(steps)} chunks are expected, the manifest lists others; {remedy}"
        )
    unpacked = math.prod(chunk) * dtype.itemsize
    for index in product(*map(range, steps)):
        chunk_file = path.joinpath("c", *map(str, index))
        if chunk_file.relative_to(root).as_posix() not in files:
            raise InputError(f"{chunk_file}: missing in the manifest; {remedy}")
        if unpacked_bytes(chunk_file) != unpacked:
            raise InputError(f"{chunk_file}: not a chunk of {unpacked} bytes; {remedy}")
    try:
        array = np.asarray(zarr.open_array(path, mode="r", zarr_format=3)[...])
    except Exception as fault:  # decoders raise various exceptions for damaged content
        raise InputError(f"{path}: cannot be read ({visible(str(fault))}); {remedy}") from None
    return array


def _shape_and_dtype(
    path: Path, label: Label, sizes: Mapping[str, int], remedy: str
) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Shape and dtype in the metadata of an array; raises `InputError` if `new_array` does not write such."""
    metadata = parse_json(read_small(path, LARGEST_METADATA_BYTES, remedy), path, remedy)
    shape, dtype = metadata.get("shape"), metadata.get("data_type")
    if not isinstance(shape, list) or not all(type(size) is int and size >= 0 for size in shape):
        raise InputError(f"{path}: shape: expected a list of whole numbers; {remedy}")
    expected = [sizes.get(dim) for dim in label.dims]
    if len(shape) != len(expected) or any(
        known not in (None, size) for known, size in zip(expected, shape, strict=True)
    ):
        wanted = ", ".join(
            dim if size is None else str(size) for dim, size in zip(label.dims, expected, strict=True)
        )
        raise InputError(f"{path}: shape: expected ({wanted}), got {tuple(shape)}; {remedy}")
    if dtype not in DTYPES:
        raise InputError(f"{path}: data_type: expected one of {', '.join(DTYPES)}, got {dtype!r}; {remedy}")
    codecs = metadata.get("codecs")
    names = (
        [codec.get("name") for codec in codecs if isinstance(codec, dict)] if isinstance(codecs, list) else []
    )
    fixed = {
        "node_type": "array",
        "zarr_format": 3,
        "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": list(chunk_shape(shape))}},
        "chunk_key_encoding": {"name": "default", "configuration": {"separator": "/"}},
        "storage_transformers": [],
    }
    for key, value in fixed.items():
        if metadata.get(key, []) != value:
            raise InputError(f"{path}: {key}: expected {value}; {remedy}")
    if names != ["bytes", "zstd", "crc32c"]:
        raise InputError(f"{path}: codecs: expected bytes, zstd, crc32c; {remedy}")
    return tuple(shape), np.dtype(dtype)


def unpacked_bytes(chunk: Path) -> int | None:
    """Unpacked length according to the header of a chunk file; None if it is not that of a zstd frame.

    RFC 8878, section 3.1.1.1: after the magic number a byte of flags, then optional fields, the length last.
    """
    with chunk.open("rb") as file:
        head = file.read(18)
    if head[:4] != ZSTD_MAGIC or len(head) < 6:
        return None
    flags = head[4]
    is_single, has_length = flags >> 5 & 1, flags >> 6
    width = (is_single, 2, 4, 8)[has_length]
    start = 5 + (1 - is_single) + (0, 1, 2, 4)[flags & 3]
    field = head[start : start + width]
    if width == 0 or len(field) < width:
        return None
    return int.from_bytes(field, "little") + (256 if width == 2 else 0)
