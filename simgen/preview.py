"""A quick look at a scene: the picture, depth and objects that the virtual centre camera sees."""

from pathlib import Path

import numpy as np

from pcii.errors import InputError
from simgen import backend
from simgen.build import build
from simgen.recipe import Grid
from simgen.render import render_view
from simgen.scene import load_scene
from simgen.truth import first_hits_at_centre


def write_preview(scene_name: str, out: Path, samples_per_pixel: int) -> None:
    """Write the preview PNG. Raises `InputError` for a bad scene or a name that is not a PNG's."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    if samples_per_pixel < 1:
        raise InputError(f"samples_per_pixel: expected at least 1, got {samples_per_pixel}")
    if out.suffix.lower() != ".png":
        raise InputError(f"{out}: name a .png file")
    scene, folder = load_scene(scene_name, Path.cwd())
    # The paper's field of view with half its pixels, and one camera: the virtual centre.
    grid = Grid(rows=1, cols=1, pixel_mm=0.0704, height=512, width=512).camera_grid()
    built = build(backend.load(), scene, folder, max_depth=3)
    picture = render_view(built, grid, 0, 0, samples_per_pixel=samples_per_pixel, seed=0)
    hits = first_hits_at_centre(built, grid)
    things = hits.object_id > 0
    white = np.quantile(picture[things] if things.any() else picture, 0.995)
    figure, axes = plt.subplots(1, 3, figsize=(15, 5.2), layout="constrained")
    axes[0].imshow(np.clip(picture / max(white, 1e-12), 0, 1) ** (1 / 2.2))
    axes[0].set_title(scene.title)
    depth = axes[1].imshow(np.where(things, hits.z_mm, np.nan), cmap="viridis")
    axes[1].set_title("planar depth of the objects")
    figure.colorbar(depth, ax=axes[1], label="z (mm)", shrink=0.8)
    axes[2].imshow(np.where(things, hits.object_id, np.nan), cmap="tab10", vmin=0.5, vmax=10.5)
    axes[2].set_title("objects")
    for number, name in built.names.items():
        i, j = np.nonzero(hits.object_id == number)
        if i.size:
            axes[2].annotate(name, (j.mean(), i.mean()), color="white", ha="center", va="center")
    for axis in axes:
        axis.set_axis_off()
    figure.savefig(out, dpi=100)
    plt.close(figure)
