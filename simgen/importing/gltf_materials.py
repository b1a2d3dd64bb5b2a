"""Materials of a glTF file as ours: what its metallic-roughness model says in numbers and pictures.

Sections 3.9 and 5.19 of the specification, and KHR_materials_*. Factors multiply pictures in linear light.
"""

import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base.errors import InputError
from pcii.base.srgb import LUMINANCE, linear_to_srgb, srgb_to_linear
from simgen.assets.asset_files import LARGEST_TOTAL_BYTES, read_texture
from simgen.assets.cutouts import cut_out
from simgen.assets.triangles import Triangles, bears_pictures_once
from simgen.importing.foreign_scene import ForeignScene
from simgen.importing.gltf_file import GltfFile
from simgen.importing.gltf_models import Material, MaterialExtensions, Texture, TextureInfo
from simgen.spec.materials import LEAST_INDEX, MOST_INDEX
from simgen.spectral.spectra import srgb_of

HALF = 0.5
BORDER = 1e-4
"""Texture coordinates may pass the borders of a picture by this much."""
REPEAT, CLAMP, MIRROR = 10497, 33071, 33648
"""How pictures go on beyond their borders, as OpenGL numbers it."""
OPAQUE, MASK, BLEND = "OPAQUE", "MASK", "BLEND"
NEAREST = 9728
DEFAULT = Material()
BACKS = "backs of surfaces that are not there from behind (doubleSided false): they look like the fronts"


def pictures_of(gltf: GltfFile) -> dict[int, np.ndarray]:
    """Pixels of the images that textures name, (H, W, 3) or with alpha (H, W, 4), uint8 or uint16, by number.

    Raises `InputError`, naming the image, for one that is missing or cannot be decoded.
    """
    wanted = sorted({texture.source for texture in gltf.document.textures if texture.source is not None})
    found: dict[int, np.ndarray] = {}
    with _on_disk(gltf, wanted) as paths:
        total = 0
        for number, path in paths.items():
            try:
                found[number] = read_texture(path, alpha=True, as_stored=True)
            except InputError as fault:
                sentence = str(fault).removeprefix(f"{path}: ")
                raise gltf.fault(f"images[{number}]: {sentence}") from None
            total += found[number].nbytes
            if total > LARGEST_TOTAL_BYTES:
                raise gltf.fault(f"its images take more than {LARGEST_TOTAL_BYTES} bytes; make them smaller")
    return found


@contextmanager
def _on_disk(gltf: GltfFile, numbers: list[int]) -> Iterator[dict[int, Path]]:
    """Images as files."""
    images = gltf.document.images
    with tempfile.TemporaryDirectory() as folder:
        paths: dict[int, Path] = {}
        for number in numbers:
            where = f"images[{number}]"
            if number >= len(images):
                raise gltf.fault(f"textures: there is no {where}")
            image = images[number]
            if image.uri is not None:
                content = gltf.named_bytes(image.uri, f"{where}.uri")
            elif image.buffer_view is not None:
                content, _ = gltf.view(image.buffer_view, f"{where}.bufferView")
            else:
                raise gltf.fault(f"{where}: it has neither a uri nor a bufferView")
            paths[number] = Path(folder) / f"{number}"
            paths[number].write_bytes(content.tobytes())
        yield paths


@dataclass(frozen=True, eq=False)
class SurfaceOfPrimitive:
    """What a primitive looks like: a material as in a scene.toml, and how its pictures are laid out."""

    material: dict[str, Any]
    texcoord: int | None
    """The set of texture coordinates that its pictures take; None without pictures."""
    uv_matrix: np.ndarray
    """(3, 3), which moves them."""
    pictures_repeat: bool


class GltfMaterials:
    """The materials of one file, each made once; pictures and what is lost go into the scene."""

    def __init__(self, gltf: GltfFile, scene: ForeignScene, cd_m2_per_emission: float) -> None:
        self.gltf, self.scene = gltf, scene
        self.cd_m2_per_emission = cd_m2_per_emission
        self._made: dict[tuple[int | None, bool], SurfaceOfPrimitive | None] = {}

    def surface(
        self, index: int | None, where: str, *, with_pictures: bool = True
    ) -> SurfaceOfPrimitive | None:
        """That of a material, or of the default one; None for one that is all clear.

        Without pictures it is for a mesh that does not say where they lie.
        """
        materials = self.gltf.document.materials
        if index is not None and index >= len(materials):
            raise self.gltf.fault(f"{where}: there is no materials[{index}]")
        key = index, with_pictures
        if key not in self._made:
            material = DEFAULT if index is None else materials[index]
            name = material.name or ("default" if index is None else f"material-{index}")
            self._made[key] = _Making(self, material, name, with_pictures).surface()
        return self._made[key]

    @cached_property
    def pictures(self) -> dict[int, np.ndarray]:
        """Pixels of the file's images, by their numbers."""
        return pictures_of(self.gltf)


