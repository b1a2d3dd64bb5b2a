"""Images of what shines from all around, turned with the scene."""

import numpy as np

from simgen.importing.foreign_scene import Surroundings

UPRIGHT = 1e-6


def turned(surroundings: Surroundings, rotation: np.ndarray) -> tuple[np.ndarray, float]:
    """The image (H, 2 H, 3) and by how many degrees it is turned to the right, in a world that is `rotation`
    (3, 3) of the file's axes.

    If it stays upright its pixels are as they were; otherwise they are interpolated.
    """
    turn = rotation @ surroundings.matrix[:3, :3]
    if turn[1, 1] > 1 - UPRIGHT:
        return surroundings.pixels, round(float(np.degrees(np.arctan2(turn[0, 2], turn[2, 2]))), 9) + 0.0
    return _rotated(surroundings.pixels, turn), 0.0


def _rotated(pixels: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """The image after the rotation `turn` (3, 3) of its directions.

    Rows lie at polar angles from 0 to pi, columns in the middle of equal parts of the circle.
    """
    from scipy.ndimage import map_coordinates

    height, width = pixels.shape[:2]
    polar = np.linspace(0, np.pi, height)[:, None]
    longitude = ((np.arange(width) + 0.5) / width - 0.5) * 2 * np.pi
    across = np.sin(polar)
    direction = np.stack(
        np.broadcast_arrays(across * np.sin(longitude), -np.cos(polar), across * np.cos(longitude)), axis=-1
    )
    x, y, z = np.moveaxis(direction @ turn, -1, 0)  # the inverse of the turn, of rows
    row = np.arccos(np.clip(-y, -1, 1)) / np.pi * (height - 1)
    col = (np.arctan2(x, z) / (2 * np.pi) + 0.5) * width - 0.5
    closed = np.concatenate([pixels[:, -1:], pixels, pixels[:, :1]], axis=1)
    channels = [
        map_coordinates(closed[..., channel], [row, col + 1], order=1, mode="nearest")
        for channel in range(pixels.shape[2])
    ]
    return np.stack(channels, axis=-1).astype(np.float32)
