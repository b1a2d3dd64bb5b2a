"""Materials as Mitsuba's surfaces, colours and spectra as its textures, in the variant that is set."""

import math
import os
from collections.abc import Hashable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from pcii.base import LUMINANCE, srgb_to_linear
from simgen.assets import Assets, paint
from simgen.renderer.backend import is_spectral
from simgen.renderer.mitsuba_shapes import check_texcoords
from simgen.spec import (
    Box,
    Card,
    Cylinder,
    Glass,
    Illuminant,
    Material,
    Matt,
    Mesh,
    Metal,
    Plastic,
    Principled,
    Reflectance,
    SceneObject,
    Shape,
    Sphere,
    is_clear,
)
from simgen.spectral import spectra


def paint_patterns(things: Sequence[SceneObject]) -> Iterator[np.ndarray | None]:
    """The pixels of each object's pattern (see `paint`), None if it carries none; several at a time."""

    def pixels(thing: SceneObject) -> np.ndarray | None:
        texture = thing.material.texture
        return None if texture is None or isinstance(texture, str) else paint(texture, aspect_of(thing.shape))

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        yield from pool.map(pixels, things)


def surface_key(material: Material, shape: Shape, assets: Assets) -> Hashable:
    """A key that is equal for objects that can share a surface, on which pictures lie alike."""
    has_texcoords = not isinstance(shape, Mesh) or assets.meshes[shape.file].texcoords is not None
    return material, shape.type in ("card", "sphere") and shape.type, aspect_of(shape), has_texcoords


def surface_plugin(
    mi: Any, material: Material, shape: Shape, assets: Assets, pattern: np.ndarray | None
) -> dict[str, Any]:
    """The surface of an object of this shape, on both sides; `pattern` are its pixels if it carries one."""

    def texture(where: str, pixels: np.ndarray, raw: bool = True) -> dict[str, Any]:
        check_texcoords(where, shape, assets)
        return texture_plugin(mi, pixels, shape, raw=raw, tiled=material.tiled)

    def reflectance() -> dict[str, Any]:
        if material.reflectance is not None:
            return reflectance_plugin(mi, material.reflectance)
        pixels = assets.image(material.texture) if isinstance(material.texture, str) else pattern
        assert pixels is not None
        # Pixels are linear, so they are colours as they stand, which spectral variants make spectra.
        return texture("material.texture", pixels, raw=not is_spectral(mi))

    def number_or_texture(field: str) -> float | dict[str, Any]:
        value, where = getattr(material.finish, field), f"material.finish.{field}"
        return texture(where, assets.numbers(value, where)) if isinstance(value, str) else value

    match material.finish:
        case Matt():
            surface = {"type": "diffuse", "reflectance": reflectance()}
        case Plastic(roughness=alpha):
            surface = {"type": "roughplastic", "distribution": "ggx", "alpha": alpha}
            surface["diffuse_reflectance"] = reflectance()
        case Metal(name=name, roughness=alpha):
            surface = {"type": "roughconductor", "distribution": "ggx", "alpha": alpha, "material": name}
        case Glass(refractive_index=index):
            pane = isinstance(shape, Card)
            surface = {"type": "thindielectric" if pane else "dielectric", "int_ior": index, "ext_ior": 1.0}
        case Principled(refractive_index=index, clearcoat_gloss=gloss):
            surface = {"type": "principled", "base_color": reflectance(), "eta": index}
            surface |= {field: number_or_texture(field) for field in ("metallic", "roughness")}
            surface["spec_trans"] = number_or_texture("transmission")
            surface |= {"clearcoat": number_or_texture("clearcoat"), "clearcoat_gloss": gloss}
    if material.normal_map is not None:
        tilts = texture("material.normal_map", assets.stored(material.normal_map))
        surface = {"type": "normalmap", "normalmap": tilts, "bsdf": surface}
    return surface if is_clear(material.finish) else {"type": "twosided", "bsdf": surface}


