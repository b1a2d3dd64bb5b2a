"""Evidence of focus from the Poisson likelihood: what does the section at a depth predict?

If the surface is at depth z, all views' samples of a voxel of the section at z share one rate, so the section
predicts where photons land; at a wrong depth it is blurred and predicts worse. The rate of each photon's own
pixel and colour is estimated from all other photons, at several scales at once, and compared with what a
blurred section would say. The sum of log ratios, less the photons that are expected more, is a gain in
log-likelihood in nats. A photon takes no part in its own prediction, so where there is nothing to see the
gain is below 0 on average, and e^gain exceeds x by chance about once in x times (simulated; up to some 2
photons per pixel and view, beyond which more often).

Setting each voxel's rate to its own maximum-likelihood value instead, and comparing depths, is minimising
the entropy of where photons land: Eq. 9 of Muniraj et al. 2017 with the right statistics.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from pcii.core.bayer import sites_of_colours
from pcii.core.focal_planes import FocalPlanes
from pcii.core.photon_counts import PhotonCounts
from pcii.evidence.cells import CELL_PX
from pcii.evidence.prediction_types import PlacedEvents, PlaneView, Predicted

WINDOW_CELLS = 2.0
WIDER_CELLS = (4.0, 8.0, 16.0)
"""Gaussian windows; those beyond the first weigh as 1 / width, so that evidence nearby counts more, and where
there is none, as inside a plain object, its outline decides."""
WINDOW_WEIGHT = 2 * np.pi * WINDOW_CELLS**2 * (1 + sum(WIDER_CELLS) / WINDOW_CELLS)
"""How often `windowed` counts each cell in all: a nat of real evidence is so many there."""
EDGE_STIFFNESS = 10.0
JUMP_NATS = 0.2
"""What a change of plane costs per px of outline, however far."""
PICTURE_CELLS = 1.0
"""What a section shows is smoothed by this before its edges are looked for."""
SWEEPS = 3
DARKEST, DARK = 0.05, 0.2
DARK_SHARE, DIM_SHARE, EVEN_SHARE = 0.25, 0.5, 0.15
"""The dark around things is below a quarter of what is typical; up to half of it, if from the darkest
twentieth to the darkest fifth of the picture it grows by less than 15 % and noise."""


@dataclass(frozen=True)
class Focus:
    """What sections at the `planes` gain over blurred ones, on cells of 4 x 4 pixels.

    `gain` (Z, H / 4, W / 4) float32 in nats, `photons` (Z, C, H / 4, W / 4) float32 by colour.
    """

    planes: FocalPlanes
    gain: np.ndarray
    photons: np.ndarray


@dataclass(frozen=True)
class Predictions:
    """What sections say of every event and cell.

    `rate` (Z, N) float32: photons per sample of each event's pixel, by all other events; `cell` (Z, N) int32:
    where it lands, flat, -1 outside; `expected` (Z, H / 4, W / 4) float32: photons in each cell.
    """

    rate: np.ndarray
    cell: np.ndarray
    expected: np.ndarray


def cell_shape(counts: PhotonCounts) -> tuple[int, int]:
    """Cells of the coarse grid, (H / 4, W / 4) rounded up."""
    return -(-counts.grid.height // CELL_PX), -(-counts.grid.width // CELL_PX)


def focus_evidence(counts: PhotonCounts, planes: FocalPlanes) -> Focus:
    """Evidence that surfaces are at these planes."""
    return _look(counts, planes, keep=False)[0]


def predictions_of(counts: PhotonCounts, planes: FocalPlanes) -> tuple[Focus, Predictions]:
    """The same, and what is predicted of each event: 8 bytes for each event and plane."""
    return _look(counts, planes, keep=True)


def _look(counts: PhotonCounts, planes: FocalPlanes, *, keep: bool) -> tuple[Focus, Predictions]:
    from pcii.base.compiled_loops import threads
    from pcii.evidence import focus_kernels as kernels
    from pcii.evidence.prediction_kernels import predict
    from pcii.evidence.projection_kernels import cells_of_events

    grid, events = counts.grid, counts.events
    rows, cols = planes.whole_shifts_px
    sites = sites_of_colours(counts.cfa)
    Z, N, C, (h, w) = len(rows), events.n.size, counts.channel_count, cell_shape(counts)
    gain, photons = np.zeros((Z, h, w), np.float32), np.zeros((Z, C, h, w), np.float32)
    # What nobody asked for is not kept.
    rate, cell = (np.zeros((Z * keep, N), kind) for kind in (np.float32, np.int32))
    expected = np.zeros((Z * keep, h, w), np.float32)
    n, believed = events.n.astype(np.float32), np.ones(N, np.float32)
    place = events.k, events.l, events.i, events.j
    film, everywhere = (grid.height, grid.width), np.ones((h, w), np.float32)

    def look(z: int) -> None:
        cell_of = np.empty(N, np.int32)
        cells_of_events(*place, rows[z], cols[z], film, cell_of)
        placed = PlacedEvents(*place, counts.event_colours, n, believed, cell_of)
        section = PlaneView(rows[z], cols[z], *film, sites, everywhere, 0.0)
        predicted = Predicted(*np.empty((2, N)), *np.empty((3, h, w)))
        predict(placed, section, predicted)
        plane_gain = predicted.samples * (predicted.blurred - predicted.mean)
        kernels.gain_over_blur(placed, predicted, plane_gain, photons[z])
        gain[z] = plane_gain
        if keep:
            rate[z], cell[z], expected[z] = predicted.rate, cell_of, predicted.samples * predicted.mean

    with ThreadPoolExecutor(threads()) as pool:
        list(pool.map(look, range(Z)))
    return Focus(planes, gain, photons), Predictions(rate, cell, expected)


def photon_weighted_mean(photons: np.ndarray) -> float:
    """What a photon sees on average: photons per cell of a picture (h, w), however much of it is dark.

    A photon does not count itself, so that Poisson noise does not bias it.
    """
    total = float(photons.sum())
    return float((photons.astype(np.float64) * np.maximum(photons - 1, 0)).sum()) / total if total else 0.0


def dark_around(light: np.ndarray, typical: float, photons: float) -> tuple[float, bool]:
    """The light of the darkest fifth of a smooth picture (...), and whether that is the dark around things.

    It is if it is well below the `typical` light of what is lit; or at least below it, and the same
    everywhere: the darker parts of things are not. `photons` is how many there are in a window of the
    smoothing for each unit of light, which tells how even light can look.
    """
    darkest, dark = (float(part) for part in np.quantile(light, (DARKEST, DARK)))
    if dark <= DARK_SHARE * typical:
        return dark, True
    noise = float(np.sqrt(dark / max(photons, 1e-12)))
    return dark, dark <= DIM_SHARE * typical and dark - darkest <= EVEN_SHARE * dark + noise


def windowed(gain: np.ndarray, photons: np.ndarray) -> np.ndarray:
    """Gains (Z, h, w) summed over windows that grow wide but stop at the edges of each plane's own picture.

    `photons` (Z, C, h, w) are those of each plane by colour; an edge is what their noise cannot make.
    A window has the weight 1 at its own cell.
    """
    from scipy.ndimage import gaussian_filter

    from pcii.evidence import label_kernels as kernels

    blur = (0, WINDOW_CELLS, WINDOW_CELLS)
    near = gaussian_filter(gain, blur, mode="constant") * np.float32(2 * np.pi * WINDOW_CELLS**2)
    smooth = gaussian_filter(photons, (0, 0, PICTURE_CELLS, PICTURE_CELLS), mode="constant")
    # The square root of a count has the variance 1/4; smoothing by a Gaussian of s cells divides it by
    # 4 pi s^2, and leaves neighbours correlated.
    noise = 0.5 / np.sqrt(4 * np.pi) / PICTURE_CELLS * np.sqrt(3) / PICTURE_CELLS
    wider = np.array(WIDER_CELLS)
    result = np.empty_like(near)
    kernels.windows_within_edges(
        near, np.sqrt(smooth + np.float32(0.1)), noise, EDGE_STIFFNESS, wider, wider / WINDOW_CELLS, result
    )
    return result


def best_labels(evidence: np.ndarray, step_nats: np.ndarray, jump_nats: float) -> np.ndarray:
    """Label (h, w) int64 of each cell: most evidence (Z, h, w), least change from cell to cell.

    Belief propagation with costs that grow by `step_nats` (Z - 1,) from label to label up to `jump_nats`,
    both as nats of real evidence per px of outline. Deterministic.
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
