"""Surfaces with holes: what an image of opacity leaves of a mesh, as a mesh.

Holes are cut along the line where the opacity is a half, found in each square between the middles of four
pixels (marching squares, Lorensen and Cline 1987). What is left is an ordinary mesh: nothing that traces rays
needs to know of holes.
"""

from collections.abc import Iterator

import numpy as np

from simgen.assets.triangles import Triangles, barycentric, check_counts, cross_2d, fan_all

FULL = 0.5
"""From this opacity on there is a surface."""
OVERLAP = 1 / 1024
"""Of a pixel, or of the height of a triangle that is less, by which neighbouring pieces overlap: rounded
corners would leave gaps between them."""
MOST_CELLS = 1 << 25
PAIRS_AT_ONCE = 1 << 18
# Around a cell, counterclockwise with v up: its corners 0, 2, 4, 6 and the ends 1, 3, 5, 7 of the line on its
# sides. What bounds the full part, by the sum of 1, 2, 4, 8 for the corners that are full.
_PARTS: dict[int, tuple[tuple[int, ...], ...]] = {
    1: ((0, 1, 7),),
    2: ((1, 2, 3),),
    3: ((0, 2, 3, 7),),
    4: ((3, 4, 5),),
    5: ((0, 1, 7), (3, 4, 5)),
    6: ((1, 2, 4, 5),),
    7: ((0, 2, 4, 5, 7),),
    8: ((5, 6, 7),),
    9: ((0, 1, 5, 6),),
    10: ((1, 2, 3), (5, 6, 7)),
    11: ((0, 2, 3, 5, 6),),
    12: ((3, 4, 6, 7),),
    13: ((0, 1, 3, 4, 6),),
    14: ((1, 2, 4, 6, 7),),
}
_JOINED = {5: ((0, 1, 3, 4, 5, 7),), 10: ((1, 2, 3, 5, 6, 7),)}
"""Of two full corners that lie across, where the middle between them is full too."""

Polygons = tuple[np.ndarray, np.ndarray]
"""Corners (N, V, 2), x right and y up in pixels, and how many of them (N,) each polygon has."""


def cut_out(mesh: Triangles, opacity: np.ndarray, *, tiled: bool) -> Triangles | None:
    """The part of a mesh with texture coordinates on which `opacity` (H, W), row 0 on top, is full, if any.

    Beyond its borders the image is repeated if `tiled`, else its outermost pixels go on. Raises `ValueError`
    with the end of a sentence for more triangles than a mesh may have.
    """
    assert mesh.texcoords is not None
    height, width = opacity.shape
    corners = (mesh.texcoords.astype(np.float64) * [width, height] - 0.5)[mesh.faces]
    first = np.floor(corners.min(axis=(0, 1))).astype(np.int64) - 1
    last = np.floor(corners.max(axis=(0, 1))).astype(np.int64) + 2
    if np.prod((last - first).astype(float)) > MOST_CELLS:
        raise ValueError(f"more than {MOST_CELLS} pixels of it lie on the mesh; use a smaller image")
    corners -= first
    values = _spread(opacity[::-1], first, last, tiled)
    full = (values >= FULL).astype(np.int8)
    sums = full[:-1, :-1] + 2 * full[:-1, 1:] + 4 * full[1:, 1:] + 8 * full[1:, :-1]
    whole, cut = _all_in(sums == 15, corners), ~_all_in(sums == 0, corners)
    # A triangle that is a line on the picture is there if its first corner is.
    line = np.abs(cross_2d(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])) < OVERLAP**2
    col, row = np.round(corners[:, 0]).astype(np.int64).T
    whole = np.where(line, full[row, col] > 0, whole)
    parts = [
        _lifted(mesh, corners, *found)
        for found in _clipped(_pieces(values, sums), corners, cut & ~whole & ~line)
    ]
    return _joined(mesh, mesh.faces[whole], parts)


