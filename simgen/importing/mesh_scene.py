"""Files of meshes alone as foreign scenes: OBJ by groups and materials, STL by solids, PLY."""

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base import InputError
from simgen.assets import MOST_VERTICES, Triangles, obj_parts, read_mesh
from simgen.base import asset, shorten
from simgen.importing.foreign_scene import ForeignScene, Part
from simgen.spec import MOST_OBJECTS

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


class MeshScene(ForeignScene):
    """The objects of a mesh file, which has no lamps, no cameras and no unit.

    `is_z_up`: the file's Z is up and its Y goes away. Raises `InputError` for a file that cannot be read.
    """

    def __init__(self, path: Path, unit_mm: float, *, is_z_up: bool) -> None:
        super().__init__(path, unit_mm)
        try:
            for name, mesh, material in self._read():
                self.parts.append(Part(name, Y_UP if is_z_up else np.eye(4), mesh, name, material))
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
