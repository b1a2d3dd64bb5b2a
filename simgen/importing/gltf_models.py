"""What of a glTF file's JSON is read, as models that check it.

Khronos Group, "glTF 2.0 Specification" (2021), section 5, and the extensions KHR_lights_punctual,
KHR_texture_transform and KHR_materials_*. What is not listed is not read.
"""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationInfo
from pydantic.alias_generators import to_camel

from simgen.base.strict_models import Positive, Real

MOST_ITEMS = 100_000
"""Of one kind, such as nodes or accessors."""

Index = Annotated[int, Field(strict=True, ge=0)]
Name = Annotated[str, Field(max_length=1000)]


def _within(low: float, high: float) -> BeforeValidator:
    """A number beyond these bounds is taken as the bound, and named in the context's list `clamped`."""

    def clamp(value: Any, info: ValidationInfo) -> Any:
        if isinstance(value, bool) or not isinstance(value, int | float) or low <= value <= high:
            return value
        bound = low if value < low else high
        if info.context is not None:
            info.context["clamped"].append(
                f"{to_camel(info.field_name or '')} of {value:.9g}, taken as {bound:g}"
            )
        return bound

    return BeforeValidator(clamp)


Share = Annotated[Real, _within(0.0, 1.0)]
NonNegative = Annotated[Real, _within(0.0, float("inf"))]
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
    mag_filter: int = 9729


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
    emissive_factor: Rgb = (0.0, 0.0, 0.0)
    alpha_mode: Literal["OPAQUE", "MASK", "BLEND"] = "OPAQUE"
    alpha_cutoff: NonNegative = 0.5
    double_sided: bool = False
    extensions: MaterialExtensions = MaterialExtensions()


Bytes = Annotated[int, Field(strict=True, ge=0, le=1 << 31)]


class Buffer(Read):
    """A run of bytes, in a file of its own, in the address itself, or behind the JSON of a .glb."""

    uri: Annotated[str, Field(max_length=1 << 29)] | None = None
    byte_length: Bytes


class BufferView(Read):
    """A part of a buffer."""

    buffer: Index
    byte_offset: Bytes = 0
    byte_length: Bytes
    byte_stride: Annotated[int, Field(ge=4, le=252)] | None = None


class SparseIndices(Read):
    """Which elements of an accessor are given one by one."""

    buffer_view: Index
    byte_offset: Bytes = 0
    component_type: Literal[5121, 5123, 5125]


class SparseValues(Read):
    """What those elements are."""

    buffer_view: Index
    byte_offset: Bytes = 0


class Sparse(Read):
    """Elements of an accessor that differ from its buffer view."""

    count: Bytes
    indices: SparseIndices
    values: SparseValues


class Accessor(Read):
    """Numbers in a buffer view."""

    buffer_view: Index | None = None
    byte_offset: Bytes = 0
    component_type: Literal[5120, 5121, 5122, 5123, 5125, 5126]
    normalized: bool = False
    count: Annotated[int, Field(strict=True, ge=1)]
    type: Literal["SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"]
    sparse: Sparse | None = None


class Primitive(Read):
    """Triangles, lines or points with one material."""

    attributes: dict[str, Index]
    indices: Index | None = None
    material: Index | None = None
    mode: Annotated[int, Field(strict=True, ge=0, le=6)] = 4
    targets: tuple[Any, ...] = ()


class Mesh(Read):
    """Primitives that stand together."""

    name: Name = ""
    primitives: Annotated[tuple[Primitive, ...], Field(min_length=1)]


class LightOfNode(Read):
    """The light that stands at a node."""

    light: Index


class Instancing(Read):
    """Where copies of a node's mesh stand: accessors of TRANSLATION, ROTATION and SCALE."""

    attributes: dict[str, Index] = {}


class NodeExtensions(Read):
    """Extensions of nodes."""

    lights_punctual: LightOfNode | None = Field(default=None, validation_alias="KHR_lights_punctual")
    mesh_gpu_instancing: Instancing | None = Field(default=None, validation_alias="EXT_mesh_gpu_instancing")


