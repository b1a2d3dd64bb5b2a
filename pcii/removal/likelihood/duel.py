"""Duels of depths, photon by photon: what does each predict that the others do not?

Light of a defocused object is predicted best by that object's own plane, so that it is explained instead of
outvoting others.
"""

from collections.abc import Sequence

import numpy as np

from pcii.core.focal_planes import FocalPlanes
from pcii.core.photon_counts import PhotonCounts
from pcii.evidence.cells import in_cells
from pcii.evidence.focus_likelihood import JUMP_NATS, Predictions, best_labels, predictions_of, windowed
from pcii.imaging.blocks import evenly_chosen
from pcii.imaging.bright_regions import connected_pieces
from pcii.removal.likelihood.regions import Region

DUEL_NATS = 20.0
DUEL_CELLS = 25
"""Regions that are compared have this much evidence and this many cells."""
VIEWS_PER_AXIS = 4
"""Expected light is averaged over 4 x 4 cameras of the grid, its corners among them."""


def duelled(
    counts: PhotonCounts,
    plane: np.ndarray,
    touching: np.ndarray,
    regions: Sequence[Region],
    own_disparity_px: np.ndarray,
) -> np.ndarray:
    """The planes (h, w) of cells after depths were compared photon by photon in `touching` (h, w) bool.

    Compared are the depths of regions, and of requested planes that have none.
    """
    strong = _strong(regions)
    named = {region.plane for region in strong}
    idle = {
        (float(disparity_px), own) for own, disparity_px in enumerate(own_disparity_px) if own not in named
    }
    labels = sorted({(region.total_disparity_px, region.plane) for region in strong} | idle)
    focus, seen = predictions_of(
        counts, FocalPlanes.at_total_disparity(counts.grid, [disparity_px for disparity_px, _ in labels])
    )
    gain = _duel(counts, focus.planes, seen)
    # Any change costs the same: these labels are in no order.
    cost = np.full(len(labels) - 1, JUMP_NATS)
    best = best_labels(windowed(gain, focus.photons), cost, JUMP_NATS)
    return np.where(touching, np.array([own for _, own in labels])[best], plane)


def where_planes_touch(bright: np.ndarray, numbers: np.ndarray, regions: Sequence[Region]) -> np.ndarray:
    """Connected pieces of what is bright that hold regions of several planes, (h, w) bool."""
    pieces = connected_pieces(bright)
    planes_of: dict[int, set[int]] = {}
    for region in _strong(regions):
        piece = int(pieces[numbers == region.number][0])
        planes_of.setdefault(piece, set()).add(region.plane)
    return np.isin(pieces, [piece for piece, own in planes_of.items() if len(own) > 1])


def _strong(regions: Sequence[Region]) -> list[Region]:
    return [region for region in regions if region.gain_nats > DUEL_NATS and region.cells >= DUEL_CELLS]


def _duel(counts: PhotonCounts, planes: FocalPlanes, seen: Predictions) -> np.ndarray:
    """Nats that each depth gains over all of them together (S, h, w)."""
    from pcii.evidence import focus_kernels as kernels

    rows, cols = (
        in_cells(axis[:, evenly_chosen(axis.shape[1], VIEWS_PER_AXIS)]) for axis in planes.whole_shifts_px
    )
    S, h, w = seen.expected.shape
    views = np.zeros((rows.shape[1] * cols.shape[1], h, w), np.float32)
    kernels.views_of_planes(seen.expected, rows, cols, 1 / S, views)
    rate = np.maximum(seen.rate, np.float32(1e-9))
    # Where a depth lands outside the section it has no say.
    inside = seen.cell >= 0
    together = np.where(inside, rate, 0).sum(axis=0) / np.maximum(inside.sum(axis=0), 1)
    gain = np.zeros_like(seen.expected)
    n = counts.events.n.astype(np.float32)
    kernels.duel_planes(views, seen.expected, rows, cols, rate, seen.cell, together, n, gain)
    return gain
