"""Pictures whose every pixel is known in closed form, and views of a plane that shows one."""

from collections.abc import Sequence

import numpy as np

from pcii.types.bayer import mosaic
from pcii.types.camera_grid import CameraGrid
from pcii.types.images import Views

CONTRAST = 0.15
"""Standard deviation of the texture, about a mean of 0.5."""


class Texture:
    """Colours of a plane as the virtual centre sees them: waves whose strength falls with frequency."""

    def __init__(self, waves: int = 200, highest_per_px: float = 0.4) -> None:
        rng = np.random.default_rng(0)
        frequency = np.exp(rng.uniform(np.log(0.004), np.log(highest_per_px), waves))
        turn = rng.uniform(0, 2 * np.pi, waves)
        self.across, self.down = frequency * np.cos(turn), frequency * np.sin(turn)
        self.phase = rng.uniform(0, 2 * np.pi, waves)
        # Colours go together as those of most things do.
        self.strength = rng.normal(size=(waves, 1)) + 0.4 * rng.normal(size=(waves, 3))
        self.strength *= frequency[:, None] ** -0.5
        # A pixel sees the mean over its square.
        self.strength *= (np.sinc(self.across) * np.sinc(self.down))[:, None]
        self.strength *= CONTRAST / np.sqrt((self.strength**2).sum(axis=0) / 2)

    def seen_at(self, row_px: np.ndarray, col_px: np.ndarray) -> np.ndarray:
        """What pixels about these rows (H,) and columns (W,) see: (H, W, 3), mean 0.5."""
        down = np.exp(2j * np.pi * np.outer(row_px, self.down) + 1j * self.phase)
        across = np.exp(2j * np.pi * np.outer(col_px, self.across))
        colours = [((down * own) @ across.T).real for own in self.strength.T]
        return 0.5 + np.stack(colours, axis=-1)


def plane_views(
    texture: Texture, disparity_px: float, side_px: int, cfas: Sequence[str | None]
) -> list[Views]:
    """100 images of the plane of this disparity at 1 mm: mosaics for each pattern, its green for None."""
    grid = CameraGrid(
        rows=10,
        cols=10,
        pitch_mm=(disparity_px, disparity_px),
        focal_mm=1.0,
        pixel_mm=1.0,
        height=side_px,
        width=side_px,
    )
    pixels, images = np.arange(side_px), np.empty((len(cfas), *grid.shape_KLHW, 1), dtype=np.float32)
    for k, l in np.ndindex(10, 10):
        seen = texture.seen_at(pixels + (k - 4.5) * disparity_px, pixels + (l - 4.5) * disparity_px)
        for own, cfa in zip(images, cfas, strict=True):
            own[k, l, ..., 0] = seen[..., 1] if cfa is None else mosaic(seen, cfa)
    return [Views(own, grid, cfa) for own, cfa in zip(images, cfas, strict=True)]
