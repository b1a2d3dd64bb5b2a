"""Candidates of photons that come straight from something that shines, drawn on its surface.

What shines has a known place, so no search finds it and none can miss it. A candidate is a point of the
surface, drawn with the bound of its piece (see `shining_pieces`), and a camera; it is kept with probability
sent / bound if it falls on the film and nothing stands in between. By the mapping theorem the kept ones are a
Poisson process on the film whose rate is the radiance of the surface where it is seen: a lamp of a thousandth
of a pixel gets its photons as a window of a million does. Paths through the film leave this light out
(`path_tracing.radiance_along`).
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from pcii.base import LUMINANCE
from pcii.types import colour_cells
from simgen.cameras import Rig
from simgen.photons.candidates import Accepted, is_on_film, nothing
from simgen.photons.capture import Capture
from simgen.photons.shining_pieces import pieces_in_view
from simgen.renderer import ShiningSurface, standing_before
from simgen.sensor import PhotonTable

SHADOW_EPSILON = 1e-5
"""Of the distance: what stands nearer than this before a shining point does not hide it. Single precision
errs by a hundredth of it."""


class ShiningPoints(NamedTuple):
    """Points (N,) that shine, the lens points that they are seen from, and where they fall on the film.

    `sent` times the radiance is what is sent per mm^2, in radiance px, and at most `bound`; 0 if the point
    faces away or lies behind the camera, where rows and columns are NaN.
    """

    surface: np.ndarray
    point_mm: np.ndarray
    camera_mm: np.ndarray
    texcoord: np.ndarray
    row_px: np.ndarray
    col_px: np.ndarray
    sent: np.ndarray
    bound: np.ndarray

    def take(self, which: np.ndarray) -> "ShiningPoints":
        """Some of them, by mask or index."""
        return ShiningPoints(*(column[which] for column in self))


class Arriving(NamedTuple):
    """Light (N,) that arrives on films: of which candidate, in which pixel, from which surface.

    `radiance` is in the pixel's own colour, `z_mm` the planar depth of the point that shines.
    """

    candidate: np.ndarray
    row: np.ndarray
    col: np.ndarray
    surface: np.ndarray
    radiance: np.ndarray
    z_mm: np.ndarray

    def take(self, which: np.ndarray) -> "Arriving":
        """Some of it, by mask or index."""
        return Arriving(*(column[which] for column in self))


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

    def try_candidates(
        self, group: np.ndarray, view: np.ndarray, cells: list[np.ndarray], seed: int
    ) -> Accepted:
        """Draw a candidate for each of `group` (N,) on the film of `view` (N,); see `CandidateSampler`.

        `cells` are the Bayer cells (2 a + b) of each group: what falls on others is rejected.
        """
        light = self.arriving(view, np.random.default_rng(seed))
        is_of_group = np.array([np.isin(np.arange(4), of_group) for of_group in cells])
        light = light.take(is_of_group[group[light.candidate], light.row % 2 * 2 + light.col % 2])
        k, l = np.divmod(view[light.candidate], self.capture.grid.cols)
        origin = {"object_id": self.numbers[light.surface], "z_mm": light.z_mm}
        photons = PhotonTable(k, l, light.row, light.col, np.ones_like(light.row), **origin)
        return nothing(self.capture.channels)._replace(photons=photons, candidate=light.candidate)

    def arriving(self, view: np.ndarray, rng: np.random.Generator) -> Arriving:
        """Those of candidates on the films of `view` (N,) that are kept and that nothing hides."""
        points, chance = self.film_points(view, rng), rng.random(view.size)
        row, col = np.floor(points.row_px + 0.5), np.floor(points.col_px + 0.5)
        which = np.flatnonzero(is_on_film(self.capture.grid, row, col) & (points.sent > 0))
        points, row, col = points.take(which), row[which].astype(np.int64), col[which].astype(np.int64)
        colour = colour_cells(self.capture.cfa).ravel()[row % 2 * 2 + col % 2]
        radiance = self._radiance(points)[np.arange(which.size), colour]
        is_kept = chance[which] * points.bound < points.sent * radiance
        light = Arriving(which, row, col, points.surface, radiance, points.point_mm[:, 2]).take(is_kept)
        points = points.take(is_kept)
        blocker = standing_before(
            self.capture.render_scene, points.camera_mm, points.point_mm, SHADOW_EPSILON
        )
        # A ball hides no point of its own that faces the camera, whatever the rounding of where it is hit.
        is_itself = self.is_ball[light.surface] & (blocker == self.numbers[light.surface])
        return light.take((blocker < 0) | is_itself)

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
        row_px, col_px, z_mm = film_px(rig, view, away_mm, lens_point)
        sent = stretch * image_px_per_mm2(rig, normal, away_mm, z_mm)
        points = surface, point_mm, camera_mm, texcoord, row_px, col_px
        return ShiningPoints(*points, sent, self.pieces.bound[piece])

    def _radiance(self, points: ShiningPoints) -> np.ndarray:
        """Radiance (N, C) of points of surfaces, in the sensor's colours."""
        radiance = np.stack([one.radiance for one in self.surfaces])[points.surface]
        for number, one in enumerate(self.surfaces):
            if one.picture is not None:
                here = points.surface == number
                radiance[here] *= _between_pixels(one.picture, points.texcoord[here], one.ball is not None)
        return radiance


def film_px(
    rig: Rig, view: np.ndarray, away_mm: np.ndarray, lens_point: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Row and column on the films of `view` (N,), and planar depth in mm, of what a point of the lens sees.

    `away_mm` (N, 3) is where that is from the point of the lens, (2, N) or (2, 1). NaN behind the camera.
    """
    k, l = np.divmod(view, rig.grid.cols)
    x, y, z_mm = np.einsum("nba,nb->an", rig.rotation[k, l], away_mm)
    z_mm = np.where(z_mm > 0, z_mm, np.nan)
    if rig.lens is not None:
        x, y = np.stack([x, y]) + lens_point * z_mm / rig.lens.focus_mm
    scale_px, axis_px = rig.grid.focal_mm / rig.grid.pixel_mm, rig.axis_px[k, l]
    return y / z_mm * scale_px + axis_px[:, 1], x / z_mm * scale_px + axis_px[:, 0], z_mm


def image_px_per_mm2(rig: Rig, normal: np.ndarray, away_mm: np.ndarray, z_mm: np.ndarray) -> np.ndarray:
    """Area (N,) of the image, in px^2, of each mm^2 of a surface of this unit `normal` (N, 3).

    It is `away_mm` (N, 3) from the camera, at the planar depth `z_mm` (N,); 0 if it faces away, or if the
    depth is NaN.
    """
    scale_px = rig.grid.focal_mm / rig.grid.pixel_mm
    return np.nan_to_num(scale_px**2 * np.maximum(-(normal * away_mm).sum(axis=1), 0) / z_mm**3)


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
