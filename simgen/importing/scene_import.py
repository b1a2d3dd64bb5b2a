"""From a scene file of another program to a scene's folder."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from pcii.base.errors import InputError
from pcii.exchange.written_pixels import write_png
from pcii.store.safe_files import new_folder_safely
from simgen.assets.mesh_files import ply_bytes
from simgen.assets.triangles import Triangles
from simgen.base.strict_models import LARGEST_TOML_BYTES, shorten, validate
from simgen.base.toml_layout import toml_text
from simgen.importing.foreign_scene import ForeignScene, Lamp, Part, Placement, bounds, placement_of
from simgen.importing.gltf_scene import CD_M2_PER_EMISSION, EmissionUnit, foreign_gltf
from simgen.spec.mitsuba_file import MitsubaFile, files_named_by
from simgen.spec.scene import MOST_LIGHTS, MOST_OBJECTS, Scene, names_of_objects

SQUARE = 1e-5
"""Axes of a matrix whose cosine is less than this are square to each other."""
FAR_MM = 100.0
"""How far before a spot its target is written."""
EVEN_LIGHT = {"type": "uniform", "luminance_cd_m2": 100.0}
"""For files without any light."""
LONGEST_TITLE = 200
MOST_TRIANGLES = 1 << 24
"""Of all objects; the renderer makes those of each instance anew, and needs 100 bytes for each."""
Unit = Literal["mm", "cm", "m", "in", "ft"]
METRES: dict[str, float] = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254, "ft": 0.3048}
GLTF, MITSUBA = (".glb", ".gltf"), ".xml"


@dataclass(frozen=True)
class ImportedScene:
    """What was written, and what of the file is not used. A scene by reference is counted in files alone."""

    folder: Path
    left_out: tuple[str, ...]
    objects: int = 0
    meshes: int = 0
    triangles: int = 0
    materials: int = 0
    lights: int = 0
    size_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Of the bounding box of all objects along X, Y and Z."""
    camera: str | None = None
    """The one that became the virtual centre."""
    camera_angle_deg: float | None = None
    """Its horizontal angle of view."""
    files: tuple[str, ...] = ()
    """Files that a scene by reference consists of."""

    def lines(self) -> Iterator[str]:
        """The same for people."""
        x, y, z = self.size_mm
        yield f"{self.folder / 'scene.toml'}"
        if self.files:
            named = _number(len(self.files) - 1, "file")
            yield f"refers to {self.files[0]}, copied with {named} that it names"
            yield from (f"not used: {what}" for what in self.left_out)
            return
        yield (
            f"{_number(self.objects, 'object')} of {_number(self.triangles, 'triangle')} in "
            f"{_number(self.meshes, 'mesh', 'meshes')}, {_number(self.materials, 'material')}, "
            f"{_number(self.lights, 'light')}; {x:.4g} x {y:.4g} x {z:.4g} mm (X, Y, Z)"
        )
        if self.camera is not None:
            angle = (
                ""
                if self.camera_angle_deg is None
                else f", which sees {self.camera_angle_deg:.3g} degrees across"
            )
            yield f"the virtual centre is the camera '{self.camera}'{angle}"
        for what in self.left_out:
            yield f"not represented: {what}"


def _number(count: int, one: str, many: str | None = None) -> str:
    return f"{count} {one if count == 1 else many or f'{one}s'}"


def write_scene_folder(scene: ForeignScene, placement: Placement, out: Path) -> ImportedScene:
    """Write a scene's folder, which must not be there yet.

    Raises `InputError` with a clause about the file for more objects, lights or triangles than may be.
    """
    if len(scene.parts) > MOST_OBJECTS:
        raise InputError(
            f"it has {len(scene.parts)} objects, and a scene at most {MOST_OBJECTS}; join some that have one "
            "material"
        )
    if len(scene.lamps) > MOST_LIGHTS:
        raise InputError(f"it has {len(scene.lamps)} lights, and a scene at most {MOST_LIGHTS}")
    triangles = sum(len(part.triangles.faces) for part in scene.parts)
    if triangles > MOST_TRIANGLES:
        raise InputError(
            f"its objects have {triangles} triangles in all; at most {MOST_TRIANGLES} are rendered"
        )
    meshes = _Meshes()
    names = names_of_objects([part.name for part in scene.parts])
    objects = [_object(part, name, placement, meshes) for part, name in zip(scene.parts, names, strict=True)]
    lights = [_light(lamp, placement, scene.mm) for lamp in scene.lamps]
    left_out = list(scene.left_out)
    lit = any("emission" in part.material for part in scene.parts)
    if not lights and not lit:
        lights.append(EVEN_LIGHT)
        left_out.append("the file has no light: the scene is lit evenly from all around")
    values = {"title": shorten(scene.title, LONGEST_TITLE), "objects": objects, "lights": lights}
    written = validate(Scene, values, "what is made of it")
    comments = ["Imported; lengths in mm.", *(f"Not represented: {what}." for what in left_out)]
    text = toml_text(written, comments).encode()
    if len(text) > LARGEST_TOML_BYTES:
        raise InputError(f"its scene.toml has {len(text)} bytes, and {LARGEST_TOML_BYTES} are allowed")
    out.parent.mkdir(parents=True, exist_ok=True)
    with new_folder_safely(out) as new:
        (new / "scene.toml").write_bytes(text)
        for name, mesh in meshes.files.items():
            (new / name).write_bytes(ply_bytes(mesh))
        for name, pixels in scene.images.items():
            write_png(new / name, pixels)
    box = placement.scale * np.ptp(bounds(scene.parts, placement.rotation), axis=0)
    materials = {repr(sorted(part.material.items(), key=str)) for part in scene.parts}
    view = placement.camera
    return ImportedScene(
        folder=out,
        objects=len(objects),
        meshes=len(meshes.files),
        triangles=triangles,
        materials=len(materials),
        lights=len(lights),
        size_mm=(float(box[0]), float(box[1]), float(box[2])),
        camera=None if view is None else view.name,
        camera_angle_deg=None if view is None else view.angle_deg,
        left_out=tuple(left_out),
    )


