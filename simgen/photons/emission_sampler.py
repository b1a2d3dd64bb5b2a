"""Candidates of photons that come straight from something that shines, drawn on its surface.

What shines has a known place, so no search finds it and none can miss it. A candidate is a point of the
surface, drawn with the bound of its piece (see `shining_pieces`), and a camera; it is kept with probability
sent / bound if it falls on the film and nothing stands in between. By the mapping theorem the kept ones are a
Poisson process on the film whose rate is the radiance of the surface where it is seen: a lamp of a thousandth
of a pixel gets its photons as a window of a million does. Paths through the film leave this light out
(`path_tracing.radiance_along`).
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from pcii.core.bayer import colour_cells
from simgen.photons.candidates import Accepted, Setup, nothing
from simgen.photons.shining_pieces import look_of, pieces_in_view, points_on_ball
from simgen.renderer.intersection import standing_before
from simgen.sensor.photon_table import PhotonTable

SHADOW_EPSILON = 1e-5
"""Of the distance: what stands nearer than this before a shining point does not hide it. Single precision
errs by a hundredth of it."""


@dataclass(frozen=True, eq=False)
class ShiningPoints:
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

    `mass` is the sum of the bounds in one view, in radiance times px as of `CandidateSampler`; 0 if no camera
    can see anything that shines.
    """

    def __init__(self, setup: Setup) -> None:
        self.setup, self.surfaces = setup, setup.render_scene.shining
        self.mass = 0.0
        self.numbers = np.array([one.number for one in self.surfaces], dtype=np.int16)
        self.is_ball = np.array([one.ball is not None for one in self.surfaces])
        if not self.surfaces:
            return
        self.look = look_of(self.surfaces, setup.cfa, setup.render_scene.filters is not None)
        self.pieces = pieces_in_view(self.surfaces, self.look, setup.rig)
        self.running = np.cumsum(self.pieces.bound * self.pieces.area_mm2)
        self.mass = float(self.running[-1]) if self.running.size else 0.0

    def try_candidates(
        self, group: np.ndarray, view: np.ndarray, cells: list[np.ndarray], seed: int
    ) -> Accepted:
        """Draw a candidate for each of `group` (N,) on the film of `view` (N,); see `CandidateSampler`.

        `cells` are the Bayer cells (2 a + b) of each group: what falls on others is rejected.
        """
        light = self.arriving(view, np.random.default_rng(seed))
        is_of_group = np.zeros((len(cells), 4), dtype=bool)
        for number, own in enumerate(cells):
            is_of_group[number, own] = True
        light = light.take(is_of_group[group[light.candidate], light.row % 2 * 2 + light.col % 2])
        k, l = np.divmod(view[light.candidate], self.setup.grid.cols)
        origin = {"object_id": self.numbers[light.surface], "z_mm": light.z_mm}
        photons = PhotonTable(k, l, light.row, light.col, np.ones_like(light.row), **origin)
        return replace(nothing(self.setup.channels), photons=photons, candidate=light.candidate)

    def arriving(self, view: np.ndarray, rng: np.random.Generator) -> Arriving:
        """Those of candidates on the films of `view` (N,) that are kept and that nothing hides."""
        points, chance, grid = self.film_points(view, rng), rng.random(view.size), self.setup.grid
        row, col = np.floor(points.row_px + 0.5), np.floor(points.col_px + 0.5)
        inside = (row >= 0) & (row < grid.height) & (col >= 0) & (col < grid.width) & (points.sent > 0)
        which = np.flatnonzero(inside)
        row, col = row[which].astype(np.int64), col[which].astype(np.int64)
        colour = colour_cells(self.setup.cfa).ravel()[row % 2 * 2 + col % 2]
        radiance = self._radiance(points.surface[which], points.texcoord[which])
        radiance = radiance[np.arange(which.size), colour]
        is_kept = chance[which] * points.bound[which] < points.sent[which] * radiance
        which, row, col, radiance = which[is_kept], row[is_kept], col[is_kept], radiance[is_kept]
        surface, point_mm = points.surface[which], points.point_mm[which]
        blocker = standing_before(self.setup.render_scene, points.camera_mm[which], point_mm, SHADOW_EPSILON)
        # A ball hides no point of its own that faces the camera, whatever the rounding of where it is hit.
        is_visible = (blocker < 0) | (self.is_ball[surface] & (blocker == self.numbers[surface]))
        return Arriving(which, row, col, surface, radiance, point_mm[:, 2]).take(is_visible)

    def film_points(self, view: np.ndarray, rng: np.random.Generator) -> ShiningPoints:
        """A point that shines for each camera (N,), drawn with its piece's bound, and where it falls."""
        rig, pieces = self.setup.rig, self.pieces
        piece = np.searchsorted(self.running, rng.random(view.size) * self.mass, side="right")
        piece = np.minimum(piece, self.running.size - 1)
        across, along = np.sqrt(rng.random(view.size)), rng.random(view.size)
        shares = np.stack([1 - across, across * (1 - along), across * along], axis=1)
        point_mm = np.einsum("nc,ncd->nd", shares, pieces.corners_mm[piece])
        texcoord = np.einsum("nc,ncd->nd", shares, pieces.texcoords[piece])
        normal, stretch, surface = pieces.normal[piece], np.ones(view.size), pieces.surface[piece]
        for number, one in enumerate(self.surfaces):
            if one.ball is not None:
                here = np.flatnonzero(surface == number)
                centre_mm, radius_mm, axes = one.ball
                point_mm[here], normal[here], stretch[here] = points_on_ball(
                    point_mm[here], pieces.height_mm[piece[here]], centre_mm, np.full(here.size, radius_mm)
                )
                x, y, z = (normal[here] @ axes).T
                east, north = np.arctan2(x, -z), np.arcsin(np.clip(-y, -1, 1))
                texcoord[here] = np.stack([(east / np.pi + 1) / 2, north / np.pi + 0.5], axis=1)
        k, l = np.divmod(view, self.setup.grid.cols)
        camera_mm, rotation = rig.position_mm[k, l], rig.rotation[k, l]
        lens_point = np.zeros((2, view.size))
        if rig.lens is not None:
            lens_point = rig.lens_points(rng.random((2, view.size)))
            camera_mm = camera_mm + np.einsum("nab,bn->na", rotation[..., :2], lens_point)
        away = point_mm - camera_mm
        x, y, z = np.einsum("nba,nb->an", rotation, away)
        z = np.where(z > 0, z, np.nan)  # what is behind the camera falls nowhere
        if rig.lens is not None:
            x, y = (
                part + shift * z / rig.lens.focus_mm for part, shift in zip((x, y), lens_point, strict=True)
            )
        scale_px = self.setup.grid.focal_mm / self.setup.grid.pixel_mm
        axis_px = rig.axis_px[k, l]
        sent = scale_px**2 * stretch * np.maximum(-(normal * away).sum(axis=1), 0) / z**3
        row_px, col_px = y / z * scale_px + axis_px[:, 1], x / z * scale_px + axis_px[:, 0]
        bound = pieces.bound[piece]
        return ShiningPoints(
            surface, point_mm, camera_mm, texcoord, row_px, col_px, np.nan_to_num(sent), bound
        )

    def _radiance(self, surface: np.ndarray, texcoord: np.ndarray) -> np.ndarray:
        """Radiance (N, C) of points of surfaces, in the sensor's colours."""
        radiance = np.stack(self.look.radiance)[surface]
        for number, picture in enumerate(self.look.pictures):
            if picture is not None:
                here = surface == number
                closes = self.surfaces[number].ball is not None
                radiance[here] *= _between_pixels(picture, texcoord[here], closes)
        return radiance


def _between_pixels(picture: np.ndarray, texcoord: np.ndarray, closes: bool) -> np.ndarray:
    """A picture (H, W, C) at texture coordinates (N, 2), linear between pixels as the renderer has it.

    Beyond its border it goes on with its last pixels, or with the first ones if it closes on itself.
    """
    size = np.array(picture.shape[1::-1])
    place_px = (texcoord * [1, -1] + [0, 1]) * size - 0.5
    first = np.floor(place_px)
    share = place_px - first
    total = np.zeros((len(texcoord), picture.shape[-1]))
    for right in (0, 1):
        for down in (0, 1):
            at = first.astype(np.int64) + np.array([right, down])
            col, row = (at % size if closes else np.clip(at, 0, size - 1)).T
            weight = np.abs(1 - right - share[:, 0]) * np.abs(1 - down - share[:, 1])
            total += weight[:, None] * picture[row, col]
    return total
