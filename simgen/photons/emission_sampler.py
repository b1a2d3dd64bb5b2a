"""Candidates of photons that come straight from something that shines, drawn on its surface.

What shines has a known place, so no search finds it and none can miss it. A candidate is a point of the
surface, drawn with the bound of its piece, and a camera; it is kept with probability sent / bound if it falls
on the film and nothing stands in between. By the mapping theorem the kept ones are a Poisson process on the
film whose rate is the radiance of the surface where it is seen: a lamp of a thousandth of a pixel gets its
photons as a window of a million does. Paths through the film leave this light out
(`PathTracer.radiance_along`).

A point P of a surface with the normal n, which a camera at C sees at depth z, fills the film per mm^2 of
surface with (f / pixel)^2 n.(C - P) / z^3 px, so a piece of the radiance L sends the film at most

    L (f / pixel)^2 max n.(C - P) / min z^3

per mm^2 (the product of both sides' cosines over the squared distance, in film coordinates). The bound is
rigorous: it holds for every point of the piece and every camera, however small or bright the piece is. Pieces
whose bound is much above what they send, because of their depth, their picture or the border of the film, are
halved until they matter no more; what no camera can see is left out.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from pcii.base import LUMINANCE
from pcii.types import colour_cells
from simgen.assets import across_faces
from simgen.base import join_rows, take_rows
from simgen.cameras import Rig, as_rig, corners
from simgen.photons.candidates import Capture, cells_of, is_on_film, pixels_of
from simgen.renderer import ShiningSurface
from simgen.sensor import PhotonTable

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
SHADOW_EPSILON = 1e-5
"""Of the distance: what stands nearer than this before a shining point does not hide it. Single precision
errs by a hundredth of it."""


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
        return np.linalg.norm(across_faces(self.corners_mm), axis=1) / 2

    @property
    def normal(self) -> np.ndarray:
        """Unit normals (P, 3) of the triangles."""
        across = across_faces(self.corners_mm)
        return across / np.linalg.norm(across, axis=1, keepdims=True)


def pieces_in_view(surfaces: Sequence[ShiningSurface], rig: Rig) -> Pieces:
    """All pieces that a camera may see; there may be none."""
    pieces, is_loose = _bounded(_whole(surfaces), surfaces, rig)
    while True:
        sent = pieces.bound * pieces.area_mm2
        halved = is_loose & (sent > FINE_SHARE * sent.sum())
        if not halved.any() or sent.size + halved.sum() > MOST_PIECES:
            return pieces
        halves, are_loose = _bounded(_halves(take_rows(pieces, halved)), surfaces, rig)
        pieces = join_rows([take_rows(pieces, ~halved), halves])
        is_loose = np.concatenate([is_loose[~halved], are_loose])


def _whole(surfaces: Sequence[ShiningSurface]) -> Pieces:
    """The surfaces' own triangles but for those without area; bounds are not known yet."""
    parts = []
    for number, one in enumerate(surfaces):
        corners_mm = one.corners_mm.astype(np.float64)
        twice_mm2 = np.linalg.norm(across_faces(corners_mm), axis=1)
        has_area = twice_mm2 > SLIVER * _sides_mm(corners_mm).max(axis=1) ** 2
        count, texcoords = int(has_area.sum()), one.texcoords
        texcoords = np.zeros((count, 3, 2)) if texcoords is None else texcoords[has_area]
        zero = np.zeros(count)
        part = Pieces(np.full(count, number), corners_mm[has_area], texcoords, zero, zero)
        if one.ball is not None:
            height_mm = ((part.corners_mm[:, 0] - one.ball[0]) * part.normal).sum(axis=1)
            part = part._replace(height_mm=height_mm)
        parts.append(part)
    return join_rows(parts)


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
    return take_rows(pieces._replace(bound=bound), bound > 0), (is_loose | is_uneven)[bound > 0]


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

    halves = take_rows(pieces, np.tile(number, 2))
    return halves._replace(corners_mm=cut(pieces.corners_mm), texcoords=cut(pieces.texcoords))


