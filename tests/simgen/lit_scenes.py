"""Two balls under a lamp, and what can be built like them: scenes of the tests of noise and of photons."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

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


def ball(name: str, x_mm: float, z_mm: float, colour: tuple[float, float, float]) -> dict[str, Any]:
    return {
        "name": name,
        "position_mm": (x_mm, 0.0, z_mm),
        "shape": {"type": "sphere", "radius_mm": 120.0},
        "material": {"reflectance": colour},
    }


def lit(objects: list[dict], lights: Sequence[dict] = (LAMP, EVENLY)) -> RenderScene:
    """The objects before a dim wall."""
    values = {
        "title": "test",
        "objects": objects,
        "lights": list(lights),
        "backdrop": {"z_mm": 1500.0, "reflectance": [0.1, 0.1, 0.1]},
    }
    return build(backend.load(), Scene.model_validate(values), Path(), DEPTH)


def two_balls(lights: Sequence[dict] = (LAMP, EVENLY)) -> RenderScene:
    balls = ball("red", -130.0, 600.0, (0.9, 0.2, 0.1)), ball("blue", 150.0, 700.0, (0.1, 0.3, 0.9))
    return lit(list(balls), lights)
