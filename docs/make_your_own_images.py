"""Pictures of the guide docs/your_own_images.md: `python docs/make_your_own_images.py FOLDER`.

Writes FOLDER/photos, 5 x 5 photographs of a wall at 190 mm, a ring at 90 mm and a star at 45 mm, and
FOLDER/lenses.png, a lens array's picture of a model of them, a quarter as large. Then it imports both as the
guide does and draws docs/your_own_images.jpg beside itself.
"""

import sys
from collections.abc import Iterator
from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("Agg")
from matplotlib import pyplot as plt

import pcii
from pcii.base import linear_to_srgb
from pcii.figures import to_srgb8, white_level, write_png

WALL_MM, RING_MM, STAR_MM = 190.0, 90.0, 45.0
Panels = Iterator[tuple[float, np.ndarray]]
SAMPLES = 2  # per pixel and axis


def light(x: np.ndarray, y: np.ndarray, rays: np.ndarray) -> np.ndarray:
    """Linear light (H, W, 3) of rays from (x, y) at Z = 0 that go `rays` (H, W, 2) mm per mm of Z."""

    def at(z_mm: float) -> tuple[np.ndarray, np.ndarray]:
        return x + rays[..., 0] * z_mm, y + rays[..., 1] * z_mm

    X, Y = at(WALL_MM)
    bricks = (np.floor(X / 14 + np.floor(Y / 9) / 2) * 7 + np.floor(Y / 9) * 13) % 11 / 11
    mortar = (((X / 14 + np.floor(Y / 9) / 2) % 1) < 0.08) | ((Y / 9) % 1 < 0.1)
    image = np.array([0.16, 0.07, 0.05]) * (0.5 + bricks)[..., None]
    image[mortar] = 0.25
    X, Y = at(RING_MM)
    radius, angle = np.hypot(X + 18, Y - 2), np.arctan2(Y - 2, X + 18)
    ring = (radius > 9) & (radius < 19)
    stripes = np.sign(np.sin(12 * angle) * np.sin(1.6 * radius)) > 0
    image[ring] = np.where(stripes[..., None], [0.9, 0.75, 0.1], [0.05, 0.2, 0.6])[ring]
    X, Y = at(STAR_MM)
    radius, angle = np.hypot(X - 9, Y + 1), np.arctan2(Y + 1, X - 9)
    star = radius < 7.5 + 2.5 * np.cos(5 * angle)
    checks = (np.floor(X / 1.7) + np.floor(Y / 1.7)) % 2 > 0
    image[star] = np.where(checks[..., None], [0.1, 0.7, 0.35], [0.9, 0.9, 0.85])[star]
    return image


def photograph(grid: pcii.CameraGrid, k: int, l: int, scale: float = 1.0) -> np.ndarray:
    """What camera (k, l) of the grid sees, 8-bit sRGB (H, W, 3), of a model of the scene of this scale."""
    H, W = grid.height * SAMPLES, grid.width * SAMPLES
    pixel = grid.pixel_mm / SAMPLES
    rays = np.stack(np.meshgrid(np.arange(W) - (W - 1) / 2, np.arange(H) - (H - 1) / 2), axis=-1)
    x = (l - (grid.cols - 1) / 2) * grid.pitch_mm[0] / scale
    y = (k - (grid.rows - 1) / 2) * grid.pitch_mm[1] / scale
    fine = light(np.array(x), np.array(y), rays * pixel / grid.focal_mm)
    linear = fine.reshape(grid.height, SAMPLES, grid.width, SAMPLES, 3).mean(axis=(1, 3))
    return np.round(255 * linear_to_srgb(linear)).astype(np.uint8)


def sections(images: pcii.Views | pcii.PhotonCounts, z_mm: tuple[float, ...], pool_px: int = 1) -> Panels:
    """The depth of each section, and a picture of it averaged over cells of `pool_px`."""
    for z, image in zip(z_mm, pcii.reconstruct(images, z_mm).estimate, strict=True):
        H, W = (size // pool_px * pool_px for size in image.shape[:2])
        cells = image[:H, :W].reshape(H // pool_px, pool_px, W // pool_px, pool_px, 3).mean(axis=(1, 3))
        yield z, to_srgb8(cells, white_level(cells))


def main(folder: Path) -> None:
    """Write the photographs and the picture of the guide."""
    (folder / "photos").mkdir(parents=True, exist_ok=True)
    optics = pcii.Optics(pitch_mm=(2, 2), focal_mm=35, sensor_mm=36)
    cameras = optics.grid((5, 5, 480, 640))
    for k, l in np.ndindex(5, 5):
        write_png(folder / "photos" / f"{l}_{k}.png", photograph(cameras, k, l))
    lens = pcii.CameraGrid(
        rows=12, cols=12, pitch_mm=(0.6, 0.6), focal_mm=0.8, pixel_mm=0.01, height=60, width=60
    )
    tiles = [[photograph(lens, k, l, scale=0.25)[::-1, ::-1] for l in range(12)] for k in range(12)]
    write_png(folder / "lenses.png", np.vstack([np.hstack(row) for row in tiles]))

    views = pcii.import_images(folder / "photos", "{col}_{row}.png", optics)
    z_mm = pcii.check_grid(views, (30, 200)).z_mm
    counts = pcii.limit_photons(views, 1000, seed=1, cfa="GRBG")
    focus = pcii.segment(counts, z_mm)
    array = pcii.LensArray(rows=12, cols=12, pitch_px=(60, 60), inverted=True)
    close = pcii.Optics(pitch_mm=(0.6, 0.6), focal_mm=0.8, pixel_mm=0.01)
    lenses = pcii.import_lens_array(folder / "lenses.png", array, close)
    z_near = pcii.check_grid(lenses, (7, 60)).z_mm[:2]
    part = plt.imread(folder / "lenses.png")[300:420, 300:420]
    shown = [(f"photographs, {z:.3g} mm", image) for z, image in sections(views, z_mm)]
    shown += [(f"1000 photons each, {z:.3g} mm", image) for z, image in sections(counts, z_mm, 8)]
    shown += [(f"in focus, {z:.3g} mm", mask) for z, mask in zip(z_mm, focus.in_focus, strict=True)]
    shown += [("four of the 12 x 12 lens images", part)]
    shown += [(f"lens array, {z:.3g} mm", image) for z, image in sections(lenses, z_near)]
    figure, axes = plt.subplots(len(shown) // 3, 3, figsize=(7.2, 7.6), layout="constrained")
    for axis, (title, image) in zip(axes.flat, shown, strict=True):
        axis.imshow(image, cmap="gray")
        axis.set(xticks=[], yticks=[])
        axis.set_title(title, fontsize=8, pad=2)
    figure.savefig(Path(__file__).with_name("your_own_images.jpg"), dpi=95, pil_kwargs={"quality": 72})


if __name__ == "__main__":
    main(Path(sys.argv[1]))
