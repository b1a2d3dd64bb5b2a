"""What glTF calls materials, textures and images, as models that check it.

Khronos Group, "glTF 2.0 Specification" (2021), section 5, and the extensions KHR_texture_transform and
KHR_materials_*. What is not listed is not read.
"""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field
from pydantic.alias_generators import to_camel

from simgen.base.strict_models import NonNegative, Real, Share

Index = Annotated[int, Field(strict=True, ge=0)]
Name = Annotated[str, Field(max_length=1000)]
Rgb = tuple[NonNegative, NonNegative, NonNegative]


class Read(BaseModel):
    """Fields that are not read are no fault: exporters write their own."""

    model_config = ConfigDict(frozen=True, allow_inf_nan=False, alias_generator=to_camel)


class Image(Read):
    """A PNG or JPEG picture."""

    name: Name = ""
    uri: Annotated[str, Field(max_length=1 << 29)] | None = None
    buffer_view: Index | None = None


class Texture(Read):
    """An image and how it is repeated."""

    source: Index | None = None
    sampler: Index | None = None
    extensions: dict[str, Any] = {}


class Sampler(Read):
    """How a texture is repeated, as OpenGL numbers it."""

    wrap_s: int = 10497
    wrap_t: int = 10497


class TextureTransform(Read):
    """How a picture is moved, turned and scaled on a surface."""

    offset: tuple[Real, Real] = (0.0, 0.0)
    rotation: Real = 0.0
    scale: tuple[Real, Real] = (1.0, 1.0)
    tex_coord: Index | None = None


class TextureExtensions(Read):
    """Extensions of references to textures."""

    texture_transform: TextureTransform | None = Field(default=None, validation_alias="KHR_texture_transform")


class TextureInfo(Read):
    """A reference to a texture."""

    index: Index
    tex_coord: Index = 0
    scale: Real = 1.0
    extensions: TextureExtensions = TextureExtensions()


class PbrMetallicRoughness(Read):
    """Base colour, metal and roughness."""

    base_color_factor: tuple[Share, Share, Share, Share] = (1.0, 1.0, 1.0, 1.0)
    base_color_texture: TextureInfo | None = None
    metallic_factor: Share = 1.0
    roughness_factor: Share = 1.0
    metallic_roughness_texture: TextureInfo | None = None


class Transmission(Read):
    """Light that passes through."""

    transmission_factor: Share = 0.0
    transmission_texture: TextureInfo | None = None


class Ior(Read):
    """Refractive index."""

    ior: NonNegative = 1.5


class Specular(Read):
    """Strength and colour of highlights."""

    specular_factor: Share = 1.0
    specular_texture: TextureInfo | None = None
    specular_color_factor: Rgb = (1.0, 1.0, 1.0)
    specular_color_texture: TextureInfo | None = None


class Clearcoat(Read):
    """A clear coat."""

    clearcoat_factor: Share = 0.0
    clearcoat_texture: TextureInfo | None = None
    clearcoat_roughness_factor: Share = 0.0
    clearcoat_roughness_texture: TextureInfo | None = None
    clearcoat_normal_texture: TextureInfo | None = None


class EmissiveStrength(Read):
    """Luminance in cd/m^2 of what shines with a factor of 1."""

    emissive_strength: NonNegative = 1.0


class MaterialExtensions(Read):
    """Extensions of materials; others are kept to be named."""

    model_config = ConfigDict(extra="allow")

    transmission: Transmission | None = Field(default=None, validation_alias="KHR_materials_transmission")
    ior: Ior | None = Field(default=None, validation_alias="KHR_materials_ior")
    specular: Specular | None = Field(default=None, validation_alias="KHR_materials_specular")
    clearcoat: Clearcoat | None = Field(default=None, validation_alias="KHR_materials_clearcoat")
    emissive_strength: EmissiveStrength | None = Field(
        default=None, validation_alias="KHR_materials_emissive_strength"
    )


class Material(Read):
    """What a surface does with light."""

    name: Name = ""
    pbr_metallic_roughness: PbrMetallicRoughness = PbrMetallicRoughness()
    normal_texture: TextureInfo | None = None
    occlusion_texture: TextureInfo | None = None
    emissive_texture: TextureInfo | None = None
    emissive_factor: tuple[Share, Share, Share] = (0.0, 0.0, 0.0)
    alpha_mode: Literal["OPAQUE", "MASK", "BLEND"] = "OPAQUE"
    alpha_cutoff: NonNegative = 0.5
    double_sided: bool = False
    extensions: MaterialExtensions = MaterialExtensions()
