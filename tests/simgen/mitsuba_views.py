"""One Mitsuba scene file seen by Mitsuba itself, and by us once it is imported."""

from pathlib import Path

import numpy as np
from mitsuba_elements import look, number, text, to_world
from scipy import stats

from pcii.core.camera_grid import CameraGrid
from simgen.importing.scene_import import import_scene
from simgen.renderer import backend
from simgen.renderer.mitsuba_scene import build
from simgen.renderer.radiance import render_view
from simgen.spec.scene import load_scene

HEIGHT, WIDTH, TILE_PX = 24, 32, 4
REPEATS = 24
"""Renderings of each kind, from which the noise is known."""
FALSE_ALARM = 1e-4
"""Probability of calling two scenes different that are the same."""


def views_of(
    content: str,
    folder: Path,
    *,
    eye: str = "1,2,-5",
    target: str = "0,0,0",
    fov: float = 40.0,
    depth: int = 4,
    samples: int = 32,
) -> tuple[np.ndarray, np.ndarray, tuple[str, ...]]:
    """Means over tiles of renderings (K, H, W, 3), ours and Mitsuba's, and what we say is left out."""
    file = folder / "scene.xml"
    frame = [
        f'<integrator type="path"><integer name="max_depth" value="{depth}"/></integrator>',
        f'<sensor type="perspective">{number("fov", fov)}{to_world(look(eye, target))}<film type="hdrfilm">',
        f'<integer name="height" value="{HEIGHT}"/><integer name="width" value="{WIDTH}"/>',
        f'{text("component_format", "float32")}<rfilter type="box"/></film></sensor>',
    ]
    file.write_text(f'<scene version="3.0.0">{"".join(frame)}{content}</scene>')
    said = import_scene(file, folder / "scene", unit="mm")
    scene, own_folder = load_scene(str(folder / "scene"))
    mi = backend.load()
    built, original = build(mi, scene, own_folder, depth), mi.load_file(str(file))
    focal_mm = WIDTH / 2 / np.tan(np.radians(fov / 2))
    grid = CameraGrid(
        rows=1, cols=1, pitch_mm=(1, 1), focal_mm=focal_mm, pixel_mm=1.0, height=HEIGHT, width=WIDTH
    )
    ours = [
        render_view(built, grid, 0, 0, samples_per_pixel=samples, seed=seed, independent=True)
        for seed in range(REPEATS)
    ]
    theirs = [np.array(mi.render(original, spp=samples, seed=1000 + seed)) for seed in range(REPEATS)]
    return _tiles(ours), _tiles(theirs), said.left_out


def _tiles(views: list[np.ndarray]) -> np.ndarray:
    rows, cols = HEIGHT // TILE_PX, WIDTH // TILE_PX
    return np.reshape(views, (REPEATS, rows, TILE_PX, cols, TILE_PX, 3)).mean(axis=(2, 4), dtype=np.float64)


def unlike(ours: np.ndarray, theirs: np.ndarray, relative: float = 1e-3) -> np.ndarray:
    """Which tiles and colours (H, W, 3) differ by more than noise, and by more than a share of what they are.

    Welch's test of each, with Bonferroni's correction for their number.
    """
    one, other = ours.var(axis=0, ddof=1) / REPEATS, theirs.var(axis=0, ddof=1) / REPEATS
    # Without any noise it is of no matter how many degrees of freedom there are.
    freedom = (REPEATS - 1) * (one + other) ** 2 / np.where(one + other > 0, one**2 + other**2, 1)
    limit = stats.t.isf(FALSE_ALARM / 2 / one.size, np.maximum(freedom, REPEATS - 1))
    away = np.abs(ours.mean(axis=0) - theirs.mean(axis=0))
    return away > limit * np.sqrt(one + other) + relative * theirs.mean(axis=0)
