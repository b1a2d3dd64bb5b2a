"""A glTF file as a foreign scene: its nodes, meshes, cameras and lights (sections 3.5 to 3.10).

The file is in metres, X right, Y up, Z towards who looks; its cameras and lights look along -Z.
"""

from collections.abc import Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from simgen.assets import MOST_FACES, MOST_VERTICES, Triangles
from simgen.importing.foreign_scene import UPRIGHT, Part
from simgen.importing.gltf_document import Node, Primitive, PunctualLight
from simgen.importing.gltf_file import GltfFile
from simgen.importing.gltf_materials import Surface, light_values
from simgen.spec import MOST_OBJECTS

MIN_EDGE_DEG = 0.1
"""A spot's light falls off within this angle at least."""
MIN_SIZE, MAX_SIZE = 1e-9, 1e9
"""Of scales and places, in the file's unit."""
NOWHERE = "which is scaled to nothing, or moved or scaled beyond numbers that can be rendered"
MAX_TRIANGLES = 1 << 24
"""Of all objects; the renderer makes those of each instance anew, and needs 100 bytes for each."""
TRIANGLES, FAN = 4, 6
"""Modes of primitives, as OpenGL numbers them; strips are between them, points and lines below."""
COPIED = {"TRANSLATION": (0.0, 0.0, 0.0), "ROTATION": (0.0, 0.0, 0.0, 1.0), "SCALE": (1.0, 1.0, 1.0)}
"""Attributes of the copies of a mesh, and what they are by default."""
MAY_BE_IN_WATTS = (
    "the ratio of surfaces that shine to lights, 683 times too small for a file of Blender's lighting mode "
    "Standard: give --emission-unit watt"
)


