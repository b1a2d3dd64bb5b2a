"""Adaptive threshold on the variance of the non-zero samples: Muniraj et al. 2017, Eq. 7.

The paper gives no T; here it is derived from the Poisson law. docs/theory.md has the equation.
"""

import numpy as np

from pcii.base import on_pixels
from pcii.removal.three_step.bright_regions import large_pieces, roberts_magnitude
from pcii.sections import ViewSamples, photons_around_a_photon, truncated_poisson_variance, view_samples
from pcii.types import FocalPlanes, PhotonCounts, Sections

WINDOW_CELLS = 4
PHOTONS_PER_SAMPLE = 10.0
LARGEST_CELL_PX = 8
"""Eq. 7 pools over 4 x 4 cells of a size at which a view has about 10 photons in them where the photons
are."""
SIGMAS = 3.0
"""By how many standard deviations of the sample variance T exceeds its expectation."""
FEWEST_SAMPLES = 8
"""With fewer non-zero samples than this a point is not removed."""


def adaptive_threshold(
    counts: PhotonCounts, planes: FocalPlanes, plane: int, cell_px: int, tolerance: float
) -> dict[str, np.ndarray]:
    """Step 1: where the variance of the non-zero samples is at most T (Eq. 7), with the maps it follows from.

    Maps (H, W): `mean`, `variance` and `threshold` float32, `kept` and `answered` bool. T is the variance of
    non-zero Poisson samples of the same mean, plus `SIGMAS` times the sampling error of a variance, about var
    sqrt(2 / (n - 1)) for n samples, plus the variance due to the slope of the section, over shifts that a
    surface in focus may have: `tolerance` px either way and the rounding to whole pixels, both uniform.
    Points with fewer than `FEWEST_SAMPLES` are kept, and so are rejected regions smaller than a window of
    cells.
    """
    samples = view_samples(counts, planes, plane, cell_px=cell_px, window_cells=WINDOW_CELLS)
    limit = _threshold(samples, cell_px, tolerance)
    known = samples.number >= FEWEST_SAMPLES
    # With so many windows, single ones exceed T by chance, and with them the cells that share their samples.
    rejected = large_pieces(known & (samples.variance > limit), WINDOW_CELLS**2)
    maps = {
        "mean": samples.mean.astype(np.float32),
        "variance": samples.variance.astype(np.float32),
        "threshold": limit.astype(np.float32),
        "answered": known,
        "kept": ~rejected,
    }
    return {name: on_pixels(cells, cell_px, counts.grid.shape_HW) for name, cells in maps.items()}


def _threshold(samples: ViewSamples, cell_px: int, tolerance_px: float) -> np.ndarray:
    noise = truncated_poisson_variance(samples.mean)
    noise = noise * (1 + SIGMAS * np.sqrt(2 / np.maximum(samples.number - 1, 1)))
    # The two diagonal differences of Roberts' cross square to twice the squared slope per cell.
    slope2 = roberts_magnitude(samples.mean) ** 2 / (2 * cell_px**2)
    return noise + slope2 * (tolerance_px**2 / 3 + 1 / 12)


def tolerance_px(planes: FocalPlanes, plane: int) -> float:
    """Blur half-extent halfway to the nearest other plane: points closer to this plane may remain."""
    apart = np.abs(planes.total_disparity_px - planes.total_disparity_px[plane])
    others = apart[apart > 0]
    return float(others.min()) / 4 if others.size else 0.0


def cell_px_for(sections: Sections) -> int:
    """Cell size at which a window holds `PHOTONS_PER_SAMPLE` photons per view where the photons are."""
    per_view = photons_around_a_photon(sections) / sections.grid.view_count
    if per_view == 0:
        return LARGEST_CELL_PX
    window_px = np.sqrt(PHOTONS_PER_SAMPLE / per_view)
    return int(np.clip(np.ceil(window_px / WINDOW_CELLS), 1, LARGEST_CELL_PX))
