"""A recipe that takes a second: the paper's two objects on few, coarse pixels."""

from typing import Any

TINY_RECIPE: dict[str, Any] = {
    "scene": "two_objects",
    "grid": {"rows": 2, "cols": 3, "pitch_mm": [18.0, 18.0], "pixel_mm": 0.5632, "height": 64, "width": 60},
}

GRID_2_X_3 = """
[grid]
rows = 2
cols = 3
pitch_mm = [18.0, 18.0]
pixel_mm = 0.5632
height = 64
width = 60
"""
"""The same cameras, as TOML."""
GRID_2_X_2 = """
[grid]
rows = 2
cols = 2
pitch_mm = [18.0, 18.0]
pixel_mm = 1.0
height = 32
width = 36
"""
