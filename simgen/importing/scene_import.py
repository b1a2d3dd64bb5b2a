"""From a scene file of another program to a scene's folder."""

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from pcii.base.errors import InputError
from simgen.importing.foreign_scene import placement_of
from simgen.importing.gltf_scene import CD_M2_PER_EMISSION, EmissionUnit, foreign_gltf
from simgen.importing.scene_folder import ImportedScene, copy_reference, write_scene_folder
from simgen.spec.mitsuba_file import MitsubaFile

Unit = Literal["mm", "cm", "m", "in", "ft"]
METRES: dict[str, float] = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254, "ft": 0.3048}
GLTF, MITSUBA = (".glb", ".gltf"), ".xml"


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
