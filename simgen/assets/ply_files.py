"""PLY meshes: text or binary of either byte order, polygons, normals and texture coordinates.

G. Turk, "The PLY Polygon File Format" (1994). Only arithmetic on a buffer: what a header claims is
compared with what is there before anything is made of it.
"""

from dataclasses import dataclass

import numpy as np

from simgen.assets.triangles import Triangles, check_counts, fan_all

LONGEST_HEADER = 1 << 16
MOST_PROPERTIES = 64
_TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"},
    **{"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"},
    **{"float": "f4", "double": "f8", "float32": "f4", "float64": "f8"},
}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_TEXCOORDS = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"))
_FACES = ("vertex_indices", "vertex_index")


@dataclass(frozen=True)
class _Property:
    name: str
    dtype: np.dtype
    count_dtype: np.dtype | None
    """None for a single number, else the type of a list's length."""


@dataclass(frozen=True)
class _Element:
    name: str
    count: int
    properties: tuple[_Property, ...]


def read_ply(data: bytes) -> Triangles:
    """The mesh in a PLY file; `ValueError` with the end of a sentence if it has none."""
    order, elements, start = _header(data)
    body = _Body(data, start, order)
    vertices, faces = None, None
    for element in elements:
        if any(item.count_dtype is not None for item in element.properties):
            if element.name == "vertex":
                raise ValueError("has lists among its vertices")
            lists = body.lists(element)
            if element.name == "face":
                faces = next((lists[name] for name in _FACES if name in lists), None)
        else:
            columns = body.columns(element)
            if element.name == "vertex":
                vertices = columns
        if vertices is not None and faces is not None:
            break
    if vertices is None or not {"x", "y", "z"} <= vertices.keys():
        raise ValueError("has no vertices with x, y and z")
    if faces is None:
        raise ValueError("has no faces")
    corners, counts = faces
    whole = corners.astype(np.int64)
    if not np.array_equal(whole, corners):
        raise ValueError("has a face whose vertex is not a whole number")
    triangles = fan_all(whole, counts)
    check_counts(0, len(triangles))
    return Triangles.checked(
        _joined(vertices, ("x", "y", "z")),
        triangles,
        _joined(vertices, ("nx", "ny", "nz")) if {"nx", "ny", "nz"} <= vertices.keys() else None,
        next((_joined(vertices, pair) for pair in _TEXCOORDS if set(pair) <= vertices.keys()), None),
    )


def _joined(columns: dict[str, np.ndarray], names: tuple[str, ...]) -> np.ndarray:
    return np.stack([columns[name].astype(np.float64) for name in names], axis=-1)


def _header(data: bytes) -> tuple[str, list[_Element], int]:
    """Byte order ('' for text), elements, and where the body begins."""
    end = data.find(b"end_header", 0, LONGEST_HEADER)
    line_end = data.find(b"\n", end)
    if not data.startswith(b"ply") or end < 0 or line_end < 0:
        raise ValueError("is not a PLY file: it has no PLY header")
    order: str | None = None
    elements: list[_Element] = []
    for line in data[:end].decode("latin-1").splitlines()[1:]:
        match line.split():
            case ["format", name, "1.0"] if name in _ORDERS:
                order = _ORDERS[name]
            case ["element", name, count] if count.isdecimal() and len(count) < 16:
                elements.append(_Element(name, int(count), ()))
                check_counts(*((int(count), 0) if name == "vertex" else (0, int(count))))
            case ["property", *words] if elements and len(elements[-1].properties) < MOST_PROPERTIES:
                last = elements[-1]
                grown = (*last.properties, _property(words, order or ""))
                elements[-1] = _Element(last.name, last.count, grown)
            case [] | ["comment", *_] | ["obj_info", *_]:
                pass
            case _:
                raise ValueError(f"has a header line that makes no sense: {line[:60]!r}")
    if order is None:
        raise ValueError("is not a PLY file that can be read: no format line of version 1.0")
    return order, elements, line_end + 1


