"""Elemental images: the radiance of every view, its light, and photon limiting (Muniraj et al. 2017, Eq. 1).

The radiance of a scope is normalised to 1 and multiplied by the photons of a light: the expected photons of
each pixel.
"""

from dataclasses import dataclass
from typing import Any, Literal, Self

import numpy as np

from pcii.base import LUMINANCE, InputError, times
from pcii.types.arrays import Plottable, is_whole, read_only
from pcii.types.cameras import CameraGrid, channel_count, check_cfa, colour_index, colours_and_samples, mosaic
from pcii.types.photon_counts import PhotonCounts

MOST_PHOTONS = 1e12
"""Largest budget of a view; sums stay exact."""
Scope = Literal["view", "channel", "scene", "exposure", "full-light"]


@dataclass(frozen=True, eq=False, repr=False)
class Views(Plottable):
    """Linear radiance of every elemental image, (K, L, H, W, C), C = 1 or 3.

    `cfa` names the Bayer pattern when C = 1 and the images are mosaics; None means that every pixel
    holds all C channels. Numbers are proportional to light: 8-bit and 16-bit whole numbers are refused, since
    those of pictures are nearly always sRGB (`pcii.srgb_to_linear`, `pcii.import_images`). `radiance` may be
    any object with `shape` and `[k, l]` (an array, or a reader that loads one view at a time).
    Raises `InputError` for another shape or an unknown pattern.

    >>> grid = CameraGrid(rows=1, cols=2, pitch_mm=(5, 5), focal_mm=50, pixel_mm=0.05, height=4, width=6)
    >>> Views(np.ones((1, 2, 4, 6, 3)), grid)
    Views(shape=1 x 2 x 4 x 6 x 3)
    """

    radiance: Any
    grid: CameraGrid
    cfa: str | None = None

    def __post_init__(self) -> None:
        check_cfa(self.cfa)
        shape = tuple(self.radiance.shape)
        if len(shape) != 5 or shape[:4] != self.grid.shape_KLHW or shape[4] not in (1, 3):
            raise InputError(f"radiance: expected shape {(*self.grid.shape_KLHW, '1 or 3')}, got {shape}")
        if self.cfa is not None and shape[4] != 1:
            raise InputError("radiance: a Bayer mosaic has one channel per pixel, C = 1")
        if isinstance(self.radiance, np.ndarray):
            dtype = self.radiance.dtype
            if dtype.kind not in "fiu":
                raise InputError(f"radiance: expected real numbers, got {dtype}")
            if dtype.newbyteorder("=") in (np.uint8, np.uint16):
                raise InputError(f"radiance: {dtype} is sRGB of pictures; decode it by pcii.srgb_to_linear")
            object.__setattr__(self, "radiance", read_only(self.radiance))

    def _facts(self) -> dict[str, object]:
        return {"shape": times(self.radiance.shape), "cfa": self.cfa}

    @property
    def channel_count(self) -> int:
        """Number of colours of sections of these views."""
        return 3 if self.cfa is not None else self.radiance.shape[4]

    def in_colours(self, k: int, l: int) -> tuple[np.ndarray, np.ndarray]:
        """Light and numbers of samples of camera (k, l), (H, W, C) each, in the colours of the pixels."""
        return colours_and_samples(self.view(k, l), self.cfa)

    def view(self, k: int, l: int) -> np.ndarray:
        """Image (H, W, C) of camera (k, l); `InputError` for no camera of the grid, NaN or infinity."""
        self.grid.check_camera(k, l)
        image = np.asarray(self.radiance[k, l])
        if not np.all(np.isfinite(image)):
            raise InputError(f"radiance: view ({k}, {l}) holds NaN or infinity")
        return image


def binary_scale(views: Views) -> float:
    """The power of two nearest above the light of the middle view, or 1 if that is within 2^-20 .. 2^20.

    Methods whose result does not depend on the unit of radiance divide by it, which is exact, so that squares
    neither overflow nor vanish.
    """
    middle = views.view(*views.grid.middle_camera)
    exponent = int(np.frexp(max(abs(float(middle.max())), abs(float(middle.min()))))[1])
    return 1.0 if abs(exponent) <= 20 else 2.0 ** min(exponent, 1023)


@dataclass(frozen=True)
class Light:
    """The light of a dataset: `photons` expected in each `scope`.

    A scope is a "view", a colour of a view ("channel") or all views ("scene"). `photons` is None for an
    "exposure", whose photons nobody states, and for "full-light", the radiance. Raises `InputError` for a
    number that is not above 0 or is larger than 10^12, and for one that such a scope does not have.
    """

    photons: float | None
    scope: Scope = "view"

    def __post_init__(self) -> None:
        n, is_valid, expected = self.photons, self.photons is None, "None"
        if self.scope not in ("exposure", "full-light"):
            is_valid = isinstance(n, int | float | np.number) and n is not True and 0 < n <= MOST_PHOTONS
            expected = f"a number above 0 and up to {MOST_PHOTONS:g}"
        if not is_valid:
            raise InputError(f"photons: expected {expected}, got {n!r}")

    @classmethod
    def parse(cls, text: float | str) -> Self:
        """A light as people and files state it: a number of photons, "full-light" or "exposure".

        Of a number the scope is a view. Raises `InputError` for anything else.

        >>> Light.parse("300"), str(Light.parse("300")), Light.parse("full-light") == FULL_LIGHT
        (Light(photons=300.0, scope='view'), '300', True)
        """
        if text in ("full-light", "exposure"):
            return cls(None, text)
        try:
            photons = float(text)
        except ValueError:
            raise InputError(f"budget: expected a number of photons or 'full-light', got {text!r}") from None
        return cls(photons)

    @property
    def stored(self) -> float | str | None:
        """The light as files have it: its photons, None for an exposure, or "full-light"."""
        return self.scope if self == FULL_LIGHT else self.photons

    def __str__(self) -> str:
        return self.scope if self.photons is None else f"{self.photons:.12g}"


