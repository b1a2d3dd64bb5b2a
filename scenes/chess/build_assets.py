"""Make the chess board: a glTF file, as modelling programs export it, and the scene that is imported of it.

Run the script without arguments: it writes chess.glb, scene.toml, meshes and pictures beside itself. In the
file lengths are metres and Y is up; the camera looks along -Z, tilted down.
"""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "set_table"))
from gltf_draft import QUAD, QUAD_FACES, QUAD_UV, GltfDraft
from gltf_parts import box, lathe, picture, surface, turn, write_scene

TILT_DEG = 20.0
TITLE = "A game of chess, imported from glTF"
DESCRIPTION = """
An endgame on a board that runs from 490 to 910 mm: lacquered pieces of boxwood and ebony, those of a kind
instances of one mesh, stand alone and before each other, between a rug and a wall with a curtain. Made as
glTF by build_assets.py, which imports it as `simgen import-scene` does.
"""
PLANES_MM = (522.0, 575.0, 620.0, 660.0, 760.0)
SQUARE_M = 0.047
THICK_M = 0.06
MIDDLE_M = -0.66

Profile = list[tuple[float, float]]
BASE: Profile = [(0, 0), (0.0165, 0), (0.017, 0.004), (0.0135, 0.008), (0.0125, 0.011)]
PAWN = [
    *BASE,
    (0.006, 0.02),
    (0.005, 0.028),
    (0.0095, 0.031),
    (0.006, 0.033),
    (0.0095, 0.039),
    (0.0085, 0.045),
]
PAWN += [(0.004, 0.0485), (0, 0.049)]
ROOK = [
    *BASE,
    (0.0095, 0.02),
    (0.0085, 0.036),
    (0.0125, 0.04),
    (0.013, 0.052),
    (0.009, 0.052),
    (0.009, 0.047),
]
ROOK += [(0, 0.047)]
BISHOP = [
    *BASE,
    (0.007, 0.022),
    (0.0055, 0.036),
    (0.011, 0.039),
    (0.006, 0.042),
    (0.01, 0.051),
    (0.008, 0.06),
]
BISHOP += [(0.003, 0.067), (0.0035, 0.07), (0, 0.073)]
QUEEN = [
    *BASE,
    (0.008, 0.024),
    (0.006, 0.046),
    (0.012, 0.05),
    (0.007, 0.053),
    (0.0095, 0.066),
    (0.0135, 0.076),
]
QUEEN += [(0.009, 0.0765), (0.004, 0.08), (0, 0.085)]
KING = [
    *BASE,
    (0.0085, 0.024),
    (0.0065, 0.05),
    (0.0125, 0.054),
    (0.0075, 0.057),
    (0.0105, 0.074),
    (0.012, 0.079),
]
KING += [(0.006, 0.083), (0, 0.084)]
BODIES = {"pawn": PAWN, "rook": ROOK, "bishop": BISHOP, "queen": QUEEN, "king": KING}
POSITION = {
    "white": {"king": "g1", "queen": "e4", "rook": "b1 c6", "bishop": "f3", "pawn": "a2 d3 f2 g3 h2"},
    "black": {"king": "f8", "queen": "d6", "rook": "b8", "bishop": "c4", "pawn": "a7 f6 g7 h6"},
}
"""Squares of the pieces; the rank 1 is the nearest."""


def board() -> np.ndarray:
    """Squares of maple and walnut within a border, as pixels."""
    y, x = np.mgrid[:180, :180] / 20.0 - 0.5  # in squares, from the corner of the first
    dark = (np.floor(x) + np.floor(y)) % 2 == 1
    inside = (x > 0) & (x < 8) & (y > 0) & (y < 8)
    grain = 0.85 + 0.15 * np.sin(9 * y + 2.5 * np.sin(1.3 * x) + 23 * (np.floor(x) * 5 + np.floor(y) * 3))
    wood = np.where((dark | ~inside)[..., None], (104, 66, 42), (214, 176, 124))
    return (wood * grain[..., None]).astype(np.uint8)


def rug() -> np.ndarray:
    """Threads in three colours; it tiles."""
    y, x = np.mgrid[:48, :48] / 48.0
    lozenge = np.abs(x - 0.5) + np.abs(y - 0.5)
    colours = np.array([(122, 44, 40), (176, 132, 84), (52, 60, 88)])
    ring = np.minimum((lozenge * 6).astype(int) % 3, 2)
    return (colours[ring] * (0.8 + 0.2 * ((np.arange(48) % 4 < 2)[:, None, None]))).astype(np.uint8)


