"""Pieces that may belong to another layer than the one that is seen there now.

Proposed are, for each layer: regions whose photons it would explain if it were in front of all others; discs
where it would explain most; regions of one brightness in the section at its depth; and convex hulls of its
visible parts, since of a surface that crosses another one parts are visible on both sides. The energy decides
which proposals are right (`pcii.removal.likelihood.layer_search`).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from pcii.evidence.cells import CELL_PX
from pcii.evidence.focus_likelihood import PICTURE_CELLS
from pcii.imaging.bright_regions import box_around, connected_pieces, dilated, roberts_magnitude
from pcii.imaging.watershed_pieces import pieces_alike, pieces_along_ridges
from pcii.removal.likelihood.layers import AREA_NATS, LENGTH_NATS, STEPS, Layers

FAVOURS_NATS = (0.0, 0.3, 0.8)
"""What a layer is granted per cell while pieces are proposed: one may be there in part."""
ALIKE_CELLS, MOST_ALIKE, SAME_SHARE = 40, 8, 0.8
"""Of pieces of one light those of 25 x 25 px and more that a layer would explain best; of two that share four
fifths of what they cover one."""
LEAST_OPEN_NATS = -0.2
"""What a layer in front of all would gain per cell, at least: it has only a part of the piece's light now."""
MOST_HULLS, MOST_PAIRED, MOST_HULLS_OF_TWO = 3, 14, 8
"""Hulls are of so many of the largest pieces of a layer; and of two of so many, the best of them."""
DISC_CELLS, MOST_DISCS = (6.0, 9.0, 13.5), 6
"""Discs of 24, 36 and 54 px, so many of each where most is gained: the fit that follows outlines them."""
SMALLEST_CELLS, FEWEST_PHOTONS = 16, 50.0
"""Less light than that cannot lower the energy by as much as a proposal must."""
AROUND_CELLS = 8
"""A proposal is judged by what changes within 32 px of it: parallax brings it there."""


@dataclass(frozen=True)
class Proposal:
    """That `layer` is what is seen in `cells`; judged in `around` (both (h, w) bool)."""

    layer: int
    cells: np.ndarray
    around: np.ndarray


def proposals_of(layers: Layers) -> Iterator[Proposal]:
    """Connected pieces of what may be another layer's, each of them once."""
    told: set[bytes] = set()
    photons = [layers.photons(layer) for layer in range(len(layers.masks))]
    light = [own.sum(axis=0).ravel() for own in photons]
    for layer, where in _supposed(layers, photons):
        pieces = connected_pieces(where)
        enough = np.bincount(pieces.ravel()) >= SMALLEST_CELLS
        enough &= np.bincount(pieces.ravel(), light[layer]) >= FEWEST_PHOTONS
        enough[0] = False
        for number in np.flatnonzero(enough):
            cells = pieces == number
            name = bytes([layer]) + np.packbits(cells).tobytes()
            if name not in told:
                told.add(name)
                yield Proposal(layer, cells, dilated(cells, AROUND_CELLS))


def _supposed(layers: Layers, photons: list[np.ndarray]) -> Iterator[tuple[int, np.ndarray]]:
    """Layers, and where (h, w) bool they may be instead of what is seen there now."""
    from pcii.removal.likelihood.outline_kernels import least_outline

    seen = layers.visible()
    near_light = dilated(seen >= 0, 2)
    for layer, gain in enumerate(layers.in_the_open()):
        other = (seen != layer) & near_light
        pieces = [piece & other for piece in (*_hulls(seen == layer, gain), *_discs(gain, other))]
        pieces += _alike(photons[layer], seen, layer, gain)
        yield from ((layer, piece) for piece in pieces if gain[piece].sum() > LEAST_OPEN_NATS * piece.sum())
        for favour in FAVOURS_NATS:
            inside = np.empty_like(gain)
            granted = gain + np.float32(favour - AREA_NATS)
            least_outline(granted, LENGTH_NATS * CELL_PX, STEPS, inside)
            yield layer, (inside > 0.5) & other


def _hulls(mask: np.ndarray, gain: np.ndarray) -> Iterator[np.ndarray]:
    """Convex hulls (h, w) bool of the largest pieces of a mask, and of two of them where that gains most.

    `gain` (h, w) is what the layer would gain in each cell; that of what a hull adds to the mask counts.
    """
    pieces = connected_pieces(mask)
    cells = np.bincount(pieces.ravel())
    cells[0] = 0
    large = [piece for piece in np.argsort(-cells)[:MOST_PAIRED] if cells[piece] >= ALIKE_CELLS]
    for piece in large[:MOST_HULLS]:
        yield _hull(pieces == piece)
    pairs = [_hull((pieces == one) | (pieces == other)) for one, other in combinations(large, 2)]
    pairs.sort(key=lambda hull: -float(gain[hull & ~mask].sum()))
    yield from _different(pairs, MOST_HULLS_OF_TWO)


def _hull(mask: np.ndarray) -> np.ndarray:
    from skimage.morphology import convex_hull_image

    hull, box = mask.copy(), box_around(mask)
    hull[box] = convex_hull_image(mask[box])
    return hull


def _discs(gain: np.ndarray, where: np.ndarray) -> Iterator[np.ndarray]:
    """Discs (h, w) bool around places `where` (h, w) bool that gain (h, w) more than those around them."""
    from scipy.ndimage import gaussian_filter, maximum_filter

    i, j = np.indices(gain.shape)
    for radius in DISC_CELLS:
        blur = radius / 1.5
        smooth = gaussian_filter(np.where(where, gain, 0), blur)
        rows, cols = np.nonzero(where & (smooth == maximum_filter(smooth, int(2 * blur) | 1)))
        for best in np.argsort(-smooth[rows, cols])[:MOST_DISCS]:
            yield (i - rows[best]) ** 2 + (j - cols[best]) ** 2 <= radius**2


def _alike(photons: np.ndarray, seen: np.ndarray, layer: int, gain: np.ndarray) -> Iterator[np.ndarray]:
    """Pieces (h, w) bool of one light, in a layer's section, that it would explain best of those not its own.

    `photons` (C, h, w) are the section's, `gain` (h, w) the nats that the layer would gain in front of all.
    """
    from scipy.ndimage import gaussian_filter

    # Of the square root of a count the noise is the same everywhere.
    edges = roberts_magnitude(np.sqrt(gaussian_filter(photons.sum(axis=0), PICTURE_CELLS)))
    pieces = pieces_along_ridges(seen >= 0, edges, ALIKE_CELLS)
    others = [piece & (seen != layer) for piece in pieces_alike(pieces, photons)]
    large = [piece for piece in others if np.count_nonzero(piece) >= ALIKE_CELLS]
    large.sort(key=lambda piece: -float(gain[piece].sum()))
    yield from _different(large, MOST_ALIKE)


def _different(pieces: Sequence[np.ndarray], most: int) -> list[np.ndarray]:
    """The first of some pieces (h, w) bool, at `most` so many, without those that are nearly another one."""
    given: list[np.ndarray] = []
    for piece in pieces:
        if len(given) < most and not any(_same(piece, other) for other in given):
            given.append(piece)
    return given


def _same(one: np.ndarray, other: np.ndarray) -> bool:
    return bool(np.count_nonzero(one & other) >= SAME_SHARE * np.count_nonzero(one | other))
