"""Removal of defocused points in the paper's three steps (Muniraj et al. 2017, section 3).

1. Adaptive threshold on the variance of the non-zero samples (Eq. 7): in focus, the views' samples of
   a voxel differ by Poisson noise alone.
2. Boundary detection by Roberts' cross (Eq. 8): the outline of what is bright runs along it, and cuts
   the section into regions.
3. Entropy criterion (Eq. 9): a region is in focus at the plane where its entropy is lowest.

Where the paper is silent we chose: samples are pooled (Eq. 7 has no window), T is what Poisson noise
would give at the same mean plus `SIGMAS` of its sampling error (Eq. 7 has no T), and probe planes
stand between the requested ones, so that what is sharp at none of them is removed from all.
"""

import numpy as np

from pcii.foreground import SMALLEST_REGION_PX, connected_pieces, outlined
from pcii.geometry import blur_half_extent_px
from pcii.photon_counts import PhotonCounts
from pcii.planes import with_probes
from pcii.reconstruct import reconstruct
from pcii.statistics import (
    ViewSamples,
    cells_to_pixels,
    pooled_estimate,
    region_entropy_bits,
    section_window_px,
    truncated_poisson_variance,
    view_samples,
)
from pcii.types import Sections, Segmented

WINDOW_CELLS = 4
PHOTONS_PER_SAMPLE = 5.0
LARGEST_CELL_PX = 8
"""Eq. 7 pools over 4 x 4 cells, wide enough for about 5 photons per view where it is bright."""
SAME_SURFACE = 0.15
"""Views of one surface in focus may differ by this share: it is neither flat nor quite at z."""
SIGMAS = 3.0
FEWEST_SAMPLES = 8
LARGEST_MARGIN_PX = 16


def three_step(counts: PhotonCounts, z_mm: np.ndarray) -> Segmented:
    """In-focus masks (Z, H, W) at the depths `z_mm` (Z,) by the three steps.

    `steps` of the result holds `kept` (step 1), `edges` (the Roberts magnitude of step 2),
    `bright` (its outline filled) and `answered` (where step 1 had enough samples).
    """
    compared = with_probes(counts.grid, z_mm)
    everything = reconstruct(counts, compared)
    window_px = section_window_px(everything)
    pooled = pooled_estimate(everything, window_px)
    samples_per_window = window_px**2 * float(everything.coverage.mean()) * pooled.shape[-1]

    count = z_mm.size
    # Only the requested planes have regions of their own; the probes are there to be compared with.
    outlines = [outlined(plane, samples_per_window, SMALLEST_REGION_PX) for plane in pooled[:count]]
    edges, masks = (list(part) for part in zip(*outlines, strict=True))
    winner = _sharpest_plane(counts, compared, pooled, masks)
    cell_px = _cell_px(pooled[:count], masks)
    kept, answered = zip(*(adaptive_threshold(counts, z, cell_px) for z in z_mm), strict=True)
    in_focus = np.stack([masks[p] & (winner == p) & kept[p] for p in range(count)])
    requested = Sections(counts.grid, z_mm, everything.counts[:count], everything.coverage[:count])
    steps = {
        "kept": np.stack(kept),
        "answered": np.stack(answered),
        "edges": np.stack(edges),
        "bright": np.stack(masks),
    }
    return Segmented(z_mm, in_focus, "three-step", requested, steps)


def adaptive_threshold(counts: PhotonCounts, z_mm: float, cell_px: int) -> tuple[np.ndarray, np.ndarray]:
    """Step 1: where the variance of the non-zero samples is at most T, and where that is known.

    Two masks (H, W). T is the variance of non-zero Poisson samples of the same mean, plus `SIGMAS`
    times the sampling error of a variance, about var sqrt(2 / (n - 1)) for n samples, plus the
    square of `SAME_SURFACE` times the mean. Where there are fewer than `FEWEST_SAMPLES` the step
    does not object.
    """
    samples = view_samples(counts, z_mm, cell_px=cell_px, window_cells=WINDOW_CELLS)
    known = samples.number >= FEWEST_SAMPLES
    kept = ~known | (samples.variance <= _threshold(samples))
    return cells_to_pixels(kept, cell_px, counts.grid), cells_to_pixels(known, cell_px, counts.grid)


def _threshold(samples: ViewSamples) -> np.ndarray:
    noise = truncated_poisson_variance(samples.mean)
    noise = noise * (1 + SIGMAS * np.sqrt(2 / np.maximum(samples.number - 1, 1)))
    return noise + (SAME_SURFACE * samples.mean) ** 2


def _cell_px(pooled: np.ndarray, masks: list[np.ndarray]) -> int:
    """Cell size at which a window of what is bright holds `PHOTONS_PER_SAMPLE` photons per view."""
    bright = np.stack(masks)
    if not bright.any():
        return LARGEST_CELL_PX
    # A Bayer window holds each colour in proportion to its sites; green's double share hardly matters.
    per_pixel = float(pooled.mean(axis=-1)[bright].mean())
    window_px = np.sqrt(PHOTONS_PER_SAMPLE / max(per_pixel, 1e-12))
    return int(np.clip(np.ceil(window_px / WINDOW_CELLS), 1, LARGEST_CELL_PX))


def _sharpest_plane(
    counts: PhotonCounts, compared: np.ndarray, pooled: np.ndarray, masks: list[np.ndarray]
) -> np.ndarray:
    """Step 3: for every pixel the plane (index) at which its region's entropy is lowest; -1 outside.

    A region is a connected piece of what is bright at any requested plane. Its entropy is taken over the
    region grown by the blur that it could have, so that all planes show the same object and light.
    """
    from scipy.ndimage import binary_dilation, find_objects

    winner = np.full(masks[0].shape, -1, dtype=np.int64)
    regions = connected_pieces(np.logical_or.reduce(masks))
    margin = int(np.ceil(max(blur_half_extent_px(counts.grid, compared, compared[0]))))
    margin = min(margin, LARGEST_MARGIN_PX)
    for number, box in enumerate(find_objects(regions), start=1):
        rows, cols = (slice(max(s.start - margin, 0), s.stop + margin) for s in box)
        here = regions[rows, cols] == number
        grown = binary_dilation(here, iterations=margin) if margin else here
        grown &= here | (regions[rows, cols] == 0)
        part = pooled[:, rows, cols]
        tops = part[:, grown].max(axis=(0, 1))
        entropies = [region_entropy_bits(plane, grown, tops) for plane in part]
        winner[rows, cols][here] = int(np.argmin(entropies))
    return winner
