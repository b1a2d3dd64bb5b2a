"""Scenes in the renderer, ready to draw from, as the studies of images need them."""

from pathlib import Path

from simgen.dataset import prepare
from simgen.photons import Capture
from simgen.spec import Recipe


def capture_of(recipe: Recipe) -> Capture:
    """The recipe's scene as its cameras see it."""
    prepared = prepare(recipe, Path())
    return prepared.capture(prepared.render_scene())


def film(side_px: int) -> list[str]:
    """Settings of a film of `side_px` x `side_px` pixels that sees what the paper's cameras see."""
    return [f"grid.height={side_px}", f"grid.width={side_px}", f"grid.pixel_mm={36.0448 / side_px}"]