EXPOSURE, FULL_LIGHT = Light(None, "exposure"), Light(None, "full-light")


def sense(radiance: np.ndarray, cfa: str | None) -> np.ndarray:
    """What a sensor's pixels see of radiance (H, W, C): (H, W), same units and dtype.

    A Bayer pixel keeps its own colour; a monochrome one the luminance of linear sRGB (float64 of whole
    numbers), or the one channel that its camera has.
    """
    if radiance.shape[2] == 1:
        return radiance[..., 0]
    if cfa is not None:
        return mosaic(radiance, cfa)
    with np.errstate(over="ignore"):  # infinite energies are refused
        luminance = radiance @ LUMINANCE
        return luminance.astype(radiance.dtype) if radiance.dtype.kind == "f" else luminance


def scope_energies(raw: np.ndarray, cfa: str | None, scope: str) -> np.ndarray:
    """Energy of one view's mosaic, over which its scope is normalised: (C,) for channel, else (1,).

    Sums are float64: float32 sums of a million pixels are wrong in the third digit.
    """
    if scope != "channel":
        with np.errstate(over="ignore"):
            return np.array([raw.sum(dtype=np.float64)])
    colours = colour_index(raw.shape[0], raw.shape[1], cfa)
    return np.bincount(colours.ravel(), raw.ravel(), minlength=channel_count(cfa))


def photon_rates(raw: np.ndarray, cfa: str | None, light: Light, energies: np.ndarray) -> np.ndarray:
    """Expected photons per pixel, (H, W) float64: the light shared out in proportion to `raw`.

    `energies` are those of `scope_energies`, for scope "scene" summed over all views. A scope with
    no light at all gets no photons. Raises `InputError` if radiance or its sum is not finite.
    """
    if not np.all(np.isfinite(energies)):
        raise InputError("radiance: the view holds NaN or infinity, or more light than can be added up")
    assert light.photons is not None  # of a scope that is normalised
    # The energy of the scope of each pixel, or of all.
    height, width = raw.shape
    energy = energies[colour_index(height, width, cfa)] if light.scope == "channel" else energies[0]
    with np.errstate(over="ignore"):
        share = np.divide(light.photons, energy, out=np.zeros_like(energy), where=energy > 0)
    if np.isfinite(share).all():
        return raw * share
    # Of very faint light the pixel's part is taken first.
    return light.photons * np.divide(raw, energy, out=np.zeros(raw.shape), where=energy > 0)


def limit_photons(views: Views, photons: float, *, seed: int, cfa: str | None = None) -> PhotonCounts:
    """Photon counts that cameras of such views would detect with `photons` expected in each view.

    Counts are Poisson. `cfa` is the Bayer pattern of the sensor that full-colour views are seen by; without
    one it is monochrome and sees their luminance. Mosaics keep their own. Each view has random numbers
    of its own, which depend on `seed` and its number alone. Raises `InputError` for light below 0, for a
    budget that is not above 0, and for a pattern other than that of the views.

    >>> grid = CameraGrid(rows=1, cols=2, pitch_mm=(5, 5), focal_mm=50, pixel_mm=0.05, height=40, width=60)
    >>> views = Views(np.ones((1, 2, 40, 60, 3)), grid)
    >>> limit_photons(views, 1000, seed=1, cfa="GRBG")
    PhotonCounts(shape=1 x 2 x 40 x 60, cfa=GRBG, photons=2056, storage=events)
    """
    light = Light(photons)
    if not is_whole(seed) or seed < 0:
        raise InputError(f"seed: expected a whole number of at least 0, got {seed!r}")
    has_one_channel = views.radiance.shape[4] == 1
    if has_one_channel and cfa not in (None, views.cfa):
        raise InputError(f"cfa: views of one channel are of a {views.cfa or 'mono'} sensor, not {cfa}")
    pattern, grid = views.cfa or cfa, views.grid
    columns: list[np.ndarray] = []
    for number, (k, l) in enumerate(np.ndindex(grid.rows, grid.cols)):
        raw = sense(views.view(k, l), pattern)
        if raw.min() < 0:
            raise InputError(f"radiance: view ({k}, {l}) holds light below 0")
        rates = photon_rates(raw, pattern, light, scope_energies(raw, pattern, light.scope))
        rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(number,)))
        counts = rng.poisson(rates)
        i, j = np.nonzero(counts)
        columns.append(np.stack([np.full(i.size, k), np.full(i.size, l), i, j, counts[i, j]]))
    k, l, i, j, n = np.concatenate(columns, axis=1)
    return PhotonCounts.from_events(k, l, i, j, n, grid, cfa=pattern)
