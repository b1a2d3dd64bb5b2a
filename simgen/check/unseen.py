"""Why an object of a scene is not seen: what stands before it, how large it is on the film, and where."""

from collections import Counter
from dataclasses import dataclass

import numpy as np

from pcii.core.camera_grid import CameraGrid
from simgen.cameras.rig import Camera, as_rig, centre_camera, corners
from simgen.renderer.mitsuba_scene import RenderScene, alone
from simgen.spec.lights import AreaLight
from simgen.spec.scene import Scene
from simgen.truth.first_hits import FirstHits, first_hits_at_centre

SAME_DEPTH = 1e-3
"""So near to the backdrop's depth, as a share of it, a hit is taken to be on it."""
LEAST_SHARE = 0.05
"""What hides less than this share of an object is not named."""


@dataclass(frozen=True)
class OnFilm:
    """Where an object's bounding box falls."""

    size_px: tuple[float, float]
    """Columns and rows that it covers of the virtual centre's film, however far that reaches."""
    in_view: bool
    """Whether part of it falls on the film of the virtual centre or of a corner camera."""


def pixels_without_occluders(render_scene: RenderScene, number: int, grid: CameraGrid) -> np.ndarray:
    """Pixels (H, W), bool, of object `number` (from 1) at the virtual centre with all other objects removed.

    Area lamps stay: they may hide it too.
    """
    return first_hits_at_centre(alone(render_scene, number, with_lamps=True), grid).object_id == number


def hidden_by(
    render_scene: RenderScene, scene: Scene, number: int, grid: CameraGrid, centre: FirstHits
) -> tuple[str, ...]:
    """What stands before object `number` (from 1), which the virtual centre does not see.

    Names of objects, "the backdrop", and lamps as "lamp 1 (lights[0])"; what hides most of it comes first.
    `centre` are the first hits of the whole scene on the same grid. Empty if nothing hides it.
    """
    shown = first_hits_at_centre(alone(render_scene, number, with_lamps=False), grid).object_id == number
    row, col = np.nonzero(shown & np.isfinite(centre.z_mm))
    z_mm, owner = centre.z_mm[row, col].astype(np.float64), centre.object_id[row, col]
    point = centre_camera(grid).towards(row, col) * z_mm[:, None]
    found = Counter(render_scene.names[number] for number in owner[owner > 0].tolist())
    other, on_wall = owner == 0, on_backdrop(scene, z_mm)
    found["the backdrop"] = int((other & on_wall).sum())
    found.update(_lamps_at(scene, point[other & ~on_wall]))
    least = max(1, LEAST_SHARE * row.size)
    return tuple(name for name, times in found.most_common() if times >= least)


def on_backdrop(scene: Scene, z_mm: np.ndarray) -> np.ndarray:
    """Which first hits at these depths, +inf for none, are so near the backdrop that they are on it; bool."""
    if scene.backdrop is None:
        return np.zeros(z_mm.shape, dtype=bool)
    wall_mm = scene.backdrop.z_mm
    return np.abs(z_mm - wall_mm) <= SAME_DEPTH * wall_mm


def on_film(box: np.ndarray, grid: CameraGrid) -> OnFilm:
    """Where a bounding box (2, 3), smallest and largest X, Y, Z in mm, falls on the films."""
    if box[0, 2] <= 0:
        return OnFilm((np.inf, np.inf), in_view=True)
    rig, centre = as_rig(grid), centre_camera(grid)
    ends = [rig.camera(k, l) for k, l in corners(grid)]
    points = np.stack(np.meshgrid(*box.T), axis=-1).reshape(-1, 3)
    across, down = np.ptp(centre.film_px(points), axis=0).tolist()
    return OnFilm((across, down), any(_meets(points, one) for one in (centre, *ends)))


def _lamps_at(scene: Scene, points: np.ndarray) -> Counter[str]:
    """How many of the points (N, 3) lie on which lamp: the one whose rectangle is nearest."""
    away: dict[str, np.ndarray] = {}
    for number, lamp in enumerate(scene.lights):
        if isinstance(lamp, AreaLight):
            facing = np.subtract(lamp.target_mm, lamp.position_mm)
            offset = points - lamp.position_mm
            reach = np.hypot(lamp.width_mm, lamp.height_mm) / 2
            beside = np.maximum(np.linalg.norm(offset, axis=1) - reach, 0)
            away[f"lamp {number + 1} (lights[{number}])"] = beside + np.abs(
                offset @ (facing / np.linalg.norm(facing))
            )
    if not away or not len(points):
        return Counter()
    names = list(away)
    return Counter(names[nearest] for nearest in np.argmin(list(away.values()), axis=0).tolist())


def _meets(points: np.ndarray, camera: Camera) -> bool:
    """Whether the outline of points reaches onto the film."""
    px, half = camera.film_px(points), np.array([camera.grid.width, camera.grid.height]) / 2
    return bool(np.all(px.min(axis=0) < half) and np.all(px.max(axis=0) > -half))
