"""Draw docs/textures.jpg, a tile of each texture: `python docs/make_textures_picture.py`."""

from pathlib import Path

import numpy as np
from PIL import Image

from simgen.assets import paint
from simgen.spec import Checks, Edge, Noise, Star, Stripes, Text

TILE_PX, GAP_PX = 180, 8
BLUE, YELLOW = (0.1, 0.25, 0.6), (0.95, 0.8, 0.3)
TILES = (
    Checks(rows=6, columns=6, pixels=TILE_PX),
    Stripes(periods=6, angle_deg=30, colours=(BLUE, YELLOW), pixels=TILE_PX),
    Star(pixels=TILE_PX, spokes=24),
    Edge(pixels=TILE_PX),
    Text(text="pcii", pixels=TILE_PX, colours=(YELLOW, BLUE)),
    Noise(pixels=TILE_PX, contrast=0.35),
    Noise(pixels=TILE_PX, exponent=1.5, contrast=0.35, chroma=0.5, seed=3),
)


def main() -> None:
    """Write the picture beside this script."""
    gap = np.ones((TILE_PX, GAP_PX, 3), np.float32)
    row = np.concatenate([part for tile in TILES for part in (paint(tile, 1.0), gap)][:-1], axis=1)
    srgb = np.where(row <= 0.0031308, 12.92 * row, 1.055 * row ** (1 / 2.4) - 0.055)
    file = Path(__file__).with_name("textures.jpg")
    Image.fromarray(np.rint(255 * srgb).astype(np.uint8)).save(file, quality=80)


if __name__ == "__main__":
    main()
