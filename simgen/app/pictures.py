"""Pictures of a scene and of a dataset: what the virtual centre camera sees, and a contact sheet.

Maps and images are drawn by the types of `pcii`; here is where they stand on a page.
"""

import io
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pcii.base import InputError, evenly_chosen, write_bytes_safely
from pcii.figures import block_px, exposed, hide_frame, new_figure, to_srgb8, white_level
from pcii.store import COUNTS, Dataset, open_dataset
from pcii.types import PhotonCounts, Truth, colours_and_samples
from simgen.cameras import coarser
from simgen.check import load_target
from simgen.renderer import backend, build, render_view
from simgen.spec import Scene
from simgen.truth import first_hits_at_centre

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FORMATS = {".png": "png", ".jpg": "jpeg", ".jpeg": "jpeg"}
PREVIEW_PX = 512
"""Longer side of the picture of a preview."""
MARGIN = 0.03
"""Around the objects, as a share of the picture's longer side."""
PANEL_IN = 4.8
"""Height of a panel."""
NAMES_IN = 1.8
"""Room for the names of objects beside their picture."""
ASPECTS = 0.5, 1.6
"""Width over height of the room for a picture; others leave some of it empty."""
MAX_TILES = 12
"""Largest number of views in a row or column of a contact sheet; of more, some are left out."""
GAP_PX = 2
BLOCKS_PER_PHOTON = 2.0
"""More blocks show smaller things, and leave more of them dark."""
BLOCKS = 24, 128
"""Blocks along the longer side of a view's photons, at least and at most."""


@dataclass(frozen=True, eq=False)
class Preview:
    """A figure of what a scene or a dataset looks like; notebooks show it."""

    title: str
    figure: "Figure" = field(repr=False)

    def write(self, out: str | Path, dots_per_inch: float | None = None) -> None:
        """Write it as PNG or JPEG; `InputError` for another name and for a folder that is not there."""
        _check_path(Path(out))
        write_bytes_safely(Path(out), self._encode(FORMATS[Path(out).suffix.lower()], dots_per_inch))

    def _repr_png_(self) -> bytes:
        return self._encode("png", None)

    def _encode(self, kind: str, dots_per_inch: float | None) -> bytes:
        buffer, dpi = io.BytesIO(), dots_per_inch or "figure"
        self.figure.savefig(buffer, format=kind, dpi=dpi, bbox_inches="tight", pad_inches=0.15)
        return buffer.getvalue()


def _check_path(out: Path) -> None:
    """Raise `InputError` unless a picture can be written there: before anything takes time."""
    if out.suffix.lower() not in FORMATS:
        raise InputError(f"{out}: name a .png or .jpg file")
    if not out.parent.is_dir():
        raise InputError(f"{out}: there is no folder {out.parent}; make it first")


def preview(
    scene: Scene | str | Path,
    out: str | Path | None = None,
    samples_per_pixel: int = 32,
    scene_number: int | None = None,
    *,
    overrides: Sequence[str] = (),
    trust_python: bool = False,
) -> Preview:
    """A picture of a scene from the virtual centre, with depth and objects, which notebooks show.

    With `out` it is written too, as PNG or JPEG. The scene, or a recipe with its scene, may be given by name
    or path, with `overrides` and `trust_python` as of `load_recipe`; of a drawn scene `scene_number` says
    which one. It takes seconds.

    Raises `pcii.InputError` for a bad scene or recipe, or a picture that cannot be written.

    >>> preview(load_scene("two_objects").move("bird", by_mm=(0, -20, 0)))           # doctest: +SKIP
    """
    if out is not None:
        _check_path(Path(out))
    if samples_per_pixel < 1:
        raise InputError(f"samples_per_pixel: expected at least 1, got {samples_per_pixel}")
    target = load_target(scene, overrides, scene_number, trust_python=trust_python)
    recipe = target.recipe
    # The recipe's field of view, and one camera: the virtual centre.
    grid = replace(coarser(recipe.grid.camera_grid(), PREVIEW_PX), rows=1, cols=1)
    render_scene = build(backend.load(), target.scene, target.folder, recipe.render.max_depth)
    picture = render_view(render_scene, grid, 0, 0, samples_per_pixel=samples_per_pixel, seed=0)
    hits = first_hits_at_centre(render_scene, grid)
    objects = hits.object_id > 0
    aspect = float(np.clip(grid.width / grid.height, *ASPECTS))
    figure = new_figure(PANEL_IN * (3 * aspect + 0.2) + NAMES_IN, PANEL_IN + 0.7, "compressed")
    whole, depth, objects_by_name = figure.subplots(1, 3)
    whole.imshow(to_srgb8(picture, white_level(picture[objects] if objects.any() else picture)))
    whole.set_title("virtual centre")
    hide_frame(whole)
    _draw_truth(depth, objects_by_name, Truth(hits.z_mm, hits.object_id, render_scene.names), whole)
    title = recipe.title or target.scene.title
    figure.suptitle(title, parse_math=False)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # which would move the panels each time that the picture is written
    drawing = Preview(title, figure)
    if out is not None:
        drawing.write(out)
    return drawing