def _sides_mm(corners_mm: np.ndarray) -> np.ndarray:
    """Lengths (P, 3) of the triangles' sides, each from the corner of its number to the next."""
    return np.linalg.norm(corners_mm - np.roll(corners_mm, -1, axis=1), axis=2)


class ShiningPoints(NamedTuple):
    """Points (N,) that shine, the lens points that they are seen from, and where they fall on the film.

    `row` and `col` are counted from the film's corner. `sent` times the radiance is what is sent per mm^2, in
    radiance px, and at most `bound`; 0 if the point faces away or lies behind the camera, where rows and
    columns are NaN.
    """

    surface: np.ndarray
    point_mm: np.ndarray
    camera_mm: np.ndarray
    texcoord: np.ndarray
    row: np.ndarray
    col: np.ndarray
    sent: np.ndarray
    bound: np.ndarray


class EmissionSampler:
    """What shines in view, as candidates are drawn from it.

    `surfaces` are in the colours of the sensor. `mass` is the sum of the bounds in one view, in radiance
    times px as of `CandidateSampler`; 0 if no camera can see anything that shines.
    """

    def __init__(self, capture: Capture) -> None:
        self.capture, self.surfaces, self.mass = capture, list(_surfaces_as_sensed(capture)), 0.0
        self.numbers = np.array([one.number for one in self.surfaces], dtype=np.int16)
        self.is_ball = np.array([one.ball is not None for one in self.surfaces])
        if self.surfaces:
            self.pieces = pieces_in_view(self.surfaces, capture.rig)
            self.running = np.cumsum(self.pieces.bound * self.pieces.area_mm2)
            self.mass = float(self.running[-1]) if self.running.size else 0.0

    def draw(self, cells: np.ndarray, view: np.ndarray, seed: int) -> tuple[PhotonTable, np.ndarray]:
        """Photons of a candidate on each film of `view` (N,), and whose each is.

        What falls on other Bayer cells than its `cells` (N, 4) bool is rejected.
        """
        candidate, points, _ = self.arriving(view, np.random.default_rng(seed))
        here = cells[candidate, cells_of(points)]
        candidate, points = candidate[here], take_rows(points, here)
        k, l = np.divmod(view[candidate], self.capture.grid.cols)
        origin = {"object_id": self.numbers[points.surface], "z_mm": points.point_mm[:, 2]}
        return PhotonTable(k, l, *pixels_of(points), np.ones_like(k), **origin), candidate

    def arriving(
        self, view: np.ndarray, rng: np.random.Generator
    ) -> tuple[np.ndarray, ShiningPoints, np.ndarray]:
        """Those of candidates on the films of `view` (N,) that are kept and that nothing hides.

        Their numbers, their points, and the radiance of each in its pixel's own colour.
        """
        points, chance = self.film_points(view, rng), rng.random(view.size)
        which = np.flatnonzero(is_on_film(self.capture.grid, points.row, points.col) & (points.sent > 0))
        points = take_rows(points, which)
        colour = colour_cells(self.capture.cfa).ravel()[cells_of(points)]
        radiance = self._radiance(points)[np.arange(which.size), colour]
        is_kept = chance[which] * points.bound < points.sent * radiance
        which, points, radiance = which[is_kept], take_rows(points, is_kept), radiance[is_kept]
        away_mm = points.point_mm - points.camera_mm
        blocker = self.capture.render_scene.objects_hit(points.camera_mm, away_mm, 1 - SHADOW_EPSILON)
        # A ball hides no point of its own that faces the camera, whatever the rounding of where it is hit.
        is_itself = self.is_ball[points.surface] & (blocker == self.numbers[points.surface])
        is_seen = (blocker < 0) | is_itself
        return which[is_seen], take_rows(points, is_seen), radiance[is_seen]

    def film_points(self, view: np.ndarray, rng: np.random.Generator) -> ShiningPoints:
        """A point that shines for each camera (N,), drawn with its piece's bound, and where it falls."""
        rig = self.capture.rig
        piece = np.searchsorted(self.running, rng.random(view.size) * self.mass, side="right")
        piece = np.minimum(piece, self.running.size - 1)
        across, along = np.sqrt(rng.random(view.size)), rng.random(view.size)
        shares = np.stack([1 - across, across * (1 - along), across * along], axis=1)
        point_mm = np.einsum("nc,ncd->nd", shares, self.pieces.corners_mm[piece])
        texcoord = np.einsum("nc,ncd->nd", shares, self.pieces.texcoords[piece])
        normal, surface = self.pieces.normal[piece], self.pieces.surface[piece]
        stretch = np.ones(view.size)
        for number, one in enumerate(self.surfaces):
            if one.ball is None:
                continue
            here, (centre_mm, radius_mm, axes) = np.flatnonzero(surface == number), one.ball
            # Points of inscribed triangles are moved outwards onto the ball, which has more area there.
            outwards = point_mm[here] - centre_mm
            length = np.linalg.norm(outwards, axis=1, keepdims=True)
            normal[here] = outwards / length
            point_mm[here] = centre_mm + radius_mm * normal[here]
            stretch[here] = np.square(radius_mm) * self.pieces.height_mm[piece[here]] / length[:, 0] ** 3
            x, y, z = (normal[here] @ axes).T
            east, north = np.arctan2(x, -z), np.arcsin(np.clip(-y, -1, 1))
            texcoord[here] = np.stack([(east / np.pi + 1) / 2, north / np.pi + 0.5], axis=1)
        k, l = np.divmod(view, self.capture.grid.cols)
        camera_mm, lens_point = rig.position_mm[k, l], np.zeros((2, 1))
        if rig.lens is not None:
            lens_point = rig.lens_points(rng.random((2, view.size)))
            camera_mm = camera_mm + np.einsum("nab,bn->na", rig.rotation[k, l][..., :2], lens_point)
        away_mm = point_mm - camera_mm
        row_px, col_px, z_mm = rig.film_px(view, away_mm, lens_point)
        sent = stretch * rig.image_px_per_mm2(normal, away_mm, z_mm)
        points = surface, point_mm, camera_mm, texcoord, row_px + 0.5, col_px + 0.5
        return ShiningPoints(*points, sent, self.pieces.bound[piece])

    def _radiance(self, points: ShiningPoints) -> np.ndarray:
        """Radiance (N, C) of points of surfaces, in the sensor's colours."""
        radiance = np.stack([one.radiance for one in self.surfaces])[points.surface]
        for number, one in enumerate(self.surfaces):
            if one.picture is not None:
                here = points.surface == number
                radiance[here] *= _between_pixels(one.picture, points.texcoord[here], one.ball is not None)
        return radiance


