"""Materials of a glTF file as ours: what its metallic-roughness model says in numbers and pictures.

Sections 3.9 and 5.19 of the specification, and KHR_materials_*. Factors multiply pictures in linear light.
"""

from typing import Any

import numpy as np

from pcii.base.srgb import LUMINANCE, linear_to_srgb, srgb_to_linear
from simgen.assets.cutouts import cut_out
from simgen.assets.triangles import Triangles, bears_pictures_once
from simgen.importing.foreign_scene import ForeignScene
from simgen.importing.gltf_document import Material, Sampler, TextureInfo
from simgen.importing.gltf_file import GltfFile
from simgen.spec.materials import LEAST_INDEX, MOST_INDEX
from simgen.spectral.spectra import srgb_of

HALF = 0.5
BORDER = 1e-4
"""Texture coordinates may pass the borders of a picture by this much."""
CLAMP = 33071
"""Beyond its borders a picture goes on by its outermost pixels, as OpenGL numbers it."""


class Surface:
    """What a primitive looks like: a material of the file, translated, and how its pictures are laid out.

    Without pictures it is for a mesh that does not say where they lie. Pictures, and the names of what is
    left out, go into the scene.
    """

    def __init__(
        self,
        gltf: GltfFile,
        scene: ForeignScene,
        index: int | None,
        cd_m2_per_emission: float,
        pictures: bool,
    ) -> None:
        self.gltf, self.scene, self.with_pictures = gltf, scene, pictures
        self.material = Material()
        if index is not None:
            self.material = gltf.item(gltf.document.materials, index, "materials")
        self.name = self.material.name or ("default" if index is None else f"material-{index}")
        self.values: dict[str, Any] | None = {}
        """As in a scene.toml; None for a surface that is all clear."""
        self.texcoord: int | None = None
        """The set of texture coordinates that its pictures take; None without pictures."""
        self.uv_matrix = np.eye(3)
        """(3, 3), which moves them."""
        self.pictures_repeat = False
        base = self._pixels(self.material.base_color_texture)
        if not self._cut_holes(base, self.values):
            self._lose("surfaces that are all clear")
            self.values = None
            return
        factor = np.array(self.material.base_color_factor[:3])
        if base is None:
            self.values["reflectance"] = srgb_of(factor)
        else:
            self.values["texture"] = self._keep("colour", _tinted(base[..., :3], factor))
        self._set_finish(self.values)
        self._set_normals(self.values)
        self._set_emission(self.values, cd_m2_per_emission)

    def material_on(self, triangles: Triangles) -> dict[str, Any] | None:
        """The material on this mesh: repeated where pictures are passed, shining where each part of them is
        there once, with holes that leave something of it; None if they leave nothing."""
        material = dict(self.values or {})
        uv = triangles.texcoords
        if uv is not None and self.pictures_repeat and (uv.min() < -BORDER or uv.max() > 1 + BORDER):
            material["tiled"] = True
        if "texture" in material.get("emission", {}) and not bears_pictures_once(triangles):
            del material["emission"]
            self._lose("pictures that shine, where parts of them are several times on a mesh")
        if "opacity" in material:
            stored = self.scene.images[material["opacity"]]
            try:
                if cut_out(triangles, stored / np.iinfo(stored.dtype).max, tiled="tiled" in material) is None:
                    self._lose("surfaces that are all clear")
                    return None
            except ValueError:
                del material["opacity"]
                self._lose("holes by pictures that are too fine for their mesh")
        return material

    def _lose(self, what: str) -> None:
        self.scene.lose(f"{what} (material '{self.name}')")

    def _keep(self, what: str, pixels: np.ndarray) -> str:
        return self.scene.keep(f"{self.name}-{what}", pixels)

    def _pixels(self, info: TextureInfo | None) -> np.ndarray | None:
        """The picture of a reference, None if there is none or it is laid out unlike the others."""
        if info is None:
            return None
        if not self.with_pictures:
            self._lose("pictures on meshes without texture coordinates for them")
            return None
        document = self.gltf.document
        texture = self.gltf.item(document.textures, info.index, "textures")
        if texture.source is None:
            self._lose("a picture that is neither PNG nor JPEG")
            return None
        texcoord = info.tex_coord if info.moved_tex_coord is None else info.moved_tex_coord
        uv_matrix = _uv_matrix(info)
        if self.texcoord is None:
            self.texcoord, self.uv_matrix = texcoord, uv_matrix
            sampler = Sampler()
            if texture.sampler is not None:
                sampler = self.gltf.item(document.samplers, texture.sampler, "samplers")
            clamps = [side == CLAMP for side in (sampler.wrap_s, sampler.wrap_t)]
            self.pictures_repeat = not all(clamps)
            if any(clamps) and self.pictures_repeat:
                self._lose("pictures that are repeated along one side alone: they are along both")
        elif texcoord != self.texcoord or (uv_matrix != self.uv_matrix).any():
            self._lose("a picture that is laid out unlike the first")
            return None
        return self.gltf.picture(texture.source)

    def _cut_holes(self, base: np.ndarray | None, values: dict[str, Any]) -> bool:
        """Sets the opacity; returns whether there is any surface."""
        mode, factor = self.material.alpha_mode, self.material.base_color_factor[3]
        if mode == "OPAQUE":
            return True
        cutoff = self.material.alpha_cutoff if mode == "MASK" else HALF
        has_alpha = base is not None and base.shape[2] == 4
        if mode == "BLEND" and (has_alpha or factor < 1):
            self._lose(
                "surfaces that are partly clear: they are opaque from an alpha of a half; export transmission"
            )
        if base is None or not has_alpha:
            return factor >= cutoff
        alpha = base[..., 3] * (factor / np.iinfo(base.dtype).max)
        if alpha.max() < cutoff:
            return False
        if alpha.min() < cutoff:  # which becomes a half; below and above it alpha stays linear
            below = np.minimum(HALF * alpha / cutoff, HALF - 1 / 255)
            above = HALF + HALF * (alpha - cutoff) / max(1 - cutoff, 1e-6)
            values["opacity"] = self._keep("opacity", _stored(np.where(alpha < cutoff, below, above)))
        return True

    def _set_finish(self, values: dict[str, Any]) -> None:
        material = self.material
        packed = self._pixels(material.metallic_roughness_texture)
        clear = self._pixels(material.transmission_texture)
        coat = self._pixels(material.clearcoat_texture)
        # The gloss with the same GGX alpha: ours goes from 0.1 to 0.001 linearly, theirs is roughness^2.
        gloss = float(np.clip((0.1 - material.clearcoat_roughness**2) / 0.099, 0, 1))
        values["finish"] = {
            "type": "principled",
            "metallic": self._share("metallic", material.metallic_factor, packed, 2),
            "roughness": self._share("roughness", material.roughness_factor, packed, 1),
            "transmission": self._share("transmission", material.transmission_factor, clear, 0),
            "clearcoat": self._share("clearcoat", material.clearcoat_factor, coat, 0),
            "clearcoat_gloss": round(gloss, 6),
            "refractive_index": self._refractive_index(),
        }

    def _share(self, what: str, factor: float, pixels: np.ndarray | None, channel: int) -> float | str:
        """A number from 0 to 1, or the file of a grey picture of such."""
        if pixels is None or factor == 0:
            return round(factor, 6)
        shares = pixels[..., channel] * (factor / np.iinfo(pixels.dtype).max)
        if np.ptp(shares) == 0:
            return round(float(shares.flat[0]), 6)
        return self._keep(what, _stored(shares))

    def _refractive_index(self) -> float:
        """The index whose highlights are as strong as index and specular factor of the file make them."""
        # By KHR_materials_ior 0 is the largest of all.
        index = max(self.material.ior, 1.0) if self.material.ior else MOST_INDEX
        amplitude = (index - 1) / (index + 1) * np.sqrt(self.material.specular_factor)
        index = (1 + amplitude) / (1 - amplitude)
        if index > MOST_INDEX + 1e-6:
            self._lose(f"a refractive index of {index:.6g}, taken as {MOST_INDEX:g}")
        return round(float(np.clip(index, LEAST_INDEX, MOST_INDEX)), 6)

    def _set_normals(self, values: dict[str, Any]) -> None:
        info = self.material.normal_texture
        pixels = self._pixels(info)
        if info is None or pixels is None:
            return
        if values["finish"]["transmission"]:
            self._lose("the normal map of a surface that light passes through")
            return
        rgb = pixels[..., :3]
        if info.scale != 1:
            tilt = rgb.astype(np.float64) * (2 / np.iinfo(rgb.dtype).max) - 1
            tilt[..., :2] *= info.scale
            tilt /= np.linalg.norm(tilt, axis=-1, keepdims=True)
            rgb = _stored(np.clip(tilt / 2 + 0.5, 0, 1))
        values["normal_map"] = self._keep("normals", rgb)

    def _set_emission(self, values: dict[str, Any], cd_m2_per_emission: float) -> None:
        material = self.material
        rgb_cd_m2 = np.array(material.emissive_factor) * material.emissive_strength * cd_m2_per_emission
        if not rgb_cd_m2.any():
            return
        pixels = self._pixels(material.emissive_texture)
        if material.emissive_texture is None:
            values["emission"] = light_values("luminance_cd_m2", rgb_cd_m2)
        elif pixels is not None and pixels[..., :3].any():
            # White of the new picture has the luminance of the strongest factor.
            file = self._keep("emission", _tinted(pixels[..., :3], rgb_cd_m2 / rgb_cd_m2.max()))
            values["emission"] = {"luminance_cd_m2": float(rgb_cd_m2.max()), "texture": file}