class GltfScene(GltfFile):
    """All that is taken from a .gltf or .glb file, in which an emission of 1 has the luminance
    `cd_m2_per_emission`. Raises `InputError` for a file that is wrong."""

    def __init__(self, path: Path, unit_mm: float, cd_m2_per_emission: float) -> None:
        super().__init__(path, unit_mm)
        self._surface = cache(partial(Surface, self, cd_m2_per_emission))
        self._primitives: dict[tuple[int, int, int | None], tuple[Triangles, dict[str, Any]] | None] = {}
        self._triangles = 0
        if (others := len(self.document.scenes) - 1) > 0:
            self.lose(f"{others} more scenes of the file")
        self._places = dict(_placed_nodes(self))
        for index in self._places:
            self._add_node(index)
        if cd_m2_per_emission == 1 and self.lamps and any("emission" in part.material for part in self.parts):
            self.lose(MAY_BE_IN_WATTS)

    def _add_node(self, index: int) -> None:
        """The mesh, camera and light of a node."""
        document, matrix = self.document, self._places[index]
        node = document.nodes[index]
        if node.mesh is not None:
            copies = {"": np.eye(4)} if node.copies is None else self._copies(node.copies)
            for ending, copy in copies.items():
                self._add_mesh(node, node.mesh, matrix @ copy, index, ending)
        if (node.camera is not None or node.light is not None) and not _can_stand(matrix):
            self.lose(f"nodes[{index}], {NOWHERE}")
            return
        if node.camera is not None:
            camera = self.item(document.cameras, node.camera, "cameras")
            angle_deg = None
            if camera.yfov is not None and camera.aspect_ratio is not None:
                half = np.tan(camera.yfov / 2) * camera.aspect_ratio
                angle_deg = float(np.degrees(2 * np.arctan(half)))
            name = node.name or camera.name or f"camera-{node.camera}"
            name = f"{name}-{index}" if name in self.cameras else name
            self.cameras[name] = matrix @ UPRIGHT, angle_deg
        if node.light is not None:
            light = self.item(document.lights, node.light, "lights")
            if light.intensity > 0 and any(light.color):
                self.lamps.append((matrix @ UPRIGHT, _lamp(light)))

    def _copies(self, attributes: dict[str, int]) -> dict[str, np.ndarray]:
        """Matrices (4, 4) of a mesh's copies in the node's axes, by ending (EXT_mesh_gpu_instancing)."""
        columns = {
            name: self.numbers(attributes[name], f"VEC{len(default)}", MOST_OBJECTS)
            for name, default in COPIED.items()
            if name in attributes
        }
        count = min(map(len, columns.values()), default=1)
        columns = {name: np.tile(default, (count, 1)) for name, default in COPIED.items()} | columns
        matrices = _matrices(*(column[:count] for column in columns.values()))
        return {f"-{number}": matrix for number, matrix in enumerate(matrices, start=1)}

    def _add_mesh(self, node: Node, number: int, matrix: np.ndarray, index: int, copy: str) -> None:
        mesh = self.item(self.document.meshes, number, "meshes")
        if node.skin is not None:
            matrix = np.eye(4)
        name = f"{node.name or mesh.name or f'node-{index}'}{copy}"
        if not _can_stand(matrix):
            self.lose(f"'{name}', {NOWHERE}")
            return
        for part, primitive in enumerate(mesh.primitives):
            key = number, part, node.skin
            if key not in self._primitives:
                self._primitives[key] = self._translated(primitive, node.skin, f"meshes[{number}]")
            if (translated := self._primitives[key]) is None:
                continue
            (triangles, material), ending = translated, ""
            if len(mesh.primitives) > 1:
                materials = self.document.materials
                of = "" if primitive.material is None else materials[primitive.material].name
                ending = f"-{of or part + 1}"
            stem = f"{mesh.name or node.name or name}{ending}"
            self.parts.append(Part(f"{name}{ending}", matrix, triangles, stem, material))
            self._triangles += len(triangles.faces)
            if len(self.parts) > MOST_OBJECTS or self._triangles > MAX_TRIANGLES:
                raise self.fault(
                    f"has more than {MOST_OBJECTS} objects or {MAX_TRIANGLES} triangles; join objects of one "
                    "material, and simplify meshes"
                )

    def _translated(
        self, primitive: Primitive, skin: int | None, where: str
    ) -> tuple[Triangles, dict[str, Any]] | None:
        """Triangles and material of a primitive, None if there is no surface."""
        if primitive.mode < TRIANGLES:
            self.lose("points and lines, which have no surface")
            return None
        surface = self._surface(primitive.material, True)
        if f"TEXCOORD_{surface.texcoord or 0}" not in primitive.attributes:
            surface = self._surface(primitive.material, False)
        if not surface.values:
            return None
        triangles = self._triangles_of(primitive, surface, skin, where)
        material = surface.material_on(triangles)
        return None if material is None else (triangles, material)

    def _triangles_of(
        self, primitive: Primitive, surface: Surface, skin: int | None, where: str
    ) -> Triangles:
        """A primitive as triangles in its own axes and unit, or in the file's axes if it has a skin."""
        positions = self._attribute(primitive, "POSITION", "VEC3", where)
        count, normals, uv = len(positions), None, None
        if "NORMAL" in primitive.attributes:
            normals = self._attribute(primitive, "NORMAL", "VEC3", where, count)
            if not normals.any(axis=1).all():
                normals = None  # an exporter's normals of faces without area
        if surface.texcoord is not None:
            uv = self._attribute(primitive, f"TEXCOORD_{surface.texcoord}", "VEC2", where, count)
            # The file's run down from the picture's upper left, ours up from its lower left.
            uv = np.column_stack([uv.astype(np.float64), np.ones(count)]) @ surface.uv_matrix[:2].T
            uv = uv * [1, -1] + [0, 1]
        if skin is not None:
            moved = self._skinned(skin, primitive, count, where)
            positions = np.einsum("nab,nb->na", moved[:, :3, :3], positions) + moved[:, :3, 3]
            normals = None if normals is None else np.einsum("nab,nb->na", moved[:, :3, :3], normals)
        corners = np.arange(count)
        if primitive.indices is not None:
            corners = self.numbers(primitive.indices, "SCALAR", 3 * MOST_FACES)[:, 0].astype(np.int64)
        faces = _faces(corners, primitive.mode)
        flat = (faces == np.roll(faces, 1, axis=1)).any(axis=1)
        try:
            return Triangles.checked(positions, faces[~flat], normals, uv)
        except ValueError as fault:
            raise self.fault(f"{where}: {fault}") from None

    def _attribute(
        self, primitive: Primitive, name: str, kind: str, where: str, count: int | None = None
    ) -> np.ndarray:
        """The values (N, C) of a primitive's vertices, `count` of them if that is known."""
        if name not in primitive.attributes:
            raise self.fault(f"{where}: has no {name}")
        values = self.numbers(primitive.attributes[name], kind, MOST_VERTICES)
        if count is not None and len(values) != count:
            raise self.fault(f"{where}: has {len(values)} elements of {name}, and {count} of POSITION")
        return values

    def _skinned(self, skin: int, primitive: Primitive, count: int, where: str) -> np.ndarray:
        """Matrices (N, 4, 4) that bring each vertex of a skinned mesh to where its joints stand.

        Section 3.7.3.3: the place of the node itself is of no account.
        """
        values = self.item(self.document.skins, skin, "skins")
        joints = np.array([self._places.get(joint, np.eye(4)) for joint in values.joints])
        if values.inverse_bind_matrices is not None:
            inverse = self.numbers(values.inverse_bind_matrices, "MAT4", len(joints))
            joints = joints[: len(inverse)] @ inverse.reshape(-1, 4, 4).transpose(0, 2, 1)
        which = self._attribute(primitive, "JOINTS_0", "VEC4", where, count)
        weight = self._attribute(primitive, "WEIGHTS_0", "VEC4", where, count)
        if which.dtype.kind != "u" or which.max() >= len(joints):
            raise self.fault(f"{where}: JOINTS_0: expected whole numbers below {len(joints)}")
        share = weight / np.maximum(weight.sum(axis=1, keepdims=True), np.finfo(np.float32).tiny)
        return np.einsum("nj,njab->nab", share, joints[which.astype(np.int64)])


