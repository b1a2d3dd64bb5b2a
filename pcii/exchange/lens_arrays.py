"""Pictures of a lens array: one picture that holds the elemental images of all lenses side by side."""

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pcii.base.errors import InputError
from pcii.exchange.image_folders import AS_STORED, VIEWS, Optics, ViewOrder, check_size, views_of
from pcii.exchange.pixel_files import Encoding, check_encoding, decode, picture_of, radiance_of
from pcii.types.images import Views


@dataclass(frozen=True, kw_only=True)
class LensArray:
    """Where the images of `rows` x `cols` lenses are in a picture.

    They repeat every `pitch_px` (x, y), which need not be whole; `offset_px` (x, y) is the left upper corner
    of the first. `inverted`: each is upside down, as a lens projects it on a sensor, and is turned by 180
    degrees. Raises `InputError` for no lenses, and for a pitch below 1 px.
    """

    rows: int
    cols: int
    pitch_px: tuple[float, float]
    offset_px: tuple[float, float] = (0.0, 0.0)
    inverted: bool = False

    def __post_init__(self) -> None:
        if min(self.rows, self.cols) < 1:
            raise InputError(f"rows, cols: expected at least one lens, got {self.rows} x {self.cols}")
        if not all(math.isfinite(pitch) and pitch >= 1 for pitch in self.pitch_px):
            raise InputError(f"pitch_px: expected at least 1 px from lens to lens, got {self.pitch_px}")
        if not all(math.isfinite(offset) for offset in self.offset_px):
            raise InputError(f"offset_px: expected two numbers of pixels, got {self.offset_px}")


def import_lens_array(
    path: str | Path,
    lenses: LensArray,
    optics: Optics,
    *,
    order: ViewOrder = AS_STORED,
    encoding: Encoding | None = None,
    cfa: str | None = None,
) -> Views:
    """Radiance of the elemental images of a picture of a lens array, cut apart.

    Images are cut around the centre of each lens, floor(pitch) pixels wide and high; where they do not begin
    at whole pixels they are interpolated, so that no depth is lost to rounding. `optics` are of one lens: its
    focal length (or gap), the distance between lenses as `pitch_mm`, and pixels of the picture; `sensor_mm`
    is the width of the whole picture. `cfa` is a Bayer pattern, of which a grey picture is a mosaic. Raises
    `InputError` for lenses that are not within the picture, and for a mosaic that cutting or turning breaks.
    """
    check_encoding(encoding)
    picture = picture_of(Path(path), VIEWS)
    if picture.pages > 1:
        raise InputError(f"{path}: has {picture.pages} pages; expected one picture")
    height, width, channels = picture.shape
    optics = replace(optics, pixel_mm=optics.pixel_of(width), sensor_mm=None)
    across = _starts(lenses.cols, lenses.pitch_px[0], lenses.offset_px[0], width, "wide", path)
    down = _starts(lenses.rows, lenses.pitch_px[1], lenses.offset_px[1], height, "high", path)
    size = math.floor(lenses.pitch_px[1]), math.floor(lenses.pitch_px[0])
    check_size(Path(path), (lenses.rows, lenses.cols, *size, channels))
    starts_evenly = not (np.concatenate([across, down]) % 2).any()
    if cfa is not None and channels == 1 and (lenses.inverted or not starts_evenly):
        raise InputError(
            f"{path}: is a mosaic, whose pattern lens images break that are turned or do not begin at even "
            "pixels; give the picture in colours"
        )
    whole = radiance_of(picture, next(decode(picture)), encoding)
    views = _cut(_cut(whole, down, size[0], 0), across, size[1], 2).swapaxes(1, 2)  # (K, h, L, w, C) before
    if lenses.inverted:
        views = views[:, :, ::-1, ::-1]
    views = np.ascontiguousarray(order.arrange(views))
    return views_of(views, optics.grid(views.shape), cfa)


def _starts(count: int, pitch: float, offset: float, size: int, how: str, path: str | Path) -> np.ndarray:
    """Where the images of the lenses of an axis begin, (count,), in px."""
    first = offset + (pitch - math.floor(pitch)) / 2
    end = first + pitch * (count - 1) + math.floor(pitch)
    if first < 0 or end > size + 1e-6:
        raise InputError(
            f"{path}: {count} lenses of {pitch:g} px from {offset:g} px on reach to {end:g}, and the picture "
            f"is {size} px {how}"
        )
    return first + pitch * np.arange(count)


def _cut(picture: np.ndarray, starts: np.ndarray, size: int, axis: int) -> np.ndarray:
    """Pieces of an axis that begin at `starts`, by linear interpolation: the axis becomes (count, size)."""
    at = starts[:, None] + np.arange(size)
    floor = np.minimum(np.floor(at + 1e-9).astype(int), picture.shape[axis] - 1)
    share = np.clip(at - floor, 0, 1).astype(np.float32)
    share = share.reshape(*share.shape, *[1] * (picture.ndim - axis - 1))
    above = np.minimum(floor + 1, picture.shape[axis] - 1)
    return picture.take(floor, axis) * (1 - share) + picture.take(above, axis) * share
