"""The camera grid as a recipe describes it: places of cameras, how far they are off, their lens."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from pcii.core.camera_grid import CameraGrid
from simgen.base.strict_models import LARGEST_MM, Count, Length, NonNegative, Real, Strict

MAX_SHEAR_PX = 1e9
"""Larger shears would overflow the shifts of views, which are 32-bit numbers of pixels."""
MAX_HALF_WIDTHS_PER_FOCAL = 1e4
"""Half a view's width by its focal length: if much larger, views are rounded to 180 degrees."""
Spread = Annotated[Real, Field(ge=0, le=LARGEST_MM)]
Shear = Annotated[Real, Field(ge=-MAX_SHEAR_PX, le=MAX_SHEAR_PX)]


class CalibrationErrors(Strict):
    """How far the cameras are off. The truth keeps it; the grid that a dataset opens with does not."""

    position_sd_mm: tuple[Spread, Spread, Spread] = (0.0, 0.0, 0.0)
    """Standard deviation of each camera's place along X, Y and Z."""
    rotation_sd_deg: tuple[NonNegative, NonNegative, NonNegative] = (0.0, 0.0, 0.0)
    """Standard deviation of each camera's turn about X (tilt), Y (pan) and Z (roll)."""
    pitch_error: Annotated[Real, Field(gt=-1, le=1)] = 0.0
    """The true pitch is (1 + this) times `pitch_mm`, along both axes."""


class Lens(Strict):
    """A thin lens in place of each pinhole: what is not at the depth in focus is blurred."""

    aperture_mm: Length
    """Diameter of the lens."""
    focus_mm: Length
    """Planar depth from the camera that is in focus."""


class Grid(Strict):
    """The camera grid: parallel cameras in the plane Z = 0, pinholes unless they have a lens."""

    rows: Count = 10
    """Rows of cameras, counted from the top."""
    cols: Count = 10
    """Columns of cameras, counted from the left."""
    pitch_mm: tuple[Length, Length] = (5.0, 5.0)
    """Distance between neighbouring cameras, (x, y)."""
    focal_mm: Length = 50.0
    """Distance from pinhole to sensor."""
    pixel_mm: Length = 0.0352
    """Side of a square pixel."""
    height: Count = 1024
    """Rows of pixels of one view."""
    width: Count = 1024
    """Columns of pixels of one view."""
    shear_px: tuple[Shear, Shear] = (0.0, 0.0)
    """By how much each camera's axis meets its film further right and down than that of the camera before.
    What has this disparity stands still: focal pitch / (z pixel) makes the cameras converge at depth z."""
    errors: CalibrationErrors | None = None
    """How far the cameras are off; none at all if left out."""
    lens: Lens | None = None
    """A thin lens for each camera; a pinhole if left out."""

    @model_validator(mode="after")
    def _views_narrower_than_half_of_all_around(self) -> Self:
        half_mm = max(self.width, self.height) * self.pixel_mm / 2
        least_mm = half_mm / MAX_HALF_WIDTHS_PER_FOCAL
        if self.focal_mm < least_mm:
            raise ValueError(
                f"focal_mm: views of {2 * half_mm:g} mm need a focal length of {least_mm:g} mm or more, "
                f"got {self.focal_mm:g}"
            )
        return self

    @model_validator(mode="after")
    def _films_that_can_be_shifted(self) -> Self:
        if self.lens is not None and self.shear_px != (0, 0):
            raise ValueError(
                "shear_px: the film behind a lens cannot be shifted; leave out shear_px or [grid.lens]"
            )
        return self

    def camera_grid(self) -> CameraGrid:
        """The same grid as the type that the dataset is written with, where cameras ought to be."""
        return CameraGrid(**self.model_dump(exclude={"errors", "lens"}))
