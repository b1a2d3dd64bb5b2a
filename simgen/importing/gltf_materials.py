"""Materials of a glTF file as ours: what its metallic-roughness model says in numbers and pictures.

Sections 3.9 and 5.19 of the specification, and KHR_materials_*. Factors multiply pictures in linear light.
"""

from typing import Any

import numpy as np

from pcii.base import LUMINANCE, linear_to_srgb, srgb_to_linear
from simgen.assets import FULL, Triangles, bears_pictures_once, cut_out
from simgen.importing.gltf_document import Material, Sampler, TextureInfo
from simgen.importing.gltf_file import GltfFile
from simgen.spec import LEAST_INDEX, MOST_INDEX
from simgen.spectral import srgb_of

BORDER = 1e-4
"""Texture coordinates may pass the borders of a picture by this much."""
CLAMP = 33071
"""Beyond its borders a picture goes on by its outermost pixels, as OpenGL numbers it."""


class Surface:
    """What a primitive looks like: a material of the file, translated, and how its pictures are laid out.

    Without pictures it is for a mesh that does not say where they lie.
    """

    def __init__(
        self, gltf: GltfFile, cd_m2_per_emission: float, index: int | None, with_pictures: bool
    ) -> None:
        self.gltf, self.with_pictures = gltf, with_pictures
        self.material, self.name = Material(), "default"
        if index is not None:
            self.material = gltf.item(gltf.document.materials, index, "materials")
            self.name = self.material.name or f"material-{index}"
        self.values: dict[str, Any] = {}
        """As in a scene.toml; none for a surface that is all clear."""
        self.texcoord: int | None = None
        """The set of texture coordinates that its pictures take; None without pictures."""
        self.uv_matrix = np.eye(3)
        """(3, 3), which moves them."""
        self.pictures_repeat = False
        base, factor = self._pixels(self.material.base_color_texture), self.material.base_color_factor
        opacity = self._opacity(base)
        if opacity is None:
            self._lose("surfaces that are all clear")
            return
        if base is None:
            self.values["reflectance"] = srgb_of(np.array(factor[:3]))
        else:
            self.values["texture"] = self._keep("colour", _tinted(base[..., :3], np.array(factor[:3])))
        self.values |= opacity | {"finish": self._finish()}
        self._add_normals()
        self._add_emission(cd_m2_per_emission)

    def material_on(self, triangles: Triangles) -> dict[str, Any] | None:
        """The material on this mesh: repeated where pictures are passed, shining where each part of them is
        there once, with holes that leave something of it; None if they leave nothing."""
        material, uv = dict(self.values), triangles.texcoords
        if uv is not None and self.pictures_repeat and (uv.min() < -BORDER or uv.max() > 1 + BORDER):
            material["tiled"] = True
        if "texture" in material.get("emission", {}) and not bears_pictures_once(triangles):
            del material["emission"]
            self._lose("pictures that shine, where parts of them are several times on a mesh")
        if "opacity" in material:
            try:
                rest = cut_out(
                    triangles, _shares(self.gltf.images[material["opacity"]]), tiled="tiled" in material
                )
            except ValueError:
                del material["opacity"]
                self._lose("holes by pictures that are too fine for their mesh")
                return material
            if rest is None:
                self._lose("surfaces that are all clear")
                return None
        return material

    def _lose(self, what: str) -> None:
        self.gltf.lose(f"{what} (material '{self.name}')")

    def _keep(self, what: str, pixels: np.ndarray) -> str:
        return self.gltf.keep(f"{self.name}-{what}", pixels)

    def _pixels(self, info: TextureInfo | None) -> np.ndarray | None:
        """The picture of a reference, None if there is none or it is laid out unlike the others."""
        if info is None:
            return None
        document = self.gltf.document
        texture = self.gltf.item(document.textures, info.index, "textures")
        texcoord = info.tex_coord if info.other_tex_coord is None else info.other_tex_coord
        # KHR_texture_transform: scaled, turned counterclockwise as one looks at the picture, moved.
        (x, y), (width, height) = info.uv_offset, info.uv_scale
        c, s = np.cos(info.uv_rotation), np.sin(info.uv_rotation)
        uv_matrix = np.array([[c * width, s * height, x], [-s * width, c * height, y], [0, 0, 1]])
        reason = ""
        if not self.with_pictures:
            reason = "pictures on meshes without texture coordinates for them"
        elif texture.source is None:
            reason = "a picture that is neither PNG nor JPEG"
        elif self.texcoord is not None and (texcoord != self.texcoord or (uv_matrix != self.uv_matrix).any()):
            reason = "a picture that is laid out unlike the first"
        if reason or texture.source is None:
            self._lose(reason)
            return None
        sampler = Sampler()
        if texture.sampler is not None:
            sampler = self.gltf.item(document.samplers, texture.sampler, "samplers")
        clamps = [side == CLAMP for side in (sampler.wrap_s, sampler.wrap_t)]
        if self.texcoord is None:
            self.texcoord, self.uv_matrix = texcoord, uv_matrix
            self.pictures_repeat = not all(clamps)
            if any(clamps) and self.pictures_repeat:
                self._lose("pictures that are repeated along one side alone: they are along both")
        elif self.pictures_repeat == all(clamps):
            self._lose("pictures that are repeated unlike the first: they are as the first is")
        return self.gltf.picture(texture.source)

    def _opacity(self, base: np.ndarray | None) -> dict[str, str] | None:
        """The file of an opacity, if there are holes; None if nothing is full."""
        mode, factor = self.material.alpha_mode, self.material.base_color_factor[3]
        if mode == "OPAQUE":
            return {}
        cutoff = self.material.alpha_cutoff if mode == "MASK" else FULL
        alpha = np.full((1, 1), factor)
        if base is not None and base.shape[2] == 4:
            alpha = _shares(base[..., 3], factor)
        if mode == "BLEND" and alpha.min() < 1:
            self._lose(
                "surfaces that are partly clear: they are opaque from an alpha of a half; export transmission"
            )
        if alpha.max() < cutoff:
            return None
        if alpha.min() >= cutoff:
            return {}
        # The cutoff becomes a half; below and above it alpha stays linear.
        below = np.minimum(FULL * alpha / cutoff, FULL - 1 / 255)
        above = FULL + FULL * (alpha - cutoff) / max(1 - cutoff, 1e-6)
        return {"opacity": self._keep("opacity", _stored(np.where(alpha < cutoff, below, above)))}

    def _finish(self) -> dict[str, Any]:
        material = self.material
        packed = self._pixels(material.metallic_roughness_texture)
        clear, coat = self._pixels(material.transmission_texture), self._pixels(material.clearcoat_texture)
        # The gloss with the same GGX alpha: ours goes from 0.1 to 0.001 linearly, theirs is roughness^2.
        gloss = float(np.clip((0.1 - material.clearcoat_roughness**2) / 0.099, 0, 1))
        # The index whose highlights are as strong as index and specular factor of the file make them. By
        # KHR_materials_ior 0 is the largest of all.
        index = max(material.ior, 1.0) if material.ior else MOST_INDEX
        amplitude = (index - 1) / (index + 1) * np.sqrt(material.specular_factor)
        index = float(np.clip((1 + amplitude) / (1 - amplitude), LEAST_INDEX, MOST_INDEX))
        return {
            "type": "principled",
            "metallic": self._share("metallic", material.metallic_factor, packed, 2),
            "roughness": self._share("roughness", material.roughness_factor, packed, 1),
            "transmission": self._share("transmission", material.transmission_factor, clear, 0),
            "clearcoat": self._share("clearcoat", material.clearcoat_factor, coat, 0),
            "clearcoat_gloss": round(gloss, 6),
            "refractive_index": round(index, 6),
        }

    def _share(self, what: str, factor: float, pixels: np.ndarray | None, channel: int) -> float | str:
        """A number from 0 to 1, or the file of a grey picture of such."""
        shares = np.array(factor) if pixels is None else _shares(pixels[..., channel], factor)
        if np.ptp(shares) == 0:
            return round(float(shares.flat[0]), 6)
        return self._keep(what, _stored(shares))

    def _add_normals(self) -> None:
        info = self.material.normal_texture
        pixels = self._pixels(info)
        if info is None or pixels is None:
            return
        if self.values["finish"]["transmission"]:
            self._lose("the normal map of a surface that light passes through")
            return
        rgb = pixels[..., :3]
        if info.scale != 1:
            tilt = (_shares(rgb, 2.0) - 1) * [info.scale, info.scale, 1]
            tilt /= np.linalg.norm(tilt, axis=-1, keepdims=True)
            rgb = _stored(np.clip(tilt / 2 + 0.5, 0, 1))
        self.values["normal_map"] = self._keep("normals", rgb)

    def _add_emission(self, cd_m2_per_emission: float) -> None:
        material = self.material
        rgb_cd_m2 = np.array(material.emissive_factor) * material.emissive_strength * cd_m2_per_emission
        if not rgb_cd_m2.any():
            return
        pixels = self._pixels(material.emissive_texture)
        if material.emissive_texture is None:
            self.values["emission"] = light_values("luminance_cd_m2", rgb_cd_m2)
        elif pixels is not None and pixels[..., :3].any():
            # White of the new picture has the luminance of the strongest factor.
            file = self._keep("emission", _tinted(pixels[..., :3], rgb_cd_m2 / rgb_cd_m2.max()))
            self.values["emission"] = {"luminance_cd_m2": float(rgb_cd_m2.max()), "texture": file}


def _tinted(pixels: np.ndarray, factor: np.ndarray) -> np.ndarray:
    """sRGB pixels (H, W, 3) times a linear factor (3,)."""
    most = np.iinfo(pixels.dtype).max
    linear = srgb_to_linear(np.arange(most + 1) / most)[:, None] * factor
    table = np.round(linear_to_srgb(linear) * most).astype(pixels.dtype)
    return pixels if (factor == 1).all() else table[pixels, np.arange(3)]


def _shares(pixels: np.ndarray, factor: float = 1.0) -> np.ndarray:
    return pixels * (factor / np.iinfo(pixels.dtype).max)


def _stored(shares: np.ndarray) -> np.ndarray:
    return np.round(shares * 255).astype(np.uint8)


def light_values(field: str, rgb: np.ndarray) -> dict[str, Any]:
    """The values of a light or emission: its luminance, as `field`, and its colour, of linear sRGB (3,)."""
    values: dict[str, Any] = {field: float(f"{rgb @ LUMINANCE:.9g}")}
    if np.ptp(rgb):
        values["illuminant"] = srgb_of(rgb / rgb.max())
    return values
