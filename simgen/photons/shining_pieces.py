"""Pieces of all that shines and can be seen, each with a bound of how many photons its points send to a film.

A point P of a surface with the normal n, which a camera at C sees at depth z, fills the film per mm^2 of
surface with (f / pixel)^2 n.(C - P) / z^3 px, so a piece of the radiance L sends the film at most

    L (f / pixel)^2 max n.(C - P) / min z^3

per mm^2 (the product of both sides' cosines over the squared distance, in film coordinates). The bound is
rigorous: it holds for every point of the piece and every camera, however small or bright the piece is. Pieces
whose bound is much above what they send, because of their depth, their picture or the border of the film, are
halved until they matter no more; what no camera can see is left out.

Plain NumPy, double precision; see `emission_sampler` for use.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from simgen.cameras import Rig, as_rig, corners
from simgen.renderer import ShiningSurface

NEAREST_MM = 1e-3
"""What shines nearer to a camera than this is taken to be this far away."""
LOOSE = 1.3
"""A piece is halved if its bound is more than this factor above what one of its points sends."""
FINE_SHARE = 1 / 2048
"""But not if it has less than this share of the whole; smaller shares cost time here and save candidates."""
MOST_PIECES = 1 << 14
"""No piece is halved where there are this many."""
SLIVER = 1e-6
"""A triangle whose height is a smaller share of its longest side has no area: its normal is mere rounding."""
ROUNDING = 1 + 1e-9
"""The bound is raised by this factor, above the rounding of what it is compared with."""


class Pieces(NamedTuple):
    """Flat triangles (P, 3, 3) in mm, the surface that each belongs to, and its bound in radiance px / mm^2.

    `texcoords` (P, 3, 2) are 0 where the surface has no picture. Of a ball `height_mm` is the distance of
    the triangle's plane from its centre; 0 for what is flat.
    """

    surface: np.ndarray
    corners_mm: np.ndarray
    texcoords: np.ndarray
    height_mm: np.ndarray
    bound: np.ndarray

    @property
    def area_mm2(self) -> np.ndarray:
        """Area of each, (P,)."""
        return np.linalg.norm(_across(self.corners_mm), axis=1) / 2

    @property
    def normal(self) -> np.ndarray:
        """Unit normals (P, 3) of the triangles."""
        across = _across(self.corners_mm)
        return across / np.linalg.norm(across, axis=1, keepdims=True)

    def take(self, which: np.ndarray) -> "Pieces":
        """Some of them, by mask or index."""
        return Pieces(*(column[which] for column in self))


def pieces_in_view(surfaces: Sequence[ShiningSurface], rig: Rig) -> Pieces:
    """All pieces that a camera may see; there may be none."""
    pieces, is_loose = _bounded(_whole(surfaces), surfaces, rig)
    while True:
        sent = pieces.bound * pieces.area_mm2
        halved = is_loose & (sent > FINE_SHARE * sent.sum())
        if not halved.any() or sent.size + halved.sum() > MOST_PIECES:
            return pieces
        halves, are_loose = _bounded(_halves(pieces.take(halved)), surfaces, rig)
        pieces = _joined([pieces.take(~halved), halves])
        is_loose = np.concatenate([is_loose[~halved], are_loose])


def _whole(surfaces: Sequence[ShiningSurface]) -> Pieces:
    """The surfaces' own triangles but for those without area; bounds are not known yet."""
    parts = []
    for number, one in enumerate(surfaces):
        corners_mm = one.corners_mm.astype(np.float64)
        twice_mm2 = np.linalg.norm(_across(corners_mm), axis=1)
        has_area = twice_mm2 > SLIVER * _sides_mm(corners_mm).max(axis=1) ** 2
        count, texcoords = int(has_area.sum()), one.texcoords
        texcoords = np.zeros((count, 3, 2)) if texcoords is None else texcoords[has_area]
        zero = np.zeros(count)
        part = Pieces(np.full(count, number), corners_mm[has_area], texcoords, zero, zero)
        if one.ball is not None:
            height_mm = ((part.corners_mm[:, 0] - one.ball[0]) * part.normal).sum(axis=1)
            part = part._replace(height_mm=height_mm)
        parts.append(part)
    return _joined(parts)


