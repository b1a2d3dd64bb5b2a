"""Groups of arrays on disk: Zarr v3, zstd and crc32c, each array with its axes, unit and meaning.

An array is read only if it is as it would be written here.
"""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base import InputError, new_folder_safely, visible
from pcii.store.folders import REMEDY
from pcii.types import Label

CHUNK_ELEMENTS = 1 << 20
"""One chunk is at most this many elements: a view, or a million events."""
DTYPES = ("bool", "uint8", "uint16", "uint32", "int16", "int32", "int64", "float32", "float64")


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
