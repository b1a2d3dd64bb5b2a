"""Balls and cards in even light: scenes whose truth can be written down."""

from pathlib import Path

from pcii.types import CameraGrid
from simgen.renderer import RenderScene, backend, build
from simgen.spec import Scene

LIGHT = {"type": "uniform", "luminance_cd_m2": 100.0}


def built(folder: Path, objects: list[dict], *, backdrop_mm: float | None = 3000.0) -> RenderScene:
    values: dict = {"title": "test", "objects": objects, "lights": [LIGHT]}
    if backdrop_mm is not None:
        values["backdrop"] = {"z_mm": backdrop_mm}
    return build(backend.load(), Scene.model_validate(values), folder, 2)


def grid(rows: int, cols: int, height: int, width: int, pixel_mm: float = 0.0704) -> CameraGrid:
    return CameraGrid(
        rows=rows,
        cols=cols,
        pitch_mm=(6.0, 4.0),
        focal_mm=50.0,
        pixel_mm=pixel_mm,
        height=height,
        width=width,
    )


def sphere(name: str, position: tuple[float, float, float], radius_mm: float) -> dict:
    return {
        "name": name,
        "position_mm": position,
        "shape": {"type": "sphere", "radius_mm": radius_mm},
        "material": {"reflectance": [0.9, 0.9, 0.9]},
    }


def card(
    name: str,
    z_mm: float,
    size_mm: float,
    material: dict,
    turn_deg: tuple[float, float, float] = (0, 0, 0),
    at_mm: tuple[float, float] = (0, 0),
) -> dict:
    return {
        "name": name,
        "position_mm": (*at_mm, z_mm),
        "rotation_deg": turn_deg,
        "shape": {"type": "card", "width_mm": size_mm, "height_mm": size_mm},
        "material": material,
    }
