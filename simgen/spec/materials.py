"""What surfaces do with light: a colour, by a reflectance or a texture, and a finish.

How patterns are painted is in `assets.texture_pixels`.
"""

import math
from itertools import pairwise
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import AfterValidator, Discriminator, Field, Tag, field_validator, model_validator

from pcii.base import srgb_to_linear
from simgen.base import Colour, ImageName, NonNegative, Positive, Real, Share, Strict, Whole
from simgen.spec.lights import STRING_OR_VALUE, Illuminant
from simgen.spectral import WAVELENGTH_NM, known_patch, patch_names

LEAST_INDEX, MOST_INDEX = 1.01, 3.0
"""Refractive indices that the renderer takes."""
CLIPPED_SHARE = 0.01
"""Share of a noise's values that may lie outside what a surface can reflect; they are clipped."""
Roughness = Annotated[Real, Field(ge=0.001, le=1)]
Index = Annotated[Real, Field(ge=LEAST_INDEX, le=MOST_INDEX)]
ShareOrImage = Annotated[
    Annotated[Share, Tag("value")] | Annotated[str, ImageName, Tag("string")], STRING_OR_VALUE
]
"""A number from 0 to 1, or a grey image of such."""
Cells = Annotated[Whole, Field(ge=1, le=1024)]


class _Pattern(Strict):
    pixels: Annotated[Whole, Field(ge=16, le=4096)] = 1024
    """Pixels along the longer side."""


class _InTwoColours(_Pattern):
    colours: tuple[Colour, Colour] = ((0.2, 0.2, 0.2), (0.95, 0.95, 0.95))
    """Two sRGB colours; by default black ink and white paper."""


class Checks(_InTwoColours):
    """A chessboard; the cell at the top left has the first colour."""

    type: Literal["checks"] = "checks"
    rows: Cells
    """Cells from top to bottom."""
    columns: Cells
    """Cells from left to right."""


class Stripes(_InTwoColours):
    """Even stripes, upright unless turned; the first begins at the left with the first colour."""

    type: Literal["stripes"] = "stripes"
    periods: Annotated[Real, Field(ge=1, le=1024)]
    """Pairs of stripes across the width; turned stripes keep this spacing."""
    angle_deg: Annotated[Real, Field(ge=-180, le=180)] = 0.0
    """Turns the stripes clockwise about the centre."""
    profile: Literal["square", "sine"] = "square"
    """Sharp borders, or reflectance that goes up and down as a sine."""


class Star(_InTwoColours):
    """A Siemens star about the centre that fills the whole area; it stays round whatever the aspect."""

    type: Literal["star"] = "star"
    spokes: Annotated[Whole, Field(ge=1, le=360)] = 36
    """Spokes of each colour."""


class Edge(_InTwoColours):
    """A straight slanted edge through the centre, as ISO 12233 measures sharpness with."""

    type: Literal["edge"] = "edge"
    angle_deg: Annotated[Real, Field(ge=-180, le=180)] = 5.0
    """Turns the edge clockwise from upright; at 0 the first colour is on the left."""


class Text(_InTwoColours):
    """One line of text in DejaVu Sans, as large as fits; the first colour on the second."""

    type: Literal["text"] = "text"
    text: Annotated[str, Field(min_length=1, max_length=64)]
    """1 to 64 printable Latin-1 characters."""

    @field_validator("text")
    @classmethod
    def _can_be_drawn(cls, text: str) -> str:
        if text.isspace() or not text.isprintable() or max(text) > "ÿ":
            raise ValueError(f"printable Latin-1 characters, not only spaces, can be drawn; got {text!r}")
        return text


