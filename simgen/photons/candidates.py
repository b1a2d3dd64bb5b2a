"""Candidates of photons: rays drawn from a majorant, and followed if they may be bright enough to be kept.

What all backends share: `wavefront_sampler` traces all candidates at once, `scalar_sampler` one after the
other.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np

from pcii.base.errors import InputError
from pcii.core.bayer import channel_count, colour_cells
from pcii.core.camera_grid import CameraGrid
from simgen.cameras.rig import Cameras, Rig, as_rig
from simgen.photons.disparity_layers import Samples
from simgen.photons.majorant import Majorant
from simgen.renderer.mitsuba_scene import RenderScene, not_finite
from simgen.sensor.photon_table import PhotonTable, no_photons


@dataclass(frozen=True)
class Setup:
    """A scene in the renderer, the cameras, the Bayer pattern, and the longest path in segments."""

    render_scene: RenderScene
    cameras: Cameras
    cfa: str | None
    max_depth: int

    @cached_property
    def rig(self) -> Rig:
        """The cameras as they really are."""
        return as_rig(self.cameras)

    @property
    def grid(self) -> CameraGrid:
        """The cameras as they ought to be."""
        return self.rig.grid

    @property
    def channels(self) -> int:
        """Colours of the sensor's pixels: 3, or 1 for a monochrome sensor."""
        return channel_count(self.cfa)


@dataclass(frozen=True, eq=False)
class Accepted:
    """The `photons` that candidates gave, a row for each that was kept, and its first hit.

    `candidate` (rows,) is the number of each. `ratio` (F,) is radiance over limit of all paths that were
    followed beyond their first hit, `exceeding` are those above it.
    """

    photons: PhotonTable
    candidate: np.ndarray
    ratio: np.ndarray
    exceeding: Samples


class FilmPoints(NamedTuple):
    """Points (N,) of films: view, and row and column from the film's corner in [0, H) and [0, W)."""

    view: np.ndarray
    row: np.ndarray
    col: np.ndarray

    def on_film(self, grid: CameraGrid) -> "FilmPoints":
        """Those that lie on the film; NaN lies nowhere."""
        rows, cols = self.row, self.col
        which = (rows >= 0) & (rows < grid.height) & (cols >= 0) & (cols < grid.width)
        return FilmPoints(self.view[which], rows[which], cols[which])


class CandidateSampler(Protocol):
    """A majorant as candidates are drawn from it.

    They come of groups of Bayer cells, each candidate of one. `mass` (G,) is the sum of the bounds of the
    pixels of each group in one view, border tiles counted whole. With an earlier majorant `below`, of the
    same tiles and nowhere higher, what lies between the two is drawn: of the tiles that have been raised
    alone, and of each path the part of its radiance above the earlier bound.
    """

    majorant: Majorant
    below: Majorant | None
    mass: np.ndarray

    @property
    def paths_each(self) -> int:
        """Light paths of a candidate that is followed."""
        ...

    @property
    def max_dark_candidates(self) -> int:
        """Where so many candidates find no light there is none."""
        ...

    def try_candidates(self, group: np.ndarray, view: np.ndarray | None, seed: int) -> Accepted:
        """Draw a candidate for each of `group` (N,), keep it with probability radiance / bound.

        `group` says which cells each may fall on, `view` (N,) on which film; None draws the view too.
        A path that exceeds its bound is kept, and is among those that are `exceeding`. Raises `InputError`
        for radiance that is not finite.
        """
        ...

    def trace(self, points: FilmPoints, follow: int, seed: int) -> Samples:
        """A pilot through these points of films, of which the first `follow` are followed.

        Of a ray that is not followed `light` is NaN (see `Samples`); backends may leave such out. Raises
        `InputError` for radiance that is not finite.
        """
        ...


def even_film_points(grid: CameraGrid, number: int, rng: np.random.Generator) -> FilmPoints:
    """About `number` points: one in each cell of a lattice over the film.

    Views take turns. Points come in random order, so that the first of them are spread as all are.
    """
    rows = max(1, round(np.sqrt(number * grid.height / grid.width)))
    cols = max(1, round(number / rows))
    cell = rng.permutation(rows * cols)
    row, col = np.divmod(cell, cols)
    down, right = rng.random((2, cell.size))
    # Rounding must not move a point onto the next film.
    i = np.minimum((row + down) * (grid.height / rows), np.nextafter(grid.height, 0))
    j = np.minimum((col + right) * (grid.width / cols), np.nextafter(grid.width, 0))
    return FilmPoints(rng.permutation(cell.size) % grid.view_count, i, j)


def paths_of(sampler: CandidateSampler, candidates: int, followed: int) -> int:
    """Light paths of so many candidates, of which some are followed beyond their first hit."""
    return candidates + (sampler.paths_each - 1) * followed


@dataclass(frozen=True)
class Chances:
    """Where the candidates of a group of Bayer cells fall: entry of the majorant and cell (2 a + b).

    `running` (N,) are the sums of the bounds of all pixels up to and with these; the last is their mass.
    """

    running: np.ndarray
    entry: np.ndarray
    cell: np.ndarray


def chances(setup: Setup, majorant: Majorant, below: Majorant | None, cells: np.ndarray) -> Chances:
    """The chances of a group of cells under a majorant; 0 on tiles that are as they were in `below`."""
    colours = colour_cells(setup.cfa).ravel()[cells]
    mass = majorant.bound[:, colours] * (majorant.side_px**2 / 4)[:, None]
    if below is not None:
        mass *= majorant.is_above(below)[:, None]
    entries = majorant.layer.size
    return Chances(np.cumsum(mass.ravel()), np.arange(entries).repeat(cells.size), np.tile(cells, entries))


def require_finite(setup: Setup, light: np.ndarray, object_id: np.ndarray) -> None:
    """`InputError` for radiance (N, ...) that is no finite number, with the object (N,) that was seen."""
    is_finite = np.isfinite(light).reshape(len(light), -1).all(axis=1)
    if not is_finite.all():
        number = int(object_id[np.flatnonzero(~is_finite)[0]])
        raise InputError(not_finite(setup.render_scene, number))


def nothing(channels: int) -> Accepted:
    """No photons."""
    whole, real, colours = np.zeros(0, np.int64), np.zeros(0, np.float32), np.zeros((0, channels))
    return Accepted(no_photons(), whole, real, Samples(whole, whole, whole, whole, real, colours, colours))
