"""Scenes in the renderer, ready to draw from, as the studies of images need them."""

from pathlib import Path

from simgen.photons.capture import Capture
from simgen.renderer import backend
from simgen.renderer.mitsuba_scene import build
from simgen.sensor.detector import sensitivities
from simgen.spec.recipe import Recipe
from simgen.spec.scene_lookup import load_scene


def capture_of(recipe: Recipe) -> Capture:
    """The recipe's scene as perfect cameras see it."""
    scene = load_scene(recipe.scene)
    mi, curves = backend.load(spectral=recipe.is_spectral), sensitivities(recipe.sensor, Path())
    built = build(mi, scene, scene.folder or Path(), recipe.render.max_depth, curves)
    return Capture(built, recipe.grid.camera_grid(), recipe.cfa, recipe.photons)


def film(side_px: int) -> list[str]:
    """Settings of a square film of so many pixels that sees what the paper's cameras see."""
    return [f"grid.height={side_px}", f"grid.width={side_px}", f"grid.pixel_mm={36.0448 / side_px}"]
