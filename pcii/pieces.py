"""Cut what is bright into pieces along the ridges of its edges, and give each piece one plane.

Basins of the Roberts magnitude (Muniraj et al. 2017, Eq. 8) are merged across the weakest border first, as
in a hierarchical watershed. That makes a tree: pieces of some size at its leaves, whole objects above.
Which of its borders are real is then told by what the planes cost on either side of them.
"""

import heapq
from collections.abc import Callable, Iterator

import numpy as np


def pieces_along_ridges(bright: np.ndarray, edges: np.ndarray, smallest_px: float) -> np.ndarray:
    """Number of the piece that each pixel of `bright` (H, W) belongs to, from 1; 0 elsewhere; int32.

    `edges` (H, W) is the steepness, whose ridges part the basins (watershed). A basin of fewer than
    `smallest_px` pixels joins the neighbour behind its lowest border, over and over; one without any
    neighbour stays.
    """
    from skimage.segmentation import watershed

    if not bright.any():
        return np.zeros(bright.shape, dtype=np.int32)
    # Each bright part has a lowest point of its own, whatever is around it.
    walled = np.pad(np.where(bright, edges, np.inf), 1, constant_values=np.inf)
    basins = watershed(walled, mask=np.pad(bright, 1))[1:-1, 1:-1]
    areas = np.bincount(basins.ravel()).tolist()
    parent = list(range(len(areas)))
    tree = _Merging(basins, edges, areas.copy())
    for a, b, joined, _ in tree.weakest_first(lambda one, other: min(one, other) < smallest_px):
        parent.append(joined)
        parent[a] = parent[b] = joined
    for node in range(len(parent) - 1, -1, -1):  # from the roots down
        parent[node] = parent[parent[node]]
    # Basin 0 is what is not bright: it has no borders here, so it stays and stays the first.
    _, numbers = np.unique(parent[: len(areas)], return_inverse=True)
    return numbers.astype(np.int32)[basins]


def cheapest_planes(
    pieces: np.ndarray, edges: np.ndarray, cost: np.ndarray, border_cost: float
) -> np.ndarray:
    """The plane (index) of each piece (N,), int64, that costs least together with the borders between them.

    `cost` (N, P) is what a piece costs at a plane, row 0 unused; a border between pieces of different
    planes costs `border_cost` for each pair of pixels along it. Of all ways to cut the tree of merged
    pieces, the best is found exactly, from the leaves up; without pieces all is -1.
    """
    tree = _Merging(pieces, edges, np.bincount(pieces.ravel(), minlength=len(cost)).tolist())
    costs, least = list(cost), [float(row.min()) for row in cost]
    children: dict[int, tuple[int, int]] = {}
    parted: set[int] = set()
    for a, b, joined, border_px in tree.weakest_first(lambda one, other: True):
        costs.append(costs[a] + costs[b])
        apart, whole = least[a] + least[b] + border_cost * border_px, float(costs[joined].min())
        least.append(min(apart, whole))
        children[joined] = (a, b)
        if apart < whole:
            parted.add(joined)
    planes = [-1] * len(costs)
    for node in range(len(costs) - 1, 0, -1):  # from the roots down: what is joined comes after its parts
        if planes[node] < 0 and node not in parted:
            planes[node] = int(np.argmin(costs[node]))
        for child in children.get(node, ()):
            planes[child] = planes[node]
    return np.array(planes[: len(cost)], dtype=np.int64)


class _Merging:
    """Pieces, their areas and the borders between them, while they are merged."""

    def __init__(self, pieces: np.ndarray, edges: np.ndarray, areas: list[int]) -> None:
        self.areas = areas
        self.alive = [True] * len(areas)
        self.borders: list[dict[int, tuple[float, int]]] = [{} for _ in areas]
        self.queue: list[tuple[float, int, int]] = []
        for a, b, height, length in _borders(pieces, edges):
            self.borders[a][b] = self.borders[b][a] = (height, length)
            self.queue.append((height / length, a, b))
        heapq.heapify(self.queue)

    def weakest_first(self, may_merge: Callable[[float, float], bool]) -> Iterator[tuple[int, int, int, int]]:
        """Merge across the border of the least mean height whose two areas may merge, over and over.

        Gives both pieces, the number of what they become, and the length of the border in pixel pairs.
        """
        while self.queue:
            _, a, b = heapq.heappop(self.queue)
            if self.alive[a] and self.alive[b] and may_merge(self.areas[a], self.areas[b]):
                yield a, b, len(self.areas), self.borders[a][b][1]
                self._merge(a, b)

    def _merge(self, a: int, b: int) -> None:
        joined = len(self.areas)
        self.areas.append(self.areas[a] + self.areas[b])
        self.alive.append(True)
        self.alive[a] = self.alive[b] = False
        around: dict[int, tuple[float, int]] = {}
        for part in (a, b):
            for other, (height, length) in self.borders[part].items():
                if other not in (a, b):
                    before = around.get(other, (0.0, 0))
                    around[other] = (before[0] + height, before[1] + length)
                    del self.borders[other][part]
        self.borders.append(around)
        for other, (height, length) in around.items():
            self.borders[other][joined] = (height, length)
            heapq.heappush(self.queue, (height / length, other, joined))


def _borders(pieces: np.ndarray, edges: np.ndarray) -> Iterator[tuple[int, int, float, int]]:
    """Both pieces, the summed height and the number of pixel pairs of each border; 0 has no borders."""
    size = int(pieces.max()) + 1
    keys, heights = [], []
    for this, beside in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        one, other = pieces[this], pieces[beside]
        apart = (one != other) & (one > 0) & (other > 0)
        one, other = one[apart].astype(np.int64), other[apart]
        keys.append(np.minimum(one, other) * size + np.maximum(one, other))
        heights.append((edges[this][apart] + edges[beside][apart]) / 2)
    pairs, where, lengths = np.unique(np.concatenate(keys), return_inverse=True, return_counts=True)
    sums = np.bincount(where, np.concatenate(heights), minlength=pairs.size)
    a, b = pairs // size, pairs % size
    yield from zip(a.tolist(), b.tolist(), sums.tolist(), lengths.tolist(), strict=True)
