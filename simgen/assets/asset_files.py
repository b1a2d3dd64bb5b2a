"""Files that a scene brings along, as plain arrays that are checked once, before the renderer sees them.

Pillow, tifffile and OpenEXR read pictures, plyfile reads PLY. Wavefront OBJ is read here: trimesh 5.2 drops
the normals of both kinds of mesh.
"""

import contextlib
import io
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.recfunctions import unstructured_to_structured
from pydantic import BaseModel

from pcii.base import InputError, srgb_to_linear
from pcii.exchange import UPRIGHT, decode, picture_of
from simgen.assets.triangles import Triangles, barycentric, cross_2d, fan_all
from simgen.base import AssetName, EnvironmentName, ImageName, MeshName, asset, named_files, shorten

_TEXCOORDS = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"))
_FACES = ("vertex_indices", "vertex_index")
_LEFT_OUT = {"", "s", "mg", "l", "p", "vp", "lod", "usemap", "maplib"}
"""Statements of OBJ files that change no surface: materials, groups, points and lines."""


@dataclass(frozen=True)
class Assets:
    """The files of one scene, by the names that the scene gives them.

    `environments` are linear RGB, (H, W, 3) float32, finite and not negative; `meshes` are in the unit of
    their files.
    """

    images: dict[str, np.ndarray] = field(default_factory=dict)
    environments: dict[str, np.ndarray] = field(default_factory=dict)
    meshes: dict[str, Triangles] = field(default_factory=dict)

    def image(self, name: str) -> np.ndarray:
        """A texture as linear RGB, (H, W, 3) float32 from 0 to 1."""
        pixels = self.images[name]
        levels = np.arange(np.iinfo(pixels.dtype).max + 1, dtype=pixels.dtype)
        return srgb_to_linear(levels).astype(np.float32)[pixels]

    def stored(self, name: str) -> np.ndarray:
        """What an image holds, without the sRGB curve: (H, W, 3) float32 from 0 to 1."""
        pixels = self.images[name]
        return pixels / np.float32(np.iinfo(pixels.dtype).max)

    def numbers(self, name: str, where: str) -> np.ndarray:
        """What a grey image holds, (H, W, 1) float32 from 0 to 1.

        Raises `InputError`, beginning with `where`, if it is coloured.
        """
        pixels = self.stored(name)
        if (pixels != pixels[..., :1]).any():
            raise InputError(f"{where}: {name!r} is coloured; a grey image is needed")
        return pixels[..., :1]


def read_assets(scene: BaseModel, folder: Path) -> Assets:
    """Decode every file that a scene names. Raises `InputError` for the first that cannot be used."""
    paths = {(type(name), str(name)): asset(folder, name, where) for where, name in named_files(scene)}

    def read_all(kind: type[AssetName], read: Callable[[Path], Any]) -> dict[str, Any]:
        return {name: read(path) for (own_kind, name), path in paths.items() if own_kind is kind}

    images, environments = read_all(ImageName, read_texture), read_all(EnvironmentName, read_environment)
    return Assets(images, environments, read_all(MeshName, read_mesh))


def read_texture(path: Path, *, for_gltf: bool = False) -> np.ndarray:
    """A PNG, JPEG or TIFF file as sRGB (H, W, 3), uint8 or uint16, upright as its EXIF entry says.

    Raises `InputError` for a file that is no single RGB, grey or palette picture, or is not opaque. For glTF
    opacity is a fourth channel if the file has it, and EXIF is ignored, as in Blender.
    """
    picture = picture_of(path, ("PNG", "JPEG", "TIFF"))
    if picture.pages != 1 or picture.dtype.kind == "f":
        raise InputError(f"{path}: has {picture.layout()}; save one page as RGB or grey of 8 or 16 bits")
    if for_gltf:
        pixels = picture.pixels[0]
    else:
        (pixels,) = decode(replace(picture, orientation=UPRIGHT))
        # From 5 on its rows are columns; then either may run backwards.
        turned = pixels.swapaxes(0, 1) if 5 <= picture.orientation <= 8 else pixels
        up, left = picture.orientation in (3, 4, 7, 8), picture.orientation in (2, 3, 6, 7)
        pixels = turned[:: -1 if up else 1, :: -1 if left else 1]
    if picture.dtype == np.bool_ or picture.bits is not None:
        pixels = np.round(pixels * (65535 / picture.most)).astype(np.uint16)
    if picture.shape[2] == 1:
        pixels = np.concatenate([np.repeat(pixels[..., :1], 3, axis=2), pixels[..., 1:]], axis=2)
    return pixels


