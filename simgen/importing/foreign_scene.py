"""A scene of another program: objects, lamps, cameras, and where it stands in ours; and files of meshes alone
as such scenes: OBJ by groups and materials, STL by solids, PLY."""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pcii.base import InputError
from simgen.assets import MOST_VERTICES, Triangles, obj_parts, read_mesh
from simgen.base import asset, shorten
from simgen.spec import MOST_OBJECTS

UPRIGHT = np.diag([1.0, -1.0, -1.0, 1.0])
"""From X right, Y up, Z towards who looks, as models stand, to X right, Y down, Z forward; and back."""
MESH_KINDS = (".obj", ".ply", ".stl")
GREY = {"reflectance": [0.7, 0.7, 0.7]}
"""Of what has no material, sRGB."""
Y_UP = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]], dtype=np.float64)
"""From axes whose Z is up and whose Y goes away to those whose Y is up."""
COLOURS_OF_VERTICES = {
    ".obj": re.compile(rb"^v(?:[ \t]+[^\s#]+){6}", re.MULTILINE),
    ".ply": re.compile(rb"^property \w+ red\b(?=[\s\S]*^end_header)", re.MULTILINE),
}
"""Patterns that occur in files whose vertices have colours."""
STL_HEAD_BYTES = 84
STL_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


class Part(NamedTuple):
    """One object: triangles in their own axes, and a matrix (4, 4) from these to the axes of the file.

    Parts with the same triangles share a file, which is called by the `stem` of the first. The material is as
    in a scene.toml.
    """

    name: str
    matrix: np.ndarray
    triangles: Triangles
    stem: str
    material: dict[str, Any]


class ForeignScene:
    """All that is taken from a file, in its own axes: X right, Y up, Z towards who looks.

    Matrices are (4, 4) float64, of columns (x, y, z, 1), from own axes to those of the file.
    """

    def __init__(self, path: Path, unit_mm: float) -> None:
        self.path, self.unit_mm = path, unit_mm
        self.parts: list[Part] = []
        self.lamps: list[tuple[np.ndarray, dict[str, Any]]] = []
        """Lights that stand at the origin of their axes and shine along +Z: matrix, and values as in a
        scene.toml but for position, target and direction."""
        self.cameras: dict[str, tuple[np.ndarray, float | None]] = {}
        """By name: matrix from axes X right, Y down, Z forward, and horizontal angle of view in degrees."""
        self.left_out: dict[str, None] = {}
        """Names of what the file says and the scene does not have, in order and each once."""
        self.images: dict[str, np.ndarray] = {}
        """Pictures by the file name that materials of the scene use."""

    def lose(self, what: str) -> None:
        """Name what the scene does not have."""
        self.left_out[what] = None

    def bounds(self, matrix: np.ndarray) -> np.ndarray:
        """The bounding box (2, 3) of all parts, smallest and largest, in axes to which a matrix leads."""
        ends = []
        for part in self.parts:
            to_axes = matrix @ part.matrix
            points = part.triangles.positions.astype(np.float64) @ to_axes[:3, :3].T + to_axes[:3, 3]
            ends += [points.min(axis=0), points.max(axis=0)]
        return np.array([np.min(ends, axis=0), np.max(ends, axis=0)])

    def placement(
        self, camera: str | None, place_at_mm: Sequence[float] | None, fit_mm: float | None
    ) -> tuple[np.ndarray, str | None]:
        """The matrix from the file's axes to the world's, in mm, and the camera that stands at its origin.

        A camera of the file becomes the virtual centre, or the middle of the scene's bounding box comes to
        `place_at_mm`, upright. `fit_mm` makes the longest side of that box so long. Raises `InputError` for a
        scene without a surface, and unless one camera or a place is chosen.
        """
        if not self.parts:
            reasons = "".join(f"; not represented: {what}" for what in self.left_out)
            raise InputError(f"{self.path}: there is no surface in it{reasons}")
        box = self.bounds(UPRIGHT)
        scale = self.unit_mm if fit_mm is None else fit_mm / float(np.ptp(box, axis=0).max())
        to_world = np.eye(4)
        if place_at_mm is not None:
            to_world[:3, :3] = scale * UPRIGHT[:3, :3]
            to_world[:3, 3] = np.array(place_at_mm) - scale * box.mean(axis=0)
            return to_world, None
        if camera is None and len(self.cameras) == 1:
            (camera,) = self.cameras
        if camera not in self.cameras:
            if self.cameras:
                raise InputError(
                    f"--camera: {self.path} has the cameras {', '.join(self.cameras)}; choose one"
                )
            x, y, z = scale * np.ptp(box, axis=0)
            raise InputError(
                f"--place-at-mm: {self.path} has no camera; say where the middle of its {x:.4g} x "
                f"{y:.4g} x {z:.4g} mm stands, such as --place-at-mm 0 0 {round(2 * max(x, y) + z / 2, -1):g}"
            )
        # The camera's axes may also be scaled: Z forward is kept, then Y down.
        matrix = self.cameras[camera][0]
        forward = matrix[:3, 2] / np.linalg.norm(matrix[:3, 2])
        right = np.cross(matrix[:3, 1], forward)
        right /= np.linalg.norm(right)
        to_world[:3, :3] = scale * np.stack([right, np.cross(forward, right), forward])
        to_world[:3, 3] = -to_world[:3, :3] @ matrix[:3, 3]
        return to_world, camera


