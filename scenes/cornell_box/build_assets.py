"""Make the meshes of the Cornell box by its published measures.

Cornell University Program of Computer Graphics, "The Cornell Box: Data", 1998: corners in mm with Y up. The
spectra of paints and lamp, here every 20 nm, are in scene.toml. Run the script without arguments: it writes
the PLY meshes beside itself.
"""

from pathlib import Path

import numpy as np

from simgen.assets import Triangles, ply_bytes

Quad = list[tuple[float, float, float]]
SHORT: list[Quad] = [
    [(130, 165, 65), (82, 165, 225), (240, 165, 272), (290, 165, 114)],
    [(290, 0, 114), (290, 165, 114), (240, 165, 272), (240, 0, 272)],
    [(130, 0, 65), (130, 165, 65), (290, 165, 114), (290, 0, 114)],
    [(82, 0, 225), (82, 165, 225), (130, 165, 65), (130, 0, 65)],
    [(240, 0, 272), (240, 165, 272), (82, 165, 225), (82, 0, 225)],
]
TALL: list[Quad] = [
    [(423, 330, 247), (265, 330, 296), (314, 330, 456), (472, 330, 406)],
    [(423, 0, 247), (423, 330, 247), (472, 330, 406), (472, 0, 406)],
    [(472, 0, 406), (472, 330, 406), (314, 330, 456), (314, 0, 456)],
    [(314, 0, 456), (314, 330, 456), (265, 330, 296), (265, 0, 296)],
    [(265, 0, 296), (265, 330, 296), (423, 330, 247), (423, 0, 247)],
]
SURFACES: dict[str, list[Quad]] = {
    "floor": [[(552.8, 0, 0), (0, 0, 0), (0, 0, 559.2), (549.6, 0, 559.2)]],
    "ceiling": [[(556, 548.8, 0), (556, 548.8, 559.2), (0, 548.8, 559.2), (0, 548.8, 0)]],
    "back-wall": [[(549.6, 0, 559.2), (0, 0, 559.2), (0, 548.8, 559.2), (556, 548.8, 559.2)]],
    "right-wall": [[(0, 0, 559.2), (0, 0, 0), (0, 548.8, 0), (0, 548.8, 559.2)]],
    "left-wall": [[(552.8, 0, 0), (549.6, 0, 559.2), (556, 548.8, 559.2), (556, 548.8, 0)]],
    "short-block": SHORT,
    "tall-block": TALL,
    # A millimetre below the ceiling, in which the real one is a hole.
    "lamp": [[(343, 547.8, 227), (343, 547.8, 332), (213, 547.8, 332), (213, 547.8, 227)]],
}


def mesh_of(quads: list[Quad]) -> Triangles:
    """Quadrangles as triangles; normals are those of their two triangles, by the angles at each corner."""
    corners = np.array(quads, dtype=np.float64)
    normals = np.zeros(corners.shape)
    for triangle in ([0, 1, 2], [0, 2, 3]):
        points = corners[:, triangle]
        across = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
        for place, corner in enumerate(triangle):
            one, other = (unit(points[:, (place + step) % 3] - points[:, place]) for step in (1, 2))
            angle = np.arccos((one * other).sum(axis=1, keepdims=True))
            normals[:, corner] += angle * unit(across)
    first = 4 * np.arange(len(quads))[:, None, None]
    faces = (first + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    # Adding 0 turns -0 into 0.
    return Triangles.checked(corners.reshape(-1, 3), faces, unit(normals).reshape(-1, 3) + 0.0, None)


def unit(vectors: np.ndarray) -> np.ndarray:
    """Vectors (N, 3) of length 1."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def main(folder: Path) -> None:
    """Write all meshes."""
    for name, quads in SURFACES.items():
        (folder / f"{name}.ply").write_bytes(ply_bytes(mesh_of(quads)))


if __name__ == "__main__":
    main(Path(__file__).resolve().parent)
