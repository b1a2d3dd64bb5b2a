"""Evidence of focus from the Poisson likelihood: how well does the section at a depth predict the photons?

If the surface is at depth z, the samples of all views in a voxel of the section at z have the same rate, so
the section predicts in which pixels photons are detected; at a wrong depth it is blurred and predicts worse.
For each photon the rate of its pixel and colour is estimated from all other photons, at several scales, and
compared with the rate by the widest scale alone, the blurred section. The gain in log-likelihood is

    gain = sum over photons of log(rate / blurred rate) - (expected photons - expected by the blurred rate)

in nats. A photon takes no part in its own prediction, so without structure the gain is below 0 on average,
and exp(gain) exceeds x by chance about once in x times (simulated; up to about 2 photons per pixel and view,
beyond which more often).

With the maximum-likelihood rate of each voxel instead, the depth of largest likelihood is that of the least
entropy of the photons' places: Eq. 9 of Muniraj et al. 2017 with Poisson statistics.
"""

from dataclasses import dataclass

import numpy as np

from pcii.evidence.cells import CELL_PX
from pcii.evidence.prediction_types import PlacedEvents, PlaneView, Predicted
from pcii.types.bayer import sites_of_colours
from pcii.types.focal_planes import FocalPlanes
from pcii.types.photon_counts import PhotonCounts

WINDOW_CELLS = 2.0
WIDER_CELLS = (4.0, 8.0, 16.0)
"""Standard deviations of the Gaussian windows. The wider ones are weighted by 1 / width, so that nearby
evidence counts more; where there is none, as inside an object without texture, that of its outline
decides."""
WINDOW_WEIGHT = 2 * np.pi * WINDOW_CELLS**2 * (1 + sum(WIDER_CELLS) / WINDOW_CELLS)
"""Sum of the weights of all windows around a cell: by this factor `windowed` multiplies evidence."""
EDGE_STIFFNESS = 10.0
"""How much an edge of twice the noise adds to the distance between neighbouring cells."""
JUMP_NATS = 0.2
"""Largest cost of a change of plane, per px of outline."""
PICTURE_CELLS = 1.0
"""Standard deviation of the Gaussian by which a section is smoothed before its edges are located."""
SWEEPS = 3
"""Rounds of belief propagation, each in four directions."""
DARKEST, DARK = 0.05, 0.2
DARK_SHARE, DIM_SHARE, EVEN_SHARE = 0.25, 0.5, 0.15
"""The dark around objects is below a quarter of the typical rate; or below half of it, if between the darkest
twentieth and the darkest fifth of the section the rate rises by less than 15 % and noise."""


@dataclass(frozen=True)
class FocusEvidence:
    """Gain in log-likelihood of sections at the `planes` over blurred ones, on cells of 4 x 4 pixels.

    `gain` (Z, H / 4, W / 4) float32 in nats, `photons` (Z, C, H / 4, W / 4) float32 by colour.
    """

    planes: FocalPlanes
    gain: np.ndarray
    photons: np.ndarray


