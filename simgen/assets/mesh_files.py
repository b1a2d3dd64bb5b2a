"""Mesh files as checked triangles: PLY as plyfile reads it, Wavefront OBJ, and PLY written.

OBJ is read here, since libraries lose what it says: trimesh 5.2 drops the normals of both kinds.
"""

import io
from pathlib import Path

import numpy as np
from plyfile import PlyData, PlyElement, PlyElementParseError

from pcii.base.errors import InputError
from simgen.assets.triangles import Triangles, check_counts, fan_all
from simgen.base.strict_models import shorten

_TEXCOORDS = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"))
_FACES = ("vertex_indices", "vertex_index")
# Of OBJ: materials and groups are the scene's business, points and lines have no surface.
_LEFT_OUT = {"mtllib", "usemtl", "o", "g", "s", "mg", "l", "p", "vp", "lod", "usemap", "maplib"}
_SIZES = {"v": 3, "vt": 2, "vn": 3}


def read_mesh(path: Path) -> Triangles:
    """The mesh in a PLY or OBJ file; `InputError` that names the file if it has none that can be used."""
    readers = {".ply": _read_ply, ".obj": _read_obj}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise InputError(f"{path}: this file is not named .ply or .obj, the kinds of mesh that are read")
    try:
        return reader(path.read_bytes())
    except ValueError as fault:
        raise InputError(f"{path}: this file {shorten(str(fault))}") from None


def ply_bytes(mesh: Triangles) -> bytes:
    """A mesh as a binary PLY file, with normals and the texture coordinates s, t where it has them."""
    columns = {"x y z": mesh.positions, "nx ny nz": mesh.normals, "s t": mesh.texcoords}
    present = {names: values for names, values in columns.items() if values is not None}
    vertices = np.empty(len(mesh.positions), [(n, "<f4") for names in present for n in names.split()])
    for names, values in present.items():
        for name, column in zip(names.split(), values.T, strict=True):
            vertices[name] = column
    faces = np.empty(len(mesh.faces), [("vertex_indices", "<i4", (3,))])
    faces["vertex_indices"] = mesh.faces
    file = io.BytesIO()
    elements = [PlyElement.describe(vertices, "vertex"), PlyElement.describe(faces, "face")]
    PlyData(elements, byte_order="<").write(file)
    return file.getvalue()


def _read_ply(data: bytes) -> Triangles:
    """`ValueError` with the end of a sentence if there is no mesh."""
    elements = {element.name: element.data for element in _parsed_ply(data).elements}
    vertices, faces = elements.get("vertex"), elements.get("face")
    if vertices is None or not {"x", "y", "z"} <= set(vertices.dtype.names or ()):
        raise ValueError("has no vertices with x, y and z")
    name = next((name for name in _FACES if faces is not None and name in (faces.dtype.names or ())), None)
    if faces is None or name is None or not len(faces):
        raise ValueError("has no faces")
    lists = faces[name]
    if lists.dtype == object:
        counts = np.fromiter((len(polygon) for polygon in lists), np.int64, len(lists))
        corners = np.concatenate(list(lists))
    else:
        counts, corners = np.full(len(lists), lists.shape[1]), lists.ravel()
    if corners.dtype.kind not in "iu":
        raise ValueError("has a face whose vertex is not a whole number")
    triangles = fan_all(corners.astype(np.int64), counts)

    def joined(*names: str) -> np.ndarray | None:
        if not set(names) <= set(vertices.dtype.names or ()):
            return None
        return np.stack([vertices[name].astype(np.float64) for name in names], axis=-1)

    positions = joined("x", "y", "z")
    assert positions is not None
    texcoords = next((found for pair in _TEXCOORDS if (found := joined(*pair)) is not None), None)
    return Triangles.checked(positions, triangles, joined("nx", "ny", "nz"), texcoords)


