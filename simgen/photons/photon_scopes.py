"""What photons are counted over, how many each of these scopes still lacks, and candidates for a round."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pcii.core.bayer import channel_count, colour_cells
from simgen.base import random_streams as seeds
from simgen.spec.recipe import Photons

WAVEFRONT = 1 << 21
"""Candidates traced at once at most."""


@dataclass
class PhotonScopes:
    """What photons are counted over, (S,): view (-1: all together), group of cells, and progress."""

    view: np.ndarray
    group: np.ndarray
    wanted: np.ndarray

    def __post_init__(self) -> None:
        self.got = np.zeros(self.view.size, dtype=np.int64)
        self.tried = np.zeros(self.view.size, dtype=np.int64)
        self.time = np.zeros(self.view.size)
        """How long photons have been drawn, in candidates per unit of majorant."""

    def open(self, max_dark_candidates: int) -> np.ndarray:
        """Numbers of those that still want photons and are not dark.

        Dark are those of which `max_dark_candidates` found nothing.
        """
        dark = (self.got == 0) & (self.tried >= max_dark_candidates)
        return np.flatnonzero((self.got < self.wanted) & ~dark)

    def part(self, number: int, parts: int) -> "PhotonScopes":
        """Like scopes that want an equal share of the photons, the `number`-th of `parts`."""
        share = self.wanted * (number + 1) // parts - self.wanted * number // parts
        is_endless = self.wanted == np.iinfo(np.int64).max
        return PhotonScopes(self.view, self.group, np.where(is_endless, self.wanted, share))

    def blocks(self) -> Iterator[np.ndarray]:
        """Numbers of scopes to be drawn together: as many as are likely to fit a wavefront."""
        block = (np.cumsum(self.wanted) - 1) // (WAVEFRONT // 4)
        yield from np.split(np.arange(self.wanted.size), np.flatnonzero(np.diff(block)) + 1)


def scopes_for(photons: Photons, view_count: int, group_count: int, seed: int) -> PhotonScopes:
    """The scopes of so many views and groups of cells; how many photons each gets of a budget is random.

    An exposure has no budget: its scopes, one a view, take as many as come.
    """
    views = np.array([-1]) if photons.scope == "scene" else np.arange(view_count)
    view, group = views.repeat(group_count), np.tile(np.arange(group_count), views.size)
    if photons.scope == "exposure":
        wanted = np.full(view.size, np.iinfo(np.int64).max)
    elif photons.statistics == "multinomial":
        wanted = np.full(view.size, round(photons.budget))
    else:
        wanted = seeds.generator(seed, stage="budget totals").poisson(photons.budget, view.size)
    return PhotonScopes(view, group, wanted)


def cell_groups(scope: str, cfa: str | None) -> list[np.ndarray]:
    """Groups of Bayer cells (2 a + b) that are counted apart: those of each colour for scope "channel"."""
    if scope != "channel":
        return [np.arange(4)]
    cells = colour_cells(cfa).ravel()
    return [np.flatnonzero(cells == colour) for colour in range(channel_count(cfa))]


def candidates_needed(missing: np.ndarray, round_number: int, share: float) -> np.ndarray:
    """How many to draw for each scope: about what is missing at first, then enough to be done.

    Together never more than fit a wavefront.
    """
    aim = missing if round_number == 0 else missing + 3.5 * np.sqrt(missing) + 4
    return np.clip(aim / share, 16, max(WAVEFRONT // missing.size, 16)).astype(np.int64)


def places(scope: np.ndarray) -> np.ndarray:
    """Place (N,), from 0, of each photon in its scope; `scope` (N,) is sorted, so that each is a run."""
    number = np.bincount(scope)
    first = np.cumsum(number) - number
    return np.arange(scope.size) - first[scope]