def _part_of_interest(mask: np.ndarray) -> tuple[slice, slice]:
    """Rows and columns around what is True in `mask` (H, W), with a margin and in the film's aspect; all if
    nothing is."""
    if not mask.any():
        return slice(0, mask.shape[0]), slice(0, mask.shape[1])
    margin_px = MARGIN * max(mask.shape)
    lines = [np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0)]
    spans = [(line[0] - margin_px, line[-1] + 1 + margin_px) for line in lines]
    scale = min(1.0, max((b - a) / size for (a, b), size in zip(spans, mask.shape, strict=True)))
    box = []
    for (a, b), size in zip(spans, mask.shape, strict=True):
        length = max(1, round(scale * size))
        start = int(np.clip(round((a + b - length) / 2), 0, size - length))
        box.append(slice(start, start + length))
    return box[0], box[1]


def _draw_truth(depth: "Axes", objects: "Axes", truth: Truth, whole: "Axes | None") -> None:
    """Depth of the objects, and the objects by name, in the part of the film where they are.

    Titles say if it is a part, which has a frame in the picture of the `whole` film, if there is one.
    """
    rows, cols = box = _part_of_interest(truth.object_id > 0)
    Truth(truth.z_mm[box], truth.object_id[box], truth.names).plot([depth, objects])
    hide_frame(depth)
    if rows.stop - rows.start == len(truth.object_id):
        return
    if whole is not None:
        left, right, top, bottom = (edge - 0.5 for edge in (cols.start, cols.stop, rows.start, rows.stop))
        corners = [left, right, right, left, left], [top, top, bottom, bottom, top]
        whole.plot(*corners, color="0.6", linewidth=0.8)
    part = "part of the film" if whole is None else "the part in the frame"
    for axes in (depth, objects):
        axes.set_title(f"{axes.get_title()}: {part}")


def write_sheet(path: Path, out: Path) -> None:
    """Write the contact sheet of a dataset as PNG or JPEG: truth, photons, full light; nothing is rendered.

    Raises `InputError` for a folder that is no finished dataset, or a picture that cannot be written.
    """
    _check_path(out)
    Preview(path.name, draw_sheet(open_dataset(path))).write(out)


def draw_sheet(dataset: Dataset) -> "Figure":
    """The contact sheet of a dataset as a figure; the place of what it does not have stays empty."""
    grid, truth, views = dataset.grid, dataset.truth, dataset.views
    aspect = float(np.clip(grid.width / grid.height, *ASPECTS))
    second = float(np.clip(aspect * grid.cols / grid.rows, aspect + NAMES_IN / PANEL_IN, 4.0))
    widths = aspect + 0.2, second
    figure = new_figure(PANEL_IN * sum(widths), 2 * PANEL_IN + 1.5, "constrained")
    panels = figure.subplot_mosaic([["view", "photons"], ["depth", "objects"]], width_ratios=widths)
    lines = [
        str(dataset.manifest.get("title") or dataset.name),
        f"{grid.rows} x {grid.cols} views of {grid.height} x {grid.width} pixels, "
        f"{dataset.cfa or 'monochrome'}, pitch {grid.pitch_mm[0]:g} x {grid.pitch_mm[1]:g} mm",
    ]
    whole = None
    if views is not None:
        whole = panels["view"]
        views.plot(whole)
    if dataset.has(COUNTS):
        counts = dataset.counts
        lines.append(f"{counts.total:,} photons counted, {counts.total / grid.view_count:,.4g} per view")
        shown = " x ".join(str(min(side, MAX_TILES)) for side in (grid.rows, grid.cols))
        panels["photons"].set_title(f"photons of {shown} views")
        panels["photons"].imshow(_photon_tiles(counts), interpolation="nearest")
    if truth is not None:
        _draw_truth(panels["depth"], panels["objects"], truth, whole)
    for axes in panels.values():
        hide_frame(axes)
    figure.suptitle("\n".join(lines), fontsize=12, parse_math=False)
    return figure


def _photon_tiles(counts: PhotonCounts) -> np.ndarray:
    """Photons of at most `MAX_TILES` views in a row and column as one 8-bit picture (h, w, 3).

    They are shown in blocks that hold about as many photons whatever the amount of light, in their colours,
    with gaps of white between views.
    """
    grid = counts.grid
    blocks = np.sqrt(BLOCKS_PER_PHOTON * counts.total / grid.view_count)
    side_px = block_px(grid.shape_HW, int(np.clip(blocks, *BLOCKS)))
    rows, cols = (evenly_chosen(number, MAX_TILES) for number in (grid.rows, grid.cols))
    views = (colours_and_samples(counts.view(k, l)[..., None], counts.cfa) for k in rows for l in cols)
    gaps = (0, 0), (0, GAP_PX), (0, GAP_PX), (0, 0)
    tiles = np.pad(np.stack(exposed(views, side_px)), gaps, constant_values=255)
    _, h, w, _ = tiles.shape
    sheet = tiles.reshape(-1, len(cols), h, w, 3).transpose(0, 2, 1, 3, 4)
    return sheet.reshape(-1, len(cols) * w, 3)[:-GAP_PX, :-GAP_PX]
