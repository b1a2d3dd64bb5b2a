"""A glTF file and the arrays and pictures that it names (sections 3.6 and 4.4 of the specification)."""

import base64
import json
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar
from urllib.parse import unquote

import numpy as np

from pcii.base.errors import InputError
from simgen.assets.asset_files import LARGEST_TOTAL_BYTES, read_texture
from simgen.base.file_lookup import LARGEST_FILE_BYTES, LONGEST_NAME, asset
from simgen.base.strict_models import shorten
from simgen.importing.gltf_document import Document, checked_document

MAX_JSON_PARTS = 2_000_000
"""Lists, tables and commas of a file's JSON; each takes some 100 bytes of memory."""
MAGIC, JSON_CHUNK, BINARY_CHUNK = b"glTF", b"JSON", b"BIN\0"
COMPRESSED = {"KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression"}
"""Without these there are no meshes; what any other extension adds can be left out."""
DTYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
SIZES = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
Item = TypeVar("Item")


@dataclass(frozen=True, eq=False)
class GltfFile:
    """A file's document, the names of what it says and that is not read, and the buffer behind its JSON."""

    path: Path
    document: Document
    left_out: list[str]
    binary: bytes
    _buffers: dict[int, np.ndarray] = field(default_factory=dict)
    _pictures: dict[int, np.ndarray] = field(default_factory=dict)

    def fault(self, text: str) -> InputError:
        """An error about this file."""
        return InputError(f"{self.path}: {text}")

    def item(self, items: tuple[Item, ...], index: int, kind: str) -> Item:
        """The item of this number; `InputError` if there is none."""
        if index >= len(items):
            raise self.fault(f"there is no {kind}[{index}]")
        return items[index]

    def content(self, uri: str, where: str) -> np.ndarray:
        """The bytes (N,), uint8, of a file beside this one, or of an address that holds them itself."""
        if uri.startswith("data:"):
            try:
                return np.frombuffer(base64.b64decode(uri.partition(";base64,")[2], validate=True), np.uint8)
            except ValueError:
                raise self.fault(f"{where}: its base64 cannot be decoded") from None
        name = shorten(unquote(uri), LONGEST_NAME)  # which changes no name that a file can have
        return np.fromfile(asset(self.path.parent, name, f"{self.path}: {where}"), np.uint8)

    def view(self, index: int) -> tuple[np.ndarray, int | None]:
        """The bytes (N,), uint8, of a buffer view, as far as the buffer goes, and their stride, if any."""
        view = self.item(self.document.buffer_views, index, "bufferViews")
        if view.buffer not in self._buffers:
            uri = self.item(self.document.buffers, view.buffer, "buffers").uri
            binary = b"" if view.buffer else self.binary
            self._buffers[view.buffer] = (
                np.frombuffer(binary, np.uint8)
                if uri is None
                else self.content(uri, f"buffers[{view.buffer}]")
            )
        content = self._buffers[view.buffer]
        return content[view.byte_offset : view.byte_offset + view.byte_length], view.byte_stride

    def picture(self, index: int) -> np.ndarray:
        """Pixels of an image, (H, W, 3) or with alpha (H, W, 4), uint8 or uint16, as they are stored.

        Raises `InputError` that names the image for one that is missing or cannot be decoded.
        """
        if index not in self._pictures:
            image, name = self.item(self.document.images, index, "images"), f"images[{index}]"
            content = self.view(image.buffer_view)[0] if image.uri is None else self.content(image.uri, name)
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder) / "picture"
                path.write_bytes(content.tobytes())
                try:
                    self._pictures[index] = read_texture(path, alpha=True, as_stored=True)
                except InputError as fault:
                    raise self.fault(f"{name}: {str(fault).removeprefix(f'{path}: ')}") from None
            if sum(pixels.nbytes for pixels in self._pictures.values()) > LARGEST_TOTAL_BYTES:
                raise self.fault(f"its images take more than {LARGEST_TOTAL_BYTES} bytes; make them smaller")
        return self._pictures[index]

    def numbers(self, index: int, kind: str, most: int) -> np.ndarray:
        """The elements (N, C) of an accessor that must be of this type, such as "VEC3", and `most` at most.

        Integers that stand for shares become float32 from 0 or -1 to 1. Raises `InputError` that names the
        accessor.
        """
        accessor, name = self.item(self.document.accessors, index, "accessors"), f"accessors[{index}]"
        if accessor.type != kind or accessor.count > most or accessor.sparse is not None:
            raise self.fault(
                f"{name}: expected at most {most} elements of {kind} that are not sparse, got "
                f"{accessor.count} of {accessor.type}"
            )
        dtype, size = np.dtype(DTYPES[accessor.component_type]), SIZES[kind]
        if accessor.buffer_view is None:
            return np.zeros((accessor.count, size), dtype)
        content, stride = self.view(accessor.buffer_view)
        steps = stride or size * dtype.itemsize, dtype.itemsize
        try:
            values = np.ndarray(
                (accessor.count, size), dtype, content.data, accessor.byte_offset, steps
            ).copy()
        except (TypeError, ValueError):
            raise self.fault(
                f"{name}: its {accessor.count} elements do not fit into the {len(content)} bytes of "
                f"bufferViews[{accessor.buffer_view}]"
            ) from None
        if not np.isfinite(values).all():
            raise self.fault(f"{name}: has numbers that are nan or infinite")
        if accessor.normalized and dtype.kind in "iu":
            return np.maximum(values / np.float32(np.iinfo(dtype).max), -1).astype(np.float32)
        return values


