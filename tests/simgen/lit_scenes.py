"""Balls and cards under a lamp or in even light, as the renderer takes them."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pcii.types import CameraGrid
from simgen.renderer import RenderScene, backend, build
from simgen.spec import Scene

DEPTH = 3
"""Bounces of a path."""
LAMP: dict[str, Any] = {
    "type": "area",
    "position_mm": (-200, -300, 200),
    "target_mm": (0, 0, 600),
    "width_mm": 200,
    "height_mm": 200,
    "luminance_cd_m2": 2000.0,
}
EVENLY: dict[str, Any] = {"type": "uniform", "luminance_cd_m2": 30.0}
DIM_WALL: dict[str, Any] = {"z_mm": 1500.0, "reflectance": (0.1, 0.1, 0.1)}
WHITE = (1.0, 1.0, 1.0)


def ball(
    name: str,
    x_mm: float,
    z_mm: float,
    colour: Sequence[float] = WHITE,
    radius_mm: float = 120,
    y_mm: float = 0,
) -> dict[str, Any]:
    return {
        "name": name,
        "position_mm": (x_mm, y_mm, z_mm),
        "shape": {"type": "sphere", "radius_mm": radius_mm},
        "material": {"reflectance": colour},
    }


def card(
    name: str,
    z_mm: float,
    size_mm: float,
    turn_deg: tuple[float, float, float] = (0, 0, 0),
    at_mm: tuple[float, float] = (0, 0),
    **material: Any,
) -> dict[str, Any]:
    return {
        "name": name,
        "position_mm": (*at_mm, z_mm),
        "rotation_deg": turn_deg,
        "shape": {"type": "card", "width_mm": size_mm, "height_mm": size_mm},
        "material": material or {"reflectance": WHITE},
    }


def lit(
    objects: list[dict],
    lights: Sequence[dict] = (LAMP, EVENLY),
    backdrop: dict[str, Any] | None = DIM_WALL,
    folder: Path = Path(),
    depth: int = DEPTH,
) -> RenderScene:
    values = {"title": "test", "objects": objects, "lights": list(lights), "backdrop": backdrop}
    return build(backend.load(), Scene.model_validate(values), folder, depth)


def two_balls(lights: Sequence[dict] = (LAMP, EVENLY)) -> RenderScene:
    balls = ball("red", -130.0, 600.0, (0.9, 0.2, 0.1)), ball("blue", 150.0, 700.0, (0.1, 0.3, 0.9))
    return lit(list(balls), lights)


def built(objects: list[dict], *, backdrop_mm: float | None = 3000.0, folder: Path = Path()) -> RenderScene:
    """The objects in even light."""
    return lit(objects, [EVENLY], None if backdrop_mm is None else {"z_mm": backdrop_mm}, folder, depth=2)


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
