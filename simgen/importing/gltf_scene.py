"""A glTF file as a foreign scene: its nodes, meshes, cameras and lights (sections 3.5 to 3.10).

The file is in metres, X right, Y up, Z towards who looks; its cameras and lights look along -Z.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

import numpy as np

from simgen.assets.triangles import MOST_FACES, Triangles
from simgen.importing.foreign_scene import ForeignScene, Lamp, Part, Viewpoint
from simgen.importing.gltf_arrays import triangles_of
from simgen.importing.gltf_file import GltfFile, read_gltf
from simgen.importing.gltf_materials import GltfMaterials, fitted, light_values
from simgen.importing.gltf_models import Node, PunctualLight

FLIP = np.diag([1.0, -1.0, -1.0, 1.0])
"""From axes with Y up that look along -Z to Y down and +Z, and back."""
LARGEST_CONE_DEG = 89.0
LEAST_EDGE_DEG = 0.1
"""A spot's light falls off within this angle at least."""
DEEPEST = 500
"""Nodes that may lie within each other."""
EmissionUnit = Literal["nit", "watt"]
"""Of emission, which is a factor times a strength: cd/m^2, as the specification says, or W/(sr m^2)."""
LUMENS_PER_WATT = 683.0
"""Blender's exporter multiplies the watts of lights by it, whatever their colour, to write candela and lux.
It writes the emission of materials in W/(sr m^2)."""
CD_M2_PER_EMISSION: dict[EmissionUnit, float] = {"nit": 1.0, "watt": LUMENS_PER_WATT}
"""Luminance of an emission of 1."""
MAY_BE_IN_WATTS = (
    "the ratio of surfaces that shine to lights, if Blender exported the file in its lighting mode Standard: "
    f"its surfaces are {LUMENS_PER_WATT:g} times too dim, which --emission-unit watt mends"
)


def foreign_gltf(path: Path, metres_per_unit: float, emission_unit: EmissionUnit) -> ForeignScene:
    """Read a .gltf or .glb file. Raises `InputError` for one that is wrong, or that cannot be read."""
    gltf = read_gltf(path)
    scene = ForeignScene(title=path.stem, mm=1000 * metres_per_unit, upright=FLIP[:3, :3])
    reader = _Reader(gltf, scene, CD_M2_PER_EMISSION[emission_unit])
    for index, matrix in _placed_nodes(gltf):
        reader.add(gltf.document.nodes[index], index, matrix)
    if gltf.document.animations:
        scene.left_out.append("animations: everything stands as the file begins")
    if emission_unit == "nit" and scene.lamps and any("emission" in part.material for part in scene.parts):
        scene.lose(MAY_BE_IN_WATTS)
    return scene


def _placed_nodes(gltf: GltfFile) -> Iterator[tuple[int, np.ndarray]]:
    """Every node of the scene, and the matrix (4, 4) from its axes to the file's.

    Raises `InputError` for nodes that are missing, within themselves, or within two others.
    """
    document = gltf.document
    number = document.scene or 0
    if document.scenes:
        if number >= len(document.scenes):
            raise gltf.fault(f"scene: there is no scenes[{number}]")
        roots = document.scenes[number].nodes
    else:
        inner = {child for node in document.nodes for child in node.children}
        roots = tuple(index for index in range(len(document.nodes)) if index not in inner)
    waiting = [(root, np.eye(4), 0) for root in reversed(roots)]
    seen = set[int]()
    while waiting:
        index, outer, depth = waiting.pop()
        if index >= len(document.nodes):
            raise gltf.fault(f"nodes: there is no nodes[{index}]")
        if index in seen:
            raise gltf.fault(f"nodes[{index}]: stands in a circle, or in two places; a node has one parent")
        if depth > DEEPEST:
            raise gltf.fault(f"nodes[{index}]: lies within more than {DEEPEST} others")
        seen.add(index)
        node = document.nodes[index]
        matrix = outer @ _matrix(node)
        yield index, matrix
        waiting += [(child, matrix, depth + 1) for child in reversed(node.children)]


def _matrix(node: Node) -> np.ndarray:
    """Of a node in its parent: given as it is, by columns; or scaled, turned by a quaternion, moved."""
    if node.matrix is not None:
        return np.array(node.matrix).reshape(4, 4).T
    x, y, z, w = np.array(node.rotation) / (np.linalg.norm(node.rotation) or 1)
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn * node.scale, node.translation
    return matrix


