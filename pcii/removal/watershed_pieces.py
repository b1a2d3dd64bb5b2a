"""Division of bright regions into pieces along the ridges of edges, and the choice of a plane for each piece.

Basins of the Roberts magnitude (Muniraj et al. 2017, Eq. 8) are merged across the weakest border first, as
in a hierarchical watershed. That makes a tree, with pieces of a least size as leaves and whole objects above.
Which of its borders are real is decided by the costs of the planes on either side of them.
"""

import heapq
from collections.abc import Callable, Iterator

import numpy as np


def pieces_along_ridges(bright: np.ndarray, edges: np.ndarray, smallest_px: float) -> np.ndarray:
    """Number of the piece that each pixel of the mask `bright` (H, W) belongs to, from 1; 0 elsewhere; int32.

    `edges` (H, W) is the gradient magnitude, whose ridges separate the basins (watershed). Basins of fewer
    than `smallest_px` pixels are merged with the neighbour behind the lowest border, repeatedly; a basin
    without a neighbour stays.
    """
    from skimage.segmentation import watershed

    if not bright.any():
        return np.zeros(bright.shape, dtype=np.int32)
    # Walls of infinite height make each connected component have a minimum.
    walled = np.pad(np.where(bright, edges, np.inf), 1, constant_values=np.inf)
    basins = watershed(walled, mask=np.pad(bright, 1))[1:-1, 1:-1]
    areas = np.bincount(basins.ravel()).tolist()
    count, parent = len(areas), list(range(len(areas)))
    for a, b, joined, _ in _weakest_first(basins, edges, areas, lambda *pair: min(pair) < smallest_px):
        parent.append(joined)
        parent[a] = parent[b] = joined
    for node in range(len(parent) - 1, -1, -1):  # from the roots down
        parent[node] = parent[parent[node]]
    # Basin 0, outside the mask, has no borders, so it is never merged and keeps its number.
    _, numbers = np.unique(parent[:count], return_inverse=True)
    return numbers.astype(np.int32)[basins]


def cheapest_planes(
    pieces: np.ndarray, edges: np.ndarray, cost: np.ndarray, border_cost: float
) -> np.ndarray:
    """Index of the plane of each piece (N,), int64, of least total cost with the borders between them.

    `cost` (N, P) is the cost of each piece at each plane, row 0 unused; a border between pieces of different
    planes costs `border_cost` for each pair of pixels along it. Of all ways to cut the tree of merged
    pieces, the best is found exactly, from the leaves up; without pieces all is -1.
    """
    areas = np.bincount(pieces.ravel(), minlength=len(cost)).tolist()
    costs, least = list(cost), [float(row.min()) for row in cost]
    children: dict[int, tuple[int, int]] = {}
    divided: set[int] = set()
    for a, b, joined, border_px in _weakest_first(pieces, edges, areas, lambda *pair: True):
        costs.append(costs[a] + costs[b])
        separate, together = least[a] + least[b] + border_cost * border_px, float(costs[joined].min())
        least.append(min(separate, together))
        children[joined] = (a, b)
        if separate < together:
            divided.add(joined)
    planes = [-1] * len(costs)
    # From the roots down: a joined piece has a higher number than its children.
    for node in range(len(costs) - 1, 0, -1):
        if planes[node] < 0 and node not in divided:
            planes[node] = int(np.argmin(costs[node]))
        for child in children.get(node, ()):
            planes[child] = planes[node]
    return np.array(planes[: len(cost)], dtype=np.int64)


def _weakest_first(
    pieces: np.ndarray, edges: np.ndarray, areas: list[int], may_merge: Callable[[int, int], bool]
) -> Iterator[tuple[int, int, int, int]]:
    """Merge repeatedly across the border of the lowest mean height whose two areas may merge.

    Yields both pieces, the number of the merged piece, and the length of the border in pixel pairs; `areas`
    has those of the merged pieces too.
    """
    borders = [dict[int, tuple[float, int]]() for _ in areas]
    queue = list[tuple[float, int, int]]()
    for a, b, height, length in _borders(pieces, edges):
        borders[a][b] = borders[b][a] = (height, length)
        queue.append((height / length, a, b))
    heapq.heapify(queue)
    merged = set[int]()
    while queue:
        _, a, b = heapq.heappop(queue)
        if merged & {a, b} or not may_merge(areas[a], areas[b]):
            continue
        joined = len(areas)
        yield a, b, joined, borders[a][b][1]
        merged |= {a, b}
        areas.append(areas[a] + areas[b])
        around: dict[int, tuple[float, int]] = {}
        for piece in (a, b):
            for neighbour, (height, length) in borders[piece].items():
                if neighbour not in (a, b):
                    before = around.get(neighbour, (0.0, 0))
                    around[neighbour] = (before[0] + height, before[1] + length)
                    del borders[neighbour][piece]
        borders.append(around)
        for neighbour, (height, length) in around.items():
            borders[neighbour][joined] = (height, length)
            heapq.heappush(queue, (height / length, neighbour, joined))


def _borders(pieces: np.ndarray, edges: np.ndarray) -> Iterator[tuple[int, int, float, int]]:
    """Both pieces, the summed height and the number of pixel pairs of each border; 0 has no borders."""
    size = int(pieces.max()) + 1
    keys, heights = [], []
    for pixel, neighbour in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        first, second = pieces[pixel], pieces[neighbour]
        is_border = (first != second) & (first > 0) & (second > 0)
        first, second = first[is_border].astype(np.int64), second[is_border]
        keys.append(np.minimum(first, second) * size + np.maximum(first, second))
        heights.append((edges[pixel][is_border] + edges[neighbour][is_border]) / 2)
    pairs, pair_of, lengths = np.unique(np.concatenate(keys), return_inverse=True, return_counts=True)
    sums = np.bincount(pair_of, np.concatenate(heights), minlength=pairs.size)
    a, b = pairs // size, pairs % size
    yield from zip(a.tolist(), b.tolist(), sums.tolist(), lengths.tolist(), strict=True)
