"""Make relief.png and glaze.png of the tiles: run it without arguments."""

from pathlib import Path

import numpy as np
from PIL import Image

HERE = Path(__file__).resolve().parent
SIDE_PX, TILES = 512, 8
JOINT_PX, HEIGHT_PX = 8, 5.0
"""Tiles are pillows that fall by this height towards the joints between them."""


def heights() -> np.ndarray:
    """How far the surface stands out (H, W), in pixels."""
    place = np.arange(SIDE_PX) % (SIDE_PX // TILES) + 0.5
    from_joint = np.minimum(place, SIDE_PX // TILES - place) - JOINT_PX / 2
    slope = np.clip(from_joint / JOINT_PX, 0, 1)
    return HEIGHT_PX * np.minimum.outer(slope, slope)


def relief() -> np.ndarray:
    """Normals as an image: red to the right, green up, blue out of it."""
    down, right = np.gradient(heights())
    normal = np.stack([-right, down, np.ones_like(down)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    return np.round((normal + 1) / 2 * 255).astype(np.uint8)


def glaze() -> np.ndarray:
    """Roughness: every other tile is glossy, joints are dull."""
    i, j = np.indices((SIDE_PX, SIDE_PX)) // (SIDE_PX // TILES)
    roughness = np.where((i + j) % 2, 0.25, 0.7)
    return np.round(np.where(heights() > 0, roughness, 0.9) * 255).astype(np.uint8)


def main(folder: Path = HERE) -> None:
    """Write both images into the folder."""
    Image.fromarray(relief()).save(folder / "relief.png", optimize=True)
    Image.fromarray(glaze()).save(folder / "glaze.png", optimize=True)


if __name__ == "__main__":
    main()
