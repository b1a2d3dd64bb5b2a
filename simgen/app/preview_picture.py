"""A quick look at a scene: the picture, depth and objects that the virtual centre camera sees."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pcii.base.errors import InputError
from pcii.figures.object_maps import named_width
from pcii.figures.panels import hide_frame, new_figure
from pcii.figures.pictures import to_srgb8, white_level
from simgen.app.picture_parts import (
    check_picture_path,
    draw_truth,
    encoded,
    frame_part,
    part_of_interest,
    save_figure,
)
from simgen.check.scene_probe import coarser
from simgen.dataset.prepared import Prepared
from simgen.renderer import backend
from simgen.renderer.mitsuba_scene import build
from simgen.renderer.radiance import render_view
from simgen.truth.first_hits import first_hits_at_centre

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SIDE_PX = 512
PANEL_IN = 4.8
"""Height of a picture's panel."""


@dataclass(frozen=True, eq=False)
class Preview:
    """What a scene looks like, in one figure; notebooks show it."""

    title: str
    figure: "Figure" = field(repr=False)

    def write(self, out: str | Path, dots_per_inch: float | None = None) -> None:
        """Write it as PNG or JPEG; `InputError` for another name and where writing is not allowed."""
        check_picture_path(Path(out))
        save_figure(self.figure, Path(out), dots_per_inch)

    def _repr_png_(self) -> bytes:
        return encoded(self.figure, "png")


def draw_preview(target: Prepared, samples_per_pixel: int) -> Preview:
    """The preview of a recipe's scene. Raises `InputError` for samples below 1, and for a bad scene."""
    if samples_per_pixel < 1:
        raise InputError(f"samples_per_pixel: expected at least 1, got {samples_per_pixel}")
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
    title = recipe.title or target.scene.title
    figure.suptitle(title, parse_math=False)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # which would move the panels each time that the picture is written
    return Preview(title, figure)