def read_environment(path: Path) -> np.ndarray:
    """An OpenEXR file as linear radiance (H, W, 3) float32, row 0 uppermost.

    Raises `InputError` for what is no OpenEXR file with the channels R, G and B, twice as wide as high, whose
    values are finite and not negative.
    """
    picture = picture_of(path, ("EXR",))
    height, width, channels = picture.shape
    if channels != 3 or width != 2 * height:
        raise InputError(f"{path}: is {picture.layout()}; expected R, G and B, twice as wide as high")
    (radiance,) = decode(picture)
    if not (np.isfinite(radiance) & (radiance >= 0)).all():
        raise InputError(f"{path}: has a pixel that is not finite or is negative; radiance is neither")
    return radiance


def read_mesh(path: Path) -> Triangles:
    """The mesh in a PLY or OBJ file; `InputError` that names the file if it has none that can be used."""
    kind = path.suffix.lower()
    if kind not in (".ply", ".obj"):
        raise InputError(f"{path}: this file is not named .ply or .obj, the kinds of mesh that are read")
    try:
        return _read_ply(path) if kind == ".ply" else obj_parts(path.read_bytes(), as_one=True)[1]["", ""]
    except ValueError as fault:
        raise InputError(f"{path}: this file {shorten(str(fault))}") from None


def ply_bytes(mesh: Triangles) -> bytes:
    """A mesh as a binary PLY file, with normals and the texture coordinates s, t where it has them."""
    from plyfile import PlyData, PlyElement

    columns = {"x y z": mesh.positions, "nx ny nz": mesh.normals, "s t": mesh.texcoords}
    present = {names: values for names, values in columns.items() if values is not None}
    layout = np.dtype([(name, "<f4") for name in " ".join(present).split()])
    vertices = unstructured_to_structured(np.hstack([*present.values()]), layout)
    faces = np.empty(len(mesh.faces), [("vertex_indices", "<i4", (3,))])
    faces["vertex_indices"] = mesh.faces
    file = io.BytesIO()
    elements = [PlyElement.describe(vertices, "vertex"), PlyElement.describe(faces, "face")]
    PlyData(elements, byte_order="<").write(file)
    return file.getvalue()


def _read_ply(path: Path) -> Triangles:
    """Raises `ValueError` with the end of a sentence if there is no mesh."""
    try:
        elements = {element.name: element.data for element in _parsed_ply(path).elements}
    except Exception as fault:  # a library raises whatever it likes about a broken file
        raise ValueError(f"cannot be read: {fault}") from None
    nothing = np.empty(0)
    vertices, faces = elements.get("vertex", nothing), elements.get("face", nothing)
    names = set(vertices.dtype.names or ())

    def columns(*wanted: str) -> np.ndarray | None:
        if not set(wanted) <= names:
            return None
        return np.stack([vertices[name].astype(np.float64) for name in wanted], axis=-1)

    positions = columns("x", "y", "z")
    if positions is None:
        raise ValueError("has no vertices with x, y and z")
    lists_name = next((name for name in _FACES if name in (faces.dtype.names or ())), None)
    if lists_name is None or not len(faces):
        strips = "tristrips" in elements
        raise ValueError("has strips of triangles; save its faces" if strips else "has no faces")
    lists = faces[lists_name]
    if lists.dtype == object:
        counts, corners = np.array([len(polygon) for polygon in lists]), np.concatenate(list(lists))
    else:
        counts, corners = np.full(len(lists), lists.shape[1]), lists.ravel()
    texcoords = next((pair for names in _TEXCOORDS if (pair := columns(*names)) is not None), None)
    if corners.dtype.kind not in "iu":
        raise ValueError("has a face whose vertex is not a whole number")
    triangles = _triangulate(corners.astype(np.int64), counts, positions)
    return Triangles.checked(positions, triangles, columns("nx", "ny", "nz"), texcoords)


def _parsed_ply(path: Path) -> Any:
    """Faces are read all at once if they are triangles, as most are: from the file, which is mapped."""
    from plyfile import PlyData, PlyElementParseError

    header = path.read_bytes().partition(b"end_header")[0]
    name = next((name for name in _FACES if name.encode() in header), _FACES[0])
    if b"format ascii" not in header:
        with contextlib.suppress(PlyElementParseError):  # other polygons, or a broken file
            return PlyData.read(str(path), known_list_len={"face": {name: 3}})
    return PlyData.read(str(path))


