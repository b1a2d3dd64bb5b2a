"""The truth of a dataset on disk: every pass at the virtual centre, and of every view on request."""

from pathlib import Path
from typing import Any

import numpy as np

from pcii.base import Report
from pcii.store import TRUTH, TRUTH_LABELS, new_array, new_group_safely
from simgen.cameras import Rig, centre_camera
from simgen.renderer import RenderScene
from simgen.spec import Products, ViewPass
from simgen.truth.first_hits import (
    coverage,
    first_hits_at_centre,
    first_hits_of_view,
    in_focus,
    visible_views,
)

RAYS = "visibility_rays"


def write_truth(
    products: Products,
    planes_mm: tuple[float, ...],
    with_poses: bool,
    render_scene: RenderScene,
    rig: Rig,
    out: Path,
    report: Report,
) -> None:
    """Write these products, what is in focus at these planes, and poses of cameras; one view at a time."""
    grid = rig.grid
    with new_group_safely(out / TRUTH, {}) as group:
        if products.truth:
            centre = first_hits_at_centre(render_scene, grid)
            is_full = products.profile == "full"
            for name in ("z_mm", "object_id", *(("normal",) if is_full else ())):
                _store(group, name, getattr(centre, name))
            if is_full:
                _store(group, "coverage", coverage(render_scene, centre_camera(grid), centre.object_id))
            if planes_mm:
                _store(group, "in_focus", in_focus(grid, centre.z_mm, planes_mm))
                group.attrs["in_focus_z_mm"] = list(planes_mm)
            if with_poses:
                _store(group, "camera_position_mm", rig.position_mm)
                _store(group, "camera_rotation", rig.rotation)
            if products.visibility:
                views, rays = visible_views(render_scene, rig, centre, report)
                _store(group, "visible_views", views)
                group.attrs[RAYS] = rays
        if products.view_truth:
            _write_views(group, render_scene, rig, products.view_truth, report)


def traced_for_visibility(out: Path) -> int | None:
    """How many rays were traced to count views, None if they were not counted."""
    import zarr

    if not (out / TRUTH).is_dir():
        return None
    rays = zarr.open_group(out / TRUTH, mode="r", zarr_format=3).attrs.get(RAYS)
    return None if rays is None else int(str(rays))


def _write_views(
    group: Any, render_scene: RenderScene, rig: Rig, passes: tuple[ViewPass, ...], report: Report
) -> None:
    grid, arrays = rig.grid, dict[str, Any]()
    for done, (k, l) in enumerate(np.ndindex(grid.rows, grid.cols), start=1):
        hits = first_hits_of_view(render_scene, rig, k, l)
        for name in passes:
            if name == "coverage":
                image = coverage(render_scene, rig.pinhole(k, l), hits.object_id)
            else:
                image = getattr(hits, name)
            if name not in arrays:
                shape, label = (grid.rows, grid.cols, *image.shape), TRUTH_LABELS[f"view_{name}"]
                arrays[name] = new_array(group, f"view_{name}", shape, image.dtype, label)
            arrays[name][k, l] = image
        report("truth of views", done, grid.view_count)


def _store(group: Any, name: str, array: np.ndarray) -> None:
    new_array(group, name, array.shape, array.dtype, TRUTH_LABELS[name])[...] = array