class Noise(_Pattern):
    """Noise whose amplitude falls as frequency^-exponent, like that of natural scenes; it tiles."""

    type: Literal["noise"] = "noise"
    exponent: Annotated[Real, Field(ge=0, le=4)] = 1.0
    """Of the amplitude spectrum: 0 is white noise, 1 natural, 2 cloudy."""
    contrast: NonNegative = 0.3
    """Standard deviation of the linear reflectance over its mean, in each channel."""
    colour: Colour = (0.6, 0.6, 0.6)
    """Mean reflectance, sRGB."""
    chroma: Share = 0.0
    """Share of the variance that each channel has for itself: channels correlate with 1 - chroma."""
    seed: Annotated[Whole, Field(ge=0, lt=2**63)] = 0
    """Another number gives another pattern of the same kind."""

    @model_validator(mode="after")
    def _stays_physical(self) -> Self:
        for mean in srgb_to_linear(np.array(self.colour)).tolist():
            width = math.sqrt(2) * mean * self.contrast  # of a normal distribution about the mean
            if width > 0 and (math.erfc(mean / width) + math.erfc((1 - mean) / width)) / 2 > CLIPPED_SHARE:
                raise ValueError(
                    f"contrast: {self.contrast:g} puts more than {CLIPPED_SHARE:.0%} of the values outside "
                    "0 to 1; it must be smaller with this colour"
                )
        return self


Texture = Annotated[Checks | Stripes | Star | Edge | Text | Noise, Field(discriminator="type")]


class Matt(Strict):
    """Scatters light evenly (Lambert)."""

    type: Literal["matt"] = "matt"


class Plastic(Strict):
    """A coloured body under a clear coat of refractive index 1.49, which gives highlights.

    Light that a rough coat scatters more than once is lost: a white ball alone in even light looks 0.98,
    0.91, 0.70 and 0.55 bright at roughness 0.01, 0.1, 0.3 and 0.5.
    """

    type: Literal["plastic"] = "plastic"
    roughness: Roughness = 0.1
    """Width of the highlights: 0.01 is a mirror to the eye, 0.1 glossy, 0.5 dull (GGX alpha)."""


class Metal(Strict):
    """A bare metal by its chemical symbol, with the measured refractive index of that metal."""

    type: Literal["metal"] = "metal"
    name: Literal["Ag", "Al", "Au", "Cr", "Cu", "W"]
    """Silver, aluminium, gold, chromium, copper or tungsten."""
    roughness: Roughness = 0.1
    """Width of the highlights: 0.01 is a mirror to the eye, 0.1 glossy, 0.5 dull (GGX alpha)."""


class Glass(Strict):
    """Clear and smooth; a card of it is a thin pane. Light passes it in as many segments as it has surfaces:
    a ball before a surface needs `render.max_depth` = 6."""

    type: Literal["glass"] = "glass"
    refractive_index: Index = 1.5
    """Of the glass against air."""


class Principled(Strict):
    """What modelling programs write: matt, metal, clear and coated, mixed by numbers (Burley 2015).

    `metallic`, `roughness`, `transmission` and `clearcoat` are numbers, or grey images inside the scene's
    folder whose values, black 0 and white 1, are taken as they are stored.
    """

    type: Literal["principled"] = "principled"
    metallic: ShareOrImage = 0.0
    """0 is plastic or the like, whose highlights are white; 1 is metal, whose highlights are coloured."""
    roughness: ShareOrImage = 0.5
    """Width of the highlights: its square is the GGX alpha that other finishes take as their roughness."""
    refractive_index: Index = 1.5
    """Of what is no metal: how strong its highlights are, and how much it bends light that passes."""
    transmission: ShareOrImage = 0.0
    """How much of the light that does not go back at once passes through, as in glass; for closed shapes."""
    clearcoat: ShareOrImage = 0.0
    """How much of a clear coat is over it, with highlights of its own."""
    clearcoat_gloss: Share = 1.0
    """Of that coat: 1 gives sharp highlights (GGX alpha 0.001), 0 wide ones (0.1)."""


Finish = Matt | Plastic | Metal | Glass | Principled


def is_clear(finish: Finish) -> bool:
    """Whether light passes through a surface of this finish."""
    return isinstance(finish, Glass) or (isinstance(finish, Principled) and finish.transmission != 0)


