"""Regions of one plane, and whether the light says that they are there.

A region is a connected piece of what is bright and has one label. Its evidence is summed over it and the
dark around it, where a blurred outline would show. A piece that its neighbour's plane explains as well is
its neighbour's; a region that some depth far from every plane explains surely better is defocused.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pcii.evidence.focus_likelihood import FocusEvidence, dark_around, photon_weighted_mean
from pcii.evidence.half_agreement import Halves, least_agreement
from pcii.imaging.bright_regions import connected_pieces, dilated

HALO_CELLS = 4
"""Evidence of an outline lies up to 16 px outside it."""
OUTLINE_NATS = 0.5
"""A border between pieces must earn this much for each cell of its length, and `SURE_NATS` in all."""
SURE_NATS = 10.0
"""Of chance e^10: once in 20 000 times."""
PHOTONS_TO_SEE = 30.0
BRIGHT_SIGMAS = 6.0
BRIGHT_SHARE = 0.1
SKIRT_CELLS = 17
"""Bright is what exceeds the dark by 6 standard deviations and by a tenth of the brightest within 32 px, of
which it may be a blurred skirt."""
AS_BRIGHT_SHARE, AROUND_CELLS = 0.5, 33
"""What a highlight is on goes on around it, though far darker: half as bright as is typical of what is bright
within 64 px is no skirt."""
STRAY_SHARE = 0.1
"""Nor is it much darker than what half of the photons come from, which single photons in the dark are."""
OWN_OPINION_CELLS = 25
"""A piece of less than 20 x 20 px within something larger is narrower than the windows that put it there; one
by itself has the evidence of the dark around it, and no benefit of doubt about whether it is in focus."""
SMALLEST_CELLS = 6
STRONG_NATS, STRONG_CELLS = 20.0, 25
"""Layers are fitted where regions touch that have this much evidence and so many cells."""
ROUNDS = 3


@dataclass(frozen=True)
class Region:
    """A piece of a plane: its cells are `number` in the map; the depth where it gains most, and how much.

    `gain_nats` is what is beyond chance, which brings it about once in e^gain times.
    """

    number: int
    plane: int
    cells: int
    total_disparity_px: float
    gain_nats: float
    is_there: bool


@dataclass(frozen=True)
class Planes:
    """Which of the searched depths count as which plane.

    `nearest` (Z,) is the plane (P,) that each searched depth is closest to, `away_px` (Z,) how far in px of
    total disparity. Within `far_px` a depth is in the plane's focus; the plane's own it is if it is `sure`
    (Z,) bool: so near it, and so far from all others, that a surface that shows best there is not of theirs.
    """

    total_disparity_px: np.ndarray
    nearest: np.ndarray
    away_px: np.ndarray
    sure: np.ndarray
    far_px: float

    def close_to(self, plane: int) -> np.ndarray:
        """Which searched depths are the plane's own, (Z,) bool."""
        return (self.nearest == plane) & self.sure

    def within(self, plane: int) -> np.ndarray:
        """Which are in its focus, (Z,) bool."""
        return (self.nearest == plane) & (self.away_px <= self.far_px)


def bright_cells(photons: np.ndarray) -> np.ndarray:
    """What is not the dark around things, (h, w) bool, from photons by cell in focus."""
    from scipy.ndimage import gaussian_filter, maximum_filter

    total = float(photons.sum())
    if total == 0:
        return np.zeros(photons.shape, dtype=bool)
    typical = max(photon_weighted_mean(photons), 0.05)
    cells = float(np.clip(np.sqrt(PHOTONS_TO_SEE / (4 * np.pi * typical)), 1.0, 4.0))
    smooth = gaussian_filter(photons, cells)
    dark, there = dark_around(smooth, typical, 4 * np.pi * cells**2)
    if not there:
        return np.ones(photons.shape, dtype=bool)
    noise = np.sqrt(max(dark, 0.02) / (4 * np.pi * cells**2))
    nearby = maximum_filter(smooth, SKIRT_CELLS)
    # Half of the photons come from where it is at least this bright: a lamp does not put out the rest.
    order = np.argsort(smooth, axis=None)
    half = float(smooth.ravel()[order[np.searchsorted(np.cumsum(photons.ravel()[order]), total / 2)]])
    least = max(BRIGHT_SIGMAS * noise, STRAY_SHARE * (half - dark))
    bright = smooth > dark + np.maximum(least, BRIGHT_SHARE * (nearby - dark))
    half_as_bright = AS_BRIGHT_SHARE * (_typical_around(smooth, bright) - dark)
    return bright | (smooth > dark + np.maximum(least, half_as_bright))


