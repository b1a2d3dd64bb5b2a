"""How wrong sections and demosaiced images are, and what that takes.

Sections of a textured plane whose views and truth are known in closed form, and of a rendered card; images
demosaiced at full light and from few photons.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.photons import setup_of
from benchmarks.timing import timed
from pcii.core.bayer import mosaic
from pcii.core.camera_grid import CameraGrid
from pcii.core.images import Views
from pcii.core.section_stack import Sections
from pcii.sections.demosaicing import METHODS, demosaic
from pcii.sections.reconstruction import reconstruct
from simgen.renderer import backend
from simgen.renderer.mitsuba_scene import RenderScene, build
from simgen.renderer.radiance import render_view
from simgen.spec.recipe import load_recipe
from simgen.spec.scene import Scene, load_scene

CFA = "GRBG"
SIDE_PX = 512
DISPARITIES_PX = (13.0, 13.15, 13.3, 13.5)
BORDER_PX = 80
PHOTONS = (1, 10, 100)


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
        self.strength *= 0.15 / np.sqrt((self.strength**2).sum(axis=0) / 2)

    def seen_at(self, row_px: np.ndarray, col_px: np.ndarray) -> np.ndarray:
        """What pixels about these rows (H,) and columns (W,) see: (H, W, 3), mean 0.5, contrast 0.15."""
        down = np.exp(2j * np.pi * np.outer(row_px, self.down) + 1j * self.phase)
        across = np.exp(2j * np.pi * np.outer(col_px, self.across))
        colours = [((down * own) @ across.T).real for own in self.strength.T]
        return 0.5 + np.stack(colours, axis=-1)


def plane_views(texture: Texture, disparity_px: float) -> Views:
    """100 mosaics of the plane, whose disparity this is."""
    grid = CameraGrid(
        rows=10,
        cols=10,
        pitch_mm=(disparity_px, disparity_px),
        focal_mm=1.0,
        pixel_mm=1.0,
        height=SIDE_PX,
        width=SIDE_PX,
    )
    pixels, images = np.arange(SIDE_PX), np.empty((*grid.shape_KLHW, 1), dtype=np.float32)
    for k, l in np.ndindex(10, 10):
        rows, cols = pixels + (k - 4.5) * disparity_px, pixels + (l - 4.5) * disparity_px
        images[k, l, ..., 0] = mosaic(texture.seen_at(rows, cols), CFA)
    return Views(images, grid, CFA)


def table() -> Iterator[str]:
    """The tables, line by line as they are measured."""
    yield from _planes()
    yield ""
    yield from _card()
    yield ""
    yield from _demosaicing()


def _ways(views: Views, z_mm: float) -> Iterator[tuple[str, float, int, np.ndarray]]:
    """Each way to make a section: its name, seconds, voxels per pixel and axis, and colours (H, W, 3)."""
    ways: dict[str, dict[str, Any]] = {
        "nearest": {},
        "bilinear": {"shifts": "bilinear"},
        "2 x 2 subpixels": {"subpixel": 2},
        "even, then Laroche-Prescott": {"shifts": "even"},
    }
    for name, options in ways.items():
        seconds, found = timed(lambda _, options=options: _colours(reconstruct(views, z_mm, **options)))
        yield name, seconds, found.shape[0] // SIDE_PX, found


def _colours(sections: Sections) -> np.ndarray:
    """The estimate (H, W, 3), NaN where no sample is."""
    if sections.cfa is not None:
        return demosaic(sections.estimate[0, ..., 0], cfa=sections.cfa)
    return np.where(sections.coverage[0] > 0, sections.estimate[0], np.nan)


def _planes() -> Iterator[str]:
    texture = Texture()
    yield f"sections of a textured plane, 100 mosaics of {SIDE_PX} x {SIDE_PX}, error against closed form"
    yield ""
    yield "| disparity in px | shifts | ms | RMS error, % of contrast | voxels with a sample |"
    yield "|---|---|---|---|---|"
    for disparity in DISPARITIES_PX:
        views = plane_views(texture, disparity)
        for name, seconds, M, found in _ways(views, 1.0):
            centres = (np.arange(SIDE_PX * M) + 0.5) / M - 0.5
            error, covered = _error(found, texture.seen_at(centres, centres), BORDER_PX * M)
            yield (
                f"| {disparity} | {name} | {1e3 * seconds:.1f} | {100 * error / 0.15:.1f} | {covered:.1%} |"
            )


def _error(found: np.ndarray, truth: np.ndarray, border_px: int) -> tuple[float, float]:
    """Root mean square error inside the border, and the share of voxels that have an answer."""
    inner = slice(border_px, -border_px)
    difference = (found - truth)[inner, inner]
    return float(np.sqrt(np.nanmean(difference**2))), float(np.isfinite(difference).mean())


def _card() -> Iterator[str]:
    """A rendered card: its views have 16 samples a pixel, the truth 1024."""
    card = {
        "name": "card",
        "position_mm": (0.0, 0.0, 600.0),
        "shape": {"type": "card", "width_mm": 500.0, "height_mm": 500.0},
        "material": {"texture": "ball.png"},
    }
    light = {"type": "uniform", "luminance_cd_m2": 100.0}
    _, folder = load_scene("two_objects")
    scene = Scene.model_validate({"title": "card", "objects": [card], "lights": [light]})
    built = build(backend.load(), scene, folder, 2)
    grid = CameraGrid(
        rows=10, cols=10, pitch_mm=(5.0, 5.0), focal_mm=50.0, pixel_mm=0.0704, height=512, width=512
    )
    images = np.empty((*grid.shape_KLHW, 1), dtype=np.float32)
    for k, l in np.ndindex(10, 10):
        seen = render_view(built, grid, k, l, samples_per_pixel=16, seed=1 + 10 * k + l)
        images[k, l, ..., 0] = mosaic(seen, CFA)
    truth = _centre_view(built, grid, 1024)
    contrast = truth[BORDER_PX:-BORDER_PX, BORDER_PX:-BORDER_PX].std()
    yield "sections of a rendered card at 600 mm (disparity 5.92 px), 100 mosaics of 512 x 512, 16 samples"
    yield ""
    yield "| shifts | ms | RMS error, % of contrast |"
    yield "|---|---|---|"
    for name, seconds, M, found in _ways(Views(images, grid, CFA), 600.0):
        if M > 1:  # the truth is known per pixel
            fine = found.reshape(SIDE_PX, M, SIDE_PX, M, 3)
            known = np.isfinite(fine).sum(axis=(1, 3))
            found = np.where(known > 0, np.nansum(fine, axis=(1, 3)) / np.maximum(known, 1), np.nan)
        error, _ = _error(found, truth, BORDER_PX)
        yield f"| {name} | {1e3 * seconds:.1f} | {100 * error / contrast:.1f} |"


def _centre_view(built: RenderScene, grid: CameraGrid, samples: int) -> np.ndarray:
    centre = replace(grid, rows=1, cols=1)
    return render_view(built, centre, 0, 0, samples_per_pixel=samples, seed=7).astype(np.float64)


def _demosaicing() -> Iterator[str]:
    recipe, _ = load_recipe("paper")
    setup = setup_of(recipe)
    grid = replace(setup.grid, height=SIDE_PX, width=SIDE_PX)
    rendered = _centre_view(setup.render_scene, grid, 512)
    pixels = np.arange(SIDE_PX)
    pictures = {
        "textured plane": Texture().seen_at(pixels, pixels),
        "two objects, rendered": rendered / np.quantile(rendered, 0.99),
    }
    yield f"demosaicing {SIDE_PX} x {SIDE_PX}: CPSNR in dB and mean CIEDE2000"
    yield ""
    yield "| picture | photons per pixel of brightness 1 | " + " | ".join(METHODS) + " |"
    yield "|---" * (2 + len(METHODS)) + "|"
    for name, picture in pictures.items():
        truth = np.clip(picture, 0, 1)
        raw = mosaic(truth, CFA)
        for photons in (None, *PHOTONS[::-1]):
            seen = raw if photons is None else np.random.default_rng(1).poisson(photons * raw) / photons
            cells = []
            for method in METHODS:
                found = demosaic(seen, cfa=CFA, method=method)
                psnr = -10 * np.log10(((found - truth) ** 2).mean())
                cells.append(f"{psnr:.1f} / {_ciede2000(found, truth):.1f}")
            yield f"| {name} | {photons or 'full light'} | " + " | ".join(cells) + " |"


def _ciede2000(found: np.ndarray, truth: np.ndarray) -> float:
    """Mean colour difference of two linear sRGB images, what is beyond the screen clipped."""
    import colour

    space = colour.RGB_COLOURSPACES["sRGB"]
    white = space.whitepoint
    one, other = (
        colour.XYZ_to_Lab(np.clip(rgb, 0, 1) @ space.matrix_RGB_to_XYZ.T, white) for rgb in (found, truth)
    )
    return float(np.mean(colour.delta_E(one, other, method="CIE 2000")))
