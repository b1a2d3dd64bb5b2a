"""Lamps and what shines from all around: where they stand, how bright and of what colour they are."""

from typing import Annotated, Literal

from pydantic import Field

from simgen.schema import Positive, Strict, Vector


class AreaLight(Strict):
    """A flat rectangular lamp that shines from its position towards a target."""

    type: Literal["area"] = "area"
    position_mm: Vector
    target_mm: Vector
    width_mm: Positive
    height_mm: Positive
    luminance_cd_m2: Positive
    illuminant: str = "D65"
    """Colour of the light: a CIE illuminant by name, such as D65, A or FL2."""


class UniformLight(Strict):
    """The same luminance from everywhere, seen by the cameras where nothing is hit."""

    type: Literal["uniform"] = "uniform"
    luminance_cd_m2: Positive
    illuminant: str = "D65"
    """Colour of the light: a CIE illuminant by name, such as D65, A or FL2."""


Light = Annotated[AreaLight | UniformLight, Field(discriminator="type")]
