"""Other labellings that the energy may prefer, each in pieces that it may take or leave.

A proposal names no reason: any may be made, and the energy alone decides, piece by piece (fusion moves,
Lempitsky et al. 2010). Axes: (h, w) cells; labels count depths from far to near, -1 is the background.
"""

from collections.abc import Iterator
from itertools import combinations
from typing import NamedTuple

import numpy as np

from pcii.imaging.bright_regions import dilated
from pcii.scene_model.ray_kernels import JUMP
from pcii.scene_model.surfaces import of_one_surface, surfaces_of

LARGEST_SURFACES = 12
"""Hulls are of so many of the largest surfaces, and of two of them: of 78 hulls at most."""
LEAST_CELLS = 6
"""Smaller additions of a hull are outlines."""
APART_CELLS = 4
"""Hulls that are nearer to each other are not proposed together."""


class Proposal(NamedTuple):
    """Labels (h, w) int16, and the number (h, w) of the piece that each cell is in; 0 stays as it is."""

    labels: np.ndarray
    pieces: np.ndarray


def other_labelling(labels: np.ndarray, other: np.ndarray) -> Proposal:
    """Another labelling, in pieces that are connected where it differs and of one surface."""
    # What does not differ is made a surface of its own, far from all labels.
    separate = np.where(other != labels, other, np.int16(np.iinfo(np.int16).min // 2))
    return Proposal(other, _numbered(surfaces_of(separate), other != labels))


def shifted(labels: np.ndarray, by: int, count: int) -> Proposal:
    """Each surface `by` so many labels nearer, of `count` labels."""
    moved = np.clip(labels + by, 0, count - 1).astype(np.int16)
    return Proposal(np.where(labels >= 0, moved, labels), _numbered(surfaces_of(labels), labels >= 0))


def merged(labels: np.ndarray, rank: int) -> Proposal:
    """Each surface at the mean label of a neighbour along their border, small surfaces first.

    The neighbour is the one with the longest border, or with the next longest ones (`rank` 1, 2, ...). None
    becomes part of what moves itself.
    """
    numbers = surfaces_of(labels)
    sizes = np.bincount(numbers.ravel())
    of, neighbour, length, label = _borders(labels, numbers)
    starts = np.searchsorted(of, np.arange(sizes.size + 1))
    target = np.full(sizes.size, np.iinfo(np.int16).min, np.int16)
    moves, stays = np.zeros((2, sizes.size), bool)
    for surface in np.argsort(sizes, kind="stable"):
        own = np.arange(int(starts[surface]), int(starts[surface + 1]))
        own = own[~moves[neighbour[own]]]
        if own.size and not stays[surface]:
            chosen = own[np.argsort(-length[own], kind="stable")[min(rank, own.size - 1)]]
            target[surface], moves[surface], stays[neighbour[chosen]] = label[chosen], True, True
    proposed = np.where(moves[numbers], target[numbers], labels)
    return Proposal(proposed, _numbered(numbers, moves[numbers]))


def outlines_moved(labels: np.ndarray, cells: int, nearer: bool, tile_cells: int) -> Proposal:
    """Outlines moved by so many cells, nearer surfaces grown or shrunk, tile by tile."""
    from scipy.ndimage import generate_binary_structure, maximum_filter, minimum_filter

    cross, moved = generate_binary_structure(2, 1), labels
    for _ in range(cells):
        moved = (maximum_filter if nearer else minimum_filter)(moved, footprint=cross)
    moved = np.where(of_one_surface(moved, labels), labels, moved)
    pieces = other_labelling(labels, moved).pieces
    h, w = (size // tile_cells + 1 for size in labels.shape)
    i, j = np.indices(labels.shape) // tile_cells
    return Proposal(moved, _numbered((pieces * h + i) * w + j, pieces > 0))


def hulls(labels: np.ndarray) -> Iterator[Proposal]:
    """Convex hulls of large surfaces, and of two of one depth, in front of what is farther.

    What crosses something is seen on both sides of it.
    """
    from skimage.morphology import convex_hull_image

    numbers = surfaces_of(labels)
    cells = np.bincount(numbers.ravel())
    means = np.bincount(numbers.ravel(), labels.ravel()) / cells
    sizes = np.where(means < 0, 0, cells)
    large = [
        int(surface) for surface in np.argsort(-sizes, kind="stable")[:LARGEST_SURFACES] if sizes[surface]
    ]
    pairs = [pair for pair in combinations(large, 2) if abs(means[pair[0]] - means[pair[1]]) <= 2 * JUMP]
    waiting = []
    for group in (*((one,) for one in large), *pairs):
        mask = np.isin(numbers, group)
        label = np.int16(round(labels[mask].mean()))
        added = convex_hull_image(mask) & ~mask & (labels < label - JUMP)
        if np.count_nonzero(added) >= LEAST_CELLS:
            waiting.append((added, label))
    while waiting:
        proposed, pieces, later = labels.copy(), np.zeros(labels.shape, np.int64), []
        for added, label in waiting:
            if pieces[dilated(added, APART_CELLS)].any():
                later.append((added, label))
            else:
                proposed[added], pieces[added] = label, pieces.max() + 1
        yield Proposal(proposed, pieces)
        waiting = later


def _numbered(numbers: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Numbers (h, w) of the pieces of what is `chosen`, from 1 without gaps; 0 elsewhere."""
    pieces = np.zeros(numbers.shape, np.int64)
    pieces[chosen] = np.unique(numbers[chosen], return_inverse=True)[1] + 1
    return pieces


def _borders(
    labels: np.ndarray, numbers: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Borders of surfaces: of which, to which, their length in edges, and the mean label on the other side.

    They are in the order of the surfaces.
    """
    one, other, beyond = [], [], []
    for here, there in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        for a, b in ((here, there), (there, here)):
            cut = numbers[a] != numbers[b]
            one.append(numbers[a][cut])
            other.append(numbers[b][cut])
            beyond.append(labels[b][cut])
    pairs, which = np.unique(
        np.stack([np.concatenate(one), np.concatenate(other)]), axis=1, return_inverse=True
    )
    length = np.bincount(which.ravel(), minlength=pairs.shape[1])
    mean = np.bincount(which.ravel(), np.concatenate(beyond), pairs.shape[1]) / np.maximum(length, 1)
    return pairs[0], pairs[1], length, mean.round().astype(np.int16)
