"""From a scene file of another program to a scene's folder."""

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from scipy.spatial.transform import Rotation

from pcii.base import InputError, new_folder_safely
from pcii.exchange import write_png
from simgen.assets import Triangles, ply_bytes
from simgen.base import LARGEST_TOML_BYTES, check_installed, shorten, toml_text, validate
from simgen.importing.foreign_scene import MESH_KINDS, ForeignScene, MeshScene, Part
from simgen.importing.gltf_scene import GltfScene
from simgen.renderer import backend, reference_to
from simgen.spec import MitsubaFile, MitsubaXml, Scene, check_unscored, names_of_objects

MIN_SHEAR = 1e-5
"""Axes of a matrix whose cosine is less than this are square to each other."""
TARGET_MM = 100.0
"""Distance of a spot's target from the spot."""
MAX_TITLE = 200
Unit = Literal["mm", "cm", "m", "in", "ft"]
MM_PER_UNIT: dict[str, float] = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4, "ft": 304.8}
EmissionUnit = Literal["nit", "watt"]
CD_M2_PER_EMISSION: dict[str, float] = {"nit": 1.0, "watt": 683.0}
"""Luminance of an emission of 1, which is in cd/m^2, as the specification says, or in W/(sr m^2). Blender's
exporter writes watts of lights times 683 lm/W, whatever their colour, but emission as it is."""
Meshes = dict[tuple[int, bytes], tuple[str, Triangles]]
"""File and triangles by the id of the part's triangles and the bytes of the matrix that moves them."""


@dataclass(frozen=True)
class ImportedScene:
    """What an import wrote, and what of the file it does not use; of a Mitsuba scene only its files."""

    folder: Path
    left_out: tuple[str, ...]
    """Names of what the file says and the scene does not have."""
    files: tuple[str, ...] = ()
    """Files that a Mitsuba scene consists of."""
    objects: int = 0
    triangles: int = 0
    lights: int = 0
    size_mm: tuple[float, ...] = (0.0, 0.0, 0.0)
    """Of the bounding box of all objects along X, Y and Z."""
    camera: str | None = None
    """The one that became the virtual centre."""
    camera_angle_deg: float | None = None
    """Its horizontal angle of view."""

    def lines(self) -> Iterator[str]:
        """The same for people."""
        yield f"{self.folder / 'scene.toml'}"
        if self.files:
            yield f"refers to {', '.join(self.files)}"
        else:
            yield f"objects: {self.objects}; triangles: {self.triangles}; lights: {self.lights}"
            yield f"size: {' x '.join(f'{side:.4g}' for side in self.size_mm)} mm (X, Y, Z)"
        if self.camera is not None:
            yield f"the virtual centre is the camera '{self.camera}'"
        if self.camera_angle_deg is not None:
            yield f"which sees {self.camera_angle_deg:.3g} degrees across"
        yield from (f"not represented: {what}" for what in self.left_out)


