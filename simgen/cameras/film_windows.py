"""Rectangles of a film that objects can be seen in."""

from collections.abc import Iterable

import numpy as np

from simgen.cameras.rig import Camera

LEAST_STEP_PX = 8
"""Sides of windows are multiples of this at least: smaller steps would save no time that can be measured."""

Window = tuple[slice, slice]
"""Rows and columns of a film."""


def object_windows(camera: Camera, corners_mm: np.ndarray) -> list[Window]:
    """Windows that do not overlap, outside of which the camera sees none of the objects in boxes.

    `corners_mm` (N, 8, 3) are the corners of each object's bounding box. A window covers the projection of
    one box, or of several whose windows overlap. The whole film is the only window if a box reaches behind
    the camera, or if the camera has a lens, which blurs.
    """
    size = np.array([camera.grid.height, camera.grid.width])
    z_mm = ((corners_mm - camera.position_mm) @ camera.rotation)[..., 2]
    if len(corners_mm) and (camera.lens is not None or z_mm.min() <= 0):
        return [(slice(0, camera.grid.height), slice(0, camera.grid.width))]
    windows: list[Window] = []
    for corners in corners_mm:
        edges_px = np.clip(camera.film_px(corners)[:, ::-1] + size / 2, -size, 2 * size)
        first, stop = np.floor(edges_px.min(axis=0)), np.ceil(edges_px.max(axis=0))
        if (stop <= 0).any() or (first >= size).any():
            continue
        window = _of_few_sizes(first, stop, size)
        while met := [other for other in windows if _overlap(window, other)]:
            windows = [other for other in windows if other not in met]
            edges = np.array([[(side.start, side.stop) for side in each] for each in (window, *met)])
            window = _of_few_sizes(edges[..., 0].min(axis=0), edges[..., 1].max(axis=0), size)
        windows.append(window)
    return windows


def covered_px(windows: Iterable[Window]) -> int:
    """How many pixels windows cover that do not overlap."""
    return sum((rows.stop - rows.start) * (cols.stop - cols.start) for rows, cols in windows)


def _of_few_sizes(first: np.ndarray, stop: np.ndarray, size: np.ndarray) -> Window:
    """A window on a film of this `size` around pixels from `first` to before `stop`; each (2,).

    Its sides take few different lengths, four to an octave, since the renderer compiles its loops for each
    size of picture.
    """
    sides = []
    for one, end, most in zip(first.astype(int), stop.astype(int), size, strict=True):
        step = max(1 << int(end - one).bit_length() >> 3, LEAST_STEP_PX)
        length = min(-(-(end - one) // step) * step, most)
        start = int(np.clip(one, 0, most - length))
        sides.append(slice(start, start + int(length)))
    return sides[0], sides[1]


def _overlap(one: Window, other: Window) -> bool:
    return all(a.start < b.stop and b.start < a.stop for a, b in zip(one, other, strict=True))
