"""Make sky.exr, the light of an afternoon outdoors from all around: run it without arguments."""

from pathlib import Path

import numpy as np
import OpenEXR

HERE = Path(__file__).resolve().parent
WIDTH, HEIGHT = 256, 128
SUN_DEG = (-130.0, 40.0)
"""Longitude from straight ahead to the right, and height: behind the cameras to the left."""
SUN_WIDTH_DEG = 6.0
"""Much wider than the real sun's, so that its shadows are soft and few samples find it."""


def sky() -> np.ndarray:
    """Radiance (H, W, 3), float16, linear sRGB; 1 is the luminance of white that the scene states."""
    height_deg = (90 - (np.arange(HEIGHT) + 0.5) * 180 / HEIGHT)[:, None]
    longitude_deg = ((np.arange(WIDTH) + 0.5) * 360 / WIDTH - 180)[None]
    up = np.clip(height_deg / 90, 0, 1)[..., None] ** 0.6
    picture = (1 - up) * [0.9, 0.9, 0.85] + up * [0.2, 0.35, 0.75]

    # Trees all around, higher than the cameras look, and the ground below.
    turn = np.radians(longitude_deg)
    tops_deg = 24 + 1.5 * np.sin(9 * turn) + 0.8 * np.sin(23 * turn + 1)
    crowns = 1 + 0.3 * np.sin(37 * turn) + 0.3 * np.sin(71 * turn + 2) * np.sin(np.radians(9 * height_deg))
    trees = (crowns * (0.3 + np.clip(height_deg / 24, 0, 1)))[..., None] * [0.012, 0.02, 0.007]
    hidden = 1 / (1 + np.exp((height_deg - tops_deg) / 0.6))
    picture = picture + hidden[..., None] * (trees - picture)
    below = 1 / (1 + np.exp(height_deg / 0.6))
    picture = picture + below[..., None] * (np.array([0.05, 0.06, 0.03]) - picture)

    heights, suns = np.radians(height_deg), np.radians(SUN_DEG)
    cosine = np.sin(heights) * np.sin(suns[1])
    cosine = cosine + np.cos(heights) * np.cos(suns[1]) * np.cos(turn - suns[0])
    away_deg = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    sun = np.exp(-((away_deg / SUN_WIDTH_DEG) ** 2))
    return (picture + sun[..., None] * [60.0, 54.0, 44.0]).astype(np.float16)


def main(folder: Path = HERE) -> None:
    """Write the environment into the folder."""
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, {"RGB": sky()}) as file:
        file.write(str(folder / "sky.exr"))


if __name__ == "__main__":
    main()
