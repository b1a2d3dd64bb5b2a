"""The JSON of a glTF file: what of it is read, as models that check it, and the names of what is not.

Khronos Group, "glTF 2.0 Specification" (2021), section 5, and the extensions that the fields below name.
"""

import math
from collections.abc import Iterator
from typing import Annotated, Any, Literal, NamedTuple, TypeVar

from pydantic import AliasPath, BaseModel, ConfigDict, Field
from pydantic.alias_generators import to_camel

from simgen.base import LONGEST_PART, Positive, Real, Vector, shorten, shown_value, validate
from simgen.spec import MOST_INDEX

UNREAD_VALUES = dict.fromkeys([("wrapS", 33648), ("wrapT", 33648)], "MIRRORED_REPEAT")
UNREAD_VALUES["magFilter", 9728] = "NEAREST"
"""Values of properties that are read which are left out, and what the specification calls them."""
NEUTRAL = (None, [], [1, 1, 1])
"""Values with which a property that is left out changes nothing."""
SAYS_NOTHING = {
    *("asset", "accessors", "bufferViews", "buffers", "images", "extensionsUsed", "extensionsRequired"),
    *("extras", "weights", "skeleton", "minFilter", "znear", "zfar", "TANGENT"),
}
"""Properties that are not searched: they change nothing that a scene has, or belong to another property."""


class Within(NamedTuple):
    """Smallest and largest value; one beyond is taken as the nearer of the two, and named."""

    low: float
    high: float


Item = TypeVar("Item")
Many = Annotated[tuple[Item, ...], Field(max_length=100_000)]
Index = Annotated[int, Field(strict=True, ge=0)]
Bytes = Annotated[int, Field(strict=True, ge=0, le=1 << 31)]
Name = Annotated[str, Field(max_length=1000)]
Pair = tuple[Real, Real]
Quadruple = tuple[Real, Real, Real, Real]
Share = Annotated[Real, Within(0.0, 1.0)]
NotNegative = Annotated[Real, Within(0.0, math.inf)]
Cone = Annotated[Real, Within(0.002, 1.553)]
Rgb = Annotated[Vector, Within(0.0, math.inf)]
ZEROS, ONES = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)


def _at(*path: str, default: Any = None) -> Any:
    """A field whose value stands deeper in the JSON."""
    return Field(default=default, validation_alias=AliasPath(*path))


def _pbr(name: str, default: Any = None) -> Any:
    return _at("pbrMetallicRoughness", name, default=default)


def _extension(extension: str, name: str, default: Any = None) -> Any:
    return _at("extensions", extension, name, default=default)


class Read(BaseModel):
    """A table of the JSON; names of its fields there are in camel case."""

    model_config = ConfigDict(frozen=True, allow_inf_nan=False, alias_generator=to_camel)


class Stored(Read):
    """A buffer or an image: a file of its own, or in the address itself, or without one in a buffer view or
    behind the JSON of a .glb file."""

    uri: str | None = None
    buffer_view: Index = 0


class _BufferView(Read):
    buffer: Index
    byte_offset: Bytes = 0
    byte_length: Bytes
    byte_stride: Annotated[int, Field(ge=4, le=252)] | None = None


class Accessor(Read):
    """An array of numbers in a buffer view, whose type is as OpenGL numbers it."""

    buffer_view: Index | None = None
    byte_offset: Bytes = 0
    component_type: Literal[5120, 5121, 5122, 5123, 5125, 5126]
    normalized: bool = False
    count: Annotated[int, Field(strict=True, ge=1)]
    type: str
    sparse: Any = None


class _Texture(Read):
    source: Index | None = None
    sampler: Index | None = None


class Sampler(Read):
    """How a texture is repeated, as OpenGL numbers it."""

    wrap_s: int = 10497
    wrap_t: int = 10497
    mag_filter: int = 9729


class TextureInfo(Read):
    """A reference to a texture, and how it is moved, turned and scaled on a surface."""

    index: Index
    tex_coord: Index = 0
    scale: Real = 1.0
    other_tex_coord: Index | None = _extension("KHR_texture_transform", "texCoord")
    uv_offset: Pair = _extension("KHR_texture_transform", "offset", (0.0, 0.0))
    uv_rotation: Real = _extension("KHR_texture_transform", "rotation", 0.0)
    uv_scale: Pair = _extension("KHR_texture_transform", "scale", (1.0, 1.0))


class Material(Read):
    """What a surface does with light."""

    name: Name = ""
    base_color_factor: Annotated[Quadruple, Within(0.0, 1.0)] = _pbr("baseColorFactor", (*ONES, 1.0))
    base_color_texture: TextureInfo | None = _pbr("baseColorTexture")
    metallic_factor: Share = _pbr("metallicFactor", 1.0)
    roughness_factor: Share = _pbr("roughnessFactor", 1.0)
    metallic_roughness_texture: TextureInfo | None = _pbr("metallicRoughnessTexture")
    normal_texture: TextureInfo | None = None
    emissive_texture: TextureInfo | None = None
    emissive_factor: Rgb = ZEROS
    emissive_strength: NotNegative = _extension("KHR_materials_emissive_strength", "emissiveStrength", 1.0)
    transmission_factor: Share = _extension("KHR_materials_transmission", "transmissionFactor", 0.0)
    transmission_texture: TextureInfo | None = _extension("KHR_materials_transmission", "transmissionTexture")
    ior: Annotated[Real, Within(0.0, MOST_INDEX)] = _extension("KHR_materials_ior", "ior", 1.5)
    specular_factor: Share = _extension("KHR_materials_specular", "specularFactor", 1.0)
    clearcoat_factor: Share = _extension("KHR_materials_clearcoat", "clearcoatFactor", 0.0)
    clearcoat_texture: TextureInfo | None = _extension("KHR_materials_clearcoat", "clearcoatTexture")
    clearcoat_roughness: Share = _extension("KHR_materials_clearcoat", "clearcoatRoughnessFactor", 0.0)
    alpha_mode: Literal["OPAQUE", "MASK", "BLEND"] = "OPAQUE"
    alpha_cutoff: NotNegative = 0.5
    double_sided: bool = False


