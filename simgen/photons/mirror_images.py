"""Photons of lamps that are seen by mirrors and through glass, drawn where their images fall on the films.

Where an image falls is known from the lamp's side (`bright_light`), and found exactly by paths through the
film that follow mirrors alone. Around the paths that meet the lamp the film is divided into cells that are
finer than the image. Candidates of these cells are kept with probability radiance / bound, as everywhere;
paths through the film leave out, in these cells alone, what candidates of them can bring. So every path is
drawn in one way, whatever the cells are, and an image of a thousandth of a pixel gets its photons as a large
one does.
"""

from collections.abc import Sequence

import numpy as np

from simgen.base import join_rows, take_rows
from simgen.base import random_streams as seeds
from simgen.photons.bright_light import BrightLight
from simgen.photons.candidates import EXPLORATION_SEED, Capture, FilmPoints, ImageCells, cells_of, pixels_of
from simgen.photons.emission_sampler import EmissionSampler
from simgen.photons.wavefront_sampler import WavefrontSampler
from simgen.sensor import PhotonTable, joined, no_photons

NEIGHBOURS = 256
"""Arrivals nearest to a camera, from which places of images on its film are interpolated."""
REWEIGHTED = 4
"""Rounds of the fit by which arrivals that do not belong to the main image lose their weight."""
MIN_SPREAD_PX = 0.5
"""Least standard deviation of the first paths around these places."""
FIRST_HITS = 300.0
"""First paths that are to meet the images in each view: many, as curved glass has faint ones beside the main
one, within the ends of `FIRST_PATHS` for all views."""
FIRST_PATHS = 1 << 14, 1 << 21
MORE_PATHS = 1 << 17
"""Paths around those that have met an image: what cells they meet is what is drawn from."""
CELLS_ACROSS = 4.0
"""Cells along an image. More: fewer candidates for each photon, but more paths to find all cells."""
MAX_CELLS_PER_PX = 1 << 10
"""Single precision tells places on a film apart by some eighth of this."""
MAX_CELLS = 1 << 20
LEAST_PEAK = 0.99
"""Light is drawn apart if it is brighter than this share of the dimmest that arrives: what rounds off."""
RAISED = 1.1
"""Bounds are this many times the largest radiance that paths have found in a cell and around it."""


class MirrorImages:
    """Images of lamps in mirrors and glass, as candidates are drawn from them.

    `bound` (M,) are those of the cells. `mass` is their sum in one view, in radiance px as of
    `CandidateSampler`, of the view that has the most.
    """

    def __init__(self, sampler: WavefrontSampler, cells: ImageCells, bound: np.ndarray) -> None:
        self.sampler, self.grid, self.cells, self.bound = sampler, sampler.capture.grid, cells, bound
        self.running = np.concatenate([[0.0], np.cumsum(bound)]) / cells.per_px**2
        of_view = self.grid.height * self.grid.width * cells.per_px**2
        first = np.arange(self.grid.view_count + 1, dtype=np.uint64) * np.uint64(of_view)
        self.of_view = self.running[np.searchsorted(cells.number, first)]
        self.mass = float(np.diff(self.of_view).max())

    def draw(self, cells: np.ndarray, view: np.ndarray, seed: int) -> tuple[PhotonTable, np.ndarray]:
        """Photons as of `EmissionSampler.draw`."""
        rng = np.random.default_rng(seed)
        points, candidate, cell = self._draw(view, rng)
        here = cells[candidate, cells_of(points)]
        points, candidate, cell = take_rows(points, here), candidate[here], cell[here]
        radiance, _, object_id, z_mm = self.sampler.trace_mirrored(points, self.cells.above, seed)
        # Of what exceeds its bound there are more photons than one.
        number = np.floor(radiance / self.bound[cell] + rng.random(cell.size)).astype(np.int64)
        k, l = np.divmod(points.view, self.grid.cols)
        origin = {"object_id": object_id, "z_mm": z_mm}
        photons = PhotonTable(k, l, *pixels_of(points), number, **origin).one_by_one()
        return photons, candidate.repeat(number)

    def light_by_bounces(self, number: int, seed: int) -> np.ndarray:
        """Light of a film, mean of all views, by the number of mirrors before it, of `number` candidates."""
        view = np.arange(number) % self.grid.view_count
        points, _, cell = self._draw(view, np.random.default_rng(seed))
        radiance, bounces, _, _ = self.sampler.trace_mirrored(points, self.cells.above, seed)
        light = radiance / self.bound[cell] * (self.mass / number)
        return np.bincount(bounces, light, minlength=self.sampler.capture.render_scene.max_depth + 1)

    def _draw(self, view: np.ndarray, rng: np.random.Generator) -> tuple[FilmPoints, np.ndarray, np.ndarray]:
        """Points of the films of `view` (N,), fewer than these: with the number of each and its cell."""
        per_px = self.cells.per_px
        # Views with less than the most have candidates that belong to no cell.
        target = self.of_view[view] + rng.random(view.size) * self.mass
        candidate = np.flatnonzero(target < self.of_view[view + 1])
        cell = np.searchsorted(self.running, target[candidate], side="right") - 1
        cell = np.clip(cell, 0, self.bound.size - 1)
        line, col = np.divmod(self.cells.number[cell].astype(np.int64), self.grid.width * per_px)
        down, right = rng.random((2, cell.size))
        row = (line % (self.grid.height * per_px) + down) / per_px
        return FilmPoints(view[candidate], row, (col + right) / per_px), candidate, cell