class Node(Read):
    """A place in the tree of places."""

    name: Name = ""
    children: tuple[Index, ...] = ()
    mesh: Index | None = None
    camera: Index | None = None
    skin: Index | None = None
    matrix: Annotated[tuple[Real, ...], Field(min_length=16, max_length=16)] | None = None
    translation: tuple[Real, Real, Real] = (0.0, 0.0, 0.0)
    rotation: tuple[Real, Real, Real, Real] = (0.0, 0.0, 0.0, 1.0)
    scale: tuple[Real, Real, Real] = (1.0, 1.0, 1.0)
    extensions: NodeExtensions = NodeExtensions()


class Skin(Read):
    """Joints, which are nodes, and by which each places the vertices that follow it."""

    joints: tuple[Index, ...]
    inverse_bind_matrices: Index | None = None


class SceneNodes(Read):
    """The roots of a scene."""

    name: Name = ""
    nodes: tuple[Index, ...] = ()


class Perspective(Read):
    """The view of a camera."""

    yfov: Positive
    aspect_ratio: Positive | None = None


class Camera(Read):
    """A camera, which looks along -Z with Y up."""

    name: Name = ""
    type: Literal["perspective", "orthographic"]
    perspective: Perspective | None = None


class Spot(Read):
    """The cone of a spot, in radians."""

    inner_cone_angle: NonNegative = 0.0
    outer_cone_angle: Positive = 0.7853981633974483


class PunctualLight(Read):
    """A lamp without size along -Z: in candela, or in lux if it is directional."""

    name: Name = ""
    type: Literal["directional", "point", "spot"]
    color: Rgb = (1.0, 1.0, 1.0)
    intensity: NonNegative = 1.0
    spot: Spot = Spot()


class PunctualLights(Read):
    """All lamps of a file."""

    lights: tuple[PunctualLight, ...] = ()


class Asset(Read):
    """The version."""

    version: Annotated[str, Field(pattern=r"^2\.\d+$")]


class DocumentExtensions(Read):
    """Extensions of the file."""

    lights_punctual: PunctualLights = Field(default=PunctualLights(), validation_alias="KHR_lights_punctual")


class Document(Read):
    """The JSON of a glTF file."""

    asset: Asset
    extensions_used: tuple[Name, ...] = ()
    extensions_required: tuple[Name, ...] = ()
    scene: Index | None = None
    scenes: Annotated[tuple[SceneNodes, ...], Field(max_length=MOST_ITEMS)] = ()
    nodes: Annotated[tuple[Node, ...], Field(max_length=MOST_ITEMS)] = ()
    meshes: Annotated[tuple[Mesh, ...], Field(max_length=MOST_ITEMS)] = ()
    accessors: Annotated[tuple[Accessor, ...], Field(max_length=MOST_ITEMS)] = ()
    buffer_views: Annotated[tuple[BufferView, ...], Field(max_length=MOST_ITEMS)] = ()
    buffers: Annotated[tuple[Buffer, ...], Field(max_length=MOST_ITEMS)] = ()
    materials: Annotated[tuple[Material, ...], Field(max_length=MOST_ITEMS)] = ()
    textures: Annotated[tuple[Texture, ...], Field(max_length=MOST_ITEMS)] = ()
    images: Annotated[tuple[Image, ...], Field(max_length=MOST_ITEMS)] = ()
    samplers: Annotated[tuple[Sampler, ...], Field(max_length=MOST_ITEMS)] = ()
    cameras: Annotated[tuple[Camera, ...], Field(max_length=MOST_ITEMS)] = ()
    skins: Annotated[tuple[Skin, ...], Field(max_length=MOST_ITEMS)] = ()
    animations: tuple[Any, ...] = ()
    extensions: DocumentExtensions = DocumentExtensions()
