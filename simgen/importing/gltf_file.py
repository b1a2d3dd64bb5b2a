"""A glTF file and the bytes that it names: JSON or its binary form, checked before anything is made of it."""

import base64
import binascii
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from pcii.base.errors import InputError
from simgen.base.file_lookup import LARGEST_FILE_BYTES, asset
from simgen.base.strict_models import LONGEST_PART, shorten, validate
from simgen.importing.gltf_models import Document

LARGEST_JSON_BYTES = 1 << 26
MOST_JSON_PARTS = 2_000_000
"""Lists, tables and commas of a file's JSON; each takes some 100 bytes of memory."""
MAGIC, JSON_CHUNK, BINARY_CHUNK = b"glTF", b"JSON", b"BIN\0"
READ_EXTENSIONS = {
    "KHR_lights_punctual",
    "KHR_texture_transform",
    "KHR_materials_transmission",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_materials_clearcoat",
    "KHR_materials_emissive_strength",
    "KHR_mesh_quantization",
    "EXT_mesh_gpu_instancing",
}
COMPRESSED = {"KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression"}
"""Without these there are no meshes; what any other extension adds can be left out."""


@dataclass(frozen=True, eq=False)
class GltfFile:
    """A file's document, and its buffers once they are asked for."""

    path: Path
    document: Document
    binary: bytes | None
    """The buffer behind the JSON of a binary file."""
    clamped: tuple[str, ...] = ()
    """Values that were out of range, and what they are taken for."""
    unread_extensions: tuple[str, ...] = ()
    _buffers: dict[int, np.ndarray] = field(default_factory=dict)

    def view(self, index: int, where: str) -> tuple[np.ndarray, int | None]:
        """The bytes (N,) of a buffer view, uint8, and their stride, if any."""
        views = self.document.buffer_views
        if index >= len(views):
            raise self.fault(f"{where}: there is no bufferViews[{index}]")
        view = views[index]
        buffer = self._buffer(view.buffer, f"bufferViews[{index}].buffer")
        end = view.byte_offset + view.byte_length
        if end > len(buffer):
            raise self.fault(
                f"bufferViews[{index}]: ends at byte {end} of buffers[{view.buffer}], which has {len(buffer)}"
            )
        return buffer[view.byte_offset : end], view.byte_stride

    def named_bytes(self, uri: str, where: str) -> np.ndarray:
        """The bytes of a file beside this one, or of an address that holds them itself; uint8."""
        if uri.startswith("data:"):
            head, comma, content = uri.partition(",")
            if not comma or not head.endswith(";base64"):
                raise self.fault(f"{where}: of addresses that hold data only those in base64 are read")
            try:
                return np.frombuffer(base64.b64decode(content, validate=True), np.uint8)
            except (binascii.Error, ValueError):
                raise self.fault(f"{where}: its base64 cannot be decoded") from None
        name = unquote(uri)
        if ":" in name.split("/")[0] or not name.isprintable() or name.startswith(("/", "\\")):
            shown = shorten(repr(name), LONGEST_PART)
            raise self.fault(f"{where}: only files beside the scene's are read, by their names, not {shown}")
        path = asset(self.path.parent, name, f"{self.path}: {where}")
        if path.stat().st_size == 0:
            raise self.fault(f"{where}: {name!r} is empty")
        return np.memmap(path, np.uint8, "r")

    def fault(self, text: str) -> InputError:
        """An error about this file."""
        return InputError(f"{self.path}: {text}")

    def _buffer(self, index: int, where: str) -> np.ndarray:
        buffers = self.document.buffers
        if index >= len(buffers):
            raise self.fault(f"{where}: there is no buffers[{index}]")
        if index not in self._buffers:
            buffer, name = buffers[index], f"buffers[{index}]"
            if buffer.uri is None:
                if index or self.binary is None:
                    raise self.fault(f"{name}: it has no uri, and the file no binary part for it")
                content = np.frombuffer(self.binary, np.uint8)
            else:
                content = self.named_bytes(buffer.uri, f"{name}.uri")
            if len(content) < buffer.byte_length:
                raise self.fault(
                    f"{name}: has {len(content)} bytes, and byteLength says {buffer.byte_length}"
                )
            self._buffers[index] = content[: buffer.byte_length]
        return self._buffers[index]