def texture_plugin(
    mi: Any, pixels: np.ndarray, shape: Shape, *, raw: bool, tiled: bool = False
) -> dict[str, Any]:
    """Pixels (H, W, C) as the texture of this shape; `raw` ones are no colours that become spectra."""
    if isinstance(shape, Card):
        pixels = pixels[::-1]  # a rectangle's v runs up, an image's rows down
    pixels = np.ascontiguousarray(pixels)
    # A bitmap is converted, which takes as long as tracing 500 000 paths; only that can become spectra.
    source: dict[str, Any] = {"data": mi.TensorXf(pixels)} if raw else {"bitmap": linear_bitmap(mi, pixels)}
    # Around a sphere a texture closes on itself; elsewhere its borders must not mix.
    wrap_mode = "repeat" if tiled or isinstance(shape, Sphere) else "clamp"
    return source | {"type": "bitmap", "raw": raw, "filter_type": "bilinear", "wrap_mode": wrap_mode}


def linear_bitmap(mi: Any, pixels: np.ndarray) -> Any:
    """Linear pixels (H, W, C) as Mitsuba's bitmap."""
    bitmap = mi.Bitmap(pixels)
    bitmap.set_srgb_gamma(False)  # otherwise a spectral variant takes them for sRGB
    return bitmap


def aspect_of(shape: Shape) -> float:
    """Width over height of what a shape's texture is laid on: a sphere's and a cylinder's go once round."""
    match shape:
        case Card() | Box():
            return shape.width_mm / shape.height_mm
        case Sphere():
            return 2.0
        case Cylinder():
            return 2 * math.pi * shape.radius_mm / shape.length_mm
        case _:
            return 1.0


def reflectance_plugin(mi: Any, reflectance: Reflectance) -> dict[str, Any]:
    """One reflectance all over. In a spectral variant sRGB is turned into a smooth spectrum by Mitsuba."""
    if isinstance(reflectance, tuple):
        return {"type": "rgb", "value": srgb_to_linear(np.array(reflectance)).tolist()}
    if isinstance(reflectance, str):
        spectrum = spectra.patch(reflectance)
    else:
        spectrum = spectra.resampled(reflectance.wavelength_nm, reflectance.value)
    if is_spectral(mi):
        return spectrum_plugin(spectrum)
    return {"type": "rgb", "value": spectra.linear_srgb(spectrum).tolist()}


def radiance_plugin(mi: Any, luminance_cd_m2: float, colour: Illuminant) -> dict[str, Any]:
    """Light of this luminance in cd/m^2, with a CIE illuminant's spectrum or colour, or of an sRGB colour."""
    if is_spectral(mi):
        return spectrum_plugin(luminance_cd_m2 * light_spectrum(mi, colour))
    if isinstance(colour, str):
        rgb = spectra.tint(colour)
    else:
        rgb = srgb_to_linear(np.array(colour))
        rgb /= LUMINANCE @ rgb
    return {"type": "rgb", "value": (luminance_cd_m2 * rgb).tolist()}


def light_spectrum(mi: Any, colour: Illuminant) -> np.ndarray:
    """The spectrum (N,) at luminance 1 of a CIE illuminant, or of an sRGB colour.

    A colour is daylight D65 behind a filter with the smooth spectrum of Jakob and Hanika (2019).
    """
    if isinstance(colour, str):
        return spectra.illuminant(colour)
    rgb = srgb_to_linear(np.array(colour))
    slope = np.polyval(np.array(mi.srgb_model_fetch((rgb / rgb.max()).tolist())), spectra.WAVELENGTH_NM)
    filtered = (0.5 + slope / (2 * np.sqrt(1 + slope**2))) * spectra.illuminant(spectra.DAYLIGHT)
    luminosity = spectra.observer()[1]
    luminance = spectra.integral(luminosity * spectra.illuminant(spectra.DAYLIGHT))
    return filtered * (luminance / spectra.integral(luminosity * filtered))


def spectrum_plugin(values: np.ndarray) -> dict[str, Any]:
    """Values (N,) at evenly spaced wavelengths."""
    first, last = spectra.WAVELENGTH_NM[[0, -1]].tolist()
    numbers = ", ".join(map(repr, values.tolist()))
    return {"type": "regular", "wavelength_min": first, "wavelength_max": last, "values": numbers}
