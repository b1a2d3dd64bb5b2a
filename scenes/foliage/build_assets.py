"""Make leaves.ply, many small leaves in a round crown: run it without arguments.

Axes as in scenes: X right, Y down, Z away from the cameras.
"""

import math
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
RINGS, CROWN_MM = 6, 76.0
"""Leaves stand on rings about the axis, up to this radius."""
LENGTH_MM, WIDTH_MM = 24.0, 10.0
DEPTH_MM = 8.0
"""How far middles of leaves lie before or behind the origin, at most."""
AROUND = 16
"""Corners of a leaf."""


def middles() -> np.ndarray:
    """Places (N, 3) of the leaves: rings of 3, 7, 11, ... in turn nearer and farther."""
    places = []
    for ring in range(RINGS):
        count = 3 + 4 * ring
        radius = CROWN_MM * (ring + 0.5) / (RINGS - 0.5)
        for step in range(count):
            angle = 2 * math.pi * (step + 0.37 * ring) / count
            depth = DEPTH_MM * ((5 * step + 3 * ring) % 7 - 3) / 3
            places.append((radius * math.cos(angle), radius * math.sin(angle), depth))
    return np.array(places)


def leaves() -> tuple[np.ndarray, np.ndarray]:
    """Vertices (N, 5), each place and texture coordinates, and polygons (M, AROUND) of their numbers.

    A leaf is a flat ellipse with pointed ends, turned and tilted as by chance, but always the same.
    """
    t = 2 * math.pi * np.arange(AROUND) / AROUND
    outline = np.stack(
        [LENGTH_MM / 2 * np.cos(t), WIDTH_MM / 2 * np.sin(t) * np.abs(np.sin(t)), 0 * t], axis=1
    )
    vertices = []
    for number, place in enumerate(middles()):
        turn, tilt, roll = 2.399963 * number, 0.5 * math.sin(1.7 * number), 0.6 * math.sin(2.9 * number)
        along = np.array([math.cos(turn) * math.cos(tilt), math.sin(turn) * math.cos(tilt), math.sin(tilt)])
        aside = np.array([-math.sin(turn), math.cos(turn), 0.0])
        across = math.cos(roll) * aside + math.sin(roll) * np.cross(along, aside)
        points = place + outline[:, :1] * along + outline[:, 1:2] * across
        # The texture lies over the whole crown as seen from the front, so that no two leaves are alike.
        reach = CROWN_MM + LENGTH_MM
        vertices.append(
            np.column_stack([points, 0.5 + points[:, 0] / (2 * reach), 0.5 - points[:, 1] / (2 * reach)])
        )
    together = np.round(np.concatenate(vertices), 4) + 0.0  # without -0: the same on every machine
    return together, np.arange(len(together)).reshape(-1, AROUND)


def ply(vertices: np.ndarray, polygons: np.ndarray) -> bytes:
    """As binary PLY."""
    properties = "".join(f"property float {name}\n" for name in ("x", "y", "z", "s", "t"))
    head = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n{properties}"
        f"element face {len(polygons)}\nproperty list uchar ushort vertex_indices\nend_header\n"
    )
    faces = np.empty(len(polygons), dtype=[("corners", "u1"), ("index", "<u2", polygons.shape[1])])
    faces["corners"], faces["index"] = polygons.shape[1], polygons
    return head.encode("ascii") + vertices.astype("<f4").tobytes() + faces.tobytes()


def main(folder: Path = HERE) -> None:
    """Write the mesh into the folder."""
    (folder / "leaves.ply").write_bytes(ply(*leaves()))


if __name__ == "__main__":
    main()