def copy_reference(path: Path, file: MitsubaFile, out: Path) -> ImportedScene:
    """Make the folder of a scene that refers to a Mitsuba file, a copy with all files that it names.

    Raises `InputError` for a file that names others outside its folder, or that are missing.
    """
    if not path.is_file():
        raise InputError(f"{path}: there is no such file")
    names = [path.name, *files_named_by(path.parent, path.name)]
    scene = Scene(title=shorten(path.stem, LONGEST_TITLE), mitsuba=file)
    out.parent.mkdir(parents=True, exist_ok=True)
    with new_folder_safely(out) as new:
        (new / "scene.toml").write_bytes(toml_text(scene, [f"Refers to {path.name}."]).encode())
        for name in names:
            (new / name).parent.mkdir(parents=True, exist_ok=True)
            (new / name).write_bytes((path.parent / name).read_bytes())
    unused = ("sensors but for where they stand, films, samplers and integrators, which recipes have",)
    return ImportedScene(folder=out, left_out=unused, files=tuple(names))


class _Meshes:
    """Files of meshes by name: one for all parts that have the same triangles."""

    def __init__(self) -> None:
        self.files: dict[str, Triangles] = {}
        self._names: dict[tuple[int, bytes], str] = {}

    def name(self, stem: str, mesh: Triangles, matrix: np.ndarray | None = None) -> str:
        """The file of a mesh, moved by a matrix (3, 3) if there is one."""
        key = id(mesh), b"" if matrix is None else matrix.tobytes()
        if key not in self._names:
            taken = {name.removesuffix(".ply") for name in self.files}
            self._names[key] = f"{names_of_objects([stem], taken)[0]}.ply"
            self.files[self._names[key]] = mesh if matrix is None else _moved(mesh, matrix)
        return self._names[key]


def _moved(mesh: Triangles, matrix: np.ndarray) -> Triangles:
    normals = None if mesh.normals is None else mesh.normals @ np.linalg.inv(matrix)
    faces = mesh.faces if np.linalg.det(matrix) > 0 else mesh.faces[:, ::-1]
    return Triangles.checked(mesh.positions @ matrix.T, faces, normals, mesh.texcoords)


def _object(part: Part, name: str, placement: Placement, meshes: _Meshes) -> dict[str, Any]:
    matrix = placement.to_world @ part.matrix
    linear = matrix[:3, :3]
    parts = _rotation_and_scales(linear)
    rotation, scales = (np.eye(3), np.ones(3)) if parts is None else parts
    shape: dict[str, Any] = {
        "type": "mesh",
        "file": meshes.name(part.file, part.triangles, linear if parts is None else None),
    }
    if parts is not None:
        alike = np.ptp(scales) <= 1e-6 * np.abs(scales).max()
        shape["scale"] = _significant(scales[0]) if alike else [_significant(one) for one in scales]
    return {
        "name": name,
        "position_mm": _rounded(matrix[:3, 3]),
        "rotation_deg": _angles_deg(rotation),
        "shape": shape,
        "material": part.material,
    }


