"""Small scenes in colours or in spectra: what cameras see of them, dense or photon by photon."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from photon_statistics import counted

from pcii import Optics
from pcii.store import write_exr_safely
from pcii.types import CameraGrid, colour_index, mosaic
from simgen.cameras import Cameras
from simgen.dataset import sensitivities
from simgen.photons import Capture, thin_photons
from simgen.renderer import RenderScene, backend, build, render_view
from simgen.sensor import PhotonTable
from simgen.spec import Photons, Scene, Sensor

CAMERA = "Nikon 5100 (NPL)"
SCALAR = backend.choose().kind == "scalar"
SKY = "sky.exr"
LAMP: dict[str, Any] = {
    "type": "area",
    "position_mm": (-200, -300, 200),
    "target_mm": (0, 0, 600),
    "width_mm": 200,
    "height_mm": 200,
    "luminance_cd_m2": 2000.0,
}
EVENLY: dict[str, Any] = {"type": "uniform", "luminance_cd_m2": 1.0}
EVENLY_30: dict[str, Any] = {"type": "uniform", "luminance_cd_m2": 30.0}
DIM_WALL: dict[str, Any] = {"z_mm": 1500.0, "reflectance": (0.1, 0.1, 0.1)}
WHITE = (1.0, 1.0, 1.0)
MATT: dict[str, Any] = {"reflectance": WHITE}


def grid(rows: int, cols: int, height: int, width: int, pixel_mm: float = 0.0704) -> CameraGrid:
    return Optics(pitch_mm=(6.0, 4.0), focal_mm=50.0, pixel_mm=pixel_mm).grid((rows, cols, height, width))


def film(height: int = 32, width: int = 32, focal_mm: float = 50.0) -> CameraGrid:
    """One camera with pixels of 1 mm."""
    return Optics(pitch_mm=(1, 1), focal_mm=focal_mm, pixel_mm=1.0).grid((1, 1, height, width))


def ball(
    name: str,
    x_mm: float,
    z_mm: float,
    colour: Sequence[float] = WHITE,
    radius_mm: float = 120,
    y_mm: float = 0,
    **material: Any,
) -> dict[str, Any]:
    return {
        "name": name,
        "position_mm": (x_mm, y_mm, z_mm),
        "shape": {"type": "sphere", "radius_mm": radius_mm},
        "material": material or {"reflectance": colour},
    }


def card(
    z_mm: float,
    size_mm: float,
    material: dict[str, Any] = MATT,
    name: str = "card",
    turn_deg: tuple[float, float, float] = (0, 0, 0),
    at_mm: tuple[float, float] = (0, 0),
) -> dict[str, Any]:
    return {
        "name": name,
        "position_mm": (*at_mm, z_mm),
        "rotation_deg": turn_deg,
        "shape": {"type": "card", "width_mm": size_mm, "height_mm": size_mm},
        "material": material,
    }


def build_scene(
    objects: Sequence[dict],
    lights: Sequence[dict],
    *,
    spectral: bool = False,
    camera: str | None = None,
    max_depth: int = 2,
    folder: Path = Path(),
    **more: Any,
) -> RenderScene:
    values = {"title": "test", "objects": list(objects), "lights": list(lights), **more}
    curves = sensitivities(Sensor(camera=CAMERA if spectral else camera), Path())
    mi = backend.load(spectral=curves is not None)
    return build(mi, Scene.model_validate(values), folder, max_depth, curves)


def lit(objects: Sequence[dict], lights: Sequence[dict] = (LAMP, EVENLY_30)) -> RenderScene:
    """Things before a dim wall."""
    return build_scene(objects, lights, max_depth=3, backdrop=DIM_WALL)


def two_balls() -> RenderScene:
    return lit([ball("red", -130.0, 600.0, (0.9, 0.2, 0.1)), ball("blue", 150.0, 700.0, (0.1, 0.3, 0.9))])


def evenly_lit(
    objects: list[dict], *, backdrop_mm: float | None = 3000.0, folder: Path = Path()
) -> RenderScene:
    """The objects in even light."""
    return build_scene(objects, [EVENLY_30], folder=folder, backdrop=backdrop_mm and {"z_mm": backdrop_mm})


def sky(folder: Path, pixels: np.ndarray, **light: Any) -> dict[str, Any]:
    """An environment light of these pixels (H, W, 3)."""
    write_exr_safely(folder / SKY, pixels.astype(np.float32))
    return {"type": "environment", "file": SKY, "luminance_cd_m2": 1.0, **light}


def white(built: RenderScene) -> np.ndarray:
    """What pixels of each colour see of a luminance of 1 of the scene's light, (3,)."""
    return np.ones(3) if built.filters is None else built.filters.white


def seen(built: RenderScene, grid: CameraGrid, samples: int, seed: int = 1) -> np.ndarray:
    """Radiance (H, W, 3), float64, of which 1 is that of the scene's light at luminance 1."""
    view = render_view(built, grid, 0, 0, samples_per_pixel=samples, seed=seed)
    return view.astype(np.float64) / white(built)


def mosaics(scene: RenderScene, cameras: Cameras, samples: int, seed: int) -> np.ndarray:
    """Bayer mosaics (V, H, W) of 2 x 2 cameras, float64."""
    views = [
        render_view(scene, cameras, k, l, samples_per_pixel=samples, seed=seed + 2 * k + l)
        for k, l in np.ndindex(2, 2)
    ]
    return mosaic(np.stack(views).astype(np.float64), "GRBG")


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
    counts, rates = counted(photons, grid)[0, 0], gain * mosaic(radiance, "GRBG")
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
    """Sums over blocks of (..., H, W)."""
    *views, height, width = pixels.shape
    return pixels.reshape(*views, height // side_px, side_px, width // side_px, side_px).sum(axis=(-3, -1))