class _Making:
    """One material as it is made."""

    def __init__(self, materials: GltfMaterials, material: Material, name: str, with_pictures: bool) -> None:
        self.all, self.material, self.name, self.with_pictures = materials, material, name, with_pictures
        self.scene = materials.scene
        self.layout: tuple[int, tuple[float, ...], tuple[int, int]] | None = None

    def surface(self) -> SurfaceOfPrimitive | None:
        material, more, pbr = self.material, self.material.extensions, self.material.pbr_metallic_roughness
        base = self._pixels(pbr.base_color_texture, "base colour")
        made: dict[str, Any] = {}
        if not self._opacity(base, made):
            return None
        factor = np.array(pbr.base_color_factor[:3])
        if base is None:
            made["reflectance"] = srgb_of(factor)
        else:
            made["texture"] = self.scene.keep(f"{self.name}-colour", _tinted(base[..., :3], factor))
        finish: dict[str, Any] = {"type": "principled"}
        rough = self._pixels(pbr.metallic_roughness_texture, "roughness")
        finish["metallic"] = self._share(pbr.metallic_factor, rough, 2, "metallic")
        finish["roughness"] = self._share(pbr.roughness_factor, rough, 1, "roughness")
        if more.transmission is not None:
            through = self._pixels(more.transmission.transmission_texture, "transmission")
            finish["transmission"] = self._share(
                more.transmission.transmission_factor, through, 0, "transmission"
            )
        if more.clearcoat is not None:
            coat = self._pixels(more.clearcoat.clearcoat_texture, "clearcoat")
            finish["clearcoat"] = self._share(more.clearcoat.clearcoat_factor, coat, 0, "clearcoat")
            finish["clearcoat_gloss"] = _gloss(more.clearcoat.clearcoat_roughness_factor)
        finish["refractive_index"] = self._refractive_index(more)
        made["finish"] = finish
        self._normals(made, is_clear=bool(finish.get("transmission")))
        self._emission(made)
        self._lost(material, more)
        if self.layout is None:
            return SurfaceOfPrimitive(made, None, np.eye(3), False)
        texcoord, transform, wrap = self.layout
        return SurfaceOfPrimitive(made, texcoord, _uv_matrix(transform), wrap != (CLAMP, CLAMP))

    def _pixels(self, info: TextureInfo | None, what: str) -> np.ndarray | None:
        """The picture of a reference, None if there is none or it is laid out unlike the others."""
        if info is None:
            return None
        gltf, name = self.all.gltf, f"material '{self.name}'"
        if not self.with_pictures:
            self.scene.lose(f"pictures of {name} on meshes that have no texture coordinates for them")
            return None
        textures, samplers = gltf.document.textures, gltf.document.samplers
        if info.index >= len(textures):
            raise gltf.fault(f"{name}: there is no textures[{info.index}]")
        texture = textures[info.index]
        if texture.source is None:
            self.scene.lose(f"the {what} picture of {name}, which {_kind_of(texture)}")
            return None
        moved = info.extensions.texture_transform
        transform, texcoord = (0.0, 0.0, 0.0, 1.0, 1.0), info.tex_coord
        if moved is not None:
            transform = (*moved.offset, moved.rotation, *moved.scale)
            texcoord = texcoord if moved.tex_coord is None else moved.tex_coord
        wrap = (REPEAT, REPEAT)
        if texture.sampler is not None:
            if texture.sampler >= len(samplers):
                raise gltf.fault(f"textures[{info.index}]: there is no samplers[{texture.sampler}]")
            sampler = samplers[texture.sampler]
            wrap = sampler.wrap_s, sampler.wrap_t
            if sampler.mag_filter == NEAREST:
                self.scene.lose(f"sharp pixels of pictures of {name} (magFilter NEAREST): they are smoothed")
            if CLAMP in wrap and wrap[0] != wrap[1]:
                self.scene.lose(f"pictures of {name} that are repeated along one side: they are along both")
        if MIRROR in wrap:
            self.scene.lose("every other repetition of a picture mirrored: pictures are repeated as they are")
        layout = (texcoord, transform, wrap)
        self.layout = self.layout or layout
        if layout[:2] != self.layout[:2]:
            self.scene.lose(f"the {what} picture of {name}, which is laid out unlike its other pictures")
            return None
        return self.all.pictures[texture.source]

    def _opacity(self, base: np.ndarray | None, made: dict[str, Any]) -> bool:
        """Sets holes; returns whether there is any surface."""
        mode, factor = self.material.alpha_mode, self.material.pbr_metallic_roughness.base_color_factor[3]
        if mode == OPAQUE:
            return True
        cutoff = self.material.alpha_cutoff if mode == MASK else HALF
        has_alpha = base is not None and base.shape[2] == 4
        if mode == BLEND and (has_alpha or factor < 1):
            self.scene.lose(
                f"surfaces of '{self.name}' that are partly clear: they are there from an alpha of a half; "
                "export them with transmission"
            )
        if base is None or not has_alpha:
            return factor >= cutoff
        alpha = base[..., 3] * (factor / np.iinfo(base.dtype).max)
        if alpha.min() >= cutoff:
            return True
        if alpha.max() < cutoff:
            return False
        # The cutoff becomes a half; below and above it alpha stays linear.
        below = HALF * alpha / cutoff
        above = HALF + HALF * (alpha - cutoff) / max(1 - cutoff, 1e-6)
        opacity = np.where(alpha < cutoff, np.minimum(below, HALF - 1 / 255), above)
        made["opacity"] = self.scene.keep(f"{self.name}-opacity", _stored(opacity))
        return True

    def _share(self, factor: float, pixels: np.ndarray | None, channel: int, what: str) -> float | str:
        """A number from 0 to 1, or the file of a grey picture of such."""
        if pixels is None or factor == 0:
            return round(factor, 6)
        shares = pixels[..., channel] * (factor / np.iinfo(pixels.dtype).max)
        if np.ptp(shares) == 0:
            return round(float(shares.flat[0]), 6)
        return self.scene.keep(f"{self.name}-{what}", _stored(shares))

    def _refractive_index(self, more: MaterialExtensions) -> float:
        """With `specular` that index whose highlights are as strong as the file says."""
        index = 1.5 if more.ior is None else more.ior.ior
        if index == 0:  # by KHR_materials_ior the largest of all
            index = MOST_INDEX
        if more.specular is not None:
            spec = more.specular
            if spec.specular_texture is not None or spec.specular_color_texture is not None:
                self.scene.lose(f"the specular picture of material '{self.name}'")
            if spec.specular_color_factor != (1.0, 1.0, 1.0):
                self.scene.lose(f"the specular colour of material '{self.name}'")
            straight = abs((index - 1) / (index + 1)) * np.sqrt(spec.specular_factor)
            index = (1 + straight) / (1 - straight)
        return round(float(np.clip(index, LEAST_INDEX, MOST_INDEX)), 6)

    def _normals(self, made: dict[str, Any], *, is_clear: bool) -> None:
        info = self.material.normal_texture
        pixels = self._pixels(info, "normal")
        if info is None or pixels is None:
            return
        if is_clear:
            self.scene.lose(f"the normal picture of material '{self.name}', which light passes through")
            return
        rgb = pixels[..., :3]
        if info.scale != 1:
            tilt = rgb.astype(np.float64) * (2 / np.iinfo(rgb.dtype).max) - 1
            tilt[..., :2] *= info.scale
            tilt /= np.linalg.norm(tilt, axis=-1, keepdims=True)
            rgb = _stored(np.clip(tilt / 2 + 0.5, 0, 1))
        made["normal_map"] = self.scene.keep(f"{self.name}-normals", rgb)

    def _emission(self, made: dict[str, Any]) -> None:
        strength = self.material.extensions.emissive_strength
        emission = np.array(self.material.emissive_factor) * (
            1.0 if strength is None else strength.emissive_strength
        )
        if not emission.any():
            return
        rgb_cd_m2 = emission * self.all.cd_m2_per_emission
        pixels = self._pixels(self.material.emissive_texture, "emissive")
        if self.material.emissive_texture is not None and pixels is None:
            return
        if pixels is None:
            made["emission"] = light_values("luminance_cd_m2", rgb_cd_m2)
        elif pixels[..., :3].any():
            # White of the new picture has the luminance of the strongest factor.
            tint = emission / emission.max()
            file = self.scene.keep(f"{self.name}-emission", _tinted(pixels[..., :3], tint))
            made["emission"] = {"luminance_cd_m2": float(rgb_cd_m2.max()), "texture": file}

    def _lost(self, material: Material, more: MaterialExtensions) -> None:
        if material.occlusion_texture is not None:
            self.scene.lose("pictures of ambient occlusion, which light itself makes here")
        if more.clearcoat is not None:
            coat = more.clearcoat
            if coat.clearcoat_roughness_texture is not None or coat.clearcoat_normal_texture is not None:
                self.scene.lose(f"roughness and normal pictures of the clearcoat of material '{self.name}'")
        if "KHR_materials_unlit" in (more.model_extra or {}):
            self.scene.lose("materials that are shown without light (KHR_materials_unlit): they are lit")
        if not material.double_sided and material is not DEFAULT:
            self.scene.lose(BACKS)
        others = sorted(set(more.model_extra or {}) - {"KHR_materials_unlit"})
        for other in others:
            self.scene.lose(f"{other[:60]} of materials")