def _typical_around(values: np.ndarray, where: np.ndarray) -> np.ndarray:
    """The geometric mean of the values > 0 (h, w) that are `where` (h, w) around each; inf if none is."""
    from scipy.ndimage import uniform_filter

    share = uniform_filter(where.astype(np.float64), AROUND_CELLS)
    logarithm = uniform_filter(np.log(values, where=where, out=np.zeros(where.shape)), AROUND_CELLS)
    some = share > 0.5 / AROUND_CELLS**2
    return np.exp(np.divide(logarithm, share, where=some, out=np.full(where.shape, np.inf)))


class _Piece(NamedTuple):
    """Connected bright cells of a plane, bool within `box`, and their `_evidence` (Z,)."""

    own: int
    box: tuple[slice, slice]
    cells: np.ndarray
    evidence: np.ndarray


def settled(plane: np.ndarray, bright: np.ndarray, focus: FocusEvidence, planes: Planes) -> np.ndarray:
    """The planes (h, w) of cells, -1 for none, after pieces without evidence of their own joined others."""
    plane = plane.copy()
    for _ in range(ROUNDS):
        pieces = [
            _Piece(int(own), box, cells, _evidence(focus, box, cells, bright))
            for own in np.unique(plane[bright])
            for box, cells in _pieces(bright & (plane == own))
        ]
        # A piece that another plane explains better goes first: what is right about it may be smaller.
        pieces.sort(key=lambda piece: _own_gain(plane, bright, planes, piece)[0])
        moved = [_join(plane, bright, planes, piece) for piece in pieces]
        if not any(moved):
            break
    return plane


def _join(plane: np.ndarray, bright: np.ndarray, planes: Planes, piece: _Piece) -> bool:
    """Give a piece to the plane it borders on most, unless it gains enough by its own."""
    gain, border, other = _own_gain(plane, bright, planes, piece)
    has_opinion = piece.cells.sum() >= OWN_OPINION_CELLS
    if border == 0 or (has_opinion and gain >= OUTLINE_NATS * border + SURE_NATS):
        return False
    plane[piece.box][piece.cells] = other
    return True


def _own_gain(plane: np.ndarray, bright: np.ndarray, planes: Planes, piece: _Piece) -> tuple[float, int, int]:
    """Nats that a piece gains by its own plane over the one it borders on most; on how many cells; which."""
    box = piece.box
    ring = dilated(piece.cells, 1) & ~piece.cells & bright[box] & (plane[box] != piece.own)
    if not ring.any():
        return np.inf, 0, piece.own
    names, numbers = np.unique(plane[box][ring], return_counts=True)
    other = int(names[np.argmax(numbers)])
    own_nats, other_nats = (piece.evidence[_depths(planes, each)].max() for each in (piece.own, other))
    return float(own_nats - other_nats), int(ring.sum()), other


def _depths(planes: Planes, plane: int) -> np.ndarray:
    """The searched depths whose evidence is of a plane; for none (-1), those in the focus of no plane."""
    return planes.close_to(plane) if plane >= 0 else planes.away_px > planes.far_px


def regions_of(
    plane: np.ndarray, bright: np.ndarray, focus: FocusEvidence, planes: Planes, halves: Halves
) -> tuple[np.ndarray, list[Region]]:
    """A map (h, w) int64 of the regions' numbers, 0 outside, and the regions.

    `halves` are what the halves of the cameras show at the searched depths. They must agree on the piece of
    what is bright that a region belongs to; on a region alone, seen between leaves, they need not.
    """
    agreed = _agreed(bright, halves)
    numbers = np.zeros(plane.shape, np.int64)
    found: list[Region] = []
    nowhere = planes.away_px > planes.far_px
    for own in np.unique(plane[bright]):
        for box, piece in _pieces(bright & (plane == own)):
            cells = int(piece.sum())
            if cells < SMALLEST_CELLS:
                continue
            evidence = _evidence(focus, box, piece, bright)
            own_depths = planes.within(int(own)) if own >= 0 else nowhere
            best = int(np.argmax(np.where(own_depths, evidence, -np.inf)))
            elsewhere = evidence[nowhere].max() if nowhere.any() else -np.inf
            sure_nats = _beyond_chance(evidence, nowhere)
            # Planes are where things are looked for: that one is elsewhere must be sure, too; not of a speck.
            doubt_nats = SURE_NATS if cells >= OWN_OPINION_CELLS else 0.0
            in_focus = evidence[~nowhere].max() >= elsewhere - doubt_nats
            is_there = own >= 0 and sure_nats[best] > SURE_NATS and in_focus
            is_there = is_there and bool(agreed[box][piece].any())
            number = len(found) + 1
            numbers[box][piece] = number
            if not is_there and elsewhere > evidence[best]:
                best = int(np.argmax(np.where(nowhere, evidence, -np.inf)))
            found.append(
                Region(
                    number,
                    int(own) if is_there else -1,
                    cells,
                    float(planes.total_disparity_px[best]),
                    float(sure_nats[best]),
                    bool(is_there),
                )
            )
    return numbers, found


