"""Make the set table: a glTF file, as modelling programs export it, and the scene that is imported of it.

Run the script without arguments: it writes set_table.glb, scene.toml, meshes and pictures beside itself. In
the file lengths are metres and Y is up; the camera looks along -Z, tilted down.
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
from gltf_draft import QUAD, QUAD_FACES, QUAD_UV, GltfDraft
from gltf_parts import Lathe, box, lathe, picture, surface, turn, write_scene

TILT_DEG = 14.0
TITLE = "A set table, imported from glTF"
DESCRIPTION = """
Tea for two in a room: plates, cups and a bowl at 530 to 870 mm, of which some are instances of one mesh and
one is mirrored, on a mat of lace that an image cuts out. A panel out of view, a paper lantern and a spot
shine on them. Made as glTF by build_assets.py, which imports it as `simgen import-scene` does.
"""
PLANES_MM = (560.0, 600.0, 710.0, 760.0, 815.0)


def with_handle(cup: Lathe) -> Lathe:
    """A cup with a ring at its side (+X)."""
    turn, around = np.meshgrid(
        np.linspace(-0.62 * np.pi, 0.62 * np.pi, 17), np.linspace(0, 2 * np.pi, 9), indexing="ij"
    )
    wide, thick = 0.016, 0.0035
    radial = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=-1)
    normals = np.cos(around)[..., None] * radial + np.sin(around)[..., None] * np.array([0.0, 0.0, 1.0])
    positions = (
        wide * radial * [1.0, 1.3, 1.0] + thick * normals + [cup[0][:, 0].max() - 0.002, 0.03, 0.0]
    ).reshape(-1, 3)
    corner = np.arange(17 * 9).reshape(17, 9)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]
    faces = np.concatenate([np.stack([a, c, b], -1).reshape(-1, 3), np.stack([a, d, c], -1).reshape(-1, 3)])
    return (
        np.vstack([cup[0], positions.astype("<f4")]),
        np.concatenate([cup[1], (faces.ravel() + len(cup[0])).astype("<u2")]),
        np.vstack([cup[2], np.zeros((17 * 9, 2), "<f4")]),
        np.vstack([cup[3], normals.reshape(-1, 3).astype("<f4")]),
    )


PLATE = [(0, 0), (0.035, 0), (0.04, 0.002), (0.064, 0.009), (0.065, 0.011), (0.062, 0.0105)]
PLATE += [(0.041, 0.0045), (0.036, 0.003), (0, 0.003)]
BOWL = [(0, 0), (0.018, 0), (0.02, 0.003), (0.034, 0.014), (0.04, 0.03), (0.0385, 0.031), (0.036, 0.028)]
BOWL += [(0.03, 0.014), (0.016, 0.005), (0, 0.004)]
CUP = [(0, 0), (0.018, 0), (0.021, 0.003), (0.027, 0.02), (0.029, 0.05), (0.0275, 0.0515), (0.026, 0.048)]
CUP += [(0.024, 0.02), (0.017, 0.006), (0, 0.005)]
APPLE = [(0, 0.004), (0.01, 0.0), (0.022, 0.005), (0.03, 0.02), (0.03, 0.036), (0.022, 0.05), (0.008, 0.053)]
APPLE += [(0, 0.046)]
FOOT = [(0, 0), (0.019, 0), (0.02, 0.003), (0.006, 0.007), (0.0045, 0.02), (0.009, 0.034), (0, 0.035)]
LANTERN = [(0, 0), (0.012, 0.001), (0.022, 0.01), (0.026, 0.026), (0.022, 0.042), (0.012, 0.051), (0, 0.052)]
SPOON = [(0, -0.02), (0.008, -0.017), (0.013, -0.007), (0.0125, 0.006), (0.007, 0.018), (0.003, 0.026)]
SPOON += [(0.0025, 0.08), (0.004, 0.098), (0, 0.1)]
NAPKIN = [(0.03, 0), (0.024, 0.02), (0.012, 0.045), (0.001, 0.07)]


def wallpaper() -> np.ndarray:
    """A leaf in two greens; it tiles."""
    y, x = (np.mgrid[:64, :64] + 0.5) / 64 - 0.5
    leaf = (np.hypot(x * 1.8 + 0.5 * y, y) < 0.33) & (np.abs(x + 0.28 * y) > 0.02)
    return np.where(leaf[..., None], (88, 112, 90), (196, 205, 178)).astype(np.uint8)


def wood() -> np.ndarray:
    """Boards with an even grain."""
    y, x = np.mgrid[:128, :256] / 128.0
    grain = np.sin(40 * y + 3 * np.sin(2 * np.pi * x) + 9 * np.floor(y * 4)) * 0.5 + 0.5
    shade = 0.72 + 0.2 * grain - 0.35 * ((y * 4) % 1 < 0.04)
    return (shade[..., None] * np.array([178, 120, 74])).astype(np.uint8)


def skin() -> np.ndarray:
    """Of an apple: red above, yellow below, with streaks."""
    y, x = np.mgrid[:64, :128] / np.array([64.0, 128.0])[:, None, None]
    red = np.clip(1.3 - y * 1.2 + 0.25 * np.sin(60 * np.pi * x) * np.sin(14 * x), 0, 1)[..., None]
    return (red * np.array([178, 34, 30]) + (1 - red) * np.array([214, 178, 60])).astype(np.uint8)


def lace() -> np.ndarray:
    """White with holes: (H, W, 4)."""
    y, x = (np.mgrid[:96, :144] + 0.5) / np.array([96.0, 144.0])[:, None, None]
    across, down = np.cos(2 * np.pi * 12 * x), np.cos(2 * np.pi * 8 * y)
    inner = (np.abs(x - 0.5) < 0.44) & (np.abs(y - 0.5) < 0.41)
    alpha = np.where(inner, np.clip(0.5 + 0.55 * (0.9 - across * down - 0.75), 0, 1), 1.0)
    pixels = np.full((96, 144, 4), (238, 234, 224, 0), np.uint8)
    pixels[..., 3] = np.round(255 * alpha)
    return pixels


def stripes() -> np.ndarray:
    """Of a napkin."""
    bands = np.where(np.arange(64) // 8 % 2 == 0, 1, 0)
    return (
        np.where(bands[None, :, None] == 1, (60, 84, 140), (224, 220, 210))
        .repeat(16, axis=0)
        .astype(np.uint8)
    )


def table() -> GltfDraft:
    """The file."""
    draft = GltfDraft()

    def mesh(shape: Lathe, material: dict[str, Any]) -> int:
        positions, faces, uv, normals = shape
        return draft.mesh(positions, faces, uv, material, normals)

    def pictured(pixels: np.ndarray, **sampler: int) -> dict[str, Any]:
        return {"baseColorTexture": {"index": picture(draft, pixels, **sampler)}}

    porcelain = surface("porcelain", 0.5, pbr={"baseColorFactor": [0.75, 0.78, 0.8, 1.0]})
    glaze = surface("glaze", 0.5, pbr={"baseColorFactor": [0.1, 0.28, 0.4, 1.0]})
    pewter = surface("pewter", 0.5, pbr={"metallicFactor": 1.0, "baseColorFactor": [0.62, 0.6, 0.56, 1.0]})
    glow: dict[str, Any] = {"emissiveFactor": [1.0, 0.6, 0.25]}
    glow["extensions"] = {"KHR_materials_emissive_strength": {"emissiveStrength": 90.0}}
    black = {"baseColorFactor": [0.0, 0.0, 0.0, 1.0]}
    panel: dict[str, Any] = {"emissiveFactor": [1.0, 0.95, 0.85]}
    panel["extensions"] = {"KHR_materials_emissive_strength": {"emissiveStrength": 900.0}}

    top = mesh(box(1.5, 0.03, 1.0), surface("oak", 0.6, pbr=pictured(wood())))
    draft.node(name="table", mesh=top, translation=[0, -0.015, -0.75])
    paper = surface("wallpaper", 0.9, pbr=pictured(wallpaper(), wrapS=10497, wrapT=10497))
    wall = draft.mesh(QUAD, QUAD_FACES, 9 * QUAD_UV, paper)
    draft.node(name="wall", mesh=wall, translation=[0, 0.4, -1.25], scale=[1.2, 1.2, 1])
    cut = surface("lace", 0.9, pbr=pictured(lace()), alphaMode="MASK", alphaCutoff=0.5, doubleSided=True)
    mat = draft.mesh(QUAD, QUAD_FACES, QUAD_UV, cut)
    draft.node(
        name="mat", mesh=mat, translation=[-0.02, 0.001, -0.58], rotation=turn(-90), scale=[0.14, 0.09, 1]
    )

    plate = mesh(lathe(PLATE), porcelain)
    draft.node(name="plate", mesh=plate, translation=[-0.055, 0.0015, -0.575])
    far = draft.node(root=False, name="bowl", mesh=mesh(lathe(BOWL), glaze), translation=[0, 0.0031, 0])
    draft.node(
        name="far-plate", mesh=plate, translation=[0.1, 0.0005, -0.78], rotation=turn(0, 25), children=[far]
    )
    cup = mesh(with_handle(lathe(CUP)), porcelain)
    draft.node(name="cup", mesh=cup, translation=[0.085, 0.0005, -0.58], rotation=turn(0, -20))
    draft.node(
        name="far-cup", mesh=cup, translation=[-0.1, 0.0005, -0.8], rotation=turn(0, -15), scale=[-1, 1.1, 1]
    )
    apple = mesh(lathe(APPLE), surface("apple", 0.5, pbr=pictured(skin())))
    draft.node(name="apple", mesh=apple, translation=[-0.06, 0.005, -0.575], rotation=turn(8, 40))
    spoon = mesh(lathe(SPOON), pewter)
    draft.node(
        name="spoon",
        mesh=spoon,
        translation=[0.03, 0.0035, -0.505],
        rotation=turn(-90, 0, 25),
        scale=[1, 1, 0.25],
    )
    foot = mesh(lathe(FOOT), pewter)
    lantern = mesh(lathe(LANTERN), surface("paper", 0.9, **glow))
    light = draft.node(root=False, name="lantern", mesh=lantern, translation=[0, 0.034, 0])
    draft.node(name="lantern-foot", mesh=foot, translation=[-0.005, 0.0005, -0.74], children=[light])
    napkin = mesh(lathe(NAPKIN), surface("linen", 0.95, pbr=pictured(stripes()), doubleSided=True))
    draft.node(
        name="napkin",
        mesh=napkin,
        translation=[0.155, 0.0005, -0.68],
        rotation=turn(0, 10),
        scale=[1, 1, 0.6],
    )

    lamp = draft.mesh(QUAD, QUAD_FACES, None, surface("lamp", 1.0, pbr=black, **panel))
    draft.node(name="lamp", mesh=lamp, translation=[0.1, 0.9, -0.5], rotation=turn(90), scale=[0.25, 0.2, 1])
    draft.light(
        {
            "type": "spot",
            "intensity": 60.0,
            "color": [0.75, 0.85, 1.0],
            "spot": {"innerConeAngle": 0.25, "outerConeAngle": 0.5},
        },
        translation=[-0.7, 0.6, -0.2],
        rotation=turn(-40, -60),
    )
    draft.camera(name="seat", translation=[0, 0.25, 0], rotation=turn(-TILT_DEG), yfov=0.6918, aspect=1.0)
    return draft


def main(folder: Path) -> None:
    """Write the file and the scene."""
    fields = {"title": TITLE, "description": DESCRIPTION.strip(), "planes_mm": PLANES_MM}
    write_scene(folder / "set_table.glb", table(), **fields)


if __name__ == "__main__":
    main(Path(__file__).resolve().parent)
