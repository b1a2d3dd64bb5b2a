"""Hot pixels at the same place of all cameras, which belong to the sensor and not to the scene.

A section shows such a pixel of all views at once, and at each depth as a pattern on which all cameras agree,
like a point at infinity. A point of the scene is at another pixel in each view, unless it is at the depth at
which the films do not move: infinity or, in a sheared grid, the depth whose parallax is the shear. A bright
point there and a hot pixel are the same photons, so that none is removed where such depths are compared.
"""

import warnings

import numpy as np

from pcii.types import FocalPlanes, PhotonCounts

RATIO, EXCESS = 2.0, 5.0
"""A hot pixel has more than twice the photons of its brightest neighbour plus 5, in most views. By Poisson
noise that happens in uniform light to less than one in 10^9 pixels of two views, and more rarely in more
views."""
STILL_PX = 1.0
"""A point that moves by less than this between the centre and any view may be in one pixel of half of the
views."""
NOTICED_SHARE = 0.01
"""Largest share of a film's pixels that is replaced without a warning."""


def without_hot_pixels(counts: PhotonCounts, planes: FocalPlanes) -> tuple[PhotonCounts, int]:
    """The counts with the photons of hot pixels replaced by those of a neighbour, and their number.

    A pixel is hot if it exceeds the eight nearest of its colour by `RATIO` and `EXCESS` in more than half of
    the views; the neighbour has the same colour. None is where points at one of the `planes` stand still in
    the films. Warns of more than 1 % of the pixels.
    """
    if min(np.maximum(*(np.abs(shifts).max(axis=1) for shifts in planes.exact_shifts_px))) < STILL_PX:
        return counts, 0
    grid, events = counts.grid, counts.events
    step = 1 if counts.cfa is None else 2
    H, W, V = grid.height, grid.width, grid.view_count
    mean = np.bincount(events.i.astype(np.int64) * W + events.j, events.n, H * W).reshape(H, W) / V
    padded = np.pad(mean, step)
    neighbours = [(a, b) for a in (0, step, 2 * step) for b in (0, step, 2 * step) if (a, b) != (step, step)]
    least = RATIO * np.max([padded[a : a + H, b : b + W] for a, b in neighbours], axis=0) + EXCESS
    # More than `least` in more than half of the views is more than half of it in the mean over all views:
    # a quick test that leaves few pixels to count.
    hot = mean > least / 2
    above = hot[events.i, events.j] & (events.n > least[events.i, events.j])
    views = np.bincount(events.i[above].astype(np.int64) * W + events.j[above], minlength=H * W)
    hot = views.reshape(H, W) > V / 2
    replaced = int(np.count_nonzero(hot))
    if not replaced or step >= W:
        return counts, 0
    if replaced > NOTICED_SHARE * H * W:
        warnings.warn(
            f"{replaced} of {H * W} pixels are at least twice as bright as all around them at the same place "
            "of most views; depth and removal take them for hot pixels of the sensor",
            UserWarning,
            stacklevel=2,
        )
    is_plain = ~hot[events.i, events.j]
    k, l, i, j, n = (getattr(events, name)[is_plain] for name in "klijn")
    # The neighbour to the left is copied, in the first columns that to the right.
    source_offset = np.where(np.arange(W) >= step, -step, step)
    pieces = [(k, l, i, j, n)]
    for offset in (-step, step):
        target = j - offset
        inside = (target >= 0) & (target < W)
        target = np.where(inside, target, 0)
        copied = inside & hot[i, target] & (source_offset[target] == offset)
        pieces.append((k[copied], l[copied], i[copied], target[copied], n[copied]))
    k, l, i, j, n = (np.concatenate(arrays) for arrays in zip(*pieces, strict=True))
    return PhotonCounts.from_events(k, l, i, j, n, grid, cfa=counts.cfa), replaced
