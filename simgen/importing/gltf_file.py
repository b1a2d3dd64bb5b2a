"""A glTF file and the arrays and pictures that it names (sections 3.6 and 4.4 of the specification)."""

import base64
import hashlib
import json
import tempfile
from pathlib import Path
from typing import TypeVar
from urllib.parse import unquote

import numpy as np

from pcii.base import InputError
from simgen.assets import read_texture
from simgen.base import LARGEST_FILE_BYTES, LONGEST_NAME, asset, shorten
from simgen.importing.foreign_scene import ForeignScene
from simgen.importing.gltf_document import checked_document
from simgen.spec import names_of_objects

COMPRESSED = {"KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression"}
"""Without these there are no meshes; what any other extension adds can be left out."""
DTYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
SIZES = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
Item = TypeVar("Item")


class GltfFile(ForeignScene):
    """A .gltf or .glb file, whose other files are opened when they are needed.

    Raises `InputError` for a file that is none or is too large, that is not as the specification says, and
    whose meshes are compressed.
    """

    def __init__(self, path: Path, unit_mm: float) -> None:
        super().__init__(path, unit_mm)
        if not path.is_file() or path.stat().st_size > LARGEST_FILE_BYTES:
            raise InputError(f"{path}: there is no such file of at most {LARGEST_FILE_BYTES} bytes")
        text, self._binary = _chunks(path, path.read_bytes())
        try:
            values = json.loads(text.decode("utf-8-sig"))
        except (RecursionError, ValueError) as fault:
            raise InputError(f"{path}: not a glTF file: {shorten(str(fault))}") from None
        if not isinstance(values, dict):
            raise InputError(f"{path}: not a glTF file: its JSON is no table")
        self.document, left_out = checked_document(values, str(path))
        self.left_out.update(dict.fromkeys(left_out))
        compressed = sorted(COMPRESSED & {*self.document.extensions_required})
        if compressed:
            raise InputError(f"{path}: needs {', '.join(compressed)}; export it without compression")
        self._names: dict[bytes, str] = {}
        self._buffers: dict[int, np.ndarray] = {}
        self._pictures: dict[int, np.ndarray] = {}

    def keep(self, name: str, pixels: np.ndarray) -> str:
        """The file name of a picture, one for all that are the same; `name` is what it is called."""
        key = hashlib.sha256(f"{pixels.dtype} {pixels.shape}".encode() + pixels.tobytes()).digest()
        if key not in self._names:
            taken = [file.removesuffix(".png") for file in self.images]
            self._names[key] = f"{names_of_objects([name], taken)[0]}.png"
            self.images[self._names[key]] = pixels
        return self._names[key]

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
        number = view.buffer
        if number not in self._buffers:
            uri = self.item(self.document.buffers, number, "buffers").uri
            binary = np.frombuffer(b"" if number else self._binary, np.uint8)
            self._buffers[number] = binary if uri is None else self.content(uri, f"buffers[{number}]")
        return self._buffers[number][view.byte_offset :][: view.byte_length], view.byte_stride

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
                    self._pictures[index] = read_texture(path, for_gltf=True)
                except InputError as fault:
                    raise self.fault(f"{name}: {str(fault).removeprefix(f'{path}: ')}") from None
        return self._pictures[index]

    def numbers(self, index: int, kind: str, most: int) -> np.ndarray:
        """The elements (N, C) of an accessor that must be of this type, such as "VEC3", and `most` at most.

        Integers that stand for shares become float32 from 0 or -1 to 1. Raises `InputError` that names the
        accessor.
        """
        accessor, name = self.item(self.document.accessors, index, "accessors"), f"accessors[{index}]"
        count = accessor.count
        if accessor.type != kind or count > most or accessor.sparse is not None:
            raise self.fault(
                f"{name}: expected at most {most} elements of {kind} that are not sparse, got {count} of "
                f"{accessor.type}"
            )
        dtype, size = np.dtype(DTYPES[accessor.component_type]), SIZES[kind]
        if accessor.buffer_view is None:
            return np.zeros((count, size), dtype)
        content, stride = self.view(accessor.buffer_view)
        steps = stride or size * dtype.itemsize, dtype.itemsize
        try:
            values = np.ndarray((count, size), dtype, content.data, accessor.byte_offset, steps).copy()
        except (TypeError, ValueError):
            raise self.fault(
                f"{name}: its {count} elements do not fit into bufferViews[{accessor.buffer_view}]"
            ) from None
        if not np.isfinite(values).all():
            raise self.fault(f"{name}: has numbers that are nan or infinite")
        if accessor.normalized and dtype.kind in "iu":
            return np.maximum(values / np.float32(np.iinfo(dtype).max), -1).astype(np.float32)
        return values


def _chunks(path: Path, content: bytes) -> tuple[bytes, bytes]:
    """JSON and binary part of a .gltf or .glb file (section 4 of the specification)."""
    if not content.startswith(b"glTF"):
        return content, b""
    if content[4:8] == (1).to_bytes(4, "little"):
        raise InputError(f"{path}: is glTF 1.0, which is not read; export it as glTF 2.0")
    chunks, at = {b"JSON": b"", b"BIN\0": b""}, 12
    while at + 8 <= len(content):
        end = at + 8 + int.from_bytes(content[at : at + 4], "little")
        if end > len(content):
            raise InputError(f"{path}: cut off; a part ends at byte {end}, of {len(content)}")
        chunks[content[at + 4 : at + 8]] = content[at + 8 : end]
        at = end
    return chunks[b"JSON"], chunks[b"BIN\0"]