class _Reader:
    """What the nodes hold, put into the scene."""

    def __init__(self, gltf: GltfFile, scene: ForeignScene, cd_m2_per_emission: float) -> None:
        self.gltf, self.scene = gltf, scene
        self.materials = GltfMaterials(gltf, scene, cd_m2_per_emission)
        self._primitives: dict[tuple[int, int], tuple[Triangles, dict[str, Any]] | None] = {}
        self._faces = 0

    def add(self, node: Node, index: int, matrix: np.ndarray) -> None:
        """The mesh, camera and light of a node."""
        where = f"nodes[{index}]"
        if node.mesh is not None:
            self._add_mesh(node, index, matrix)
        if node.camera is not None:
            self._add_camera(node, where, matrix)
        if node.extensions.lights_punctual is not None:
            lights = self.gltf.document.extensions.lights_punctual.lights
            number = node.extensions.lights_punctual.light
            if number >= len(lights):
                raise self.gltf.fault(f"{where}: there is no lights[{number}] of KHR_lights_punctual")
            if lights[number].intensity > 0 and any(lights[number].color):
                self.scene.lamps.append(Lamp(matrix @ FLIP, _lamp(lights[number])))
        if node.extensions.mesh_gpu_instancing is not None:
            self.scene.lose("copies of meshes by EXT_mesh_gpu_instancing, but for the first")

    def _add_mesh(self, node: Node, index: int, matrix: np.ndarray) -> None:
        meshes, number = self.gltf.document.meshes, node.mesh
        assert number is not None
        if number >= len(meshes):
            raise self.gltf.fault(f"nodes[{index}]: there is no meshes[{number}]")
        if node.skin is not None:
            self.scene.lose("skeletons: meshes stand as they were modelled")
        mesh = meshes[number]
        name = node.name or mesh.name or f"node-{index}"
        stem = mesh.name or name
        if not np.linalg.det(matrix[:3, :3]):
            self.scene.lose(f"'{name}', which is scaled to nothing")
            return
        for part, primitive in enumerate(mesh.primitives):
            made = self._primitive(number, part)
            if made is None:
                continue
            triangles, material = made
            several = len(mesh.primitives) > 1
            materials = self.gltf.document.materials
            of = materials[primitive.material].name if several and primitive.material is not None else ""
            ending = f"-{of or part + 1}" if several else ""
            self.scene.parts.append(Part(f"{name}{ending}", matrix, triangles, f"{stem}{ending}", material))

    def _primitive(self, mesh: int, part: int) -> tuple[Triangles, dict[str, Any]] | None:
        """Triangles and material of a primitive, None if there are none; those of one primitive are one."""
        key = mesh, part
        if key not in self._primitives:
            self._primitives[key] = self._read_primitive(mesh, part)
        return self._primitives[key]

    def _read_primitive(self, mesh: int, part: int) -> tuple[Triangles, dict[str, Any]] | None:
        where = f"meshes[{mesh}].primitives[{part}]"
        primitive = self.gltf.document.meshes[mesh].primitives[part]
        surface = self.materials.surface(primitive.material, where)
        if surface is None:
            self.scene.lose("surfaces that are all clear")
            return None
        texcoord = surface.texcoord
        if texcoord is not None and f"TEXCOORD_{texcoord}" not in primitive.attributes:
            raise self.gltf.fault(f"{where}: its pictures need TEXCOORD_{texcoord}, which it has not")
        triangles = triangles_of(self.gltf, primitive, texcoord, surface.uv_matrix, where)
        if triangles is None:
            self.scene.lose("points and lines, which have no surface")
            return None
        if primitive.targets:
            self.scene.lose("shapes that meshes can take (morph targets): they stand as they were modelled")
        if "COLOR_0" in primitive.attributes:
            self.scene.lose("colours of vertices")
        self._faces += len(triangles.faces)
        if self._faces > MOST_FACES:
            raise self.gltf.fault(f"has more than {MOST_FACES} triangles; simplify its meshes")
        material = fitted(surface.material, triangles, self.scene, pictures_repeat=surface.pictures_repeat)
        return None if material is None else (triangles, material)

    def _add_camera(self, node: Node, where: str, matrix: np.ndarray) -> None:
        cameras, number = self.gltf.document.cameras, node.camera
        assert number is not None
        if number >= len(cameras):
            raise self.gltf.fault(f"{where}: there is no cameras[{number}]")
        camera = cameras[number]
        name = node.name or camera.name or f"camera-{number}"
        angle = None
        if camera.perspective is None:
            self.scene.lose(f"the parallel view of camera '{name}': cameras here have a focal length")
        elif camera.perspective.aspect_ratio is not None:
            half = np.tan(camera.perspective.yfov / 2) * camera.perspective.aspect_ratio
            angle = float(np.degrees(2 * np.arctan(half)))
        self.scene.viewpoints.append(Viewpoint(name, matrix @ FLIP, angle))


def _lamp(light: PunctualLight) -> dict[str, Any]:
    """KHR_lights_punctual: intensity times colour, in candela or, directional, in lux."""
    field = "illuminance_lux" if light.type == "directional" else "intensity_cd"
    values = {"type": light.type, **light_values(field, light.intensity * np.array(light.color))}
    if light.type == "spot":
        beam, cutoff = light.spot.inner_cone_angle, light.spot.outer_cone_angle
        values |= _cone_values(float(np.degrees(beam)), float(np.degrees(cutoff)))
    return values


def _cone_values(beam_deg: float, cutoff_deg: float) -> dict[str, float]:
    """The angles of a spot, within what a scene allows."""
    cutoff_deg = min(max(cutoff_deg, LEAST_EDGE_DEG), LARGEST_CONE_DEG)
    beam_deg = min(max(beam_deg, 0.0), cutoff_deg - LEAST_EDGE_DEG)
    return {"beam_deg": round(beam_deg, 6), "cutoff_deg": round(cutoff_deg, 6)}