def cell_shape(counts: PhotonCounts) -> tuple[int, int]:
    """Shape of the coarse grid, (H / 4, W / 4) rounded up."""
    return -(-counts.grid.height // CELL_PX), -(-counts.grid.width // CELL_PX)


def focus_evidence(counts: PhotonCounts, planes: FocalPlanes) -> FocusEvidence:
    """Evidence that surfaces are at these planes."""
    from pcii.base.compiled_loops import each_in_threads
    from pcii.evidence import focus_kernels as kernels
    from pcii.evidence.prediction_kernels import predict
    from pcii.evidence.projection_kernels import cells_of_events

    grid, events = counts.grid, counts.events
    rows, cols = planes.whole_shifts_px
    sites = sites_of_colours(counts.cfa)
    Z, N, C, (h, w) = len(rows), events.n.size, counts.channel_count, cell_shape(counts)
    gain, photons = np.zeros((Z, h, w), np.float32), np.zeros((Z, C, h, w), np.float32)
    n, full_weight = events.n.astype(np.float32), np.ones(N, np.float32)
    place = events.k, events.l, events.i, events.j
    shape_HW, all_views = grid.shape_HW, np.ones((h, w), np.float32)

    def evaluate(z: int) -> None:
        cell_of = np.empty(N, np.int32)
        cells_of_events(*place, rows[z], cols[z], shape_HW, CELL_PX, cell_of)
        placed = PlacedEvents(*place, counts.event_colours, n, full_weight, cell_of)
        section = PlaneView(rows[z], cols[z], *shape_HW, sites, all_views, 0.0)
        predicted = Predicted(*np.empty((2, N)), *np.empty((3, h, w)))
        predict(placed, section, predicted)
        plane_gain = predicted.samples * (predicted.blurred - predicted.mean)
        kernels.gain_over_blur(placed, predicted, plane_gain, photons[z])
        gain[z] = plane_gain

    each_in_threads(evaluate, range(Z))
    return FocusEvidence(planes, gain, photons)


def photon_weighted_mean(photons: np.ndarray) -> float:
    """Mean over the photons of how many others are in the same cell, of photons per cell (h, w).

    So the typical brightness of the bright parts, however large the dark ones are. A photon does not count
    itself, so that Poisson noise does not bias the mean. 0 without photons.

    >>> photon_weighted_mean(np.array([[0, 0, 0], [3, 3, 0]]))
    2.0
    """
    total = float(photons.sum())
    return float((photons.astype(np.float64) * np.maximum(photons - 1, 0)).sum()) / total if total else 0.0


def dark_around(rate: np.ndarray, typical: float, photons: float) -> tuple[float, bool]:
    """The darkest fifth of smoothed rates (...), and whether it is the dark around objects.

    It is if it is well below the `typical` rate of bright parts; or below it and uniform, which the darker
    parts of objects are not. `photons` is how many a window of the smoothing holds for each unit of rate,
    from which the noise of the rates follows.
    """
    darkest, dark = (float(quantile) for quantile in np.quantile(rate, (DARKEST, DARK)))
    if dark <= DARK_SHARE * typical:
        return dark, True
    noise = float(np.sqrt(dark / max(photons, 1e-12)))
    return dark, dark <= DIM_SHARE * typical and dark - darkest <= EVEN_SHARE * dark + noise


def windowed(gain: np.ndarray, photons: np.ndarray) -> np.ndarray:
    """Gains (Z, h, w) summed over windows of several widths, the wider of which stop at edges.

    `photons` (Z, C, h, w) are those of each plane by colour; an edge is a step in them beyond their noise.
    Windows have the weight 1 at their centre.
    """
    from scipy.ndimage import gaussian_filter

    from pcii.evidence import label_kernels as kernels

    blur = (0, WINDOW_CELLS, WINDOW_CELLS)
    narrow = gaussian_filter(gain, blur, mode="constant") * np.float32(2 * np.pi * WINDOW_CELLS**2)
    smooth = gaussian_filter(photons, (0, 0, PICTURE_CELLS, PICTURE_CELLS), mode="constant")
    # The square root of a count has the variance 1/4; smoothing by a Gaussian of s cells divides it by
    # 4 pi s^2, and leaves neighbours correlated.
    noise = 0.5 / np.sqrt(4 * np.pi) / PICTURE_CELLS * np.sqrt(3) / PICTURE_CELLS
    wider = np.array(WIDER_CELLS)
    result = np.empty_like(narrow)
    kernels.windows_within_edges(
        narrow, np.sqrt(smooth + np.float32(0.1)), noise, EDGE_STIFFNESS, wider, wider / WINDOW_CELLS, result
    )
    return result


def best_labels(evidence: np.ndarray, step_nats: np.ndarray, jump_nats: float) -> np.ndarray:
    """Label (h, w) int64 of each cell, from 0, of large evidence (Z, h, w) and few changes between cells.

    Min-sum belief propagation: neighbours of different labels cost the sum of `step_nats` (Z - 1,) between
    them and at most `jump_nats`, both in nats per px of outline before `windowed`. Deterministic.
    """
    from pcii.evidence import label_kernels as kernels

    cost = np.ascontiguousarray(np.moveaxis(-evidence, 0, -1), dtype=np.float32)
    if cost.shape[-1] == 1:
        return np.zeros(cost.shape[:2], np.int64)
    messages = np.zeros((4, *cost.shape), np.float32)
    steps = (np.asarray(step_nats) * WINDOW_WEIGHT).astype(np.float32)
    for _ in range(SWEEPS):
        for direction in range(4):
            kernels.pass_messages(cost, messages, direction, steps, jump_nats * WINDOW_WEIGHT)
    return np.argmin(cost + messages.sum(axis=0), axis=-1)