def curtain() -> np.ndarray:
    """Folds with a woven pattern; it tiles."""
    y, x = np.mgrid[:64, :64] / 64.0
    fold = 0.7 + 0.3 * np.sin(2 * np.pi * x + 0.6 * np.sin(4 * np.pi * x))
    woven = np.where(
        (np.hypot((x * 4) % 1 - 0.5, (y * 4) % 1 - 0.5) < 0.28)[..., None], (204, 190, 150), (84, 116, 122)
    )
    return (woven * fold[..., None]).astype(np.uint8)


def chess() -> GltfDraft:
    """The file."""
    draft = GltfDraft()

    def pictured(name: str, pixels: np.ndarray, roughness: float, **sampler: int) -> dict:
        return surface(
            name, roughness, pbr={"baseColorTexture": {"index": picture(draft, pixels, **sampler)}}
        )

    positions, faces, uv, normals = box(9 * SQUARE_M, THICK_M, 9 * SQUARE_M)
    draft.node(
        name="board",
        mesh=draft.mesh(positions, faces, uv, pictured("inlay", board(), 0.4), normals),
        translation=[0, -THICK_M / 2, MIDDLE_M],
    )
    tiles = {"wrapS": 10497, "wrapT": 10497}
    floor = draft.mesh(QUAD, QUAD_FACES, 14 * QUAD_UV, pictured("wool", rug(), 1.0, **tiles))
    draft.node(
        name="rug", mesh=floor, translation=[0, -THICK_M, -0.7], rotation=turn(-90), scale=[1.0, 0.6, 1]
    )
    wall = draft.mesh(QUAD, QUAD_FACES, 11 * QUAD_UV, pictured("cloth", curtain(), 1.0, **tiles))
    draft.node(name="curtain", mesh=wall, translation=[0, 0.3, -1.15], scale=[1.0, 1.0, 1])

    woods = {
        "white": surface("boxwood", 0.35, pbr={"baseColorFactor": [0.62, 0.43, 0.21, 1.0]}),
        "black": surface("ebony", 0.35, pbr={"baseColorFactor": [0.05, 0.04, 0.035, 1.0]}),
    }
    for kind, profile in BODIES.items():
        positions, faces, uv, normals = lathe(profile)
        white = draft.mesh(positions, faces, None, woods["white"], normals)
        same = dict(
            draft.json["meshes"][white]["primitives"][0], material=draft.put("materials", woods["black"])
        )
        meshes = {"white": white, "black": draft.put("meshes", {"primitives": [same]})}
        for colour, mesh in meshes.items():
            for square in POSITION[colour][kind].split():
                x, rank = "abcdefgh".index(square[0]) - 3.5, int(square[1]) - 4.5
                draft.node(
                    name=f"{colour}-{kind}-{square}",
                    mesh=mesh,
                    translation=[x * SQUARE_M, 0.0, MIDDLE_M - rank * SQUARE_M],
                )
    panel = surface("panel", 1.0, pbr={"baseColorFactor": [0.0, 0.0, 0.0, 1.0]})
    panel["emissiveFactor"] = [1.0, 0.93, 0.82]
    panel["extensions"] = {"KHR_materials_emissive_strength": {"emissiveStrength": 900.0}}
    lamp = draft.mesh(QUAD, QUAD_FACES, None, panel)
    draft.node(name="lamp", mesh=lamp, translation=[-0.4, 0.9, -0.5], rotation=turn(90), scale=[0.3, 0.3, 1])
    sun = {"type": "directional", "intensity": 600.0, "color": [0.8, 0.9, 1.0]}
    draft.light(sun, rotation=turn(-50, 35))
    camera_m = -MIDDLE_M * np.tan(np.radians(TILT_DEG))
    draft.camera(name="seat", translation=[0, camera_m, 0], rotation=turn(-TILT_DEG), yfov=0.6918)
    return draft


def main(folder: Path) -> None:
    """Write the file and the scene."""
    fields = {"title": TITLE, "description": DESCRIPTION.strip(), "planes_mm": PLANES_MM}
    write_scene(folder / "chess.glb", chess(), **fields)


if __name__ == "__main__":
    main(Path(__file__).resolve().parent)