def obj_parts(data: bytes, *, as_one: bool = False) -> tuple[list[str], dict[tuple[str, str], Triangles]]:
    """The material files that an OBJ file names, and its meshes by the names of group and material.

    Raises `ValueError` with the end of a sentence if there is no mesh. Statements that change no surface are
    left out; others, such as curved surfaces, are refused.
    """
    libraries: list[str] = []
    group, material = "", ""
    points: dict[str, list[list[float]]] = {"v": [], "vt": [], "vn": []}
    faces: dict[tuple[str, str], tuple[list[list[int]], list[int]]] = {}
    text = data.decode("latin-1").replace("\\\r\n", " ").replace("\\\n", " ")
    for number, line in enumerate(text.split("\n"), start=1):
        keyword, *words = line.split("#", 1)[0].split() or [""]
        try:
            if keyword == "f" and words:
                sizes = [len(values) for values in points.values()]
                corners, counts = faces.setdefault(("", "") if as_one else (group, material), ([], []))
                corners += [_corner(word, sizes) for word in words]
                counts.append(len(words))
            elif keyword in ("o", "g"):
                group = " ".join(words)
            elif keyword == "usemtl":
                material = " ".join(words)
            elif keyword == "mtllib":
                libraries.append(line.split(None, 1)[1].strip())
            elif keyword == "vt":
                u, v = [*words, "0"][:2]  # v may be left out
                points["vt"].append([float(u), float(v)])
            elif keyword in points:
                x, y, z = words[:3]
                points[keyword].append([float(x), float(y), float(z)])
            elif keyword not in _LEFT_OUT:
                raise ValueError
        except ValueError:
            raise ValueError(f"has a line {number} that cannot be used: {line.strip()[:60]!r}") from None
    if not faces:
        raise ValueError("has no faces")
    values = [np.array(one) for one in points.values()]
    return libraries, {
        name: _obj_mesh(values, np.array(corners), np.array(counts))
        for name, (corners, counts) in faces.items()
    }


def _obj_mesh(values: list[np.ndarray], triples: np.ndarray, counts: np.ndarray) -> Triangles:
    """The mesh of polygons with `counts` corners, each the numbers of a position, coordinate and normal."""
    # One vertex for each combination of them that occurs.
    triples[:, (triples < 0).any(axis=0)] = -1  # of these some corners have none
    uv_count, normal_count = (len(one) + 1 for one in values[1:])
    keys = triples @ [uv_count * normal_count, normal_count, 1]
    _, first, vertices = np.unique(keys, return_index=True, return_inverse=True)
    positions, uv, normals = (
        one[numbers] if numbers[0] >= 0 else None
        for one, numbers in zip(values, triples[first].T, strict=True)
    )
    assert positions is not None
    return Triangles.checked(positions, _triangulate(vertices.ravel(), counts, positions), normals, uv)


def _corner(word: str, sizes: list[int]) -> list[int]:
    """Numbers of position, texture coordinate and normal from 0; -1 for those that a corner lacks. Numbers of
    a file count from 1, or from -1 for the latest so far."""
    numbers = [int(part or "0") for part in [*word.split("/"), "", ""][:3]]
    if not numbers[0] or any(abs(number) > size for number, size in zip(numbers, sizes, strict=True)):
        raise ValueError
    return [n - 1 if n >= 0 else size + n for n, size in zip(numbers, sizes, strict=True)]


def _triangulate(corners: np.ndarray, counts: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """Triangles as of `fan_all`, also of polygons that are not convex, of vertices at `positions` (V, 3)."""
    triangles = fan_all(corners, counts)
    if (counts == 3).all() or corners.min(initial=0) < 0 or corners.max(initial=0) >= len(positions):
        return triangles  # vertices that do not exist are refused with the mesh
    a, b, c = np.moveaxis(positions[triangles], 1, 0)
    normals, owner = np.cross(b - a, c - a), np.repeat(np.arange(len(counts)), counts - 2)
    whole = np.zeros((len(counts), 3))
    np.add.at(whole, owner, normals)
    is_turned = np.einsum("ij,ij->i", normals, whole[owner]) < 0
    first, begin = np.cumsum(counts) - counts, np.cumsum(counts - 2) - (counts - 2)
    for polygon in np.unique(owner[is_turned]):
        vertices = corners[first[polygon] : first[polygon] + counts[polygon]]
        ears = _cut_ears(positions[vertices], whole[polygon])
        triangles[begin[polygon] : begin[polygon] + len(ears)] = vertices[ears]
    return triangles


def _cut_ears(points: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Triangles (N - 2, 3) of a polygon (N, 3) in a plane, cut off one after another (Meisters 1975)."""
    axis = int(np.abs(normal).argmax())
    flat = np.delete(points, axis, axis=1)
    if (normal[axis] < 0) != (axis == 1):  # so that it runs the positive way round
        flat = flat[:, ::-1]
    left, ears = list(range(len(points))), list[list[int]]()
    while len(left) > 3:
        trio = left[:3]  # edges that cross each other leave no ear: any three will do
        for place in range(len(left)):
            trio = [left[place - 1], left[place], left[(place + 1) % len(left)]]
            a, b, c = flat[trio]
            others = [number for number in left if number not in trio]
            is_within = (barycentric(flat[others], np.array([[a, b, c]])) > 0).all(axis=1)
            if cross_2d(b - a, c - b) > 0 and not is_within.any():
                break
        ears.append(trio)
        left.remove(trio[1])
    return np.array([*ears, left])