class KnownPlaces:
    """All that is drawn where it is known to be, as candidates are drawn from it: of each in its share of the
    `mass`, the sum of theirs."""

    def __init__(self, parts: Sequence[EmissionSampler | MirrorImages]) -> None:
        self.parts = [part for part in parts if part.mass]
        self.masses = np.array([part.mass for part in self.parts])
        self.mass = float(self.masses.sum())

    @property
    def image_cells(self) -> ImageCells | None:
        """Cells in which images of lamps are drawn, which paths through the film leave out."""
        return next((part.cells for part in self.parts if isinstance(part, MirrorImages)), None)

    def draw(self, cells: np.ndarray, view: np.ndarray, seed: int) -> tuple[PhotonTable, np.ndarray]:
        """Photons as of `EmissionSampler.draw`."""
        which = np.zeros(view.size, dtype=np.int64)
        if len(self.parts) > 1:
            rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(1,)))
            which = rng.choice(self.masses.size, view.size, p=self.masses / self.mass)
        tables, candidates = [no_photons()], [np.zeros(0, dtype=np.int64)]
        for number, part in enumerate(self.parts):
            here = np.flatnonzero(which == number)
            photons, candidate = part.draw(cells[here], view[here], seed)
            tables.append(photons)
            candidates.append(here[candidate])
        return joined(tables), np.concatenate(candidates)


def find_images(sampler: WavefrontSampler, lights: Sequence[BrightLight]) -> MirrorImages | None:
    """Images of these lights, of which all have arrivals; None if no path meets any of them."""
    peaks = [light.arrivals.peak.min() for light in lights if light.arrivals is not None]
    grid, above = sampler.capture.grid, LEAST_PEAK * float(min(peaks))
    met, radiance = [FilmPoints(*np.zeros((3, 0)))], [np.zeros(0)]

    def send(points: FilmPoints, part: int) -> FilmPoints:
        if points.view.size:
            seed = seeds.integer(EXPLORATION_SEED, stage="lamp rays", part=part)
            brought, *_ = sampler.trace_mirrored(points, above, seed)
            points = take_rows(points, brought > 0)
            met.append(points)
            radiance.append(brought[brought > 0])
        return points

    for number, light in enumerate(lights):
        rng = seeds.generator(EXPLORATION_SEED, stage="lamp rays", part=number)
        first = send(_first_points(sampler.capture, light, rng), 10 + 2 * number)
        if first.view.size:
            around = _evenly_by_pixel(first, MORE_PATHS, rng)
            aside_px = rng.standard_normal((2, MORE_PATHS)) * np.sqrt(light.image_px)
            row, col = first.row[around] + aside_px[0], first.col[around] + aside_px[1]
            send(FilmPoints(first.view[around], row, col).on_film(grid), 11 + 2 * number)
    points, brought = join_rows(met), np.concatenate(radiance)
    if not brought.size:
        return None
    finest = CELLS_ACROSS / np.sqrt(min(light.image_px for light in lights))
    per_px = int(np.clip(2 ** np.ceil(np.log2(finest)), 1, MAX_CELLS_PER_PX))
    while True:
        cells, bound = _cells_around(sampler.capture, points, brought, per_px)
        if cells.size <= MAX_CELLS:
            return MirrorImages(sampler, ImageCells(per_px, cells, above), RAISED * bound)
        per_px //= 2


