"""Lamps: position, size, luminance in cd/m^2 and the colour of a CIE illuminant.

In RGB mode radiance is linear sRGB scaled such that its luminance, 0.2126 R + 0.7152 G + 0.0722 B,
is in cd/m^2.
"""

from functools import cache
from typing import Any

import numpy as np

from pcii.errors import InputError
from simgen.lights import AreaLight, UniformLight
from simgen.schema import suggestion

# IEC 61966-2-1: luminance of the sRGB primaries, and XYZ to linear sRGB.
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
_XYZ_TO_SRGB = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])


def light_plugin(mi: Any, light: AreaLight | UniformLight) -> dict[str, Any]:
    """The Mitsuba emitter of a lamp."""
    radiance = {"type": "rgb", "value": (light.luminance_cd_m2 * _tint(light.illuminant)).tolist()}
    match light:
        case UniformLight():
            return {"type": "constant", "radiance": radiance}
        case AreaLight():
            towards = np.subtract(light.target_mm, light.position_mm)
            if not np.any(towards):
                raise InputError("lights: an area light's target_mm must differ from its position_mm")
            up = [0.0, -1.0, 0.0] if abs(towards[1]) < 0.99 * np.linalg.norm(towards) else [0, 0, 1]
            pose = mi.ScalarTransform4f().look_at(
                origin=list(light.position_mm), target=list(light.target_mm), up=up
            )
            size = mi.ScalarTransform4f().scale([light.width_mm / 2, light.height_mm / 2, 1])
            return {
                "type": "rectangle",
                "to_world": pose @ size,
                "emitter": {"type": "area", "radiance": radiance},
                "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}},
            }


@cache
def _tint(illuminant: str) -> np.ndarray:
    """Linear sRGB of a CIE illuminant at luminance 1; channels outside the gamut are cut to 0."""
    if illuminant == "D65":  # the white of sRGB; also spares the second that colour takes to load
        return np.ones(3)
    import colour

    table = colour.CCS_ILLUMINANTS["CIE 1931 2 Degree Standard Observer"]
    if illuminant not in table:
        raise InputError(f"lights: no illuminant {illuminant!r}{suggestion(illuminant, list(table))}")
    x, y = table[illuminant]
    rgb = np.clip(_XYZ_TO_SRGB @ [x / y, 1.0, (1 - x - y) / y], 0, None)
    return rgb / (LUMINANCE @ rgb)