def _bounded(pieces: Pieces, surfaces: Sequence[ShiningSurface], rig: Rig) -> tuple[Pieces, np.ndarray]:
    """The pieces that may be seen, with their bounds, and whether each is much above what the piece sends."""
    count, normal = pieces.surface.size, pieces.normal
    balls = [(np.zeros(3), 0.0) if one.ball is None else one.ball[:2] for one in surfaces]
    centre_mm, radius_mm = (np.array(column)[pieces.surface] for column in zip(*balls, strict=True))
    is_round = radius_mm > 0
    # How far the surface bulges out of its triangle, and how much more area it has at most.
    bulge_mm = np.where(is_round, radius_mm - pieces.height_mm, 0)
    stretch = np.where(is_round, radius_mm / np.where(is_round, pieces.height_mm, 1), 1) ** 2
    outwards = (pieces.corners_mm - centre_mm[:, None]) / np.where(is_round, radius_mm, 1)[:, None, None]
    turned = np.where(is_round, np.linalg.norm(outwards - normal[:, None], axis=2).max(axis=1), 0)

    # Over all cameras: each corner's place before the camera, and how far above the surface the camera is.
    low_mm, high_mm = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    low_px, high_px = np.full((count, 2), np.inf), np.full((count, 2), -np.inf)
    above_mm, least_above_mm = np.full(count, -np.inf), np.full(count, np.inf)
    grid = rig.grid
    scale_px, widest = grid.focal_mm / grid.pixel_mm, np.zeros(2)
    size_px = np.array([grid.width, grid.height])
    for k, l in _extreme_cameras(rig):
        place_mm, axis_px = rig.position_mm[k, l], rig.axis_px[k, l]
        before_mm = (pieces.corners_mm - place_mm) @ rig.rotation[k, l]
        low_mm = np.minimum(low_mm, before_mm.min(axis=1))
        high_mm = np.maximum(high_mm, before_mm.max(axis=1))
        film_px = before_mm[..., :2] / np.maximum(before_mm[..., 2:], NEAREST_MM) * scale_px + axis_px
        low_px, high_px = np.minimum(low_px, film_px.min(axis=1)), np.maximum(high_px, film_px.max(axis=1))
        widest = np.maximum(widest, np.maximum(axis_px + 0.5, size_px - 0.5 - axis_px) / scale_px)
        # n.(C - P) is the same all over a flat piece; on a ball it is n.(C - centre) - radius.
        flat_mm = ((place_mm - pieces.corners_mm[:, 0]) * normal).sum(axis=1)
        round_mm = ((place_mm - centre_mm) * normal).sum(axis=1) - radius_mm
        spread_mm = turned * np.linalg.norm(place_mm - centre_mm, axis=1)
        above_mm = np.maximum(above_mm, np.where(is_round, round_mm + spread_mm, flat_mm))
        least_above_mm = np.minimum(least_above_mm, np.where(is_round, round_mm - spread_mm, flat_mm))
    low_mm, high_mm = low_mm - bulge_mm[:, None], high_mm + bulge_mm[:, None]
    aperture_mm, per_focus = 0.0, 0.0
    if rig.lens is not None:
        aperture_mm, per_focus = rig.lens.aperture_mm / 2, rig.lens.aperture_mm / 2 / rig.lens.focus_mm
    # What is seen at the side of the film is at least as far ahead as the film's widest slope allows.
    aside_mm = np.maximum(np.maximum(low_mm, -high_mm)[:, :2] - aperture_mm, 0) / (widest + per_focus)
    nearest_mm = np.maximum(np.maximum(low_mm[:, 2], NEAREST_MM), aside_mm.max(axis=1))
    farthest_mm = high_mm[:, 2]
    is_cut = low_mm[:, 2] <= NEAREST_MM
    blur_px = scale_px * ((bulge_mm + aperture_mm) / nearest_mm + per_focus)[:, None]
    low_px = np.where(is_cut[:, None], -np.inf, low_px - blur_px)
    high_px = np.where(is_cut[:, None], np.inf, high_px + blur_px)
    is_seen = (farthest_mm >= nearest_mm) & (above_mm + aperture_mm > 0)
    is_seen &= ((high_px > -0.5) & (low_px < size_px - 0.5)).all(axis=1)
    sent = np.where(is_seen, (above_mm + aperture_mm) / nearest_mm**3, 0)
    is_loose = sent > LOOSE * np.maximum(least_above_mm, 0) / np.maximum(farthest_mm, nearest_mm) ** 3
    is_loose |= ((low_px < -0.5) | (high_px > size_px - 0.5)).any(axis=1)
    brightest, is_uneven = _brightest(pieces, surfaces)
    bound = ROUNDING * scale_px**2 * sent * stretch * brightest
    return pieces._replace(bound=bound).take(bound > 0), (is_loose | is_uneven)[bound > 0]