def _placed_nodes(gltf: GltfFile) -> Iterator[tuple[int, np.ndarray]]:
    """Every node of the scene, and the matrix (4, 4) from its axes to the file's.

    Raises `InputError` for nodes that are missing, within themselves, or within two others.
    """
    nodes, scenes = gltf.document.nodes, gltf.document.scenes
    children = {child for node in nodes for child in node.children}
    roots = tuple(index for index in range(len(nodes)) if index not in children)
    if scenes:
        roots = gltf.item(scenes, gltf.document.scene, "scenes").nodes
    waiting = [(root, np.eye(4)) for root in reversed(roots)]
    visited = set[int]()
    while waiting:
        index, outer = waiting.pop()
        node = gltf.item(nodes, index, "nodes")
        if index in visited:
            raise gltf.fault(f"nodes[{index}]: stands in a circle, or in two places; a node has one parent")
        visited.add(index)
        if node.matrix is None:
            matrix = outer @ _matrices(*np.atleast_2d(node.translation, node.rotation, node.scale))[0]
        else:  # by columns
            matrix = outer @ np.reshape(node.matrix, (4, 4)).T
        yield index, matrix
        waiting += [(child, matrix) for child in reversed(node.children)]


def _matrices(translation: np.ndarray, rotation: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Matrices (N, 4, 4) that scale by (N, 3), turn by quaternions (N, 4) and move by (N, 3)."""
    norms = np.linalg.norm(rotation, axis=1, keepdims=True)
    quaternions = np.where(norms > 0, rotation, [0.0, 0.0, 0.0, 1.0])
    matrices = np.tile(np.eye(4), (len(quaternions), 1, 1))
    matrices[:, :3, :3] = Rotation.from_quat(quaternions).as_matrix() * scale[:, None, :]
    matrices[:, :3, 3] = translation
    return matrices


def _can_stand(matrix: np.ndarray) -> bool:
    """Whether a matrix leaves a size and a place that can be told."""
    if not np.abs(matrix).max() <= MAX_SIZE:  # or nan
        return False
    sizes = np.linalg.norm(matrix[:3, :3], axis=0)
    return sizes.min() >= MIN_SIZE and abs(np.linalg.det(matrix[:3, :3] / sizes)) >= MIN_SIZE


def _faces(corners: np.ndarray, mode: int) -> np.ndarray:
    """Triangles (M, 3) of the corners of a primitive."""
    if mode == TRIANGLES:
        return corners[: len(corners) // 3 * 3].reshape(-1, 3)
    first, second, third = corners[:-2], corners[1:-1], corners[2:]
    if mode == FAN:
        return np.column_stack([second, third, np.broadcast_to(corners[:1], third.shape)])
    # Of a strip every other triangle turns the other way.
    is_odd = np.arange(len(first)) % 2 == 1
    return np.column_stack([first, np.where(is_odd, third, second), np.where(is_odd, second, third)])


def _lamp(light: PunctualLight) -> dict[str, Any]:
    """KHR_lights_punctual: intensity times colour, in candela or, directional, in lux."""
    field = "illuminance_lux" if light.type == "directional" else "intensity_cd"
    values = {"type": light.type, **light_values(field, light.intensity * np.array(light.color))}
    if light.type == "spot":
        cutoff_deg = float(np.degrees(light.outer_cone_angle))
        beam_deg = min(float(np.degrees(light.inner_cone_angle)), cutoff_deg - MIN_EDGE_DEG)
        values |= {"beam_deg": round(beam_deg, 6), "cutoff_deg": round(cutoff_deg, 6)}
    return values
