"""Files that a scene brings along, as plain arrays that are checked once, before the renderer sees them.

Pillow, tifffile and OpenEXR read pictures, plyfile reads PLY. Wavefront OBJ is read here: trimesh 5.2 drops
the normals of both kinds of mesh.
"""

import io
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from plyfile import PlyData, PlyElement, PlyElementParseError
from pydantic import BaseModel

from pcii.base.errors import InputError
from pcii.base.srgb import srgb_to_linear
from pcii.exchange.pixel_files import decode, kind_of, picture_of
from simgen.assets.triangles import Triangles, fan_all
from simgen.base.file_lookup import EnvironmentName, ImageName, MeshName, asset, named_files
from simgen.base.strict_models import shorten

LARGEST_TOTAL_BYTES = 1 << 30
MOST_TEXTURE_PIXELS = 1 << 26
_TEXCOORDS = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"))
_FACES = ("vertex_indices", "vertex_index")
# Of OBJ: materials and groups are the scene's business, points and lines have no surface.
_LEFT_OUT = {"mtllib", "usemtl", "o", "g", "s", "mg", "l", "p", "vp", "lod", "usemap", "maplib"}
_SIZES = {"v": 3, "vt": 2, "vn": 3}


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
        largest = np.iinfo(pixels.dtype).max
        return srgb_to_linear(np.arange(largest + 1) / largest).astype(np.float32)[pixels]

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
    assets = Assets()
    total = 0
    paths = {(type(name), str(name)): asset(folder, name, where) for where, name in named_files(scene)}
    for (kind, name), path in paths.items():
        if kind is MeshName:
            mesh = assets.meshes[name] = read_mesh(path)
            total += mesh.positions.nbytes + mesh.faces.nbytes
        elif kind is ImageName:
            total += assets.images.setdefault(name, read_texture(path)).nbytes
        elif kind is EnvironmentName:
            total += assets.environments.setdefault(name, read_environment(path)).nbytes
        if total > LARGEST_TOTAL_BYTES:
            raise InputError(
                f"{path}: with this file the scene's files take more than {LARGEST_TOTAL_BYTES} bytes"
            )
    return assets


def read_texture(path: Path, *, alpha: bool = False, as_stored: bool = False) -> np.ndarray:
    """A PNG, JPEG or TIFF file as sRGB (H, W, 3), uint8 or uint16, upright as its EXIF entry says.

    With `as_stored` that entry is ignored, as glTF allows and Blender does. Raises `InputError` for a file
    that is no single RGB, grey or palette picture, or is not opaque; with `alpha` that is a fourth channel
    if the file has it.
    """
    picture = picture_of(path, ("PNG", "JPEG", "TIFF"), MOST_TEXTURE_PIXELS)
    if picture.pages != 1:
        raise InputError(f"{path}: holds {picture.pages} pictures; give a file with one")
    if picture.dtype.kind == "f":
        raise InputError(f"{path}: a picture of {picture.dtype}; save it as RGB or grey with 8 or 16 bits")
    (pixels,) = decode(picture, turn=None if as_stored else True, alpha=alpha)
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
    if kind_of(path) != "EXR":
        raise InputError(f"{path}: not an OpenEXR picture; convert it to OpenEXR (.exr)")
    picture = picture_of(path, ("EXR",))
    height, width, channels = picture.shape
    if channels != 3 or width != 2 * height:
        raise InputError(
            f"{path}: this file is {height} x {width} pixels with {channels} channels; what shines from all "
            "around is twice as wide as high, with R, G and B"
        )
    (radiance,) = decode(picture)
    is_sound = np.isfinite(radiance) & (radiance >= 0)
    if not is_sound.all():
        i, j, c = np.argwhere(~is_sound)[0]
        raise InputError(
            f"{path}: has the value {radiance[i, j, c]:g} at row {i}, column {j}; "
            "radiance is finite and not negative"
        )
    return radiance


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
    """Raises `ValueError` with the end of a sentence if there is no mesh."""
    try:
        elements = {element.name: element.data for element in _parsed_ply(data).elements}
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
        raise ValueError("has no faces")
    lists = faces[lists_name]
    if lists.dtype == object:
        counts = np.fromiter((len(polygon) for polygon in lists), np.int64, len(lists))
        corners = np.concatenate(list(lists))
    else:
        counts, corners = np.full(len(lists), lists.shape[1]), lists.ravel()
    if corners.dtype.kind not in "iu":
        raise ValueError("has a face whose vertex is not a whole number")
    texcoords = next((pair for names in _TEXCOORDS if (pair := columns(*names)) is not None), None)
    triangles = fan_all(corners.astype(np.int64), counts)
    return Triangles.checked(positions, triangles, columns("nx", "ny", "nz"), texcoords)