def read_gltf(path: Path) -> GltfFile:
    """Read a .gltf or .glb file; the files that it names are opened when they are needed.

    Raises `InputError` for a file that is none or is too large, that is not as the specification says, and
    that needs extensions which are not read.
    """
    if not path.is_file():
        raise InputError(f"{path}: there is no such file")
    if path.stat().st_size > LARGEST_FILE_BYTES:
        raise InputError(f"{path}: has {path.stat().st_size} bytes; at most {LARGEST_FILE_BYTES} are read")
    content = path.read_bytes()
    text, binary = _parts(path, content) if content.startswith(MAGIC) else (content, None)
    values = _json(path, text)
    _check_version(path, values)
    clamped: list[str] = []
    document = validate(Document, values, str(path), {"clamped": clamped})
    compressed = sorted(COMPRESSED & {*document.extensions_required})
    if compressed:
        raise InputError(f"{path}: needs {', '.join(compressed)}; export it without compression")
    used = dict.fromkeys((*document.extensions_used, *document.extensions_required))
    unread = (shorten(name, LONGEST_PART) for name in used if name not in READ_EXTENSIONS)
    return GltfFile(path, document, binary, tuple(dict.fromkeys(clamped)), tuple(unread))


def _parts(path: Path, content: bytes) -> tuple[bytes, bytes | None]:
    """JSON and binary part of a .glb file (section 4 of the specification)."""
    found: dict[bytes, bytes] = {}
    at = 12
    if len(content) < at or int.from_bytes(content[4:8], "little") != 2:
        raise InputError(f"{path}: not a binary glTF file of version 2")
    while at + 8 <= len(content):
        length, kind = int.from_bytes(content[at : at + 4], "little"), content[at + 4 : at + 8]
        if at + 8 + length > len(content):
            raise InputError(
                f"{path}: cut off; a part of {length} bytes begins at byte {at}, of {len(content)}"
            )
        found.setdefault(kind, content[at + 8 : at + 8 + length])
        at += 8 + length
    if JSON_CHUNK not in found:
        raise InputError(f"{path}: a binary glTF file without its JSON part")
    return found[JSON_CHUNK], found.get(BINARY_CHUNK)


def _json(path: Path, text: bytes) -> Any:
    if len(text) > LARGEST_JSON_BYTES:
        raise InputError(
            f"{path}: has {len(text)} bytes of JSON; at most {LARGEST_JSON_BYTES} are read: export it as .glb"
        )
    if sum(text.count(letter) for letter in (b"[", b"{", b",")) > MOST_JSON_PARTS:
        raise InputError(
            f"{path}: its JSON has more than {MOST_JSON_PARTS} parts; join meshes or drop animations"
        )

    def refuse(constant: str) -> float:
        raise ValueError(f"{constant} is no number of JSON")

    try:
        return json.loads(text.decode("utf-8-sig"), parse_constant=refuse)
    except RecursionError:
        raise InputError(f"{path}: its JSON is nested too deeply") from None
    except ValueError as fault:
        raise InputError(f"{path}: not a glTF file: {shorten(str(fault))}") from None


def _check_version(path: Path, values: Any) -> None:
    asset_values = values.get("asset") if isinstance(values, dict) else None
    version = asset_values.get("version") if isinstance(asset_values, dict) else None
    if version is None:
        raise InputError(f"{path}: not a glTF file: it has no asset.version")
    if not str(version).startswith("2."):
        raise InputError(
            f"{path}: glTF of version {shorten(str(version), LONGEST_PART)}; version 2.0 is read, which most "
            "programs export"
        )
