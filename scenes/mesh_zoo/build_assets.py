"""Make ring.obj, gear.obj and knot.ply: run it without arguments.

Axes as in scenes: X right, Y down, Z away from the cameras.
"""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
RING_MM = (46.0, 17.0)
"""Radius of the ring's middle line and of its tube."""
KNOT_MM = (21.0, 9.5)
"""Half of the knot's inner radius and the tube's radius."""
GEAR_CM = (2.9, 3.8, 1.1, 0.75)
"""Radius of the roots and of the tips of the teeth, of the hole, and half the thickness."""
TEETH = 14


def tube(line: Callable[[np.ndarray], np.ndarray], radius: float, around: int, across: int) -> tuple:
    """A closed tube about `line`: positions, normals (N, 3), texture coordinates (N, 2), quads (M, 4).

    `line` takes angles (n,) from 0 to 2 pi to points (n, 3). The first and last row and column are the same
    places with different texture coordinates.
    """
    t = np.linspace(0, 2 * np.pi, around + 1)
    step = 1e-4
    along = line(t + step) - line(t - step)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    # Away from the Z axis where the line goes around it: no frame that turns on its own.
    aside = np.cross(along, [0.0, 0.0, 1.0])
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    up = np.cross(aside, along)
    turn = np.linspace(0, 2 * np.pi, across + 1)[None, :, None]
    normals = np.cos(turn) * aside[:, None] + np.sin(turn) * up[:, None]
    positions = line(t)[:, None] + radius * normals
    u, v = np.meshgrid(np.linspace(0, 1, around + 1), np.linspace(0, 1, across + 1), indexing="ij")
    first = (np.arange(around)[:, None] * (across + 1) + np.arange(across)[None]).ravel()
    quads = np.stack([first, first + across + 1, first + across + 2, first + 1], axis=1)
    values = positions.reshape(-1, 3), normals.reshape(-1, 3), np.stack([u, v], -1).reshape(-1, 2)
    return *(rounded(part) for part in values), quads


def rounded(values: np.ndarray) -> np.ndarray:
    """To four digits behind the point, without -0: the same on every machine."""
    return np.round(values, 4) + 0.0


def ring(t: np.ndarray) -> np.ndarray:
    """A circle that faces the cameras."""
    return RING_MM[0] * np.stack([np.cos(t), np.sin(t), 0 * t], axis=1)


def knot(t: np.ndarray) -> np.ndarray:
    """A trefoil knot."""
    x, y = np.sin(t) + 2 * np.sin(2 * t), np.cos(t) - 2 * np.cos(2 * t)
    return KNOT_MM[0] * np.stack([x, y, -np.sin(3 * t)], axis=1)


def gear() -> tuple[np.ndarray, list[list[int]]]:
    """Positions (N, 3) and quads of a gear wheel with a hole, its axis along Z."""
    root, tip, hole, half = GEAR_CM
    step = 2 * math.pi / TEETH
    corners = [
        (radius, step * (tooth + part))
        for tooth in range(TEETH)
        for radius, part in ((root, -0.28), (tip, -0.16), (tip, 0.16), (root, 0.28))
    ]
    rim = [(radius * math.cos(angle), radius * math.sin(angle)) for radius, angle in corners]
    bore = [(hole * math.cos(angle), hole * math.sin(angle)) for _, angle in corners]
    positions = rounded(np.array([(x, y, z) for z in (-half, half) for line in (rim, bore) for x, y in line]))
    n = len(rim)
    quads = []
    for here in range(n):
        there = (here + 1) % n
        quads += [
            [here, n + here, n + there, there],  # front
            [2 * n + here, 2 * n + there, 3 * n + there, 3 * n + here],  # back
            [here, there, 2 * n + there, 2 * n + here],  # rim
            [n + here, 3 * n + here, 3 * n + there, n + there],  # hole
        ]
    return positions, quads


def obj_of_tube(positions: np.ndarray, normals: np.ndarray, texcoords: np.ndarray, quads: np.ndarray) -> str:
    """As Wavefront OBJ, indices from 1."""
    lines = [f"v {x:g} {y:g} {z:g}" for x, y, z in positions]
    lines += [f"vt {u:g} {v:g}" for u, v in texcoords]
    lines += [f"vn {x:g} {y:g} {z:g}" for x, y, z in normals]
    lines += ["f " + " ".join(f"{i}/{i}/{i}" for i in quad) for quad in quads + 1]
    return "\n".join(lines) + "\n"


def obj_of_gear(positions: np.ndarray, quads: list[list[int]]) -> str:
    """Positions and faces alone: flat faces, no texture."""
    lines = [f"v {x:g} {y:g} {z:g}" for x, y, z in positions]
    lines += ["f " + " ".join(str(i + 1) for i in quad) for quad in quads]
    return "\n".join(lines) + "\n"


def ply_of_tube(
    positions: np.ndarray, normals: np.ndarray, texcoords: np.ndarray, quads: np.ndarray
) -> bytes:
    """As binary PLY."""
    properties = "".join(f"property float {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz", "s", "t"))
    head = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(positions)}\n{properties}"
        f"element face {len(quads)}\nproperty list uchar ushort vertex_indices\nend_header\n"
    )
    vertices = np.concatenate([positions, normals, texcoords], axis=1).astype("<f4")
    faces = np.empty(len(quads), dtype=[("corners", "u1"), ("index", "<u2", 4)])
    faces["corners"], faces["index"] = 4, quads
    return head.encode("ascii") + vertices.tobytes() + faces.tobytes()


def main(folder: Path = HERE) -> None:
    """Write the meshes into the folder."""
    (folder / "ring.obj").write_text(obj_of_tube(*tube(ring, RING_MM[1], 48, 14)))
    (folder / "gear.obj").write_text(obj_of_gear(*gear()))
    (folder / "knot.ply").write_bytes(ply_of_tube(*tube(knot, KNOT_MM[1], 96, 12)))


if __name__ == "__main__":
    main()
