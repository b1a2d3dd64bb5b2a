"""glTF files made by hand: a table of JSON, and numbers behind it.

Khronos Group, "glTF 2.0 Specification" (2021).
"""

import base64
import json
import struct
from typing import Any

import numpy as np

Json = dict[str, Any]
KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
CODES = {"u1": 5121, "u2": 5123, "u4": 5125, "f4": 5126}
QUAD = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], "<f4")
QUAD_UV = np.array([(0, 1), (1, 1), (1, 0), (0, 0)], "<f4")  # v runs down
QUAD_FACES = np.array([0, 1, 2, 0, 2, 3], "<u2")


class GltfDraft:
    """A document as it grows; its buffer is one."""

    def __init__(self) -> None:
        self.json: Json = {"asset": {"version": "2.0"}, "scenes": [{"nodes": []}], "scene": 0}
        self.bytes = b""

    def put(self, kind: str, value: Json) -> int:
        """Add to a list of the document; the number of the new entry."""
        items = self.json.setdefault(kind, [])
        items.append(value)
        return len(items) - 1

    def view(self, content: bytes, **more: Any) -> int:
        """Bytes as a buffer view."""
        self.bytes += b"\0" * (-len(self.bytes) % 4)
        at = len(self.bytes)
        self.bytes += content
        return self.put("bufferViews", {"buffer": 0, "byteOffset": at, "byteLength": len(content), **more})

    def numbers(self, values: np.ndarray, **more: Any) -> int:
        """An array (N,) or (N, C) as an accessor."""
        values = np.atleast_2d(values.T).T
        return self.put(
            "accessors",
            {
                "bufferView": self.view(values.tobytes()),
                "componentType": CODES[values.dtype.str[1:]],
                "count": len(values),
                "type": KINDS[values.shape[1]],
                **more,
            },
        )

    def mesh(
        self,
        positions: np.ndarray = QUAD,
        faces: np.ndarray | None = QUAD_FACES,
        uv: np.ndarray | None = None,
        material: Json | None = None,
        normals: np.ndarray | None = None,
        **more: Any,
    ) -> int:
        """A mesh of one primitive, by default a square of 2 x 2 that faces +Z."""
        attributes = {"POSITION": self.numbers(positions)}
        if uv is not None:
            attributes["TEXCOORD_0"] = self.numbers(uv)
        if normals is not None:
            attributes["NORMAL"] = self.numbers(normals)
        primitive: Json = {"attributes": attributes, **more}
        if faces is not None:
            primitive["indices"] = self.numbers(faces)
        if material is not None:
            primitive["material"] = self.put("materials", material)
        return self.put("meshes", {"primitives": [primitive]})

    def texture(self, png: bytes, **sampler: int) -> int:
        """A picture as a texture."""
        image = self.put("images", {"bufferView": self.view(png), "mimeType": "image/png"})
        texture: Json = {"source": image}
        if sampler:
            texture["sampler"] = self.put("samplers", dict(sampler))
        return self.put("textures", texture)

    def node(self, *, root: bool = True, **values: Any) -> int:
        """A node, by default of the scene itself."""
        index = self.put("nodes", values)
        if root:
            self.json["scenes"][0]["nodes"].append(index)
        return index

    def camera(self, *, yfov: float = 0.7, aspect: float = 1.0, **values: Any) -> int:
        """A camera at a node, by default at the origin, where it looks along -Z."""
        view = {"type": "perspective", "perspective": {"yfov": yfov, "aspectRatio": aspect, "znear": 0.01}}
        return self.node(camera=self.put("cameras", view), **values)

    def light(self, values: Json, **node: Any) -> int:
        """A light at a node."""
        lights = self.json.setdefault("extensions", {}).setdefault("KHR_lights_punctual", {"lights": []})
        lights["lights"].append(values)
        number = len(lights["lights"]) - 1
        return self.node(extensions={"KHR_lights_punctual": {"light": number}}, **node)

    def document(self) -> Json:
        """The JSON, with the buffer's length."""
        return {**self.json, "buffers": [{"byteLength": len(self.bytes)}]} if self.bytes else self.json

    def glb(self) -> bytes:
        """The binary form."""
        return glb(json.dumps(self.document()).encode(), self.bytes)

    def gltf(self) -> bytes:
        """The text form, with the buffer in its address."""
        document = self.document()
        address = "data:application/octet-stream;base64," + base64.b64encode(self.bytes).decode()
        document["buffers"][0]["uri"] = address
        return json.dumps(document).encode()


def glb(text: bytes, binary: bytes) -> bytes:
    """A binary file of these two parts."""
    text += b" " * (-len(text) % 4)
    binary += b"\0" * (-len(binary) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text
    if binary:
        body += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body
