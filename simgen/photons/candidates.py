"""Candidates of photons: rays drawn from a majorant, and followed if they may be bright enough to be kept.

What all backends share: `wavefront_sampler` traces all candidates at once, `scalar_sampler` one after the
other.
"""

from abc import ABC, abstractmethod
from typing import Any, NamedTuple

import numpy as np

from pcii.base import InputError
from pcii.types import CameraGrid, colour_cells
from simgen.photons.capture import Capture
from simgen.photons.disparity_layers import Samples
from simgen.photons.majorant import Majorant
from simgen.renderer import not_finite
from simgen.sensor import PhotonTable, no_photons


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


class FilmPoints(NamedTuple):
    """Points (N,) of films: view, and row and column from the film's corner in [0, H) and [0, W)."""

    view: np.ndarray
    row: np.ndarray
    col: np.ndarray

    def on_film(self, grid: CameraGrid) -> "FilmPoints":
        """Those that lie on the film; NaN lies nowhere."""
        which = is_on_film(grid, self.row, self.col)
        return FilmPoints(self.view[which], self.row[which], self.col[which])


def is_on_film(grid: CameraGrid, row: Any, col: Any) -> Any:
    """Whether rows and columns lie on the film; arrays of NumPy or of the renderer."""
    return (row >= 0) & (row < grid.height) & (col >= 0) & (col < grid.width)


def even_film_points(grid: CameraGrid, number: int, seed: int) -> FilmPoints:
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
    return FilmPoints(rng.permutation(cell.size) % grid.view_count, i, j)


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


class CandidateSampler(ABC):
    """A majorant as candidates are drawn from it, in light that is guessed to be `ambient` (C,) all around.

    Each comes of one group of Bayer cells (`Capture.cell_groups`). What is drawn apart in `image_cells` is
    left out. `running` are for each group the
    sums of the bounds of all pixels, in one view, up to and with those of an entry's cell; the last is their
    `mass` (G,), border tiles counted whole. With an earlier majorant `below`, of the same tiles and nowhere
    higher, what lies between the two is drawn: of the tiles that have been raised alone, and of each path the
    part of its radiance above the earlier bound.
    """

    paths_each: int
    """Light paths of a candidate that is followed."""
    max_dark_candidates: int
    """Number of candidates without light after which a place is taken as dark."""

    def __init__(
        self,
        capture: Capture,
        majorant: Majorant,
        ambient: np.ndarray,
        image_cells: ImageCells | None = None,
        below: Majorant | None = None,
    ) -> None:
        self.capture, self.majorant, self.ambient = capture, majorant, ambient
        self.image_cells, self.below = image_cells, below
        bound = majorant.bound * (majorant.side_px**2 / 4)[:, None]
        if below is not None:
            bound *= majorant.is_above(below)[:, None]
        self.colours = colour_cells(capture.cfa).ravel()
        self.running = [np.cumsum(bound[:, self.colours[cells]]) for cells in capture.cell_groups]
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
            raise InputError(not_finite(scene, number, (k, l), (row, col), self.capture.grid))
