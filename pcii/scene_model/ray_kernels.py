"""Compiled: which surface a ray of a camera meets first, and how many pixels of all cameras see a cell.

Axes: (h, w) cells of the virtual centre, N rays. A surface is a label for each cell, which counts depths from
far to near, or -1. `front` is what the virtual centre sees, `hidden` what goes on behind it. A ray moves by
up to half a cell from label to label. Owners of rays are numbers of cells: of `front`, of `hidden` after
those, and one more for the background.
"""

import math

import numpy as np

from pcii.base.compiled_loops import compiled, helper, shared

JUMP = 2
"""Neighbouring cells are of one surface if their labels differ by no more."""
FRONT, HIDDEN = 1, 2


@helper
def met(label: int, front: int, hidden: int, front_before: int, hidden_before: int) -> int:
    """Which surface of its column a ray meets at a label: FRONT, HIDDEN or 0.

    It also meets a surface that rises from the column before it to this one, and so passes the ray in
    between.
    """
    if front == label:
        return FRONT
    if hidden == label:
        return HIDDEN
    if label < front <= label + JUMP and (
        front - JUMP <= front_before <= label or front - JUMP <= hidden_before <= label
    ):
        return FRONT
    if label < hidden <= label + JUMP and (
        hidden - JUMP <= front_before <= label or hidden - JUMP <= hidden_before <= label
    ):
        return HIDDEN
    return 0


@shared(lambda start_row, *_: len(start_row))
def owners(
    first: int,
    last: int,
    start_row: np.ndarray,
    start_col: np.ndarray,
    step_row: np.ndarray,
    step_col: np.ndarray,
    front: np.ndarray,
    hidden: np.ndarray,
    beside: np.ndarray,
    at_edge: np.ndarray,
    owner: np.ndarray,
    other: np.ndarray,
) -> None:
    """Writes the `owner` (N,) of rays and, within half a cell of an outline, that of its `other` side, or -1.

    Rays start at (start_row, start_col) in half cells at label 0 and move by (step_row, step_col) to the
    next; `beside` and `at_edge` (2h, 2w) are those of `outlines`.
    """
    h, w = front.shape
    background = 2 * h * w
    nearest = front.max()
    for ray in range(first, last):
        found, across, past_edge = background, -1, False
        front_before = hidden_before = -9
        for label in range(nearest, -1, -1):
            y = math.floor(start_row[ray] + label * step_row[ray])
            x = math.floor(start_col[ray] + label * step_col[ray])
            if y < 0 or x < 0 or y >= 2 * h or x >= 2 * w:
                continue
            i, j = y >> 1, x >> 1
            here, behind_it = int(front[i, j]), int(hidden[i, j])
            which = met(label, here, behind_it, front_before, hidden_before)
            if which:
                cell = i * w + j + (h * w if which == HIDDEN else 0)
                if past_edge:
                    across = cell
                    break
                found = cell
                if across >= 0 or which == HIDDEN or not at_edge[y, x]:
                    break
                past_edge = True
            elif across < 0 and not past_edge and beside[y, x] == label:
                above, left = i + (1 if y & 1 else -1), j + (1 if x & 1 else -1)
                if 0 <= above < h and front[above, j] == label:
                    across = above * w + j
                elif 0 <= left < w and front[i, left] == label:
                    across = i * w + left
            front_before, hidden_before = here, behind_it
        owner[ray] = found
        other[ray] = background if past_edge and across < 0 else across


