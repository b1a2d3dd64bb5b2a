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


def pieces_alike(pieces: np.ndarray, photons: np.ndarray) -> Iterator[np.ndarray]:
    """Masks (H, W) bool of the pieces, and of what they become as those whose light is most alike are merged.

    `photons` (C, H, W) by colour. Two are alike if one rate for both, in each colour, costs little
    log-likelihood for the length of their border (after Koepfler, Lopez and Morel 1994).
    """
    tree = _MergingByLight(pieces, photons)
    members = [[piece] for piece in range(len(tree.areas))]
    for a, b, _, _ in tree.weakest_first(lambda one, other: True):
        members.append(members[a] + members[b])
    for own in members[1:]:  # piece 0 is none
        yield np.isin(pieces, own)


class _Merging:
    """Pieces, their areas and the borders between them, while they are merged."""

    def __init__(self, pieces: np.ndarray, edges: np.ndarray, areas: list[int]) -> None:
        self.areas = areas
        self.alive = [True] * len(areas)
        self.borders: list[dict[int, tuple[float, int]]] = [{} for _ in areas]
        self.queue: list[tuple[float, int, int]] = []
        for a, b, height, length in _borders(pieces, edges):
            self.borders[a][b] = self.borders[b][a] = (height, length)
            self.queue.append((self.strength(a, b), a, b))
        heapq.heapify(self.queue)

    def strength(self, a: int, b: int) -> float:
        """How much parts two neighbours: the mean height of their border."""
        height, length = self.borders[a][b]
        return height / length

    def weakest_first(self, may_merge: Callable[[float, float], bool]) -> Iterator[tuple[int, int, int, int]]:
        """Merge across the weakest border whose two areas may merge, over and over.

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
            heapq.heappush(self.queue, (self.strength(other, joined), other, joined))


class _MergingByLight(_Merging):
    """The same, where what parts two pieces is how different their light is."""

    def __init__(self, pieces: np.ndarray, photons: np.ndarray) -> None:
        own, count = pieces.ravel(), int(pieces.max()) + 1
        each = [np.bincount(own, colour.ravel(), count) for colour in photons]
        self.photons = list(np.stack(each, axis=-1))
        super().__init__(pieces, np.zeros(pieces.shape), np.bincount(own).tolist())

    def strength(self, a: int, b: int) -> float:
        """Nats that one rate for both costs, for each pair of pixels along their border."""
        apart = _likelihood(self.photons[a], self.areas[a]) + _likelihood(self.photons[b], self.areas[b])
        together = _likelihood(self.photons[a] + self.photons[b], self.areas[a] + self.areas[b])
        return (apart - together) / self.borders[a][b][1]

    def _merge(self, a: int, b: int) -> None:
        self.photons.append(self.photons[a] + self.photons[b])
        super()._merge(a, b)


def _likelihood(photons: np.ndarray, area: float) -> float:
    """Log likelihood of photons (C,) on an area at the rate that fits them best, but for a constant."""
    some = photons[photons > 0]
    return float((some * np.log(some / area)).sum())


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
