"""The grid of cameras, and what their sensors record: one colour of each pixel, in frames of few bits.

A Bayer pattern is named by its first two rows, read left to right, top to bottom: in ``GRBG`` the pixel
(0, 0) is green, (0, 1) red, (1, 0) blue and (1, 1) green (Muniraj et al. 2017, Fig. 3).

A single-photon camera divides the exposure into T equal frames. In each a pixel stops at m = 2^bits - 1
counts; of one bit it shows whether there was a photon at all. With mu photons expected in a frame the number
of frames with a photon is binomial, of T with the probability 1 - exp(-mu) (Fossum, "What to do with sub-
diffraction-limit pixels? A proposal for a gigapixel digital film sensor", 2005; Yang et al., "Bits from
photons", IEEE Trans. Image Process. 21, 2012).
"""

import math
from dataclasses import dataclass
from typing import TypeGuard

import numpy as np

from pcii.base import InputError
from pcii.types.arrays import is_whole

COLOURS = "RGB"
PATTERNS = ("GRBG", "RGGB", "BGGR", "GBRG")

MOST_FRAMES = 1 << 24
"""At 100 000 frames a second, three minutes."""

MOST_BITS = 32

NEGLIGIBLE_LOSS = 0.02
"""Share of photons lost to saturation up to which a model of Poisson counts holds well: contrasts and the
variance of counts are each too small by this share, less than the noise of either (docs/single_photon.md)."""

NEWTON_STEPS = 100
"""A mean within 1e-12 of the limit of 2 to 32 bits takes 36 at most."""


def _is_finite(value: object) -> TypeGuard[float]:
    number = isinstance(value, int | float | np.integer | np.floating)
    return number and not isinstance(value, bool) and math.isfinite(value)


@dataclass(frozen=True, kw_only=True)
class CameraGrid:
    """A grid of `rows` x `cols` parallel pinhole cameras in the plane Z = 0, looking along +Z.

    Camera (k, l), k from the top, l from the left, stands at X = (l - (cols-1)/2) pitch_x,
    Y = (k - (rows-1)/2) pitch_y. `pitch_mm` is (pitch_x, pitch_y). Each image has `height` x `width`
    square pixels of `pixel_mm`, `focal_mm` behind the pinhole; the optical axis meets pixel
    ((height-1)/2, (width-1)/2). In a sheared grid `shear_px` (x, y) is not 0: it moves each camera's axis to
    the right (down), by this number of px per camera step from the centre of the grid, so that a point whose
    parallax equals the shear appears at the same pixel of all views. Raises `InputError` for a size below 1,
    a length not above 0 or a shear that is not finite.

    >>> grid = CameraGrid(
    ...     rows=10, cols=10, pitch_mm=(5.0, 5.0), focal_mm=50.0, pixel_mm=0.0352, height=1024, width=1024
    ... )
    >>> grid.view_count, grid.shape_KLHW
    (100, (10, 10, 1024, 1024))
    """

    rows: int
    cols: int
    pitch_mm: tuple[float, float]
    focal_mm: float
    pixel_mm: float
    height: int
    width: int
    shear_px: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        for name in ("rows", "cols", "height", "width"):
            size = getattr(self, name)
            if not is_whole(size) or size < 1:
                raise InputError(f"{name}: expected a whole number of at least 1, got {size!r}")
            object.__setattr__(self, name, int(size))
        for name in ("focal_mm", "pixel_mm"):
            length = getattr(self, name)
            if not (_is_finite(length) and length > 0):
                raise InputError(f"{name}: expected a finite length above 0 mm, got {length!r}")
            if isinstance(length, np.generic):  # small types of NumPy would overflow in products
                object.__setattr__(self, name, float(length))
        for name, least, words in (
            ("pitch_mm", 0.0, "lengths (x, y) above 0 mm"),
            ("shear_px", -math.inf, "numbers (x, y) of pixels"),
        ):
            pair = getattr(self, name)
            is_pair = isinstance(pair, tuple | list) and len(pair) == 2
            if not is_pair or not all(_is_finite(value) and value > least for value in pair):
                raise InputError(f"{name}: expected two finite {words}, got {pair!r}")
            object.__setattr__(self, name, (float(pair[0]), float(pair[1])))

    @property
    def view_count(self) -> int:
        """Number of cameras, rows x cols."""
        return self.rows * self.cols

    @property
    def shape_KLHW(self) -> tuple[int, int, int, int]:
        """Shape (K, L, H, W) of one monochrome stack of views."""
        return (self.rows, self.cols, self.height, self.width)

    @property
    def shape_HW(self) -> tuple[int, int]:
        """Shape (H, W) of one view, and of a section."""
        return (self.height, self.width)

    @property
    def middle_camera(self) -> tuple[int, int]:
        """The camera (k, l) in the middle, of an even number the one after it."""
        return self.rows // 2, self.cols // 2

    def check_camera(self, k: object, l: object) -> None:
        """Raise `InputError` for anything but a camera (k, l) of the grid."""
        if not (is_whole(k) and is_whole(l) and 0 <= k < self.rows and 0 <= l < self.cols):
            raise InputError(f"view: expected a camera (k, l) of {self.rows} x {self.cols}, got ({k}, {l})")