class MeshScene(ForeignScene):
    """The objects of a mesh file, which has no lamps, no cameras and no unit.

    `is_z_up`: the file's Z is up and its Y goes away. Raises `InputError` for a file that cannot be read.
    """

    def __init__(self, path: Path, unit_mm: float, *, is_z_up: bool) -> None:
        super().__init__(path, unit_mm)
        try:
            for name, mesh, material in self._read():
                self.parts.append(Part(name, Y_UP if is_z_up else np.eye(4), mesh, name, material))
        except InputError:  # names its file
            raise
        except ValueError as fault:
            raise InputError(f"{path}: this file {shorten(str(fault))}") from None
        except OSError as fault:
            raise InputError(f"{path}: cannot be read ({fault.strerror})") from None
        if len(self.parts) > MOST_OBJECTS:
            raise InputError(f"{path}: has more than {MOST_OBJECTS} groups; join those of one material")

    def _read(self) -> Iterator[tuple[str, Triangles, dict[str, Any]]]:
        """Names, meshes and materials of objects; several may have one name."""
        kind, stem, data = self.path.suffix.lower(), self.path.stem, self.path.read_bytes()
        if (colour := COLOURS_OF_VERTICES.get(kind)) and re.search(colour, data):
            self.lose("colours of vertices")
        if kind == ".stl":
            yield from ((name, mesh, GREY) for name, mesh in _stl_solids(data, stem))
        elif kind == ".ply":
            yield stem, read_mesh(self.path), GREY
        else:
            libraries, parts = obj_parts(data)
            materials = self._materials(libraries)
            materials_of = Counter(group for group, _ in parts)
            for (group, material), mesh in parts.items():
                name = group or material or stem
                if group and material and materials_of[group] > 1:
                    name = f"{group}-{material}"
                yield name, mesh, materials.get(material, GREY)

    def _materials(self, libraries: list[str]) -> dict[str, dict[str, Any]]:
        """Diffuse colours (Kd) by material of the MTL files of an OBJ file; what else they have is named."""
        materials: dict[str, dict[str, Any]] = {}
        for library in libraries:
            try:
                file = asset(self.path.parent, library, f"{self.path}: mtllib")
                lines = file.read_text("latin-1").splitlines()
            except (InputError, OSError):
                self.lose(f"the materials of {shorten(library)}, which is not beside the file")
                continue
            name = ""
            for line in lines:
                keyword, *words = line.split("#", 1)[0].split() or [""]
                if keyword == "newmtl":
                    name = " ".join(words)
                elif keyword == "Kd" and len(words) == 3:
                    materials[name] = {"reflectance": [min(max(float(word), 0.0), 1.0) for word in words]}
                elif keyword == "Kd":
                    self.lose("colours of materials (Kd) that are no three numbers")
                elif keyword.startswith("map_"):
                    self.lose(f"pictures of materials ({keyword})")
                elif keyword in ("Ke", "Tf", "d", "Tr") and {*words} - {"0", "0.0", "1", "1.0"}:
                    self.lose(f"{keyword} of materials")
                elif keyword in ("Ks", "Ns", "Pr", "Pm") and {*words} - {"0", "0.0"}:
                    self.lose("gloss of materials (Ks, Ns, Pr, Pm): all are matt")
        return materials


def _stl_solids(data: bytes, stem: str) -> Iterator[tuple[str, Triangles]]:
    """Names and meshes of the solids of an STL file; raises `ValueError` with the end of a sentence."""
    count = int.from_bytes(data[STL_HEAD_BYTES - 4 : STL_HEAD_BYTES], "little")
    ends = STL_HEAD_BYTES + count * STL_FACET.itemsize  # some programs write more behind it
    if ends == len(data) or (ends < len(data) and not data.lstrip().startswith(b"solid")):
        yield stem, _joined(np.frombuffer(data, STL_FACET, count, STL_HEAD_BYTES)["corners"].reshape(-1, 3))
        return
    text = data.decode("latin-1")
    if not text.lstrip().startswith("solid"):
        raise ValueError(f"is cut off or no STL file: {count} facets are {len(data)} bytes")
    for solid in re.split(r"^\s*solid\b", text, flags=re.MULTILINE)[1:]:
        name, _, body = solid.partition("\n")
        points = re.findall(r"vertex\s+(\S+)\s+(\S+)\s+(\S+)", body)
        yield name.strip() or stem, _joined(np.array(points, dtype=np.float64).reshape(-1, 3))


def _joined(corners: np.ndarray) -> Triangles:
    """Triangles of corners (3 F, 3), which follow each other; corners at one place are one vertex."""
    if not len(corners) or len(corners) % 3:
        raise ValueError("has no faces, or one that is no triangle")
    if len(corners) > MOST_VERTICES:
        raise ValueError(f"has more than {MOST_VERTICES // 3} triangles")
    positions, vertices = np.unique(corners, axis=0, return_inverse=True)
    return Triangles.checked(positions.astype(np.float64), vertices.reshape(-1, 3), None, None)
