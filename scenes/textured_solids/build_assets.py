"""Make cone.ply, an upright cone: run it without arguments.

Axes as in scenes: X right, Y down, Z away from the cameras.
"""

import math
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
RADIUS_MM, HEIGHT_MM = 46.0, 120.0
AROUND = 72
"""Faces of the side."""


def cone() -> tuple[np.ndarray, np.ndarray]:
    """Vertices (N, 8), each place, normal and texture coordinates, and triangles (M, 3).

    The origin is halfway up the axis. The texture goes once around: its middle in front, its seam behind.
    """
    turn = np.linspace(0, 2 * math.pi, AROUND + 1)  # from behind, over the left
    across, away = -np.sin(turn), np.cos(turn)
    share = np.linspace(0, 1, AROUND + 1)
    slope = math.hypot(RADIUS_MM, HEIGHT_MM)
    normals = np.stack([HEIGHT_MM * across, np.full_like(turn, -RADIUS_MM), HEIGHT_MM * away], axis=1) / slope
    foot = np.stack([RADIUS_MM * across, np.full_like(turn, HEIGHT_MM / 2), RADIUS_MM * away], axis=1)
    tip = np.broadcast_to([0.0, -HEIGHT_MM / 2, 0.0], foot.shape)
    down = np.broadcast_to([0.0, 1.0, 0.0], foot.shape)
    disc = np.stack([0.5 - across / 2, 0.5 - away / 2], axis=1)
    rows = [
        np.column_stack([foot, normals, share, np.zeros_like(share)]),
        np.column_stack([tip, normals, share, np.ones_like(share)]),
        np.column_stack([foot, down, disc]),
        np.array([[0.0, HEIGHT_MM / 2, 0.0, 0.0, 1.0, 0.0, 0.5, 0.5]]),
    ]
    vertices = np.round(np.concatenate(rows), 4) + 0.0  # without -0: the same on every machine
    here, n = np.arange(AROUND), AROUND + 1
    side = np.stack([here, n + here, here + 1], axis=1)
    bottom = np.stack([2 * n + here, 2 * n + here + 1, np.full_like(here, 3 * n)], axis=1)
    return vertices, np.concatenate([side, bottom])


def ply(vertices: np.ndarray, triangles: np.ndarray) -> bytes:
    """As binary PLY."""
    properties = "".join(f"property float {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz", "s", "t"))
    head = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n{properties}"
        f"element face {len(triangles)}\nproperty list uchar ushort vertex_indices\nend_header\n"
    )
    faces = np.empty(len(triangles), dtype=[("corners", "u1"), ("index", "<u2", 3)])
    faces["corners"], faces["index"] = 3, triangles
    return head.encode("ascii") + vertices.astype("<f4").tobytes() + faces.tobytes()


def main(folder: Path = HERE) -> None:
    """Write the mesh into the folder."""
    (folder / "cone.ply").write_bytes(ply(*cone()))


if __name__ == "__main__":
    main()