def _kind_of(texture: Texture) -> str:
    return f"is of the kind {', '.join(sorted(texture.extensions))}" if texture.extensions else "has no image"


def _uv_matrix(transform: tuple[float, ...]) -> np.ndarray:
    """KHR_texture_transform: scaled, turned counterclockwise as one looks at the picture, moved."""
    x, y, angle, width, height = transform
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c * width, s * height, x], [-s * width, c * height, y], [0, 0, 1]])


def _tinted(pixels: np.ndarray, factor: np.ndarray) -> np.ndarray:
    """sRGB pixels (H, W, 3) times a linear factor (3,)."""
    if (factor == 1).all():
        return pixels
    most = np.iinfo(pixels.dtype).max
    curve = srgb_to_linear(np.arange(most + 1) / most)
    tables = [
        np.round(linear_to_srgb(np.clip(curve * part, 0, 1)) * most).astype(pixels.dtype) for part in factor
    ]
    return np.stack([table[pixels[..., channel]] for channel, table in enumerate(tables)], axis=-1)


def _stored(shares: np.ndarray) -> np.ndarray:
    return np.round(shares * 255).astype(np.uint8)


def _gloss(roughness: float) -> float:
    """The gloss g with the same GGX alpha: ours goes from 0.1 to 0.001 linearly, theirs is roughness^2."""
    return round(float(np.clip((0.1 - roughness**2) / 0.099, 0, 1)), 6)


