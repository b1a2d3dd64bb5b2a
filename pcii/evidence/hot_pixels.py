"""Pixels that are hot in the same place of all cameras: what is fixed to the sensor tells no depth.

Sections gather such a pixel from all views, as they would a point beyond the horizon: at each depth it makes
a pattern that all cameras agree on. A thing in the scene is seen by each camera in another pixel.
"""

import numpy as np

from pcii.core.photon_counts import PhotonCounts

RATIO, FEW = 2.0, 5.0
"""Hot is what has more than twice the photons of its brightest neighbour, and 5, in most views. Poisson noise
makes that of an even film in less than one of 10^9 pixels of two views, and of more views more seldom."""


def without_hot_pixels(counts: PhotonCounts) -> PhotonCounts:
    """The counts with the photons of a neighbour, of the same colour, in place of those of hot pixels.

    Hot is a pixel that stands out from the eight nearest of its colour in more than half of the views.
    """
    grid, events = counts.grid, counts.events
    step = 1 if counts.cfa is None else 2
    H, W, V = grid.height, grid.width, grid.view_count
    light = np.bincount(events.i.astype(np.int64) * W + events.j, events.n, H * W).reshape(H, W) / V
    padded = np.pad(light, step)
    around = [(a, b) for a in (0, step, 2 * step) for b in (0, step, 2 * step) if (a, b) != (step, step)]
    least = RATIO * np.max([padded[a : a + H, b : b + W] for a, b in around], axis=0) + FEW
    # In more than half of the views it has more than that, so on average more than half of it.
    hot = light > least / 2
    above = hot[events.i, events.j] & (events.n > least[events.i, events.j])
    views = np.bincount(events.i[above].astype(np.int64) * W + events.j[above], minlength=H * W)
    hot = views.reshape(H, W) > V / 2
    if not hot.any() or step >= W:
        return counts
    kept = ~hot[events.i, events.j]
    k, l, i, j, n = (getattr(events, name)[kept] for name in "klijn")
    # From the left, in the first columns from the right.
    beside = np.where(np.arange(W) >= step, -step, step)
    parts = [(k, l, i, j, n)]
    for move in (-step, step):
        at = j - move
        inside = (at >= 0) & (at < W)
        at = np.where(inside, at, 0)
        copied = inside & hot[i, at] & (beside[at] == move)
        parts.append((k[copied], l[copied], i[copied], at[copied], n[copied]))
    k, l, i, j, n = (np.concatenate(part) for part in zip(*parts, strict=True))
    return PhotonCounts.from_events(k, l, i, j, n, grid, cfa=counts.cfa)