def check_cfa(cfa: str | None) -> str | None:
    """Return `cfa` if it names a Bayer pattern or is None (monochrome), else raise `InputError`."""
    if cfa is None or cfa in PATTERNS:
        return cfa
    raise InputError(
        f"cfa: there is no Bayer pattern {cfa!r}; use one of {', '.join(PATTERNS)}, "
        "or none (None in Python) for a monochrome sensor"
    )


def channel_count(cfa: str | None) -> int:
    """Number of colours of a pattern: 3, or 1 for a monochrome sensor (None)."""
    return 1 if cfa is None else 3


def colour_cells(cfa: str | None) -> np.ndarray:
    """Colour of each cell of the 2 x 2 pattern, shape (2, 2), int; 0, 1, 2 = R, G, B.

    A monochrome sensor has the single colour 0 everywhere. Raises `InputError` for an unknown pattern.

    >>> colour_cells("GRBG").tolist()
    [[1, 0], [2, 1]]
    """
    check_cfa(cfa)
    if cfa is None:
        return np.zeros((2, 2), dtype=np.int64)
    return np.array([COLOURS.index(letter) for letter in cfa], dtype=np.int64).reshape(2, 2)


def colour_index(height: int, width: int, cfa: str | None) -> np.ndarray:
    """Colour that each pixel records, shape (height, width), uint8; 0, 1, 2 = R, G, B."""
    cells = colour_cells(cfa).astype(np.uint8)
    return np.tile(cells, ((height + 1) // 2, (width + 1) // 2))[:height, :width]


def colours_and_samples(
    light: np.ndarray, cfa: str | None, samples: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Light and number of samples, (H, W, C) each, of an image (H, W, C) that may be a mosaic.

    `samples` (H, W, C) are those of the image, by default one everywhere. A pixel of a mosaic is 0 in the
    colours that it does not record.

    >>> colours_and_samples(np.array([[[2], [4]]]), "GRBG")[0].tolist()
    [[[0, 2, 0], [4, 0, 0]]]
    """
    samples = np.ones(light.shape, dtype=np.int64) if samples is None else samples
    if cfa is None:
        return light, samples
    is_recorded = colour_index(light.shape[0], light.shape[1], cfa)[..., None] == np.arange(3)
    return light * is_recorded, samples * is_recorded


def mosaic(rgb: np.ndarray, cfa: str) -> np.ndarray:
    """Bayer mosaic (..., H, W) of a colour image (..., H, W, 3), same dtype: one colour of each pixel.

    Raises `InputError` for another shape or an unknown pattern.

    >>> mosaic(np.array([[[1, 2, 3], [4, 5, 6]]]), "GRBG")
    array([[2, 4]])
    """
    if rgb.ndim < 3 or rgb.shape[-1] != 3:
        raise InputError(f"rgb: expected an array (..., H, W, 3), got shape {rgb.shape}")
    raw = np.empty(rgb.shape[:-1], dtype=rgb.dtype)
    for (a, b), colour in np.ndenumerate(colour_cells(cfa)):
        raw[..., a::2, b::2] = rgb[..., a::2, b::2, colour]
    return raw


@dataclass(frozen=True)
class Readout:
    """An exposure of equal `frames`, in each of which a pixel stops at 2^`bits` - 1 counts.

    Without `bits` it does not stop. Raises `InputError` for a number of frames or bits that cannot be.
    """

    frames: int = 1
    bits: int | None = None

    def __post_init__(self) -> None:
        for name, value, most in (("frames", self.frames, MOST_FRAMES), ("bits", self.bits, MOST_BITS)):
            if name == "bits" and value is None:
                continue
            if not is_whole(value) or not 1 <= value <= most:
                raise InputError(f"{name}: expected a whole number from 1 to {most}, got {value!r}")
            object.__setattr__(self, name, int(value))

    @property
    def is_plain(self) -> bool:
        """Whether nothing but the photons decides the counts: one frame, and no limit."""
        return self.frames == 1 and self.bits is None

    @property
    def most_per_frame(self) -> int | None:
        """Counts at which a pixel stops in each frame, None for no limit."""
        return None if self.bits is None else (1 << self.bits) - 1

    def check(self, n: np.ndarray) -> None:
        """Raise `InputError` for counts of a pixel that its frames cannot hold."""
        most, largest = self.most_per_frame, int(n.max(initial=0))
        if most is not None and largest > most * self.frames:
            raise InputError(
                f"n: a pixel has {largest} counts, where frames = {self.frames}, bits = {self.bits} hold "
                f"{most * self.frames} at most"
            )

    def photons(self, counts: np.ndarray, samples: np.ndarray) -> np.ndarray:
        """Photons per pixel and exposure where `samples` pixels have `counts` in all, float64.

        Both are whole numbers of one shape. Without a limit it is the mean, counts / samples; of one bit the
        maximum-likelihood estimate -T ln(1 - N / (V T)) of N set bits in V samples; of more bits the mean of
        Poisson numbers whose mean after they are clipped is that of the counts. Infinite where all frames are
        full, 0 without samples.
        """
        mean = np.zeros(counts.shape, dtype=np.float64)
        np.divide(counts, samples, out=mean, where=samples > 0)
        most = self.most_per_frame
        if most is None:
            return mean
        lit = (counts > 0) & (samples > 0)
        number, trials = counts[lit].astype(np.float64), samples[lit].astype(np.float64) * self.frames
        if most == 1:
            with np.errstate(divide="ignore"):
                few, many = -np.log1p(-number / trials), np.log(trials) - np.log(trials - number)
            # Where most bits are set the difference is taken first, in whole numbers.
            rate = np.where(number <= trials / 2, few, many)
        else:
            rate = _rate(number / trials, most)
        mean[lit] = self.frames * rate
        return mean


PLAIN = Readout()
"""One frame without a limit."""


def clipped_mean(rate: np.ndarray, most: int) -> np.ndarray:
    """Mean of Poisson numbers of these rates, clipped at `most`: mu P(X < most) + most P(X > most)."""
    from scipy.special import pdtr, pdtrc

    return rate * pdtr(most - 1, rate) + most * pdtrc(most, rate)


def _rate(mean: np.ndarray, most: int) -> np.ndarray:
    """The mean mu of Poisson numbers that have this `mean` when they are clipped at `most`.

    `clipped_mean` is concave and has the slope P(X < most), so Newton's steps from the mean, which is never
    above mu, approach it from one side.
    """
    from scipy.special import pdtr

    rate = np.where(mean < most, mean, np.inf)
    open_ = np.isfinite(rate)
    for _ in range(NEWTON_STEPS):
        mu = rate[open_]
        step = np.maximum(mean[open_] - clipped_mean(mu, most), 0) / pdtr(most - 1, mu)
        rate[open_] = mu + step
        open_[open_] = step > 1e-15 * mu
        if not open_.any():
            break
    return rate
