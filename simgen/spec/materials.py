"""What surfaces do with light: a colour, by a reflectance or a texture, and a finish."""

from itertools import pairwise
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Discriminator, Field, Tag, model_validator

from simgen.base.file_lookup import ImageName
from simgen.base.strict_models import Colour, Positive, Real, Share, Strict, completed_by
from simgen.spec.lights import Illuminant
from simgen.spec.textures import Texture
from simgen.spectral.spectra import WAVELENGTH_NM, known_patch, patch_names

LEAST_INDEX, MOST_INDEX = 1.01, 3.0
"""Refractive indices that the renderer takes."""


def _number_or_image(given: Any) -> str:
    return "image" if isinstance(given, str) else "number"


ShareOrImage = Annotated[
    Annotated[Share, Tag("number")] | Annotated[str, ImageName, Tag("image")], Discriminator(_number_or_image)
]
"""A number from 0 to 1, or a grey image of such."""


class Matt(Strict):
    """Scatters light evenly (Lambert)."""

    type: Literal["matt"] = "matt"


class Plastic(Strict):
    """A coloured body under a clear coat of refractive index 1.49, which gives highlights.

    Light that a rough coat scatters more than once is lost: a white ball alone in even light looks 0.98,
    0.91, 0.70 and 0.55 bright at roughness 0.01, 0.1, 0.3 and 0.5.
    """

    type: Literal["plastic"] = "plastic"
    roughness: Annotated[Real, Field(ge=0.001, le=1)] = 0.1
    """Width of the highlights: 0.01 is a mirror to the eye, 0.1 glossy, 0.5 dull (GGX alpha)."""


class Metal(Strict):
    """A bare metal by its chemical symbol, with the measured refractive index of that metal."""

    type: Literal["metal"] = "metal"
    name: Literal["Ag", "Al", "Au", "Cr", "Cu", "W"]
    """Silver, aluminium, gold, chromium, copper or tungsten."""
    roughness: Annotated[Real, Field(ge=0.001, le=1)] = 0.1
    """Width of the highlights: 0.01 is a mirror to the eye, 0.1 glossy, 0.5 dull (GGX alpha)."""


class Glass(Strict):
    """Clear and smooth; a card of it is a thin pane. Light passes it in as many segments as it has surfaces,
    so recipes with glass need a larger `render.max_depth`: 6 for a ball in front of a surface."""

    type: Literal["glass"] = "glass"
    refractive_index: Annotated[Real, Field(ge=LEAST_INDEX, le=MOST_INDEX)] = 1.5
    """Of the glass against air: 1.5 of windows, 1.33 of water, 1.9 of heavy flint."""


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
    refractive_index: Annotated[Real, Field(ge=LEAST_INDEX, le=MOST_INDEX)] = 1.5
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
    """How bright it is; a screen has some 300, a lit lampshade 3000."""
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
        json_schema_extra=completed_by("enum", patch_names),
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


def _file_or_pattern(given: Any) -> str | None:
    """Which of the two a texture is, so that an error is about that one alone."""
    if isinstance(given, str):
        return "file"
    return "pattern" if isinstance(given, dict | Strict) else None


FileOrPattern = Annotated[
    Annotated[str, ImageName, Tag("file")] | Annotated[Texture, Tag("pattern")],
    Discriminator(
        _file_or_pattern,
        custom_error_type="texture",
        custom_error_message='give the name of an image file or a table such as { type = "star" }',
    ),
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
    def _one_of_two(self) -> Self:
        coloured = not isinstance(self.finish, Metal | Glass)
        if coloured and (self.reflectance is None) == (self.texture is None):
            raise ValueError("give either 'reflectance' or 'texture'")
        if not coloured and (self.reflectance is not None or self.texture is not None):
            kind = self.finish.type
            raise ValueError(f"the colour of {kind} is its own; give no 'reflectance' and no 'texture'")
        if self.normal_map is not None and is_clear(self.finish):
            raise ValueError("normal_map: a surface that light passes through cannot be tilted by an image")
        if self.opacity is not None and is_clear(self.finish):
            raise ValueError("opacity: what light passes through is bounded by whole surfaces, without holes")
        return self
