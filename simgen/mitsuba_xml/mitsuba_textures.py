"""Colours, spectra and textures of a Mitsuba scene: sRGB, tables by wavelength, pictures and grey numbers.

Mitsuba 3.9, what its variants in colours make of them: src/core/properties.cpp (get_texture_impl),
src/core/spectrum.cpp (spectrum_list_to_srgb), src/textures.
"""

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np

from pcii.base.srgb import LUMINANCE, linear_to_srgb, srgb_to_linear
from simgen.assets.asset_files import LARGEST_TOTAL_BYTES, read_pictures
from simgen.base.srgb import FROM_XYZ, srgb_of
from simgen.mitsuba_xml.mitsuba_contents import read_named
from simgen.mitsuba_xml.mitsuba_scene import MitsubaScene, Plugin, Rgb, SpectrumValues, Value
from simgen.spectral.spectra import DAYLIGHT, WAVELENGTH_NM, illuminant, integral, observer, resampled

Given: TypeAlias = "Value | Plugin"
CHECK_PIXELS = 512
"""Along each side of a checkerboard's two by two squares."""
BESIDE = 1e-6
"""Nanometres in which a table falls to 0 beyond its ends."""


def light_of(value: Given) -> np.ndarray:
    """Radiance and the like as linear sRGB (3,), not negative; of an index of refraction too."""
    match value:
        case Rgb(linear):
            rgb = np.array(linear)
        case SpectrumValues((), (one,)):
            rgb = one * FROM_XYZ.sum(axis=1)
        case SpectrumValues(wavelength_nm, values):
            seen = observer() * resampled(wavelength_nm, values, outside=0)
            rgb = FROM_XYZ @ (integral(seen) / integral(observer()[1]))
        case _:
            assert isinstance(value, int | float)
            rgb = np.full(3, float(value))
    return np.maximum(rgb, 0)


def reflected(value: Given) -> np.ndarray:
    """A reflectance or transmittance as linear sRGB (3,) from 0 to 1, in daylight D65."""
    match value:
        case Rgb(linear):
            rgb = np.array(linear)
        case SpectrumValues((), (one,)):
            rgb = np.full(3, one)
        case SpectrumValues(wavelength_nm, values):
            seen = observer() * illuminant(DAYLIGHT) * resampled(wavelength_nm, values, outside=0)
            rgb = FROM_XYZ @ (integral(seen) / integral(observer()[1] * illuminant(DAYLIGHT)))
        case _:
            assert isinstance(value, int | float)
            rgb = np.full(3, float(value))
    return np.clip(rgb, 0, 1)


def reflectance_of(value: Given) -> list[float] | dict[str, list[float]]:
    """A reflectance as in a scene.toml: sRGB, or a table, which is 0 beyond its ends as in Mitsuba."""
    if not isinstance(value, SpectrumValues) or not value.wavelength_nm:
        return srgb_of(reflected(value))
    first, last = value.wavelength_nm[0], value.wavelength_nm[-1]
    if first >= WAVELENGTH_NM[-1] or last <= WAVELENGTH_NM[0]:
        return [0.0, 0.0, 0.0]
    table = dict(zip(value.wavelength_nm, np.clip(value.value, 0, 1).tolist(), strict=True))
    if first > WAVELENGTH_NM[0]:
        table = {first - BESIDE: 0.0, **table}
    if last < WAVELENGTH_NM[-1]:
        table[last + BESIDE] = 0.0
    return {"wavelength_nm": [*table], "value": [*table.values()]}


class MitsubaTextures:
    """The textures of one scene."""

    def __init__(self, scene: MitsubaScene) -> None:
        self._pictures = read_named(
            scene,
            ("bitmap",),
            read_pictures,
            lambda pixels: pixels.nbytes,
            LARGEST_TOTAL_BYTES,
            "bytes of images",
        )

    def stored(self, bitmap: Plugin) -> np.ndarray:
        """The pixels of a picture as they are in the file, (H, W, 3), uint8 or uint16."""
        return self._pictures[bitmap.text("filename")][..., :3]

    def linear(self, texture: Plugin) -> np.ndarray:
        """A texture as the renderer sees it, (H, W, 3) float32; of a checkerboard its two by two squares."""
        if texture.type == "checkerboard":
            one, other = self.colours(texture)
            row = np.repeat([one, other], CHECK_PIXELS // 2, axis=0)
            return np.repeat([row, row[::-1]], CHECK_PIXELS // 2, axis=0).astype(np.float32)
        pixels = self.stored(texture)
        most = np.iinfo(pixels.dtype).max
        numbers = np.arange(most + 1) / most
        return (numbers if texture.parameters["raw"] else srgb_to_linear(numbers)).astype(np.float32)[pixels]

    def numbers(self, texture: Plugin) -> np.ndarray:
        """A texture where the renderer needs numbers, (H, W) float32: the luminance of its colours.

        For numbers the renderer has the two colours of a checkerboard the other way round (eval_1).
        """
        numbers = self.linear(texture) @ LUMINANCE.astype(np.float32)
        return numbers[:, ::-1] if texture.type == "checkerboard" else numbers

    def colours(self, checkerboard: Plugin) -> tuple[np.ndarray, np.ndarray]:
        """The two colours of a checkerboard, linear (3,); that of its first square comes first."""
        one, other = (self.flat(checkerboard.parameters[name]) for name in ("color0", "color1"))
        return one, other

    def flat(self, value: Given, of: Callable[[Given], np.ndarray] = reflected) -> np.ndarray:
        """A colour, linear (3,), as `of` makes it; of a texture the mean of what the renderer sees."""
        if not isinstance(value, Plugin):
            return of(value)
        if value.type == "checkerboard":
            return np.mean(self.colours(value), axis=0)
        return self.linear(value).mean(axis=(0, 1), dtype=np.float64)

    def held(self, bitmap: Plugin) -> np.ndarray:
        """What the renderer sees of a picture as numbers that are taken as they are, uint8 or uint16."""
        if bitmap.parameters["raw"]:
            return self.stored(bitmap)
        return np.round(self.linear(bitmap) * 65535).astype(np.uint16)

    def painted(self, texture: Plugin, factor: np.ndarray) -> dict[str, Any] | np.ndarray:
        """A texture times a linear factor (3,): a pattern as in a scene.toml, or pixels as sRGB (H, W, 3)."""
        if texture.type == "checkerboard":
            colours = [srgb_of(colour * factor) for colour in self.colours(texture)]
            return {"type": "checks", "rows": 2, "columns": 2, "colours": colours, "pixels": CHECK_PIXELS}
        if (factor == 1).all() and not texture.parameters["raw"]:
            return self.stored(texture)
        return np.round(linear_to_srgb(self.linear(texture) * factor) * 65535).astype(np.uint16)
