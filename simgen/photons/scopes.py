"""Scopes: what photons are counted over, which is an exposure of each view or a budget.

A budget is one of each view, of each colour of each view, or of the whole scene (a recipe's
`photons.scope`).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pcii.types.bayer import channel_count, colour_cells
from pcii.types.camera_grid import CameraGrid
from simgen.base import random_streams as seeds
from simgen.sensor.photon_table import PhotonTable
from simgen.spec.recipe import Photons

ENDLESS = np.iinfo(np.int64).max
"""Photons that a scope of an exposure takes: as many as come."""


@dataclass(frozen=True, eq=False)
class Scopes:
    """The scopes (S,) of the photons of all views of `grid`, behind the Bayer pattern `cfa`.

    `photons_per_radiance` are those that a pixel catches of a unit of radiance, for an exposure; None for a
    budget. Raises ValueError for an exposure without it, and for a budget with it.
    """

    photons: Photons
    grid: CameraGrid
    cfa: str | None
    photons_per_radiance: float | None

    def __post_init__(self) -> None:
        if (self.photons_per_radiance is None) == (self.photons.scope == "exposure"):
            raise ValueError(
                "photons_per_radiance: needed for photons of scope 'exposure', and for no others"
            )

    @cached_property
    def cell_groups(self) -> list[np.ndarray]:
        """Groups of Bayer cells (2 a + b) that are counted apart: those of each colour, or all of them."""
        if self.photons.scope != "channel":
            return [np.arange(4)]
        cells = colour_cells(self.cfa).ravel()
        return [np.flatnonzero(cells == colour) for colour in range(channel_count(self.cfa))]

    @property
    def is_of_all_views(self) -> bool:
        """Whether one budget is that of all views together."""
        return self.photons.scope == "scene"

    @cached_property
    def view(self) -> np.ndarray:
        """View of each scope (S,), -1 for all views together."""
        views = np.array([-1]) if self.is_of_all_views else np.arange(self.grid.view_count)
        return views.repeat(len(self.cell_groups))

    @cached_property
    def group(self) -> np.ndarray:
        """Number of each scope's group of cells (S,)."""
        return np.arange(self.view.size) % len(self.cell_groups)

    @property
    def photons_per_view(self) -> float | None:
        """Photons of a view that a budget asks for; None for an exposure."""
        if self.photons_per_radiance is not None:
            return None
        if self.is_of_all_views:
            return self.photons.budget / self.grid.view_count
        return self.photons.budget * len(self.cell_groups)

    @property
    def pixels(self) -> int | None:
        """Pixels over which a budget is counted, of the rarest colour at worst; None for an exposure."""
        if self.photons_per_radiance is not None:
            return None
        of_view = self.grid.height * self.grid.width
        if self.is_of_all_views:
            return of_view * self.grid.view_count
        return max(of_view // 4, 1) if len(self.cell_groups) > 1 else of_view

    def expected_photons(self, radiance: np.ndarray) -> float:
        """Photons of all views, given the mean radiance (C,) of each colour."""
        if self.photons_per_radiance is None:
            return self.photons.budget * self.view.size
        per_pixel = self.photons_per_radiance * radiance[colour_cells(self.cfa).ravel()].mean()
        return float(per_pixel * (self.grid.view_count * self.grid.height * self.grid.width))

    def draw_totals(self, seed: int) -> np.ndarray:
        """Photons that each scope is to have (S,), int64: of a Poisson budget random, else exact."""
        if self.photons.scope == "exposure":
            return np.full(self.view.size, ENDLESS)
        if self.photons.statistics == "multinomial":
            return np.full(self.view.size, round(self.photons.budget))
        return seeds.generator(seed, stage="budget totals").poisson(self.photons.budget, self.view.size)

    def scope_of(self, photons: PhotonTable) -> np.ndarray:
        """Number of the scope that each row (N,) of a table is counted in."""
        if self.is_of_all_views:
            return np.zeros(photons.k.size, dtype=np.int64)
        view, groups = photons.k.astype(np.int64) * self.grid.cols + photons.l, len(self.cell_groups)
        return view * groups + photons.colours(self.cfa) if groups > 1 else view


def places(scope: np.ndarray) -> np.ndarray:
    """Place (N,), from 0, of each photon in its scope; `scope` (N,) is sorted, so that each is a run."""
    number = np.bincount(scope)
    first = np.cumsum(number) - number
    return np.arange(scope.size) - first[scope]
