"""Write scene.toml, 24 cards with the patches of a ColorChecker: run it without arguments."""

from pathlib import Path

HERE = Path(__file__).resolve().parent
ROWS = (
    ("dark skin", "light skin", "blue sky", "foliage", "blue flower", "bluish green"),
    ("orange", "purplish blue", "moderate red", "purple", "yellow green", "orange yellow"),
    ("blue", "green", "red", "yellow", "magenta", "cyan"),
    ("white 9.5", "neutral 8", "neutral 6.5", "neutral 5", "neutral 3.5", "black 2"),
)
SIDE_MM, STEP_MM, Z_MM = 42.0, 46.0, 540.0

HEAD = '''# Written by build_scene.py in this folder.
title = "Colour chart"
description = """
Colour against photon noise: the 24 patches of a ColorChecker at 540 mm in even light, so that a patch of
reflectance r has the radiance r x 500 lux / pi and nothing is out of focus.
"""
planes_mm = [540.0]

# Light from all around has no direction: no shading, the same on every patch.
[[lights]]
type = "uniform"
luminance_cd_m2 = 100.0 # [level] below tells how bright it is
illuminant = "D65"

# 500 lux, as on a desk in an office, on a surface at this depth that faces the cameras.
[level]
illuminance_lux = 500.0
z_mm = 540.0

# A black cardboard behind the patches. Without a reflectance it is wholly black.
[backdrop]
z_mm = 545.0

# Black 2 sends so little light that simgen check warns of it.
# In a recipe with sensor.camera each patch has its measured spectrum; without, its colour.
'''

CARD = """
[[objects]]
name = "{name}"
position_mm = [{x}, {y}, {z}]
shape = {{ type = "card", width_mm = {side}, height_mm = {side} }}
material = {{ reflectance = "{patch}" }}
"""


def scene() -> str:
    """The scene's text."""
    cards = [
        CARD.format(
            name=patch.replace(" ", "_").replace(".", "_"),
            x=(column - 2.5) * STEP_MM,
            y=(row - 1.5) * STEP_MM,
            z=Z_MM,
            side=SIDE_MM,
            patch=patch,
        )
        for row, patches in enumerate(ROWS)
        for column, patch in enumerate(patches)
    ]
    return HEAD + "".join(cards)


def main(folder: Path = HERE) -> None:
    """Write the scene into the folder."""
    (folder / "scene.toml").write_text(scene(), encoding="utf-8")


if __name__ == "__main__":
    main()