def import_scene(
    file: str | Path,
    out: str | Path,
    *,
    camera: str | None = None,
    unit: Unit | None = None,
    up: Literal["y", "z"] = "y",
    place_at_mm: Sequence[float] | None = None,
    fit_mm: float | None = None,
    emission_unit: EmissionUnit = "nit",
    unscored: Sequence[str] = (),
) -> ImportedScene:
    """Make the folder `out` of glTF (.glb, .gltf), a mesh (.obj, .ply, .stl) or a Mitsuba scene (.xml).

    A glTF file is translated into an ordinary scene, and so is a mesh, each group of an OBJ file and each
    solid of an STL file as an object. A Mitsuba scene is copied, with all files that it names, beside a
    scene.toml that refers to it. The other arguments are the options of `simgen import-scene`. Raises
    `pcii.InputError` for a file that cannot be read or has no such object, and for a folder that is there
    already.
    """
    check_installed()
    path, folder = Path(file), Path(out)
    suffix = path.suffix.lower()
    is_mesh = suffix in MESH_KINDS
    if suffix not in (".glb", ".gltf", ".xml", *MESH_KINDS):
        raise InputError(
            f"{path}: expected a glTF file (.glb or .gltf), a mesh (.obj, .ply or .stl) or a Mitsuba scene "
            "(.xml)"
        )
    if is_mesh and unit is None and fit_mm is None:
        raise InputError(
            f"--unit: {path} has no unit of length; say --unit mm, cm, m, in or ft, or how long its longest "
            "side is, --fit-mm"
        )
    if up != "y" and not is_mesh:
        raise InputError("--up: is for meshes; of glTF files and Mitsuba scenes Y is up")
    unit = unit or "m"
    if unit not in MM_PER_UNIT:
        raise InputError(f"unit: expected one of {', '.join(MM_PER_UNIT)}, got {unit!r}")
    if emission_unit not in CD_M2_PER_EMISSION or (
        suffix not in (".glb", ".gltf") and emission_unit != "nit"
    ):
        raise InputError(f"emission_unit: expected nit, or watt for a glTF file, got {emission_unit!r}")
    if folder.exists():
        raise InputError(f"{folder}: is there already; choose another folder or remove it")
    values = {"file": path.name, "unit_mm": MM_PER_UNIT[unit], "camera": camera, "fit_mm": fit_mm}
    values["place_at_mm"] = None if place_at_mm is None else tuple(place_at_mm)
    values["unscored"] = tuple(unscored)
    reference = validate(MitsubaFile, {k: v for k, v in values.items() if v is not None}, "import-scene")
    if suffix == ".xml":
        return _copy_reference(path, reference, folder)
    if is_mesh:
        scene: ForeignScene = MeshScene(path, reference.unit_mm, is_z_up=up == "z")
    else:
        scene = GltfScene(path, reference.unit_mm, CD_M2_PER_EMISSION[emission_unit])
    to_world, camera = scene.placement(camera, reference.place_at_mm, fit_mm)
    return _write_scene(scene, to_world, camera, unscored, folder)


def _copy_reference(path: Path, reference: MitsubaFile, out: Path) -> ImportedScene:
    """Make the folder of a scene that refers to a Mitsuba file, a copy with all files that it names."""
    if reference.unscored:  # Mitsuba alone knows the names of the objects
        reference_to(backend.load(), reference, path.parent)
    xml = MitsubaXml(path.parent, path.name)
    scene = Scene(title=shorten(path.stem, MAX_TITLE), mitsuba=reference, folder=path.parent)
    out.parent.mkdir(parents=True, exist_ok=True)
    with new_folder_safely(out) as new:
        scene.save(new)
    of_sensors = "of a sensor place and medium are used"
    if reference.place_at_mm is not None:
        of_sensors = "of a sensor nothing is used, not even its medium, since the scene is placed"
    unused = f"{shorten(', '.join(xml.unused))}: recipes have them; {of_sensors}"
    return ImportedScene(out, (unused,) if xml.unused else (), (path.name, *xml.files))


def _write_scene(
    scene: ForeignScene, to_world: np.ndarray, camera: str | None, unscored: Sequence[str], out: Path
) -> ImportedScene:
    """Write the folder of a translated scene."""
    meshes = Meshes()
    names = names_of_objects([part.name for part in scene.parts])
    check_unscored(unscored, names, str(scene.path))
    objects = [
        _object(part, name, to_world, meshes) | {"scored": name not in unscored}
        for part, name in zip(scene.parts, names, strict=True)
    ]
    growth = float(np.linalg.norm(to_world[:3, 0])) / scene.unit_mm
    lights = [_light(to_world @ matrix, values, growth) for matrix, values in scene.lamps]
    if not lights and not any("emission" in part.material for part in scene.parts):
        lights.append({"type": "uniform", "luminance_cd_m2": 100.0, "visible": False})
        scene.lose("the file has no light: the scene is lit evenly from all around")
    values = {"title": shorten(scene.path.stem, MAX_TITLE), "objects": objects, "lights": lights}
    valid = validate(Scene, values, f"{scene.path}: the scene made of it")
    comments = ["Imported; lengths in mm.", *(f"Not represented: {what}." for what in scene.left_out)]
    text = toml_text(valid, comments).encode()
    if len(text) > LARGEST_TOML_BYTES:
        raise InputError(f"{scene.path}: its scene.toml would have more than {LARGEST_TOML_BYTES} bytes")
    out.parent.mkdir(parents=True, exist_ok=True)
    with new_folder_safely(out) as new:
        (new / "scene.toml").write_bytes(text)
        for name, mesh in meshes.values():
            (new / name).write_bytes(ply_bytes(mesh))
        for name, pixels in scene.images.items():
            write_png(new / name, pixels)
    triangles = sum(len(part.triangles.faces) for part in scene.parts)
    size_mm = tuple(np.ptp(scene.bounds(to_world), axis=0).tolist())
    angle_deg = None if camera is None else scene.cameras[camera][1]
    return ImportedScene(
        out, tuple(scene.left_out), (), len(objects), triangles, len(lights), size_mm, camera, angle_deg
    )