def read_gltf(path: Path) -> GltfFile:
    """Read a .gltf or .glb file; the files that it names are opened when they are needed.

    Raises `InputError` for a file that is none or is too large, that is not as the specification says, and
    whose meshes are compressed.
    """
    if not path.is_file():
        raise InputError(f"{path}: there is no such file")
    if path.stat().st_size > LARGEST_FILE_BYTES:
        raise InputError(f"{path}: has {path.stat().st_size} bytes; at most {LARGEST_FILE_BYTES} are read")
    content = path.read_bytes()
    text, binary = _chunks(path, content) if content.startswith(MAGIC) else (content, b"")
    document, left_out = checked_document(_json(path, text), str(path))
    compressed = sorted(COMPRESSED & {*document.extensions_required})
    if compressed:
        raise InputError(f"{path}: needs {', '.join(compressed)}; export it without compression")
    return GltfFile(path, document, left_out, binary)


def _chunks(path: Path, content: bytes) -> tuple[bytes, bytes]:
    """JSON and binary part of a .glb file (section 4 of the specification)."""
    chunks = {JSON_CHUNK: b"", BINARY_CHUNK: b""}
    at = 12
    while at + 8 <= len(content):
        end = at + 8 + int.from_bytes(content[at : at + 4], "little")
        if end > len(content):
            raise InputError(f"{path}: cut off; a part ends at byte {end}, of {len(content)}")
        chunks[content[at + 4 : at + 8]] = content[at + 8 : end]
        at = end
    return chunks[JSON_CHUNK], chunks[BINARY_CHUNK]


def _json(path: Path, text: bytes) -> dict[str, Any]:
    if sum(text.count(letter) for letter in (b"[", b"{", b",")) > MAX_JSON_PARTS:
        raise InputError(
            f"{path}: its JSON has more than {MAX_JSON_PARTS} parts; join meshes or drop animations"
        )
    try:
        values = json.loads(text.decode("utf-8-sig"))
    except (RecursionError, ValueError) as fault:
        raise InputError(f"{path}: not a glTF file: {shorten(str(fault))}") from None
    if not isinstance(values, dict):
        raise InputError(f"{path}: not a glTF file: its JSON is no table")
    return values
