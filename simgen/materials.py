"""What surfaces do with light: a colour, by a reflectance or a texture, and a finish."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from simgen.schema import Colour, Real, Strict


class Matt(Strict):
    """Scatters light evenly (Lambert)."""

    type: Literal["matt"] = "matt"


class Plastic(Strict):
    """A coloured body under a clear coat of refractive index 1.49, which gives highlights."""

    type: Literal["plastic"] = "plastic"
    roughness: Annotated[Real, Field(ge=0.001, le=1)] = 0.1
    """Width of the highlights: 0.01 is a mirror to the eye, 0.1 glossy, 0.5 dull (GGX alpha)."""


class Metal(Strict):
    """A bare metal by its chemical symbol, with the measured refractive index of that metal."""

    type: Literal["metal"] = "metal"
    name: Literal["Ag", "Al", "Au", "Cr", "Cu", "W"]
    roughness: Annotated[Real, Field(ge=0.001, le=1)] = 0.1
    """Width of the highlights: 0.01 is a mirror to the eye, 0.1 glossy, 0.5 dull (GGX alpha)."""


Finish = Matt | Plastic | Metal


class Material(Strict):
    """What a surface does with light: its colour, by a reflectance or a texture, and its finish."""

    reflectance: Colour | None = None
    """sRGB reflectance, three numbers from 0 to 1."""
    texture: str | None = None
    """An sRGB image file inside the scene's folder, laid out by the shape's texture coordinates."""
    finish: Finish = Field(default=Matt(), discriminator="type")
    """Matt unless told otherwise; { type = "plastic", roughness = 0.1 } adds highlights."""

    @model_validator(mode="after")
    def _one_of_two(self) -> Self:
        coloured = not isinstance(self.finish, Metal)
        if coloured and (self.reflectance is None) == (self.texture is None):
            raise ValueError("give either 'reflectance' or 'texture'")
        if not coloured and (self.reflectance is not None or self.texture is not None):
            raise ValueError("a metal's colour is its own; give no 'reflectance' and no 'texture'")
        return self