def _brightest(pieces: Pieces, surfaces: Sequence[ShiningSurface]) -> tuple[np.ndarray, np.ndarray]:
    """Radiance (P,) in its brightest colour at most, and whether parts of the piece have much less."""
    brightest, is_uneven = np.empty(pieces.surface.size), np.zeros(pieces.surface.size, dtype=bool)
    for number, one in enumerate(surfaces):
        here, picture = np.flatnonzero(pieces.surface == number), one.picture
        brightest[here] = one.radiance.max()
        if picture is None:
            continue
        size = np.array(picture.shape[1::-1])
        place_px = (pieces.texcoords[here] * [1, -1] + [0, 1]) * size - 0.5
        # Two pixels more: linear interpolation takes the next one, and on a ball the picture is bent.
        first = np.clip(np.floor(place_px.min(axis=1)) - 2, 0, size - 1).astype(np.int64)
        last = np.clip(np.ceil(place_px.max(axis=1)) + 2, 0, size - 1).astype(np.int64)
        for piece, (left, top), (right, bottom) in zip(here, first, last, strict=True):
            part = picture[top : bottom + 1, left : right + 1]
            highest = part.max()
            brightest[piece] *= highest
            is_uneven[piece] = highest > LOOSE * part.max(axis=-1).mean()
    return brightest, is_uneven


def _extreme_cameras(rig: Rig) -> list[tuple[int, int]]:
    """Cameras between which all others stand: those at the corners, or all where errors move them."""
    is_exact = np.array_equal(rig.position_mm, as_rig(rig.grid).position_mm)
    is_exact &= bool((rig.rotation == np.eye(3)).all())
    return corners(rig.grid) if is_exact else list(np.ndindex(rig.grid.rows, rig.grid.cols))


def _halves(pieces: Pieces) -> Pieces:
    """Each piece cut in two at the middle of its longest side."""
    number = np.arange(pieces.surface.size)
    order = (_sides_mm(pieces.corners_mm).argmax(axis=1)[:, None] + np.arange(3)) % 3

    def cut(values: np.ndarray) -> np.ndarray:
        """The first half keeps the side's first corner and the second its other one; both turn as before."""
        first, second = values[number[:, None], order], values[number[:, None], order]
        first[:, 1] = second[:, 0] = first[:, :2].mean(axis=1)
        return np.concatenate([first, second])

    halves = pieces.take(np.tile(number, 2))
    return halves._replace(corners_mm=cut(pieces.corners_mm), texcoords=cut(pieces.texcoords))


def _joined(parts: Sequence[Pieces]) -> Pieces:
    return Pieces(*map(np.concatenate, zip(*parts, strict=True)))


def _sides_mm(corners_mm: np.ndarray) -> np.ndarray:
    """Lengths (P, 3) of the triangles' sides, each from the corner of its number to the next."""
    return np.linalg.norm(corners_mm - np.roll(corners_mm, -1, axis=1), axis=2)


def _across(corners_mm: np.ndarray) -> np.ndarray:
    return np.cross(corners_mm[:, 1] - corners_mm[:, 0], corners_mm[:, 2] - corners_mm[:, 0])