def _surfaces_as_sensed(capture: Capture) -> Iterator[ShiningSurface]:
    """What shines in the colours of the sensor: luminance alone for a monochrome one."""

    def sensed(values: np.ndarray) -> np.ndarray:
        has_colours = capture.render_scene.filters is not None or capture.cfa is not None
        return values if has_colours else (values @ LUMINANCE)[..., None]

    for one in capture.render_scene.shining:
        if one.picture is None:
            yield replace(one, radiance=sensed(one.radiance))
        else:
            picture = sensed(one.picture.astype(np.float64))
            yield replace(one, picture=picture, radiance=np.full(picture.shape[-1], one.radiance[0]))


def _between_pixels(picture: np.ndarray, texcoord: np.ndarray, closes: bool) -> np.ndarray:
    """A picture (H, W, C) at texture coordinates (N, 2), linear between pixels as the renderer has it.

    Beyond its border it goes on with its last pixels, or with the first ones if it closes on itself.
    """
    size = np.array(picture.shape[1::-1])
    place_px = (texcoord * [1, -1] + [0, 1]) * size - 0.5
    first = np.floor(place_px)
    share = place_px - first
    total = np.zeros((len(texcoord), picture.shape[-1]))
    for right, down in np.ndindex(2, 2):
        at = first.astype(np.int64) + np.array([right, down])
        col, row = (at % size if closes else np.clip(at, 0, size - 1)).T
        weight = np.abs(1 - right - share[:, 0]) * np.abs(1 - down - share[:, 1])
        total += weight[:, None] * picture[row, col]
    return total
