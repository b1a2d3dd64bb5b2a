"""Scenes in colours or in spectra: what one small camera sees of them, dense or photon by photon."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pcii.store import write_exr_safely
from pcii.types import CameraGrid, colour_index, mosaic
from simgen.photons import Capture, thin_photons
from simgen.renderer import RenderScene, backend, build, render_view
from simgen.sensor import PhotonTable, sensitivities
from simgen.spec import Photons, Recipe, Scene

CAMERA = "Nikon 5100 (NPL)"
SCALAR = backend.choose().kind == "scalar"
SKY = "sky.exr"


def film(height: int = 32, width: int = 32, focal_mm: float = 50.0) -> CameraGrid:
    """One camera with pixels of 1 mm."""
    return CameraGrid(
        rows=1, cols=1, pitch_mm=(1, 1), focal_mm=focal_mm, pixel_mm=1.0, height=height, width=width
    )


def thing(name: str, x_mm: float, y_mm: float, z_mm: float, material: dict, **shape: Any) -> dict[str, Any]:
    return {"name": name, "position_mm": (x_mm, y_mm, z_mm), "shape": shape, "material": material}


def card(z_mm: float, size_mm: float, material: dict[str, Any]) -> dict[str, Any]:
    return thing("card", 0.0, 0.0, z_mm, material, type="card", width_mm=size_mm, height_mm=size_mm)


def made(
    objects: Sequence[dict],
    lights: Sequence[dict],
    *,
    spectral: bool = False,
    max_depth: int = 2,
    folder: Path = Path(),
    **more: Any,
) -> RenderScene:
    values = {"title": "test", "objects": list(objects), "lights": list(lights), **more}
    mi, curves = backend.load(spectral=spectral), None
    if spectral:
        grid = {"rows": 1, "cols": 1, "height": 2, "width": 2}
        recipe = Recipe.model_validate({"scene": "-", "grid": grid, "sensor": {"camera": CAMERA}})
        curves = sensitivities(recipe.sensor, Path())
    return build(mi, Scene.model_validate(values), folder, max_depth, curves)


def white(built: RenderScene) -> np.ndarray:
    """What pixels of each colour see of a luminance of 1 of the scene's light, (3,)."""
    return np.ones(3) if built.filters is None else built.filters.white


def seen(built: RenderScene, grid: CameraGrid, samples: int, seed: int = 1) -> np.ndarray:
    """Radiance (H, W, 3), float64, of which 1 is that of the scene's light at luminance 1."""
    view = render_view(built, grid, 0, 0, samples_per_pixel=samples, seed=seed)
    return view.astype(np.float64) / white(built)


def thinned(
    built: RenderScene, grid: CameraGrid, gain: float, seed: int = 1
) -> tuple[PhotonTable, dict[str, Any]]:
    """Photons, `gain` for each unit of radiance, and a log of how they were drawn."""
    return thin_photons(Capture(built, grid, "GRBG", Photons(scope="exposure"), gain, seed))


def surprise(
    photons: PhotonTable, radiance: np.ndarray, grid: CameraGrid, gain: float, block_px: int = 4
) -> float:
    """By how many deviations chi-square of counts exceeds its mean, for rates of gain times a view.

    Blocks of each colour, but those where less than five photons are expected, are compared.
    """
    counts, rates = np.zeros((grid.height, grid.width)), gain * mosaic(radiance, "GRBG")
    np.add.at(counts, (photons.i, photons.j), 1)
    colours = colour_index(grid.height, grid.width, "GRBG")
    found, expected = (
        np.concatenate([on_blocks(values * (colours == colour), block_px).ravel() for colour in range(3)])
        for values in (counts, rates)
    )
    enough = expected >= 5
    score = ((found - expected)[enough] ** 2 / expected[enough]).sum()
    # Of a Poisson number of mean m the square of the deviate varies by 2 + 1 / m.
    return float((score - enough.sum()) / np.sqrt((2 + 1 / expected[enough]).sum()))


def on_blocks(pixels: np.ndarray, side_px: int) -> np.ndarray:
    height, width = pixels.shape
    return pixels.reshape(height // side_px, side_px, width // side_px, side_px).sum(axis=(1, 3))


def sky(folder: Path, pixels: np.ndarray, **light: Any) -> dict[str, Any]:
    """An environment light of these pixels (H, W, 3)."""
    write_exr_safely(folder / SKY, pixels.astype(np.float32))
    return {"type": "environment", "file": SKY, "luminance_cd_m2": 1.0, **light}
