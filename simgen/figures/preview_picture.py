"""A quick look at a scene: the picture, depth and objects that the virtual centre camera sees."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from pcii.base.errors import InputError
from pcii.figures.object_maps import named_width
from pcii.figures.panels import hide_frame, new_figure
from pcii.figures.pictures import to_srgb8, white_level
from simgen.check.scene_probe import coarser
from simgen.check.targets import load_target
from simgen.figures.picture_parts import (
    check_picture_path,
    draw_truth,
    frame_part,
    part_of_interest,
    save_figure,
)
from simgen.renderer import backend
from simgen.renderer.mitsuba_scene import build
from simgen.renderer.radiance import render_view
from simgen.truth.first_hits import first_hits_at_centre

SIDE_PX = 512
PANEL_IN = 4.8
"""Height of a picture's panel."""


def write_preview(
    name_or_path: str,
    out: Path,
    samples_per_pixel: int,
    *,
    overrides: Sequence[str] = (),
    scene_number: int | None = None,
    dots_per_inch: float | None = None,
) -> None:
    """Write the preview of a scene or of a recipe's, a PNG or JPEG; `scene_number` says which draw of it.

    Raises `InputError` for a bad scene or recipe, and for a picture that cannot be written there.
    """
    if samples_per_pixel < 1:
        raise InputError(f"samples_per_pixel: expected at least 1, got {samples_per_pixel}")
    check_picture_path(out)
    target = load_target(name_or_path, overrides, scene_number)
    recipe = target.recipe
    # The recipe's field of view, and one camera: the virtual centre.
    grid = replace(coarser(recipe.grid.camera_grid(), SIDE_PX), rows=1, cols=1)
    render_scene = build(backend.load(), target.scene, target.folder, recipe.render.max_depth)
    picture = render_view(render_scene, grid, 0, 0, samples_per_pixel=samples_per_pixel, seed=0)
    hits = first_hits_at_centre(render_scene, grid)
    things = hits.object_id > 0
    box = part_of_interest(things)
    aspect = float(np.clip(grid.width / grid.height, 0.4, 2.5))
    named = named_width(aspect)
    figure = new_figure(PANEL_IN * (aspect * (2 + named) + 0.2) + 0.5, PANEL_IN + 0.7, "compressed")
    whole, depth, objects = figure.subplots(1, 3, width_ratios=(1, 1, named))
    whole.imshow(to_srgb8(picture, white_level(picture[things] if things.any() else picture)))
    whole.set_title("virtual centre")
    hide_frame(whole)
    if things.any() and box[0].stop - box[0].start < grid.height:
        frame_part(whole, box)
    draw_truth(depth, objects, hits.z_mm[box], hits.object_id[box], render_scene.names)
    figure.suptitle(recipe.title or target.scene.title, parse_math=False)
    save_figure(figure, out, dots_per_inch)