@shared(lambda own, *_: len(own))
def exposures(
    first: int,
    last: int,
    own: np.ndarray,
    front: np.ndarray,
    hidden: np.ndarray,
    nearest: np.ndarray,
    offsets: np.ndarray,
    shift_row: np.ndarray,
    shift_col: np.ndarray,
    step_row: np.ndarray,
    step_col: np.ndarray,
    rows: np.ndarray,
    cols: np.ndarray,
    cell_px: int,
    exposure: np.ndarray,
) -> None:
    """Writes how many pixels of all cameras see each cell of `own` (h, w), which is `front` or `hidden`.

    A camera sees a cell or not by one ray, `offsets` (K L, 2) into the cell. `shift_row` (K,) and `shift_col`
    (L,) are its shifts at label 0 in cells, `step_row` and `step_col` how much they grow with a label, `rows`
    (K, 2) and `cols` (L, 2) the part of its film that counts. Nothing is nearer to a cell than `nearest` (h,
    w).
    """
    h, w = own.shape
    L = step_col.size
    for i in range(first, last):
        for j in range(w):
            label = own[i, j]
            if label < 0:
                continue
            cameras = 0
            for camera in range(offsets.shape[0]):
                k, l = camera // L, camera % L
                y, x = i + offsets[camera, 0], j + offsets[camera, 1]
                row = y - shift_row[k] - label * step_row[k]
                col = x - shift_col[l] - label * step_col[l]
                if row < rows[k, 0] or row >= rows[k, 1] or col < cols[l, 0] or col >= cols[l, 1]:
                    continue
                seen = True
                front_before = hidden_before = -9
                for nearer in range(nearest[i, j], label + JUMP, -1):
                    a = math.floor(y + (nearer - label) * step_row[k])
                    b = math.floor(x + (nearer - label) * step_col[l])
                    if a < 0 or b < 0 or a >= h or b >= w:
                        continue
                    here, behind_it = int(front[a, b]), int(hidden[a, b])
                    if met(nearer, here, behind_it, front_before, hidden_before):
                        seen = False
                        break
                    front_before, hidden_before = here, behind_it
                cameras += seen
            exposure[i, j] = cameras * cell_px * cell_px


@compiled
def outlines(front: np.ndarray, beside: np.ndarray, at_edge: np.ndarray) -> None:
    """Writes which nearer label half cells (2h, 2w) touch, or -1, and whether they touch a farther one."""
    h, w = front.shape
    for y in range(2 * h):
        for x in range(2 * w):
            i, j = y >> 1, x >> 1
            beside[y, x], at_edge[y, x] = -1, False
            for place in range(2):
                a = i + (1 if y & 1 else -1) if place == 0 else i
                b = j + (1 if x & 1 else -1) if place == 1 else j
                if 0 <= a < h and 0 <= b < w:
                    if front[a, b] > front[i, j] + JUMP:
                        beside[y, x] = max(beside[y, x], front[a, b])
                    at_edge[y, x] |= front[a, b] < front[i, j] - JUMP


@compiled
def behind(front: np.ndarray, cells_per_label: float) -> np.ndarray:
    """Labels (h, w) int16 of what goes on behind nearer surfaces, -2 where no camera sees it.

    It has the label of the surface next to the outline, as far as cameras see past that: `cells_per_label` is
    by how much a ray moves from label to label, at most.
    """
    h, w = front.shape
    hidden = np.full((h, w), -2, np.int16)
    distance = np.zeros((h, w), np.int32)
    queue = np.empty((h * w, 2), np.int32)
    head = tail = 0
    for i in range(h):
        for j in range(w):
            best = -2
            for place in range(4):
                a, b = i + (place == 0) - (place == 1), j + (place == 2) - (place == 3)
                if 0 <= a < h and 0 <= b < w and front[a, b] < front[i, j] - JUMP:
                    best = max(best, front[a, b])
            if front[i, j] >= 0 and best > -2:
                hidden[i, j] = best
                queue[tail] = (i, j)
                tail += 1
    while head < tail:
        i, j = queue[head]
        head += 1
        for place in range(9):
            a, b = i + place // 3 - 1, j + place % 3 - 1
            if not (0 <= a < h and 0 <= b < w) or hidden[a, b] > -2 or front[a, b] - JUMP <= hidden[i, j]:
                continue
            if distance[i, j] < (front[a, b] - hidden[i, j]) * cells_per_label + 1:
                hidden[a, b], distance[a, b] = hidden[i, j], distance[i, j] + 1
                queue[tail] = (a, b)
                tail += 1
    return hidden