def _spread(opacity: np.ndarray, first: np.ndarray, last: np.ndarray, tiled: bool) -> np.ndarray:
    """The image from pixel `first` to pixel `last` (x, y), wherever these are."""
    col, row = (np.arange(low, high + 1) for low, high in zip(first, last, strict=True))
    if tiled:
        return opacity[np.ix_(row % len(opacity), col % opacity.shape[1])]
    return opacity[np.ix_(np.clip(row, 0, len(opacity) - 1), np.clip(col, 0, opacity.shape[1] - 1))]


def _all_in(flag: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Whether all cells (H, W) in the bounding box of each triangle (M, 3, 2) have the flag; (M,) bool."""
    running = np.pad(np.cumsum(np.cumsum(flag, axis=0), axis=1), ((1, 0), (1, 0)))
    low, high = (np.floor(end).astype(np.int64) for end in (corners.min(axis=1), corners.max(axis=1)))
    (x0, y0), (x1, y1) = low.T, high.T + 1
    found = running[y1, x1] - running[y0, x1] - running[y1, x0] + running[y0, x0]
    return found == (x1 - x0) * (y1 - y0)


def _pieces(values: np.ndarray, sums: np.ndarray) -> Polygons:
    """The full part of the image as convex polygons of at most 6 corners."""
    shapes, counts = [_rectangles(sums == 15)], [4]
    joined = values[:-1, :-1] + values[:-1, 1:] + values[1:, 1:] + values[1:, :-1] >= 4 * FULL
    for number, apart in _PARTS.items():
        here = sums == number
        for parts, chosen in ((apart, here & ~joined), (_JOINED.get(number, apart), here & joined)):
            ring = _ring(values, *np.nonzero(chosen))
            for part in parts:
                shapes.append(ring[:, list(part)])
                counts.append(len(part))
    padded = [np.pad(shape, ((0, 0), (0, 6 - shape.shape[1]), (0, 0))) for shape in shapes]
    return np.concatenate(padded), np.repeat(counts, [len(shape) for shape in shapes])


def _rectangles(full: np.ndarray) -> np.ndarray:
    """Rectangles (N, 4, 2) that cover the full cells, each of which is in one, a little beyond its sides."""
    change = np.diff(np.pad(full, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    (row, start), (_, end) = np.nonzero(change == 1), np.nonzero(change == -1)
    order = np.lexsort((row, end, start))
    row, start, end = row[order], start[order], end[order]
    # Equal runs of neighbouring rows are one rectangle.
    goes_on = (np.diff(row) == 1) & (np.diff(start) == 0) & (np.diff(end) == 0)
    lowest = np.flatnonzero(np.append(True, ~goes_on)[: len(row)])
    highest = np.append(lowest[1:], len(row))[: len(lowest)] - 1
    x0, x1 = start[lowest] - OVERLAP, end[lowest] + OVERLAP
    y0, y1 = row[lowest] - OVERLAP, row[highest] + 1 + OVERLAP
    return np.stack([np.stack([x0, x1, x1, x0], axis=-1), np.stack([y0, y0, y1, y1], axis=-1)], axis=-1)


def _ring(values: np.ndarray, row: np.ndarray, col: np.ndarray) -> np.ndarray:
    """The 8 points around cells, (N, 8, 2); a side that the line does not cross has some point."""
    corner = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
    at = values[row[:, None] + corner[:, 1], col[:, None] + corner[:, 0]].astype(np.float64)
    onward = np.roll(at, -1, axis=1) - at
    share = (FULL - at) / np.where(onward == 0, 1, onward)
    points = np.empty((len(row), 8, 2))
    points[:, ::2] = corner
    points[:, 1::2] = corner + share[..., None] * (np.roll(corner, -1, axis=0) - corner)
    return points + np.stack([col, row], axis=-1)[:, None]


def _clipped(
    pieces: Polygons, corners: np.ndarray, wanted: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Pieces within each wanted triangle of `corners` (M, 3, 2): polygons, counts, the triangles' numbers."""
    shapes, counts = pieces
    real = np.arange(shapes.shape[1]) < counts[:, None]
    low = np.where(real[..., None], shapes, np.inf).min(axis=1)
    high = np.where(real[..., None], shapes, -np.inf).max(axis=1)
    triangles = np.flatnonzero(wanted)
    step = max(1, PAIRS_AT_ONCE // max(1, len(counts)))
    for start in range(0, len(triangles), step):
        some = triangles[start : start + step]
        least, most = corners[some].min(axis=1)[:, None], corners[some].max(axis=1)[:, None]
        owner, piece = np.nonzero(((low < most + OVERLAP) & (high > least - OVERLAP)).all(axis=2))
        polygons, number = shapes[piece], counts[piece]
        triangle = corners[some[owner]]
        across = cross_2d(triangle[:, 1] - triangle[:, 0], triangle[:, 2] - triangle[:, 0])
        turn, doubled = np.sign(across), np.abs(across)
        for side in range(3):
            begin, along = triangle[:, side], triangle[:, (side + 1) % 3] - triangle[:, side]
            inside = turn[:, None] * cross_2d(along[:, None], polygons - begin[:, None])
            inside += OVERLAP * np.minimum(np.linalg.norm(along, axis=1), doubled)[:, None]
            polygons, number = _on_one_side(polygons, number, inside)
        left = number >= 3
        yield polygons[left], number[left], some[owner[left]]


def _on_one_side(polygons: np.ndarray, counts: np.ndarray, inside: np.ndarray) -> Polygons:
    """What of convex polygons lies where `inside` (N, V), linear over the plane, is not negative.

    Sutherland and Hodgman 1974, for all at once.
    """
    size = polygons.shape[1]
    slot = np.arange(size)
    following = np.where(slot + 1 < counts[:, None], slot + 1, 0)
    here, real = inside, slot < counts[:, None]
    there = np.take_along_axis(inside, following, axis=1)
    onward = np.take_along_axis(polygons, following[..., None], axis=1)
    crosses = real & ((here >= 0) != (there >= 0))
    share = here / np.where(crosses, here - there, 1)
    between = polygons + share[..., None] * (onward - polygons)
    points = np.stack([polygons, between], axis=2).reshape(len(polygons), 2 * size, 2)
    kept = np.stack([real & (here >= 0), crosses], axis=2).reshape(len(polygons), 2 * size)
    first = np.argsort(~kept, axis=1, kind="stable")[:, : size + 1]
    return np.take_along_axis(points, first[..., None], axis=1), kept.sum(axis=1)


def _lifted(
    mesh: Triangles, corners: np.ndarray, polygons: np.ndarray, counts: np.ndarray, owner: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Polygons on the picture as triangles, the mesh's face under each corner, and shares of it."""
    real = np.arange(polygons.shape[1]) < counts[:, None]
    points, of = polygons[real], np.repeat(owner, counts)
    return fan_all(np.arange(len(points)), counts), of, barycentric(points, corners[of])


def _joined(
    mesh: Triangles, kept: np.ndarray, parts: list[tuple[np.ndarray, np.ndarray, np.ndarray]]
) -> Triangles | None:
    """The faces that stay whole, and those of the parts, whose corners lie between a face's."""
    if not len(kept) and not any(len(faces) for faces, _, _ in parts):
        return None
    check_counts(0, len(kept) + sum(len(faces) for faces, _, _ in parts))

    def of_corners(values: np.ndarray) -> np.ndarray:
        mixed = [np.einsum("nc,ncd->nd", shares, values[mesh.faces[of]]) for _, of, shares in parts]
        return np.concatenate([values, *mixed])

    starts = len(mesh.positions) + np.cumsum([0, *(len(of) for _, of, _ in parts)])
    faces = [kept, *(part[0] + start for part, start in zip(parts, starts, strict=False))]
    return Triangles.checked(
        of_corners(mesh.positions.astype(np.float64)),
        np.concatenate(faces),
        None if mesh.normals is None else of_corners(mesh.normals.astype(np.float64)),
        of_corners(mesh.texcoords.astype(np.float64)) if mesh.texcoords is not None else None,
    )
