"""A glTF file as a foreign scene: its nodes, meshes, cameras and lights (sections 3.5 to 3.10).

The file is in metres, X right, Y up, Z towards who looks; its cameras and lights look along -Z.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

import numpy as np

from simgen.assets.triangles import MOST_FACES, MOST_VERTICES, Triangles
from simgen.base.strict_models import validate
from simgen.importing.foreign_scene import ForeignScene, Lamp, Part, Viewpoint
from simgen.importing.gltf_arrays import numbers, triangles_of
from simgen.importing.gltf_file import GltfFile, read_gltf
from simgen.importing.gltf_materials import GltfMaterials, fitted, light_values
from simgen.importing.gltf_models import Instancing, Node, Primitive, PunctualLight
from simgen.spec.scene import MOST_OBJECTS

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
    for what in gltf.clamped:
        scene.lose(what)
    places = dict(_placed_nodes(gltf))
    reader = _Reader(gltf, scene, CD_M2_PER_EMISSION[emission_unit], places)
    for index, matrix in places.items():
        reader.add(gltf.document.nodes[index], index, matrix)
    for name in gltf.unread_extensions:
        if not any(name in what for what in scene.left_out):
            scene.lose(name)
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

    def __init__(
        self,
        gltf: GltfFile,
        scene: ForeignScene,
        cd_m2_per_emission: float,
        places: dict[int, np.ndarray],
    ) -> None:
        self.gltf, self.scene, self.places = gltf, scene, places
        self.materials = GltfMaterials(gltf, scene, cd_m2_per_emission)
        self._primitives: dict[tuple[int, int, int | None], tuple[Triangles, dict[str, Any]] | None] = {}
        self._faces = 0

    def add(self, node: Node, index: int, matrix: np.ndarray) -> None:
        """The mesh, camera and light of a node."""
        where = f"nodes[{index}]"
        if node.mesh is not None:
            copies = node.extensions.mesh_gpu_instancing
            for number, copy in enumerate([np.eye(4)] if copies is None else self._copies(copies, where)):
                self._add_mesh(node, index, matrix @ copy, f"-{number + 1}" if copies is not None else "")
        if node.camera is not None:
            self._add_camera(node, where, matrix)
        if node.extensions.lights_punctual is not None:
            lights = self.gltf.document.extensions.lights_punctual.lights
            number = node.extensions.lights_punctual.light
            if number >= len(lights):
                raise self.gltf.fault(f"{where}: there is no lights[{number}] of KHR_lights_punctual")
            if lights[number].intensity > 0 and any(lights[number].color):
                self.scene.lamps.append(Lamp(matrix @ FLIP, _lamp(lights[number])))

    def _copies(self, copies: Instancing, where: str) -> list[np.ndarray]:
        """Matrices (4, 4) of the copies of a mesh, in the node's axes (EXT_mesh_gpu_instancing)."""
        kinds = {"TRANSLATION": "VEC3", "ROTATION": "VEC4", "SCALE": "VEC3"}
        columns = {
            name.lower(): numbers(self.gltf, copies.attributes[name], where, kind, MOST_OBJECTS)
            for name, kind in kinds.items()
            if name in copies.attributes
        }
        count = min((len(column) for column in columns.values()), default=1)
        rows = [{name: column[row] for name, column in columns.items()} for row in range(count)]
        source = f"{self.gltf.path}: {where}"
        return [
            _matrix(validate(Node, {name: part.tolist() for name, part in row.items()}, source))
            for row in rows
        ]

    def _skinned(self, skin: int, primitive: Primitive, where: str) -> np.ndarray:
        """Matrices (N, 4, 4) that bring each vertex of a skinned mesh to where its joints stand.

        Section 3.7.3.3: the place of the node itself is of no account.
        """
        skins = self.gltf.document.skins
        if skin >= len(skins):
            raise self.gltf.fault(f"{where}: there is no skins[{skin}]")
        if not {"JOINTS_0", "WEIGHTS_0"} <= primitive.attributes.keys():
            raise self.gltf.fault(f"{where}: a mesh with a skin needs JOINTS_0 and WEIGHTS_0")
        joints = np.array([self.places.get(joint, np.eye(4)) for joint in skins[skin].joints])
        number = skins[skin].inverse_bind_matrices
        if number is not None:
            inverse = numbers(self.gltf, number, where, "MAT4", len(joints)).reshape(-1, 4, 4)
            joints = joints[: len(inverse)] @ inverse.transpose(0, 2, 1)
        which, weight = (
            numbers(self.gltf, primitive.attributes[name], where, "VEC4", MOST_VERTICES)
            for name in ("JOINTS_0", "WEIGHTS_0")
        )
        if len(which) != len(weight) or which.dtype.kind != "u" or which.max() >= len(joints):
            raise self.gltf.fault(
                f"{where}: JOINTS_0: expected a whole number below {len(joints)}, the joints of "
                f"skins[{skin}], for each of WEIGHTS_0"
            )
        share = weight / np.maximum(weight.sum(axis=1, keepdims=True), np.finfo(np.float32).tiny)
        return np.einsum("nj,njab->nab", share, joints[which.astype(np.int64)])

    def _add_mesh(self, node: Node, index: int, matrix: np.ndarray, copy: str) -> None:
        meshes, number = self.gltf.document.meshes, node.mesh
        assert number is not None
        if number >= len(meshes):
            raise self.gltf.fault(f"nodes[{index}]: there is no meshes[{number}]")
        if node.skin is not None:
            matrix = np.eye(4)
            self.scene.lose("skeletons: meshes stand as the file begins")
        mesh = meshes[number]
        name = f"{node.name or mesh.name or f'node-{index}'}{copy}"
        stem = mesh.name or node.name or name
        if not np.linalg.det(matrix[:3, :3]):
            self.scene.lose(f"'{name}', which is scaled to nothing")
            return
        for part, primitive in enumerate(mesh.primitives):
            made = self._primitive(number, part, node.skin)
            if made is None:
                continue
            triangles, material = made
            several = len(mesh.primitives) > 1
            materials = self.gltf.document.materials
            of = materials[primitive.material].name if several and primitive.material is not None else ""
            ending = f"-{of or part + 1}" if several else ""
            self.scene.parts.append(Part(f"{name}{ending}", matrix, triangles, f"{stem}{ending}", material))

    def _primitive(self, mesh: int, part: int, skin: int | None) -> tuple[Triangles, dict[str, Any]] | None:
        """Triangles and material of a primitive, None if there are none; those of one primitive are one."""
        key = mesh, part, skin
        if key not in self._primitives:
            self._primitives[key] = self._read_primitive(mesh, part, skin)
        return self._primitives[key]

    def _read_primitive(
        self, mesh: int, part: int, skin: int | None
    ) -> tuple[Triangles, dict[str, Any]] | None:
        where = f"meshes[{mesh}].primitives[{part}]"
        primitive = self.gltf.document.meshes[mesh].primitives[part]
        surface = self.materials.surface(primitive.material, where)
        if surface is not None and f"TEXCOORD_{surface.texcoord or 0}" not in primitive.attributes:
            surface = self.materials.surface(primitive.material, where, with_pictures=False)
        if surface is None:
            self.scene.lose("surfaces that are all clear")
            return None
        moved = None if skin is None else self._skinned(skin, primitive, where)
        triangles = triangles_of(self.gltf, primitive, surface.texcoord, surface.uv_matrix, where, moved)
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