def _rotation_and_scales(linear: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """A matrix (3, 3) as a rotation after scales (3,) along the axes; None if it also shears."""
    scales = np.linalg.norm(linear, axis=0)
    if not scales.all():
        return None
    axes = linear / scales
    if np.abs(axes.T @ axes - np.eye(3)).max() > SQUARE:
        return None
    if np.linalg.det(axes) < 0:
        axes, scales = axes * [-1, 1, 1], scales * [-1, 1, 1]
    return axes, scales


def _angles_deg(rotation: np.ndarray) -> list[float]:
    """Turns about the fixed X, Y and Z axes, in this order."""
    if abs(rotation[2, 0]) > 1 - 1e-12:  # Y by a right angle: of the turns about X and Z only one is needed
        angles = 0.0, -np.arcsin(np.clip(rotation[2, 0], -1, 1)), np.arctan2(-rotation[0, 1], rotation[1, 1])
    else:
        angles = (
            np.arctan2(rotation[2, 1], rotation[2, 2]),
            -np.arcsin(rotation[2, 0]),
            np.arctan2(rotation[1, 0], rotation[0, 0]),
        )
    return [round(float(np.degrees(angle)), 9) + 0.0 for angle in angles]


def _light(lamp: Lamp, placement: Placement, mm: float) -> dict[str, Any]:
    """A lamp of a scene that was made larger is as much brighter: surfaces keep their brightness."""
    matrix = placement.to_world @ lamp.matrix
    position, forward = matrix[:3, 3], matrix[:3, 2] / np.linalg.norm(matrix[:3, 2])
    values = dict(lamp.values)
    if "intensity_cd" in values:
        values["intensity_cd"] = _significant(values["intensity_cd"] * (placement.scale / mm) ** 2)
    if values["type"] in ("point", "spot"):
        values["position_mm"] = _rounded(position)
    if values["type"] == "spot":
        values["target_mm"] = _rounded(position + FAR_MM * forward)
    if values["type"] == "directional":
        values["direction"] = [round(float(part), 9) + 0.0 for part in forward]
    return values


def _rounded(position_mm: np.ndarray) -> list[float]:
    """To a millionth of a millimetre; without -0."""
    return [round(float(part), 6) + 0.0 for part in position_mm]


def _significant(value: float) -> float:
    return float(f"{value:.7g}")


def import_scene(
    file: str | Path,
    out: str | Path,
    *,
    camera: str | None = None,
    unit: Unit = "m",
    place_at_mm: Sequence[float] | None = None,
    fit_mm: float | None = None,
    emission_unit: EmissionUnit = "nit",
) -> ImportedScene:
    """Make the folder `out` of a glTF file (.glb, .gltf) or a Mitsuba scene (.xml).

    A glTF file is translated into an ordinary scene. A Mitsuba scene is copied, with all files that it names,
    beside a scene.toml that refers to it. A camera of the file, `camera` if there are several, becomes the
    virtual centre; or the middle of the scene comes to `place_at_mm`. `unit` is the file's; `fit_mm` makes
    its longest side so long.
    `emission_unit` is that of the emission of a glTF file's materials: nit, which are cd/m^2, or watt, which
    are W/(sr m^2) and become 683 cd/m^2 each, as lights do that Blender exports in its mode Standard.
    Raises `pcii.InputError` for a file that cannot be read, and for a folder that is there already.
    """
    path, folder = Path(file), Path(out)
    suffix = path.suffix.lower()
    if suffix not in (*GLTF, MITSUBA):
        raise InputError(f"{path}: expected a glTF file (.glb or .gltf) or a Mitsuba scene (.xml)")
    if unit not in METRES:
        raise InputError(f"--unit: expected one of {', '.join(METRES)}, got {unit!r}")
    if emission_unit not in CD_M2_PER_EMISSION:
        raise InputError(
            f"--emission-unit: expected one of {', '.join(CD_M2_PER_EMISSION)}, got {emission_unit!r}"
        )
    if suffix == MITSUBA and emission_unit != "nit":
        raise InputError("--emission-unit: is for glTF files; surfaces and lights of Mitsuba have one unit")
    if fit_mm is not None and not 0 < fit_mm < float("inf"):
        raise InputError(f"--fit-mm: expected a length above 0, got {fit_mm:g}")
    if place_at_mm is not None and not all(abs(part) < float("inf") for part in place_at_mm):
        raise InputError("--place-at-mm: expected three finite numbers")
    if folder.exists():
        raise InputError(f"{folder}: is there already; choose another folder or remove it")
    if suffix == MITSUBA:
        place = {"unit_mm": 1000 * METRES[unit], "camera": camera, "fit_mm": fit_mm}
        if place_at_mm is not None:
            place["place_at_mm"] = tuple(place_at_mm)
        return copy_reference(path, MitsubaFile(file=path.name, **place), folder)
    scene = foreign_gltf(path, METRES[unit], emission_unit)
    try:
        return write_scene_folder(scene, placement_of(scene, camera, place_at_mm, fit_mm), folder)
    except InputError as fault:
        raise fault if str(fault).startswith("--") else InputError(f"{path}: {fault}") from None