def _parsed_ply(data: bytes) -> PlyData:
    """The file as plyfile has it; `ValueError` with the end of a sentence for one that it does not read."""
    header = data[: data.find(b"end_header")]
    try:
        return _with_triangles(data, header)
    except MemoryError:
        raise ValueError("claims to hold more than memory can") from None
    except Exception as fault:  # a library raises whatever it likes about a broken file
        raise ValueError(f"cannot be read: {fault}") from None


def _with_triangles(data: bytes, header: bytes) -> PlyData:
    """Faces are read all at once if they are triangles, as most are."""
    name = next((name for name in _FACES if name.encode() in header), _FACES[0])
    if b"format ascii" not in header:
        try:
            return PlyData.read(io.BytesIO(data), known_list_len={"face": {name: 3}})
        except PlyElementParseError:
            pass  # other polygons, or a file that is broken, as is then said
    return PlyData.read(io.BytesIO(data))


def _read_obj(data: bytes) -> Triangles:
    """The mesh in an OBJ file; `ValueError` with the end of a sentence if it has none."""
    points: dict[str, list[list[float]]] = {"v": [], "vt": [], "vn": []}
    corners: list[tuple[int, int, int]] = []
    counts: list[int] = []
    text = data.decode("latin-1").replace("\\\r\n", " ").replace("\\\n", " ")
    for number, line in enumerate(text.split("\n"), start=1):
        words = line.split("#", 1)[0].split()
        if not words or words[0] in _LEFT_OUT:
            continue
        keyword, *rest = words
        try:
            if keyword in points:
                point = [float(word) for word in rest[: _SIZES[keyword]]]
                # A texture coordinate may have u alone.
                if len(point) < _SIZES[keyword] and (keyword != "vt" or not point):
                    raise ValueError
                points[keyword].append(point if len(point) == _SIZES[keyword] else [*point, 0.0])
            elif keyword == "f":
                sizes = len(points["v"]), len(points["vt"]), len(points["vn"])
                corners.extend([_corner(word, sizes) for word in rest])
                counts.append(len(rest))
            else:
                raise ValueError
        except ValueError:
            raise ValueError(f"has a line {number} that cannot be used: {line.strip()[:60]!r}") from None
    check_counts(len(points["v"]), len(counts))
    if not counts:
        raise ValueError("has no faces")
    triples = np.array(corners, dtype=np.int64).reshape(-1, 3)
    return _welded(points, triples, np.array(counts, dtype=np.int64))


def _corner(word: str, sizes: tuple[int, int, int]) -> tuple[int, int, int]:
    """Numbers of position, texture coordinate and normal from 0; -1 for those that a corner lacks."""
    v, t, n = [*word.split("/"), "", ""][:3] if word.count("/") <= 2 else ("", "", "")
    return _index(v or "0", sizes[0]), _index(t, sizes[1]), _index(n, sizes[2])


def _index(word: str, size: int) -> int:
    """From 1, or from -1 for the latest so far."""
    if not word:
        return -1
    number = int(word)
    if number == 0 or abs(number) > size:
        raise ValueError
    return number - 1 if number > 0 else size + number


def _welded(points: dict[str, list[list[float]]], triples: np.ndarray, counts: np.ndarray) -> Triangles:
    """One vertex for each combination of position, texture coordinate and normal that occurs."""
    has = {key: bool((triples[:, n] >= 0).all()) for n, key in enumerate(points)}
    v, t, n = (triples[:, n] if has[key] else 0 * triples[:, n] for n, key in enumerate(points))
    widths = len(points["vt"]) + 1, len(points["vn"]) + 1
    _, first, corner = np.unique((v * widths[0] + t) * widths[1] + n, return_index=True, return_inverse=True)
    faces = fan_all(corner.ravel(), counts)
    position = np.array(points["v"])[v[first]]
    texcoord = np.array(points["vt"])[t[first]] if has["vt"] else None
    normal = np.array(points["vn"])[n[first]] if has["vn"] else None
    return Triangles.checked(position, faces, normal, texcoord)