def _mesh_file(part: Part, matrix: np.ndarray | None, meshes: Meshes) -> str:
    """The file of a part's mesh, moved by a matrix (3, 3) if there is one; the same meshes have one file."""
    key = id(part.triangles), b"" if matrix is None else matrix.tobytes()
    if key not in meshes:
        mesh, names = part.triangles, [file.removesuffix(".ply") for file, _ in meshes.values()]
        if matrix is not None:
            normals = None if mesh.normals is None else mesh.normals @ np.linalg.inv(matrix)
            faces = mesh.faces if np.linalg.det(matrix) > 0 else mesh.faces[:, ::-1]
            try:
                mesh = Triangles.checked(mesh.positions @ matrix.T, faces, normals, mesh.texcoords)
            except ValueError as fault:
                raise InputError(f"the mesh '{part.stem}' {fault}") from None
        meshes[key] = f"{names_of_objects([part.stem], names)[0]}.ply", mesh
    return meshes[key][0]


def _object(part: Part, name: str, to_world: np.ndarray, meshes: Meshes) -> dict[str, Any]:
    matrix = to_world @ part.matrix
    linear = matrix[:3, :3]
    scales = np.linalg.norm(linear, axis=0)
    rotation = linear / scales
    is_sheared = np.abs(rotation.T @ rotation - np.eye(3)).max() > MIN_SHEAR
    if is_sheared:  # which a rotation and scales cannot make: the mesh is moved
        rotation, scales = np.eye(3), np.ones(3)
    elif np.linalg.det(rotation) < 0:
        rotation, scales = rotation * [-1, 1, 1], scales * [-1, 1, 1]
    with warnings.catch_warnings(action="ignore"):  # Y by a right angle: X and Z turn about the same axis
        angles_deg = Rotation.from_matrix(rotation).as_euler("xyz", degrees=True)
    file, scale = _mesh_file(part, linear if is_sheared else None, meshes), [*map(_significant, scales)]
    is_even = np.ptp(scales) <= 1e-6 * np.abs(scales).max()
    return {
        "name": name,
        "position_mm": _rounded(matrix[:3, 3], 6),
        "rotation_deg": _rounded(angles_deg, 9),
        "shape": {"type": "mesh", "file": file, "scale": scale[0] if is_even else scale},
        "material": part.material,
    }


def _light(matrix: np.ndarray, values: dict[str, Any], growth: float) -> dict[str, Any]:
    """A lamp of a scene that was made larger is as much brighter: surfaces keep their brightness."""
    position_mm, forward = matrix[:3, 3], matrix[:3, 2] / np.linalg.norm(matrix[:3, 2])
    if values["type"] == "directional":
        return values | {"direction": _rounded(forward, 9)}
    place = {"position_mm": _rounded(position_mm, 6)}
    if values["type"] == "spot":
        place["target_mm"] = _rounded(position_mm + TARGET_MM * forward, 6)
    return values | place | {"intensity_cd": _significant(values["intensity_cd"] * growth**2)}


def _rounded(values: np.ndarray, digits: int) -> list[float]:
    """Numbers without -0."""
    return (np.round(values, digits) + 0.0).tolist()


def _significant(value: float) -> float:
    return float(f"{value:.7g}")