def ply_bytes(mesh: Triangles) -> bytes:
    """A mesh as a binary PLY file, with normals and the texture coordinates s, t where it has them."""
    columns = {"x y z": mesh.positions, "nx ny nz": mesh.normals, "s t": mesh.texcoords}
    present = {names: values for names, values in columns.items() if values is not None}
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(mesh.positions)}"]
    head += [f"property float {name}" for names in present for name in names.split()]
    head += [f"element face {len(mesh.faces)}", "property list uchar int vertex_indices", "end_header"]
    faces = np.empty(len(mesh.faces), dtype=[("corners", "u1"), ("vertex", "<i4", 3)])
    faces["corners"], faces["vertex"] = 3, mesh.faces
    vertices = np.concatenate(list(present.values()), axis=1).astype("<f4")
    return "\n".join(head).encode() + b"\n" + vertices.tobytes() + faces.tobytes()


def _property(words: list[str], order: str) -> _Property:
    match words:
        case [kind, name] if kind in _TYPES:
            return _Property(name, np.dtype(order + _TYPES[kind]), None)
        case ["list", count, kind, name] if kind in _TYPES and _TYPES.get(count, "f")[0] in "iu":
            return _Property(name, np.dtype(order + _TYPES[kind]), np.dtype(order + _TYPES[count]))
    raise ValueError(f"has a property that makes no sense: {' '.join(words)[:60]!r}")


class _Body:
    """Numbers after the header, read from the front; positions are bytes, or words of a text file."""

    def __init__(self, data: bytes, start: int, order: str) -> None:
        self._text = not order
        if self._text:
            try:
                self._data = np.array([float(word) for word in data[start:].split()])
            except ValueError:
                raise ValueError("has a word among its numbers") from None
        else:
            self._data = np.frombuffer(data, np.uint8)[start:]
        self._at = 0

    def columns(self, element: _Element) -> dict[str, np.ndarray]:
        """Numbers of an element without lists, by property."""
        sizes = [self._size(item.dtype) for item in element.properties]
        block = self._take(element, element.count * sum(sizes)).reshape(element.count, sum(sizes))
        starts = np.cumsum([0, *sizes])
        return {
            item.name: self._as(item.dtype, block[:, a : a + n])[:, 0]
            for item, a, n in zip(element.properties, starts, sizes, strict=False)
        }

    def lists(self, element: _Element) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """All entries of each list of an element, one list after another, and the lists' lengths."""
        starts: dict[str, list[int]] = {item.name: [] for item in element.properties}
        counts: dict[str, list[int]] = {item.name: [] for item in element.properties}
        end, at = len(self._data), self._at
        plan = [
            (item.name, self._size(item.dtype), item.count_dtype, self._size(item.count_dtype or item.dtype))
            for item in element.properties
        ]
        for _ in range(element.count):
            for name, size, count_dtype, count_size in plan:
                if count_dtype is None:
                    at += size
                    continue
                if at + count_size > end:
                    raise self._short(element)
                count = self._whole(at, count_dtype, count_size)
                at += count_size
                starts[name].append(at)
                counts[name].append(count)
                at += count * size
            if at > end:
                raise self._short(element)
        self._at = at
        return {
            item.name: self._gather(item.dtype, np.array(starts[item.name]), np.array(counts[item.name]))
            for item in element.properties
            if item.count_dtype is not None
        }

    def _gather(
        self, dtype: np.dtype, starts: np.ndarray, counts: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        counts, size = counts.astype(np.int64), self._size(dtype)
        lengths = counts * size
        before = np.cumsum(lengths) - lengths
        where = np.repeat(starts.astype(np.int64) - before, lengths) + np.arange(lengths.sum())
        return self._as(dtype, self._data[where].reshape(-1, size))[:, 0], counts

    def _whole(self, at: int, dtype: np.dtype, size: int) -> int:
        if self._text:
            value = float(self._data[at])
            if not 0 <= value < 2**31 or value != int(value):
                raise ValueError(f"has a list of length {value:g}")
            return int(value)
        if size == 1 and dtype.kind == "u":
            return int(self._data[at])
        value = int(self._data[at : at + size].view(dtype)[0])
        if value < 0:
            raise ValueError(f"has a list of length {value}")
        return value

    def _size(self, dtype: np.dtype) -> int:
        return 1 if self._text else dtype.itemsize

    def _as(self, dtype: np.dtype, cells: np.ndarray) -> np.ndarray:
        return cells if self._text else np.ascontiguousarray(cells).view(dtype)

    def _take(self, element: _Element, size: int) -> np.ndarray:
        if size > len(self._data) - self._at:
            raise self._short(element)
        self._at += size
        return self._data[self._at - size : self._at]

    def _short(self, element: _Element) -> ValueError:
        return ValueError(f"ends before its {element.count} elements of '{element.name[:20]}' do")