def where_planes_touch(bright: np.ndarray, numbers: np.ndarray, regions: Sequence[Region]) -> np.ndarray:
    """Connected pieces of what is bright that hold strong regions of several planes, (h, w) bool."""
    pieces = connected_pieces(bright)
    planes_of: dict[int, set[int]] = {}
    for region in regions:
        if region.gain_nats > STRONG_NATS and region.cells >= STRONG_CELLS:
            piece = int(pieces[numbers == region.number][0])
            planes_of.setdefault(piece, set()).add(region.plane)
    return np.isin(pieces, [piece for piece, own in planes_of.items() if len(own) > 1])


def dark_pieces(plane: np.ndarray, bright: np.ndarray) -> np.ndarray:
    """Connected pieces of each plane's cells that are nowhere bright, (h, w) bool; `plane` is -1 for none.

    Layers take such a piece where it is darker than the dark is elsewhere: as a surface it explains the
    photons that are missing, but nobody sees it.
    """
    found = np.zeros(bright.shape, dtype=bool)
    for own in np.unique(plane[plane >= 0]):
        for box, piece in _pieces(plane == own):
            if not (piece & bright[box]).any():
                found[box] |= piece
    return found


def _agreed(bright: np.ndarray, halves: Halves) -> np.ndarray:
    """Which of the connected pieces of what is bright the halves of the cameras agree on, (h, w) bool."""
    least = least_agreement(halves.planes)
    agreed = np.zeros(bright.shape, dtype=bool)
    for box, piece in _pieces(bright):
        if halves.agreement_over(*box, _around(box, piece, bright)) > least:
            agreed[box] |= piece
    return agreed


def _pieces(mask: np.ndarray) -> list[tuple[tuple[slice, slice], np.ndarray]]:
    """Connected pieces of a mask: a box with room for the halo, and the piece in it."""
    from scipy.ndimage import find_objects

    numbers = connected_pieces(mask)
    found = []
    for number, place in enumerate(find_objects(numbers), start=1):
        room = HALO_CELLS + 2
        box = (
            slice(max(place[0].start - room, 0), place[0].stop + room),
            slice(max(place[1].start - room, 0), place[1].stop + room),
        )
        found.append((box, numbers[box] == number))
    return found


def _evidence(
    focus: FocusEvidence, box: tuple[slice, slice], piece: np.ndarray, bright: np.ndarray
) -> np.ndarray:
    """Gain of every searched depth over a piece and the dark around it, (Z,) float64."""
    around = _around(box, piece, bright)
    return focus.gain[:, box[0], box[1]][:, around].sum(axis=1, dtype=np.float64)


def _around(box: tuple[slice, slice], piece: np.ndarray, bright: np.ndarray) -> np.ndarray:
    """A piece and the dark around it."""
    return dilated(piece, HALO_CELLS) & (~bright[box] | piece)


def _beyond_chance(evidence: np.ndarray, nowhere: np.ndarray) -> np.ndarray:
    """How sure the evidence (Z,) of each depth is: chance brings it about once in e^nats times.

    Where a section shows only noise it predicts worse than a blurred one, by m on average and with the
    variance 2 m: so much that e^evidence is 1 on average. Of many photons m exceeds what is to be found, and
    is told by the depths of no plane; s standard deviations above -m are s^2 / 2 nats. Of few it is not, and
    chance is not normal: then the evidence itself is what is sure.
    """
    noise = -float(np.median(evidence[nowhere])) if nowhere.any() else 0.0
    if noise <= SURE_NATS:
        return evidence
    above = evidence + noise
    return above * np.abs(above) / (4 * noise)
