"""Surfaces with holes: what an image of opacity leaves of a mesh, as a mesh.

Holes are cut where the opacity is a half, along a line in each square between the middles of four pixels
(marching squares, Lorensen and Cline 1987). What is left is an ordinary mesh.
"""

from collections.abc import Iterator

import numpy as np

from simgen.assets.triangles import Triangles, barycentric, cross_2d, fan_all

FULL = 0.5
"""From this opacity on there is a surface."""
OVERLAP = 1 / 1024
"""Neighbouring pieces overlap by this share of a pixel, or of a triangle's height if that is less, since
rounded corners would leave gaps between them."""
MOST_CELLS = 1 << 25
PAIRS_AT_ONCE = 1 << 18
_OPPOSITE = {5: (1, 4), 10: (2, 8)}
"""Sums of two opposite full corners, which are apart unless the middle between them is full."""

Polygons = tuple[np.ndarray, np.ndarray]
"""Corners (N, V, 2), x right and y up in pixels, and how many of them (N,) each polygon has."""


def cut_out(mesh: Triangles, opacity: np.ndarray, *, tiled: bool) -> Triangles | None:
    """The part of a mesh with texture coordinates on which `opacity` (H, W), row 0 on top, is full, if any.

    Beyond its borders the image is repeated if `tiled`, else its outermost pixels go on. Raises `ValueError`
    with the end of a sentence for more pixels or triangles than may be.
    """
    assert mesh.texcoords is not None
    height, width = opacity.shape
    corners = (mesh.texcoords.astype(np.float64) * [width, height] - 0.5)[mesh.faces]
    first = np.floor(corners.min(axis=(0, 1))).astype(np.int64) - 1
    last = np.floor(corners.max(axis=(0, 1))).astype(np.int64) + 2
    if np.prod((last - first).astype(float)) > MOST_CELLS:
        raise ValueError(f"more than {MOST_CELLS} pixels of it lie on the mesh; use a smaller image")
    corners -= first
    col, row = (np.arange(low, high + 1) for low, high in zip(first, last, strict=True))
    if tiled:
        col, row = col % width, row % height
    values = opacity[::-1][np.ix_(np.clip(row, 0, height - 1), np.clip(col, 0, width - 1))]
    full = (values >= FULL).astype(np.int8)
    sums = full[:-1, :-1] + 2 * full[:-1, 1:] + 4 * full[1:, 1:] + 8 * full[1:, :-1]
    is_whole, is_empty = _all_in(sums == 15, corners), _all_in(sums == 0, corners)
    # A triangle that is a line on the picture is there if its first corner is.
    is_line = np.abs(cross_2d(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])) < OVERLAP**2
    col, row = np.round(corners[:, 0]).astype(np.int64).T
    is_whole = np.where(is_line, full[row, col] > 0, is_whole)
    parts = [*_clipped(_pieces(values, sums), corners, ~is_empty & ~is_whole & ~is_line)]
    if not is_whole.any() and not any(len(faces) for faces, _, _ in parts):
        return None

    def at_corners(values: np.ndarray) -> np.ndarray:
        values = values.astype(np.float64)
        mixed = [np.einsum("nc,ncd->nd", shares, values[mesh.faces[face]]) for _, face, shares in parts]
        return np.concatenate([values, *mixed])

    starts = len(mesh.positions) + np.cumsum([0, *(len(face) for _, face, _ in parts)])
    faces = [mesh.faces[is_whole], *(part[0] + start for part, start in zip(parts, starts, strict=False))]
    normals = None if mesh.normals is None else at_corners(mesh.normals)
    positions, texcoords = at_corners(mesh.positions), at_corners(mesh.texcoords)
    return Triangles.checked(positions, np.concatenate(faces), normals, texcoords)


def _all_in(flag: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Whether all cells (H, W) in the bounding box of each triangle (M, 3, 2) have the flag; (M,) bool."""
    running = np.pad(np.cumsum(np.cumsum(flag, axis=0), axis=1), ((1, 0), (1, 0)))
    low, high = (np.floor(end).astype(np.int64) for end in (corners.min(axis=1), corners.max(axis=1)))
    (x0, y0), (x1, y1) = low.T, high.T + 1
    number = running[y1, x1] - running[y0, x1] - running[y1, x0] + running[y0, x0]
    return number == (x1 - x0) * (y1 - y0)


def _pieces(values: np.ndarray, sums: np.ndarray) -> Polygons:
    """The full part of the image as convex polygons of at most 6 corners."""
    shapes = [_rectangles(sums == 15)]
    joined = values[:-1, :-1] + values[:-1, 1:] + values[1:, 1:] + values[1:, :-1] >= 4 * FULL
    for number in range(1, 15):
        for parts, is_joined in ((_OPPOSITE.get(number, (number,)), False), ((number,), True)):
            ring = _ring(values, *np.nonzero((sums == number) & (joined == is_joined)))
            shapes += [ring[:, _outline(part)] for part in parts]
    padded = [np.pad(shape, ((0, 0), (0, 6 - shape.shape[1]), (0, 0))) for shape in shapes]
    counts = [shape.shape[1] for shape in shapes]
    return np.concatenate(padded), np.repeat(counts, [len(shape) for shape in shapes])


def _outline(number: int) -> np.ndarray:
    """Points of a cell's ring that bound its full part; `number` sums 1, 2, 4, 8 for its full corners.

    These are its full corners, and the points on sides between a full corner and one that is not.
    """
    full = np.array([number >> corner & 1 for corner in range(4)])
    return np.flatnonzero(np.stack([full, full != np.roll(full, -1)], axis=1))


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
    """The 8 points around cells, (N, 8, 2), counterclockwise with v up: each corner, and after it the end of
    the line on the next side; a side that the line does not cross has some point."""
    corner = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
    at = values[row[:, None] + corner[:, 1], col[:, None] + corner[:, 0]].astype(np.float64)
    onward = np.roll(at, -1, axis=1) - at
    share = (FULL - at) / np.where(onward == 0, 1, onward)
    points = np.empty((len(row), 8, 2))
    points[:, ::2] = corner
    points[:, 1::2] = corner + share[..., None] * (np.roll(corner, -1, axis=0) - corner)
    return points + np.stack([col, row], axis=-1)[:, None]


def _clipped(
    pieces: Polygons, corners: np.ndarray, is_cut: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Pieces within those triangles of `corners` (M, 3, 2) that are cut: triangles (T, 3) of new corners, the
    face (C,) that each corner lies on, and shares (C, 3) of it."""
    shapes, counts = pieces
    real = np.arange(shapes.shape[1]) < counts[:, None]
    low = np.where(real[..., None], shapes, np.inf).min(axis=1)
    high = np.where(real[..., None], shapes, -np.inf).max(axis=1)
    triangles = np.flatnonzero(is_cut)
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
        remains = number >= 3
        polygons, number = polygons[remains], number[remains]
        points = polygons[np.arange(polygons.shape[1]) < number[:, None]]
        face = np.repeat(some[owner[remains]], number)
        yield fan_all(np.arange(len(points)), number), face, barycentric(points, corners[face])


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
    is_corner = np.stack([real & (here >= 0), crosses], axis=2).reshape(len(polygons), 2 * size)
    first = np.argsort(~is_corner, axis=1, kind="stable")[:, : size + 1]
    return np.take_along_axis(points, first[..., None], axis=1), is_corner.sum(axis=1)