class Primitive(Read):
    """Triangles, lines or points with one material."""

    attributes: dict[str, Index]
    indices: Index | None = None
    material: Index | None = None
    mode: Annotated[int, Field(strict=True, ge=0, le=6)] = 4


class _Mesh(Read):
    name: Name = ""
    primitives: Annotated[tuple[Primitive, ...], Field(min_length=1)]


class Node(Read):
    """A place in the tree of places, and what stands there."""

    name: Name = ""
    children: tuple[Index, ...] = ()
    mesh: Index | None = None
    camera: Index | None = None
    skin: Index | None = None
    light: Index | None = _extension("KHR_lights_punctual", "light")
    copies: dict[str, Index] | None = _extension("EXT_mesh_gpu_instancing", "attributes")
    matrix: Annotated[tuple[Real, ...], Field(min_length=16, max_length=16)] | None = None
    translation: Vector = ZEROS
    rotation: Quadruple = (*ZEROS, 1.0)
    scale: Vector = ONES


class _Skin(Read):
    joints: tuple[Index, ...]
    inverse_bind_matrices: Index | None = None


class _SceneRoots(Read):
    nodes: tuple[Index, ...] = ()


class _Camera(Read):
    name: Name = ""
    yfov: Positive | None = _at("perspective", "yfov")
    aspect_ratio: Positive | None = _at("perspective", "aspectRatio")


class PunctualLight(Read):
    """A lamp without size along -Z: in candela, or in lux if it is directional; angles are in radians."""

    type: Literal["directional", "point", "spot"]
    color: Rgb = ONES
    intensity: NotNegative = 1.0
    inner_cone_angle: NotNegative = _at("spot", "innerConeAngle", default=0.0)
    outer_cone_angle: Cone = _at("spot", "outerConeAngle", default=math.pi / 4)


class Document(Read):
    """The JSON of a glTF file."""

    version: Annotated[str, Field(pattern=r"^2\.")] = Field(validation_alias=AliasPath("asset", "version"))
    extensions_used: tuple[Name, ...] = ()
    extensions_required: tuple[Name, ...] = ()
    scene: Index = 0
    scenes: Many[_SceneRoots] = ()
    nodes: Many[Node] = ()
    meshes: Many[_Mesh] = ()
    accessors: Many[Accessor] = ()
    buffer_views: Many[_BufferView] = ()
    buffers: Many[Stored] = ()
    materials: Many[Material] = ()
    textures: Many[_Texture] = ()
    images: Many[Stored] = ()
    samplers: Many[Sampler] = ()
    cameras: Many[_Camera] = ()
    skins: Many[_Skin] = ()
    lights: Many[PunctualLight] = _extension("KHR_lights_punctual", "lights", ())


READ_KEYS = {
    *("POSITION", "NORMAL", "JOINTS_0", "WEIGHTS_0", "TRANSLATION", "ROTATION", "SCALE"),
    "KHR_mesh_quantization",
}
"""Attributes, properties and extensions that are read."""
RANGES: dict[str, Within] = {}
for _model in Read.__subclasses__():
    for _field in _model.model_fields.values():
        _alias = _field.validation_alias
        _path = [str(key) for key in (_alias.path if isinstance(_alias, AliasPath) else [_alias])]
        READ_KEYS.update(_path)
        RANGES.update((_path[-1], mark) for mark in _field.metadata if isinstance(mark, Within))


def checked_document(values: dict[str, Any], source: str) -> tuple[Document, list[str]]:
    """The JSON of a file as a model, and the names of all that it says and that is not read.

    Values that are out of range are changed in `values`, and named. Raises `InputError`, which begins with
    `source`, for what is not as the specification says.
    """
    names = list(_search(values))
    document = validate(Document, values, source)
    extensions = (*document.extensions_used, *document.extensions_required)
    names += [shorten(key, LONGEST_PART) for key in extensions if key not in READ_KEYS]
    if not all(material.double_sided for material in document.materials):
        names.append("backs of one-sided surfaces, which look like their fronts (doubleSided)")
    return document, names


def _search(values: dict[str, Any]) -> Iterator[str]:
    """Names of what is not read; values that are out of range are changed."""
    waiting: list[Any] = [values]
    while waiting:
        part = waiting.pop()
        if isinstance(part, list):
            waiting += reversed(part)
        if not isinstance(part, dict):
            continue
        for key, value in part.items():
            if key in SAYS_NOTHING:
                continue
            if key in RANGES:
                part[key] = _nearest(value, *RANGES[key])
                if part[key] != value:
                    yield f"{key} of {shown_value(value)}, taken as {shown_value(part[key])}"
            elif key not in READ_KEYS and not key.startswith("TEXCOORD_"):
                if value not in NEUTRAL:
                    yield shorten(key, LONGEST_PART)
            elif isinstance(value, list | dict):
                waiting.append(value)
            elif (key, value) in UNREAD_VALUES:
                yield f"{key} {UNREAD_VALUES[key, value]}"


def _nearest(value: Any, low: float, high: float) -> Any:
    """A number, or each number of a list, within bounds."""
    if isinstance(value, list):
        return [_nearest(part, low, high) for part in value]
    return min(max(value, low), high) if isinstance(value, int | float) else value