def _parsed_ply(data: bytes) -> PlyData:
    """Faces are read all at once if they are triangles, as most are."""
    header = data[: data.find(b"end_header")]
    name = next((name for name in _FACES if name.encode() in header), _FACES[0])
    if b"format ascii" not in header:
        try:
            return PlyData.read(io.BytesIO(data), known_list_len={"face": {name: 3}})
        except PlyElementParseError:
            pass  # other polygons, or a broken file, for which the next line raises
    return PlyData.read(io.BytesIO(data))


def _read_obj(data: bytes) -> Triangles:
    """Raises `ValueError` with the end of a sentence if there is no mesh."""
    points: dict[str, list[list[float]]] = {"v": [], "vt": [], "vn": []}
    corners: list[list[int]] = []
    counts: list[int] = []
    text = data.decode("latin-1").replace("\\\r\n", " ").replace("\\\n", " ")
    for number, line in enumerate(text.split("\n"), start=1):
        words = line.split("#", 1)[0].split()
        if not words or words[0] in _LEFT_OUT:
            continue
        keyword, *rest = words
        try:
            if keyword == "f":
                corners += [_corner(word, [len(values) for values in points.values()]) for word in rest]
                counts.append(len(rest))
                continue
            values = [float(word) for word in rest[: _SIZES[keyword]]]
            if keyword == "vt":
                values = [*values, 0.0][:2]  # v may be left out
            if len(values) < _SIZES[keyword]:
                raise ValueError
            points[keyword].append(values)
        except (KeyError, ValueError):
            raise ValueError(f"has a line {number} that cannot be used: {line.strip()[:60]!r}") from None
    if not counts:
        raise ValueError("has no faces")
    return _welded(points, np.array(corners, dtype=np.int64).reshape(-1, 3), np.array(counts, dtype=np.int64))


def _corner(word: str, sizes: list[int]) -> list[int]:
    """Numbers of position, texture coordinate and normal from 0; -1 for those that a corner lacks."""
    parts = word.split("/")
    if not parts[0] or len(parts) > 3:
        raise ValueError
    parts += [""] * (3 - len(parts))
    return [_index(part, size) if part else -1 for part, size in zip(parts, sizes, strict=True)]


def _index(word: str, size: int) -> int:
    """Numbers of a file count from 1, or from -1 for the latest so far."""
    number = int(word)
    if number == 0 or abs(number) > size:
        raise ValueError
    return number - 1 if number > 0 else size + number


def _welded(points: dict[str, list[list[float]]], triples: np.ndarray, counts: np.ndarray) -> Triangles:
    """One vertex for each combination of position, texture coordinate and normal that occurs."""
    present = {key: bool((triples[:, n] >= 0).all()) for n, key in enumerate(points)}
    v, t, n = (triples[:, n] if present[key] else 0 * triples[:, n] for n, key in enumerate(points))
    widths = len(points["vt"]) + 1, len(points["vn"]) + 1
    _, first, corner = np.unique((v * widths[0] + t) * widths[1] + n, return_index=True, return_inverse=True)
    return Triangles.checked(
        np.array(points["v"])[v[first]],
        fan_all(corner.ravel(), counts),
        np.array(points["vn"])[n[first]] if present["vn"] else None,
        np.array(points["vt"])[t[first]] if present["vt"] else None,
    )
