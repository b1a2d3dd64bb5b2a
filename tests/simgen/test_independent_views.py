"""No two views of a large grid share their noise: not of rendering, not of photons, not of the detector."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
import tomli_w
from lit_scenes import EVENLY, LAMP, build_scene
from photon_statistics import counted

from pcii.store import open_dataset
from simgen.base import random_streams as seeds
from simgen.dataset import generate
from simgen.photons import Capture, thin_photons
from simgen.spec import Grid, Photons, Recipe

pytestmark = pytest.mark.renders
SIDE, CAMERAS = 32, 6
VIEWS, PAIRS = CAMERAS**2, CAMERAS**2 * (CAMERAS**2 - 1) // 2
MOST = 5 / SIDE
"""Of 630 independent coefficients, each normal of width 1 / 32, one exceeds it in one of 2700 cases."""
NEAR_LAMP = LAMP | {"position_mm": [300, 0, 100], "target_mm": [0, 0, 500]}
NEAR_LAMP |= {"width_mm": 300, "height_mm": 300, "luminance_cd_m2": 100.0}
BACKDROP = {"z_mm": 500.0, "reflectance": [0.8, 0.8, 0.8]}
WALL: dict[str, Any] = {"title": "An evenly lit wall", "lights": [NEAR_LAMP], "backdrop": BACKDROP}
LIGHT_ALONE = {"title": "Light", "lights": [EVENLY | {"luminance_cd_m2": 100.0}]}
# Cameras so close together that all see the same.
GRID = {"rows": CAMERAS, "cols": CAMERAS, "height": SIDE, "width": SIDE, "pitch_mm": [1e-3, 1e-3]}
GRID |= {"pixel_mm": 0.3}


def dataset(folder: Path, scene: dict[str, Any] = WALL, **changes: Any) -> Path:
    (folder / "wall").mkdir()
    (folder / "wall" / "scene.toml").write_text(tomli_w.dumps(scene))
    products, render = {"truth": False, "radiance": "mosaic"}, {"samples_per_pixel": 1, "max_depth": 2}
    values: dict[str, Any] = {"scene": "wall", "seed": 11, "grid": GRID, "render": render}
    generate(Recipe.model_validate(values | {"products": products} | changes), folder, folder / "out")
    return folder / "out"


def radiance(path: Path) -> np.ndarray:
    views: Any = open_dataset(path).views
    return np.stack([np.asarray(views.radiance[k, l])[..., 0] for k, l in np.ndindex(CAMERAS, CAMERAS)])


def counts(path: Path) -> np.ndarray:
    found = open_dataset(path).counts
    return np.stack([found.view(k, l) for k, l in np.ndindex(CAMERAS, CAMERAS)])


def rough(pixels: np.ndarray) -> float:
    """Mean square of second differences among pixels of one colour, along rows: 0 of a slope."""
    return float(((pixels[..., :-4] - 2 * pixels[..., 2:-2] + pixels[..., 4:]) ** 2).mean())


def likeness(pixels: np.ndarray) -> np.ndarray:
    """Correlation of what each view has more than all on average, of each pair."""
    excess = pixels.astype(np.float64) - pixels.mean(axis=0, dtype=np.float64)
    # What all views have in common is left out, so it must be smooth: not noise that all share.
    assert rough(pixels.mean(axis=0, dtype=np.float64)) < 2 / VIEWS * rough(pixels.astype(np.float64))
    every = np.asarray(np.corrcoef(excess.reshape(VIEWS, -1)))
    return np.abs(every[np.triu_indices(VIEWS, 1)])


def rendered(folder: Path) -> np.ndarray:
    return radiance(dataset(folder, photons={"budget": 100}))


def one_by_one(folder: Path) -> np.ndarray:
    grid = Grid.model_validate(GRID).camera_grid()
    scene = build_scene([], [NEAR_LAMP], backdrop=BACKDROP)
    photons, _ = thin_photons(Capture(scene, grid, "GRBG", Photons(budget=4000), seed=11))
    return counted(photons, grid).reshape(VIEWS, SIDE, SIDE)


def from_views(folder: Path) -> np.ndarray:
    path = dataset(folder, photons={"budget": 4000}, products={"truth": False})
    assert open_dataset(path).manifest["photons"]["method"] == "dense"
    return counts(path)


def detected(folder: Path) -> np.ndarray:
    sensor = {"full_light": {"full_well_e": 1000.0, "read_noise_e": 3.0, "adc_bits": 12}}
    # Nothing but light, which is rendered without noise: only the detector's is left.
    bare = {"photons": {"budget": 100}, "sensor": sensor, "exposure": {"f_number": 4.0, "time_s": 1e-7}}
    return radiance(dataset(folder, LIGHT_ALONE, **bare))


@pytest.mark.parametrize("noisy", [rendered, one_by_one, from_views, detected])
def test_all_pairs_of_views_have_noise_of_their_own(
    noisy: Callable[[Path], np.ndarray], tmp_path: Path
) -> None:
    pixels = noisy(tmp_path)
    found = likeness(pixels)
    assert found.size == PAIRS
    assert found.max() <= MOST
    pixels[23] += pixels[14]  # the fault: one view has another's noise besides its own
    assert (likeness(pixels) > 0.5).sum() == 1  # 0.7: half of that view is the other


def test_every_stage_and_view_has_a_seed_of_its_own() -> None:
    stages, views = get_args(seeds.Stage), range(200)
    integers = [seeds.integer(11, view=view, stage=stage) for stage in stages for view in views]
    assert len(set(integers)) == len(integers)
    assert seeds.integer(11 + (1 << 32), stage="photons") not in integers
