"""What is captured: a scene as cameras behind a Bayer pattern see it, and how much of its light is counted.

Photons are counted over scopes: an exposure of each view, or a budget of each view, of each colour of each
view, or of the whole scene (a recipe's `photons.scope`).
"""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from pcii.types import CameraGrid, channel_count, colour_cells
from simgen.base import random_streams as seeds
from simgen.cameras import Cameras, Rig, as_rig, corners, with_larger_pixels
from simgen.renderer import RenderScene
from simgen.sensor import PhotonTable
from simgen.spec import Photons
from simgen.truth import first_hits_of_view

COARSE_PX = 64
"""Longer side of films on which a scene is looked at first."""
ENDLESS = np.iinfo(np.int64).max
"""Photons that a scope of an exposure takes: as many as come."""


@dataclass(frozen=True, eq=False)
class Capture:
    """A scene in the renderer, cameras, the Bayer pattern `cfa`, the light that is counted, and the seed.

    `photons_per_radiance` are the photons that a pixel catches of a unit of radiance, for an exposure; None
    for a budget. `dark_map` is what pixels count without any, as of `detect`. Raises ValueError for an
    exposure without `photons_per_radiance`, and for a budget with it.
    """

    render_scene: RenderScene
    cameras: Cameras
    cfa: str | None
    photons: Photons = field(default_factory=Photons)
    photons_per_radiance: float | None = None
    seed: int = 0
    dark_map: np.ndarray | None = None

    def __post_init__(self) -> None:
        if (self.photons_per_radiance is None) == (self.photons.scope == "exposure"):
            raise ValueError(
                "photons_per_radiance: needed for photons of scope 'exposure', and for no others"
            )

    @cached_property
    def rig(self) -> Rig:
        """The cameras as they really are."""
        return as_rig(self.cameras)

    @property
    def grid(self) -> CameraGrid:
        """The cameras as they ought to be."""
        return self.rig.grid

    @property
    def coarse_grid(self) -> CameraGrid:
        """The same cameras with the same field of view on few pixels."""
        return with_larger_pixels(self.grid, max(self.grid.shape_HW) / COARSE_PX, least_px=2)

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
        of_view = self.grid.height * self.grid.width
        if self.has_one_budget:
            return of_view * self.grid.view_count
        return max(of_view // 4, 1) if len(self.cell_groups) > 1 else of_view

    def expected_photons(self, radiance: np.ndarray) -> float:
        """Photons of all views, given the mean radiance (C,) of each colour."""
        if self.photons_per_radiance is None:
            return self.photons.budget * self.view_of_scope.size
        per_pixel = self.photons_per_radiance * radiance[colour_cells(self.cfa).ravel()].mean()
        return float(per_pixel * (self.grid.view_count * self.grid.height * self.grid.width))

    def draw_totals(self) -> np.ndarray:
        """Photons that each scope is to have (S,), int64: of a Poisson budget random, else exact."""
        size, photons = self.view_of_scope.size, self.photons
        if photons.scope == "exposure":
            return np.full(size, ENDLESS)
        if photons.statistics == "multinomial":
            return np.full(size, round(photons.budget))
        return seeds.generator(self.seed, stage="budget totals").poisson(photons.budget, size)


def ranks_in_scopes(scope: np.ndarray) -> np.ndarray:
    """Number (N,), from 0, of each photon in its scope; `scope` (N,) is sorted, so that each is a run."""
    number = np.bincount(scope)
    first = np.cumsum(number) - number
    return np.arange(scope.size) - first[scope]