def _evenly_by_pixel(points: FilmPoints, number: int, rng: np.random.Generator) -> np.ndarray:
    """Indices (`number`,) of points, half of them drawn evenly and half so that each pixel has as many."""
    pixel = np.stack([points.view, *pixels_of(points)])
    _, which, times = np.unique(pixel, axis=1, return_inverse=True, return_counts=True)
    chance = 1 / times[which.ravel()]
    half = rng.choice(chance.size, number // 2, p=chance / chance.sum())
    return np.concatenate([half, rng.integers(0, chance.size, number - number // 2)])


def _first_points(capture: Capture, light: BrightLight, rng: np.random.Generator) -> FilmPoints:
    """Points of all films around the places at which this light is seen.

    Arrivals pass the disc around the cameras beside these. With the place where they pass the image moves on
    the film, so what the nearest ones show is continued to each camera along a plane through them.
    """
    from scipy.spatial import KDTree

    arrivals, grid, views = light.arrivals, capture.grid, np.arange(capture.grid.view_count)
    assert arrivals is not None
    k, l = np.divmod(views, grid.cols)
    at_mm, number = capture.rig.position_mm[k, l][:, :2], min(NEIGHBOURS, arrivals.light.size)
    _, nearest = KDTree(arrivals.place_mm).query(at_mm, number)
    nearest = nearest.reshape(-1, number)
    away = np.concatenate([arrivals.slope, np.ones((arrivals.light.size, 1))], axis=1)
    row, col, _ = capture.rig.film_px(views.repeat(number), away[nearest.ravel()])
    seen_px = np.stack([row, col], axis=1).reshape(-1, number, 2)
    aside_mm = arrivals.place_mm[nearest] - at_mm[:, None]
    design = np.concatenate([np.ones((*aside_mm.shape[:2], 1)), aside_mm], axis=2)
    weight, usual_px = np.ones((views.size, number, 1)), np.zeros((views.size, 1, 1))
    fitted = np.zeros((views.size, 3, 2))
    for _ in range(REWEIGHTED):  # of several images the commonest decides, as with Cauchy's weights
        fitted = np.linalg.pinv(weight * design) @ (weight * seen_px)
        off_px = np.linalg.norm(seen_px - design @ fitted, axis=2, keepdims=True)
        usual_px = np.maximum(np.median(off_px, axis=1, keepdims=True), MIN_SPREAD_PX)
        weight = 1 / np.sqrt(1 + (off_px / usual_px) ** 2)
    spread_px = usual_px[:, 0, 0] + np.sqrt(light.image_px)
    if (lens := capture.rig.lens) is not None:  # whose images are blurred as they move over it
        moves_px = fitted[:, 1:] + np.eye(2)[::-1] * (grid.focal_mm / grid.pixel_mm) / lens.focus_mm
        spread_px += lens.aperture_mm / 2 * np.abs(moves_px).sum(axis=1).max(axis=1)
    paths = (FIRST_HITS * 2 * np.pi * spread_px**2 / light.image_px).sum()
    moved_px = (seen_px - aside_mm @ fitted[:, 1:]).reshape(-1, 2) + 0.5
    points = FilmPoints(views.repeat(number), *moved_px.T).on_film(grid)
    if not points.view.size:
        return points
    which = _evenly_by_pixel(points, int(np.clip(paths, *FIRST_PATHS)), rng)
    aside_px = rng.standard_normal((2, which.size)) * spread_px[points.view[which]]
    row, col = points.row[which] + aside_px[0], points.col[which] + aside_px[1]
    return FilmPoints(points.view[which], row, col).on_film(grid)


def _cells_around(
    capture: Capture, points: FilmPoints, radiance: np.ndarray, per_px: int
) -> tuple[np.ndarray, np.ndarray]:
    """Numbers (M,) uint64, sorted, of the cells that points (N,) lie in and of those beside them, and the
    largest radiance (M,) of points in each and beside it."""
    height, width = capture.grid.height * per_px, capture.grid.width * per_px
    row, col = ((part * per_px).astype(np.int64) for part in (points.row, points.col))
    down, right = np.indices((3, 3)).reshape(2, -1, 1) - 1
    i, j = row + down, col + right
    inside = (i >= 0) & (i < height) & (j >= 0) & (j < width)
    number = (points.view.astype(np.int64) * height + i) * width + j
    cells, index = np.unique(number[inside], return_inverse=True)
    largest = np.zeros(cells.size)
    np.maximum.at(largest, index, np.broadcast_to(radiance, inside.shape)[inside])
    return cells.astype(np.uint64), largest