class Spectrum(Strict):
    """Reflectance by wavelength, linear in between and the same beyond the ends."""

    wavelength_nm: Annotated[tuple[Positive, ...], Field(min_length=2, max_length=2000)]
    """Growing wavelengths, in nm; from 380 to 780 nm they matter."""
    value: tuple[Share, ...]
    """Reflectance at each of them, from 0 to 1."""

    @model_validator(mode="after")
    def _is_a_table(self) -> Self:
        if len(self.value) != len(self.wavelength_nm):
            raise ValueError("give as many values as wavelengths")
        if any(here >= there for here, there in pairwise(self.wavelength_nm)):
            raise ValueError("wavelength_nm: wavelengths must grow")
        if self.wavelength_nm[0] >= WAVELENGTH_NM[-1] or self.wavelength_nm[-1] <= WAVELENGTH_NM[0]:
            raise ValueError("wavelength_nm: light has 380 to 780 nm, and none of these are there")
        return self


class Emission(Strict):
    """Emission of a surface, of the same radiance in all directions, on the side of its normals: outside a
    closed shape, and on the side of an unturned card that faces the cameras."""

    luminance_cd_m2: Positive
    """How bright it is; a screen has some 300."""
    illuminant: Illuminant = "D65"
    """Its colour: a CIE illuminant by name, or sRGB, whose brightness is of no matter."""
    texture: ImageName | None = None
    """An sRGB image inside the scene's folder whose white has this luminance and the colour D65."""

    @model_validator(mode="after")
    def _has_one_colour(self) -> Self:
        if self.texture is not None and self.illuminant != "D65":
            raise ValueError("illuminant: the colours of an image are its own; leave it out")
        return self


def _kind_of_reflectance(value: Any) -> str:
    if isinstance(value, str):
        return "patch"
    return "spectrum" if isinstance(value, dict | Spectrum) else "colour"


PatchName = Annotated[
    str,
    Field(
        description="one of the 24 ColorChecker patches, such as 'dark skin'",
        json_schema_extra=lambda schema: schema.update(enum=[*patch_names()]),
    ),
    AfterValidator(known_patch),
]
Reflectance = Annotated[
    Annotated[Colour, Tag("colour")]
    | Annotated[PatchName, Tag("patch")]
    | Annotated[Spectrum, Tag("spectrum")],
    Discriminator(_kind_of_reflectance),
]
"""As sRGB, as the name of a ColorChecker patch, or as a spectrum."""
FileOrPattern = Annotated[
    Annotated[str, ImageName, Tag("string")] | Annotated[Texture, Tag("value")], STRING_OR_VALUE
]


class Material(Strict):
    """What a surface does with light: its colour, by a reflectance or a texture, and its finish."""

    reflectance: Reflectance | None = None
    """sRGB, three numbers from 0 to 1; or the name of a ColorChecker patch; or a spectrum, such as
    { wavelength_nm = [400, 700], value = [0.2, 0.8] }."""
    texture: FileOrPattern | None = None
    """An sRGB image file inside the scene's folder, or a pattern such as { type = "star", spokes = 36 };
    laid out by the shape's texture coordinates."""
    finish: Finish = Field(default=Matt(), discriminator="type")
    """Matt by default; { type = "plastic", roughness = 0.1 } adds highlights."""
    normal_map: Annotated[str, ImageName] | None = None
    """An image inside the scene's folder that tilts the surface: red to the right of the picture, green up,
    blue out of it, each stored as half of the component plus a half (as in OpenGL and glTF)."""
    tiled: bool = False
    """Beyond its borders a picture is repeated; otherwise its outermost pixels go on there."""
    opacity: ImageName | None = None
    """A grey image inside the scene's folder, taken as it is stored: where it, linear between the middles of
    its pixels, is below a half, there is no surface. On cards, boxes, cylinders and meshes."""
    emission: Emission | None = None
    """Light that the surface sends out by itself, such as { luminance_cd_m2 = 300.0 }."""

    @model_validator(mode="after")
    def _fits_its_finish(self) -> Self:
        colours = [name for name in ("reflectance", "texture") if getattr(self, name) is not None]
        if isinstance(self.finish, Metal | Glass):
            if colours:
                raise ValueError(f"{colours[0]}: the colour of {self.finish.type} is its own; leave it out")
        elif len(colours) != 1:
            raise ValueError("give either 'reflectance' or 'texture'")
        for field in ("normal_map", "opacity"):
            if is_clear(self.finish) and getattr(self, field) is not None:
                raise ValueError(f"{field}: a surface that light passes through cannot have one")
        return self
