"""Advice where imported views do not fit the stated cameras: which options would make them fit."""

from dataclasses import fields

from pcii.core.camera_grid import CameraGrid
from pcii.core.images import Views
from pcii.importing.camera_order import ViewOrder
from pcii.importing.grid_check import GridCheck, check_grid
from pcii.importing.image_folders import is_picture
from pcii.importing.import_requests import Imported, Request

FINEST_PIXEL_MM = 2e-4
"""No sensor has smaller pixels: a third of a wavelength of light."""
FLAGS = {order.name: f"--{order.name.replace('_', '-')}" for order in fields(ViewOrder)}


def checked(
    imported: Imported, asked: Request, z_range_mm: tuple[float, float] | None
) -> tuple[tuple[float, ...], str | None]:
    """Depths at which things are sharpest, and a warning with what mends it, or None.

    Cameras that the source itself specifies are not questioned; if it specifies depths, none are searched.
    """
    if imported.z_mm:
        return (), None
    counted = is_picture(asked.source) if asked.views.pattern is None else "{index" in asked.views.pattern
    found = check_grid(
        imported.view_of(), imported.images.grid, z_range_mm, order=asked.views.order, counted=counted
    )
    return found.z_mm, _warning(found, asked, imported, z_range_mm) if asked.optics is not None else None


def _warning(
    found: GridCheck, asked: Request, imported: Imported, z_range_mm: tuple[float, float] | None
) -> str | None:
    if found.order is not None:
        return f"the views fit together far better {_mend(found.order, asked)}"
    across, down = imported.images.grid.pitch_mm
    if found.pitches_exchanged:
        return f"the views fit together far better with --pitch-mm {down:g} {across:g}"
    if found.outside_mm is not None and z_range_mm is not None:
        near, far = z_range_mm
        z, end = found.outside_mm, near if found.outside_mm < near else far
        factor = end / z
        return (
            f"most is sharp at about {z:.3g} mm, outside of {near:g} to {far:g} mm; if nothing is there, "
            f"--pitch-mm is wrong, and {across * factor:.2g} {down * factor:.2g} would bring it to "
            f"{end:g} mm (or --focal-mm or the size of pixels is wrong by this factor)"
        )
    wrong_unit = _wrong_unit(found, imported.images.grid)
    if wrong_unit is None and found.in_no_order and isinstance(imported.images, Views):
        return (  # not of photons, which may be too few to say
            "the views fit together no better than in a random order; unless they have no texture, correct "
            "their order, --pitch-mm, --focal-mm or the size of pixels"
        )
    return wrong_unit


def _wrong_unit(found: GridCheck, grid: CameraGrid) -> str | None:
    """What tells that a length was given in metres or micrometres."""
    if grid.pixel_mm < FINEST_PIXEL_MM:
        return (
            f"a pixel would be {grid.pixel_mm:.3g} mm, less than a third of a wavelength of light; "
            "lengths are in mm, not in m"
        )
    if found.z_mm and found.z_mm[-1] < grid.focal_mm / 10:
        return (
            f"things are sharp up to {found.z_mm[-1]:.3g} mm away, nearer than a tenth of the focal length; "
            "--pitch-mm, --focal-mm and --sensor-mm or --pixel-mm are all in mm"
        )
    return None


def _mend(order: ViewOrder, asked: Request) -> str:
    """Options to add and to leave out for another order."""
    stated = asked.views.order
    changed = {name for name in FLAGS if getattr(order, name) != getattr(stated, name)}
    options = [(flag, not getattr(stated, name)) for name, flag in FLAGS.items() if name in changed]
    if asked.lenses is not None and changed == {"flip_rows", "flip_cols"} and stated == ViewOrder():
        options = [("--inverted", not asked.lenses.inverted)]
    added = " ".join(flag for flag, is_new in options if is_new)
    dropped = " ".join(flag for flag, is_new in options if not is_new)
    return " and ".join([f"with {added}"] * bool(added) + [f"without {dropped}"] * bool(dropped))