def fitted(
    made: Mapping[str, Any], triangles: Triangles, scene: ForeignScene, *, pictures_repeat: bool
) -> dict[str, Any] | None:
    """The material on this mesh: repeated where pictures are passed, shining where each part of them is
    there once, with holes that leave something of it; None if they leave nothing.

    What is lost by it is said in the scene, which also has the pictures.
    """
    material = dict(made)
    uv = triangles.texcoords
    if uv is not None and pictures_repeat and (uv.min() < -BORDER or uv.max() > 1 + BORDER):
        material["tiled"] = True
    if "texture" in material.get("emission", {}) and not bears_pictures_once(triangles):
        del material["emission"]
        scene.lose("pictures that shine, where parts of them are several times on a mesh")
    if "opacity" in material:
        stored = scene.images[material["opacity"]]
        try:
            if cut_out(triangles, stored / np.iinfo(stored.dtype).max, tiled="tiled" in material) is None:
                scene.lose("surfaces that are all clear")
                return None
        except ValueError:
            del material["opacity"]
            scene.lose("holes by pictures that are too fine for their mesh: it is whole")
    return material


def light_values(field: str, rgb: np.ndarray) -> dict[str, Any]:
    """The values of a light or emission: its luminance, as `field`, and its colour, of linear sRGB (3,)."""
    values: dict[str, Any] = {field: float(f"{rgb @ LUMINANCE:.9g}")}
    if np.ptp(rgb):
        values["illuminant"] = srgb_of(rgb / rgb.max())
    return values
