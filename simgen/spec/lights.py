"""Lamps and what shines from all around: where they stand, how bright and of what colour they are."""

from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Discriminator, Field, Tag, model_validator

from simgen.base import Colour, Direction, EnvironmentName, Length, Position, Positive, Real, Strict
from simgen.spectral import illuminant_names, known_illuminant

NamedIlluminant = Annotated[
    str,
    Field(
        max_length=40,
        description="a CIE illuminant by name, such as D65, A or FL2",
        json_schema_extra=lambda schema: schema.update(enum=[*illuminant_names()]),
    ),
    AfterValidator(known_illuminant),
]


def _not_black(colour: tuple[float, float, float]) -> tuple[float, float, float]:
    if not any(colour):
        raise ValueError("light must not be black")
    return colour


STRING_OR_VALUE = Discriminator(lambda written: "string" if isinstance(written, str) else "value")
"""Which part of a union is meant, so that an error is about that one alone."""
Illuminant = Annotated[
    Annotated[NamedIlluminant, Tag("string")] | Annotated[Colour, AfterValidator(_not_black), Tag("value")],
    STRING_OR_VALUE,
]
"""Colour of the light: a CIE illuminant by name, or sRGB, whose brightness is of no matter."""


def _check_target(lamp: "AreaLight | SpotLight") -> "AreaLight | SpotLight":
    if lamp.position_mm == lamp.target_mm:
        raise ValueError("target_mm: a lamp must face another place than its own position_mm")
    return lamp


class AreaLight(Strict):
    """A flat rectangular lamp that shines from its position towards a target."""

    type: Literal["area"] = "area"
    position_mm: Position
    """Where the middle of the lamp stands."""
    target_mm: Position
    """What the lamp faces; behind itself it is dark."""
    width_mm: Length
    """Across, level if the lamp can be."""
    height_mm: Length
    luminance_cd_m2: Positive
    illuminant: Illuminant = "D65"

    _faces_another_place = model_validator(mode="after")(_check_target)


class PointLight(Strict):
    """A lamp without size, which shines evenly in all directions and is seen by no camera."""

    type: Literal["point"] = "point"
    position_mm: Position
    intensity_cd: Positive
    """Luminous intensity: lux times square metres."""
    illuminant: Illuminant = "D65"


class SpotLight(Strict):
    """A lamp without size that shines in a cone about its axis; it is seen by no camera."""

    type: Literal["spot"] = "spot"
    position_mm: Position
    target_mm: Position
    """What its axis goes through."""
    intensity_cd: Positive
    """Luminous intensity along its axis: lux times square metres."""
    beam_deg: Annotated[Real, Field(ge=0, lt=90)] = 15.0
    """Up to this angle from its axis it is as bright as along it."""
    cutoff_deg: Annotated[Real, Field(gt=0, lt=90)] = 20.0
    """Beyond this angle it is dark; between the two it falls evenly with the angle."""
    illuminant: Illuminant = "D65"

    _faces_another_place = model_validator(mode="after")(_check_target)

    @model_validator(mode="after")
    def _is_a_cone(self) -> Self:
        if self.beam_deg >= self.cutoff_deg:
            raise ValueError("beam_deg: the angle up to which a spot is bright must be below its cutoff_deg")
        return self


class DirectionalLight(Strict):
    """Parallel light from far away, such as the sun's, which fills the scene; it is seen by no camera."""

    type: Literal["directional"] = "directional"
    direction: Direction
    """Where the light goes, a vector of any length: (0, 0, 1) away from the cameras, (0, 1, 0) down."""
    illuminance_lux: Positive
    """What a surface that faces the light gets: 100 000 from the sun."""
    illuminant: Illuminant = "D65"


Visible = Annotated[bool, Field(strict=True, exclude_if=lambda visible: visible)]
"""Whether cameras see a light where nothing is hit. What is written of a scene has it where it is not so."""


class UniformLight(Strict):
    """The same luminance from everywhere, seen by the cameras where nothing is hit."""

    type: Literal["uniform"] = "uniform"
    luminance_cd_m2: Positive
    """Its luminance; a surface that sees nothing else gets pi times as many lux."""
    illuminant: Illuminant = "D65"
    visible: Visible = True
    """false: cameras see darkness where nothing is hit, and the light only in mirrors and through glass."""


class EnvironmentLight(Strict):
    """An image of all that shines from far away, seen by the cameras where nothing is hit; in daylight D65.

    Longitude by latitude: the middle of the image lies straight ahead (+Z), its first row straight above,
    its last straight below, its right half to the right.
    """

    type: Literal["environment"] = "environment"
    file: Annotated[str, EnvironmentName]
    """An OpenEXR image inside the scene's folder, twice as wide as high, linear sRGB."""
    luminance_cd_m2: Positive
    """Luminance of white, pixels of (1, 1, 1)."""
    turn_deg: Real = 0.0
    """By how much the surroundings are turned to the right about the vertical axis."""
    visible: Visible = True
    """false: cameras see darkness where nothing is hit, and the image only in mirrors and through glass."""


LightAround = UniformLight | EnvironmentLight
Light = Annotated[
    AreaLight | PointLight | SpotLight | DirectionalLight | LightAround, Field(discriminator="type")
]


class Level(Strict):
    """How bright it is: all lights are made brighter or dimmer together until a plane gets so many lux."""

    illuminance_lux: Positive
    """Direct light, with nothing in the way, on a surface at (0, 0, z_mm) that faces the cameras."""
    z_mm: Length
    """Where that surface stands."""
