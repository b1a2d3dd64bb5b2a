"""What is captured: a scene as cameras behind a Bayer pattern see it, and how much of its light is counted.

Photons are counted over scopes: an exposure of each view, or a budget of each view, of each colour of each
view, or of the whole scene (a recipe's `photons.scope`). Candidates of photons are rays drawn from a
majorant, and followed if they may be bright enough to be kept: `wavefront_sampler` traces all of them at
once, `scalar_sampler` one after the other.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np

from pcii.base import InputError
from pcii.types import CameraGrid, channel_count, colour_cells
from simgen.base import random_streams as seeds
from simgen.base import take_rows
from simgen.cameras import Cameras, Rig, as_rig, coarser, corners
from simgen.photons.majorant import Majorant, Samples
from simgen.renderer import RenderScene
from simgen.sensor import PhotonTable, no_photons
from simgen.spec import Photons
from simgen.truth import first_hits_of_view

EXPLORATION_SEED = 0
"""What is found before photons are drawn decides how they are drawn, not where they fall: with one seed for
all, datasets that differ in nothing but their seed are made alike, with the origins of photons or without."""
COARSE_PX = 64
"""Longer side of films on which a scene is looked at first."""


@dataclass(frozen=True, eq=False)
class Capture:
    """A scene in the renderer, cameras, the Bayer pattern `cfa`, the light that is counted, and the seed.

    `photons_per_radiance` are the photons that a pixel catches of a unit of radiance, for an exposure; None
    for a budget. `dark_map` is what pixels count without any, as of `detect`.
    """

    render_scene: RenderScene
    cameras: Cameras
    cfa: str | None
    photons: Photons = field(default_factory=Photons)
    photons_per_radiance: float | None = None
    seed: int = 0
    dark_map: np.ndarray | None = None

    @cached_property
    def rig(self) -> Rig:
        """The cameras as they really are."""
        return as_rig(self.cameras)

    @property
    def grid(self) -> CameraGrid:
        """The cameras as they ought to be."""
        return self.rig.grid

    @property
    def pixels(self) -> int:
        """Pixels of a view."""
        return self.grid.height * self.grid.width

    @property
    def coarse_grid(self) -> CameraGrid:
        """The same cameras with the same field of view on few pixels."""
        return coarser(self.grid, COARSE_PX, least_px=2, may_be_finer=True)

    @cached_property
    def coarse_z_mm(self) -> np.ndarray:
        """Depths (N,) in mm that the corner cameras see on few pixels; inf where nothing is hit."""
        coarse = self.coarse_grid
        hits = [first_hits_of_view(self.render_scene, coarse, k, l) for k, l in corners(coarse)]
        return np.concatenate([of_view.z_mm.ravel() for of_view in hits])

    @property
    def channels(self) -> int:
        """Colours of the sensor's pixels: 3, or 1 for a monochrome sensor."""
        return channel_count(self.cfa)

    @cached_property
    def cell_groups(self) -> list[np.ndarray]:
        """Groups of Bayer cells (2 a + b) that are counted apart: those of each colour, or all of them."""
        if self.photons.scope != "channel":
            return [np.arange(4)]
        cells = colour_cells(self.cfa).ravel()
        return [np.flatnonzero(cells == colour) for colour in range(self.channels)]

    @cached_property
    def is_cell_of_group(self) -> np.ndarray:
        """Whether each of these groups has each Bayer cell, (G, 4) bool."""
        return np.array([np.isin(np.arange(4), cells) for cells in self.cell_groups])

    @property
    def has_one_budget(self) -> bool:
        """Whether one budget is that of all views together."""
        return self.photons.scope == "scene"

    @cached_property
    def view_of_scope(self) -> np.ndarray:
        """View of each scope (S,), -1 for all views together."""
        views = np.array([-1]) if self.has_one_budget else np.arange(self.grid.view_count)
        return views.repeat(len(self.cell_groups))

    @cached_property
    def group_of_scope(self) -> np.ndarray:
        """Number of each scope's group of cells (S,)."""
        return np.arange(self.view_of_scope.size) % len(self.cell_groups)

    def scope_of(self, photons: PhotonTable) -> np.ndarray:
        """Number of the scope that each row (N,) of a table is counted in."""
        if self.has_one_budget:
            return np.zeros(photons.k.size, dtype=np.int64)
        view, groups = photons.k.astype(np.int64) * self.grid.cols + photons.l, len(self.cell_groups)
        return view * groups + photons.colours(self.cfa) if groups > 1 else view

    @property
    def budget_per_view(self) -> float | None:
        """Photons of a view that a budget asks for; None for an exposure."""
        if self.photons_per_radiance is not None:
            return None
        if self.has_one_budget:
            return self.photons.budget / self.grid.view_count
        return self.photons.budget * len(self.cell_groups)

    @property
    def budget_pixels(self) -> int | None:
        """Pixels over which a budget is counted, of the rarest colour at worst; None for an exposure."""
        if self.photons_per_radiance is not None:
            return None
        if self.has_one_budget:
            return self.pixels * self.grid.view_count
        return max(self.pixels // 4, 1) if len(self.cell_groups) > 1 else self.pixels

    def expected_photons(self, radiance: np.ndarray) -> float:
        """Photons of all views, given the mean radiance (C,) of each colour."""
        if self.photons_per_radiance is None:
            return self.photons.budget * self.view_of_scope.size
        per_pixel = self.photons_per_radiance * radiance[colour_cells(self.cfa).ravel()].mean()
        return float(per_pixel * (self.grid.view_count * self.pixels))

    def draw_totals(self) -> np.ndarray:
        """Photons that each scope is to have (S,), int64: of a Poisson budget random, else exact.

        A scope of an exposure takes as many as come.
        """
        size, photons = self.view_of_scope.size, self.photons
        if photons.scope == "exposure":
            return np.full(size, np.iinfo(np.int64).max)
        if photons.statistics == "multinomial":
            return np.full(size, round(photons.budget))
        return seeds.generator(self.seed, stage="budget totals").poisson(photons.budget, size)


def ranks_in_scopes(scope: np.ndarray) -> np.ndarray:
    """Number (N,), from 0, of each photon in its scope; `scope` (N,) is sorted, so that each is a run."""
    return np.arange(scope.size) - np.searchsorted(scope, scope)


class ImageCells(NamedTuple):
    """Cells of the films in which images of lamps in mirrors and glass are drawn apart (`mirror_images`).

    A px has `per_px` cells to a side; `number` (M,) uint64, sorted, are those of the cells, counted along
    rows, columns of all films. What is seen there by mirrors alone is drawn apart if it is brighter than
    `above`.
    """

    per_px: int
    number: np.ndarray
    above: float


class Accepted(NamedTuple):
    """The `photons` that candidates gave, a row for each that was kept, and its first hit.

    `candidate` (rows,) is the number of each. `ratio` (F,) is radiance over limit of all paths that were
    followed beyond their first hit, `exceeding` are those above it.
    """

    photons: PhotonTable
    candidate: np.ndarray
    ratio: np.ndarray
    exceeding: Samples


def nothing(channels: int) -> Accepted:
    """No photons."""
    whole, real, colours = np.zeros(0, np.int64), np.zeros(0, np.float32), np.zeros((0, channels))
    return Accepted(no_photons(), whole, real, Samples(whole, whole, whole, whole, real, colours, colours))


def pixels_of(points: Any) -> tuple[np.ndarray, np.ndarray]:
    """Row and column (N,), int64, of the pixels that points of films lie in."""
    return points.row.astype(np.int64), points.col.astype(np.int64)


def cells_of(points: Any) -> np.ndarray:
    """Bayer cell 2 a + b (N,) of each of these pixels."""
    row, col = pixels_of(points)
    return row % 2 * 2 + col % 2


class FilmPoints(NamedTuple):
    """Points (N,) of films: view, and row and column from the film's corner in [0, H) and [0, W)."""

    view: np.ndarray
    row: np.ndarray
    col: np.ndarray

    def on_film(self, grid: CameraGrid) -> "FilmPoints":
        """Those that lie on the film; NaN lies nowhere."""
        return take_rows(self, is_on_film(grid, self.row, self.col))

    @classmethod
    def evenly(cls, grid: CameraGrid, number: int, seed: int) -> "FilmPoints":
        """About `number` points: one in each cell of a lattice over the film.

        Views take turns. Points come in random order, so that the first of them are spread as all are.
        """
        rng = np.random.default_rng(seed)
        rows = max(1, round(np.sqrt(number * grid.height / grid.width)))
        cols = max(1, round(number / rows))
        cell = rng.permutation(rows * cols)
        row, col = np.divmod(cell, cols)
        down, right = rng.random((2, cell.size))
        # Rounding must not move a point onto the next film.
        i = np.minimum((row + down) * (grid.height / rows), np.nextafter(grid.height, 0))
        j = np.minimum((col + right) * (grid.width / cols), np.nextafter(grid.width, 0))
        return cls(rng.permutation(cell.size) % grid.view_count, i, j)


def is_on_film(grid: CameraGrid, row: Any, col: Any) -> Any:
    """Whether rows and columns lie on the film; arrays of NumPy or of the renderer."""
    return (row >= 0) & (row < grid.height) & (col >= 0) & (col < grid.width)


class Candidates(NamedTuple):
    """Candidates (N,), in arrays of NumPy or of the renderer.

    Camera, pixel, place on the film, entry of the majorant, colour, whether the pixel is on the film, the
    point (2, N) of the lens in mm, and numbers that decide on wavelengths in compiled backends. Dr.Jit looks
    into tuples but not into named ones: hand it their elements.
    """

    k: Any
    l: Any
    row: Any
    col: Any
    row_px: Any
    col_px: Any
    entry: Any
    colour: Any
    inside: Any
    lens_point: Any
    wavelength_sample: Any = None


@dataclass(eq=False)
class CandidateSampler(ABC):
    """A majorant as candidates are drawn from it, in light that is guessed to be `ambient` (C,) all around.

    Each comes of one group of Bayer cells (`Capture.cell_groups`). What is drawn apart in `image_cells` is
    left out. `running` are for each group the sums of the bounds of all pixels, in one view, up to and with
    those of an entry's cell; the last is their `mass` (G,), border tiles counted whole. With an earlier
    majorant `below`, of the same tiles and nowhere higher, what lies between the two is drawn: of the tiles
    that have been raised alone, and of each path the part of its radiance above the earlier bound.
    """

    capture: Capture
    majorant: Majorant
    ambient: np.ndarray
    image_cells: ImageCells | None = None
    below: Majorant | None = None
    paths_each: ClassVar[int]
    """Light paths of a candidate that is followed."""
    max_dark_candidates: ClassVar[int]
    """Number of candidates without light after which a place is taken as dark."""

    def __post_init__(self) -> None:
        majorant = self.majorant
        bound = majorant.bound * (majorant.side_px**2 / 4)[:, None]
        if self.below is not None:
            both = zip(majorant.bounds, self.below.bounds, strict=True)
            bound *= np.any([above > below for above, below in both], axis=(0, 2))[:, None]
        self.colours = colour_cells(self.capture.cfa).ravel()
        self.running = [np.cumsum(bound[:, self.colours[cells]]) for cells in self.capture.cell_groups]
        self.mass = np.array([sums[-1] for sums in self.running])

    @abstractmethod
    def try_candidates(self, group: np.ndarray, view: np.ndarray | None, seed: int) -> Accepted:
        """Draw a candidate for each of `group` (N,), keep it with probability radiance / bound.

        `group` says which cells each may fall on, `view` (N,) on which film; None draws the view too.
        A path that exceeds its bound is kept, and is among those that are `exceeding`. Raises `InputError`
        for radiance that is not finite.
        """

    @abstractmethod
    def trace(self, points: FilmPoints, follow: int, seed: int) -> Samples:
        """A pilot through these points of films, of which the first `follow` are followed.

        Of a ray that is not followed `light` is NaN (see `Samples`); backends may leave such out. Raises
        `InputError` for radiance that is not finite.
        """

    def count_paths(self, candidates: int, followed: int) -> int:
        """Light paths of `candidates`, of which `followed` go on beyond their first hit."""
        return candidates + (self.paths_each - 1) * followed

    def require_finite(self, radiance: np.ndarray, candidates: Candidates, object_id: np.ndarray) -> None:
        """`InputError` for radiance (N,) of candidates, which see objects (N,), that is no finite number."""
        wrong = np.flatnonzero(~np.isfinite(radiance))
        if wrong.size:
            k, l, row, col = (int(np.array(part)[wrong[0]]) for part in candidates[:4])
            scene, number = self.capture.render_scene, int(object_id[wrong[0]])
            raise InputError(scene.not_finite(number, (k, l), (row, col), self.capture.grid))
