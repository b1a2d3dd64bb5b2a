"""Findings on many draws of a distribution of scenes, by geometry alone: what is out of view or of focus."""

from collections.abc import Mapping
from itertools import combinations

import numpy as np

from pcii.base.errors import InputError
from pcii.core.camera_grid import CameraGrid
from simgen.cameras.disparities import apart_px
from simgen.check.depths import FOCUS_PX
from simgen.check.scene_facts import Finding, listed
from simgen.check.unseen import on_film
from simgen.spec.bodies import Body, body_of
from simgen.spec.scene import Scene

TOUCHING_MM = 0.01
"""What reaches into another no further than this only touches it."""


def draw_findings(
    scenes: Mapping[int, Scene | InputError], grid: CameraGrid, z_mm: tuple[float, ...]
) -> list[Finding]:
    """How many draws have objects that are out of view, in one another or at no plane; meshes are left out.

    `scenes` are the draws by number, with the error of those that are not valid. Planes are those of the
    scene unless the recipe names depths, `z_mm`.
    """
    invalid = {number: [str(scene)] for number, scene in scenes.items() if isinstance(scene, InputError)}
    valid = {number: scene for number, scene in scenes.items() if isinstance(scene, Scene)}
    bodies = {number: _bodies(scene) for number, scene in valid.items()}
    planes = {number: np.array(z_mm or scene.planes_mm) for number, scene in valid.items()}
    outside = {number: _outside(own, grid) for number, own in bodies.items()}
    overlapping = {number: _overlapping(own) for number, own in bodies.items()}
    unfocused = {number: _at_no_plane(own, planes[number], grid) for number, own in bodies.items()}
    kinds = (invalid, outside, overlapping, unfocused)
    concerned = sum(any(kind.get(number) for kind in kinds) for number in scenes)
    found = [Finding("ok", "draws", f"{concerned} of {len(scenes)} have findings")]
    if invalid:
        found.append(Finding("bad", "draws", _summary(invalid, scenes, "are not valid:")))
    if any(outside.values()):
        text = _summary(outside, scenes, "have objects outside all films, such as")
        found.append(Finding("warn", "objects", text, "draw their places nearer to the middle"))
    else:
        found.append(Finding("ok", "objects", "in no draw is an object outside all films"))
    if any(overlapping.values()):
        text = _summary(overlapping, scenes, "have objects whose bounds overlap, such as")
        found.append(Finding("note", "overlap", text, "placement = { apart_mm = 0 } keeps them apart"))
    else:
        found.append(Finding("ok", "overlap", "in no draw do bounds of objects overlap"))
    if not any(own.size for own in planes.values()):
        found.append(Finding("warn", "focus", "no planes are named", "add planes_mm to the scene"))
    elif any(unfocused.values()):
        text = _summary(unfocused, scenes, "have objects that are in focus at no plane, such as")
        found.append(Finding("warn", "focus", text, "let planes_mm follow the depths that are drawn"))
    else:
        found.append(Finding("ok", "focus", "in all draws every object reaches a plane"))
    return found


def _summary(found: Mapping[int, list[str]], scenes: Mapping[int, object], what: str) -> str:
    """How many draws are concerned and which, and the first example."""
    numbers = [number for number, names in found.items() if names]
    which = listed([str(number) for number in numbers])
    return f"{len(numbers)} of {len(scenes)} draws ({which}) {what} {found[numbers[0]][0]}"


def _bodies(scene: Scene) -> dict[str, Body]:
    bodies = {
        thing.name: body_of(thing.shape, thing.position_mm, thing.rotation_deg) for thing in scene.objects
    }
    return {name: body for name, body in bodies.items() if body is not None}


def _box(body: Body) -> np.ndarray:
    """Smallest and largest X, Y, Z (2, 3)."""
    return np.add(body.centre_mm, np.outer((-1, 1), body.reach_mm))


def _outside(bodies: Mapping[str, Body], grid: CameraGrid) -> list[str]:
    return [name for name, body in bodies.items() if not on_film(_box(body), grid).in_view]


def _overlapping(bodies: Mapping[str, Body]) -> list[str]:
    """Pairs whose bounding spheres and boxes overlap: of walls and desks spheres alone say nothing."""
    found = []
    for (name, one), (other_name, other) in combinations(bodies.items(), 2):
        apart = np.abs(np.subtract(other.centre_mm, one.centre_mm))
        spheres = np.linalg.norm(apart) < one.radius_mm + other.radius_mm - TOUCHING_MM
        if spheres and np.all(apart < np.add(one.reach_mm, other.reach_mm) - TOUCHING_MM):
            found.append(f"{name} and {other_name}")
    return found


def _at_no_plane(bodies: Mapping[str, Body], planes_mm: np.ndarray, grid: CameraGrid) -> list[str]:
    """What is blurred at every plane, even that of its points which is nearest to it."""
    found = []
    for name, body in bodies.items():
        near, far = _box(body)[:, 2]
        nearest = np.clip(planes_mm, near, far)
        blurred = apart_px(grid, nearest[nearest > 0], planes_mm[nearest > 0]) / 2 > FOCUS_PX
        if planes_mm.size and blurred.all():
            found.append(name)
    return found