def _uv_matrix(info: TextureInfo) -> np.ndarray:
    """KHR_texture_transform: scaled, turned counterclockwise as one looks at the picture, moved."""
    (x, y), (width, height) = info.uv_offset, info.uv_scale
    c, s = np.cos(info.uv_rotation), np.sin(info.uv_rotation)
    return np.array([[c * width, s * height, x], [-s * width, c * height, y], [0, 0, 1]])


def _tinted(pixels: np.ndarray, factor: np.ndarray) -> np.ndarray:
    """sRGB pixels (H, W, 3) times a linear factor (3,)."""
    most = np.iinfo(pixels.dtype).max
    linear = srgb_to_linear(np.arange(most + 1) / most)[:, None] * factor
    table = np.round(linear_to_srgb(np.clip(linear, 0, 1)) * most).astype(pixels.dtype)
    return pixels if (factor == 1).all() else table[pixels, np.arange(3)]


def _stored(shares: np.ndarray) -> np.ndarray:
    return np.round(shares * 255).astype(np.uint8)


def light_values(field: str, rgb: np.ndarray) -> dict[str, Any]:
    """The values of a light or emission: its luminance, as `field`, and its colour, of linear sRGB (3,)."""
    values: dict[str, Any] = {field: float(f"{rgb @ LUMINANCE:.9g}")}
    if np.ptp(rgb):
        values["illuminant"] = srgb_of(rgb / rgb.max())
    return values
