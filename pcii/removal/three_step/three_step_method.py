"""Removal of defocused points by the three steps of Muniraj et al. 2017, section 3.

1. Adaptive threshold on the variance of the non-zero samples (Eq. 7): in focus, the views' samples of
   a voxel differ by Poisson noise alone.
2. Boundary detection by Roberts' cross (Eq. 8): the outlines of bright regions lie on its ridges, and ridges
   inside divide them into smaller regions.
3. Entropy criterion (Eq. 9): a region is in focus at the plane where its entropy is lowest.

docs/removal.md describes the choices that the paper leaves open, docs/experiments/three_step.md has the
measurements behind them.
"""

from dataclasses import dataclass, fields

import numpy as np

from pcii.base.errors import InputError
from pcii.core.estimates import Segmented
from pcii.core.focal_planes import FocalPlanes
from pcii.core.photon_counts import PhotonCounts
from pcii.core.section_stack import Sections
from pcii.imaging.bright_regions import (
    EDGE_SMOOTHING_PX,
    SMALLEST_REGION_PX,
    brightness,
    large_pieces,
    outlined,
    roberts_magnitude,
)
from pcii.imaging.watershed_pieces import pieces_along_ridges
from pcii.removal.three_step.edge_entropy import edge_entropies, planes_of_least_entropy
from pcii.sections.photon_statistics import (
    ViewSamples,
    cells_to_pixels,
    photons_around_a_photon,
    pooled_estimate,
    section_window_px,
    truncated_poisson_variance,
    view_samples,
)
from pcii.sections.probe_planes import PROBE_STEPS_PX, with_probes
from pcii.sections.reconstruction import extend, reconstruct

WINDOW_CELLS = 4
PHOTONS_PER_SAMPLE = 10.0
LARGEST_CELL_PX = 8
"""Eq. 7 pools over 4 x 4 cells of a size at which a view has about 10 photons in them where the photons
are."""
SIGMAS = 3.0
"""By how many standard deviations of the sample variance T exceeds its expectation."""
FEWEST_SAMPLES = 8
"""With fewer non-zero samples than this a point is not removed."""
PROBE_STEP_PX = min(abs(step) for step in PROBE_STEPS_PX)
LARGEST_BLUR_PX = max(abs(step) for step in PROBE_STEPS_PX) / 2
"""Half-extent, at the farthest probe plane, of the blur of a point in focus at a requested plane."""


@dataclass(frozen=True)
class ThreeStep:
    """The paper's removal as a `method` of `pcii.segment`; each step can be left out.

    Without `threshold` no point is removed for its variance. Without `boundary` every point with a photon in
    its window may remain, and the sub-images of the entropy are square tiles. Without `entropy` no region is
    removed for being sharper at another plane. Without all three, every point with a photon in its window
    remains at every plane.

    With `subpixel` = M outlines are located on voxels M times finer (section 3.1); a pixel is in focus if
    half of its voxels are. Raises `InputError` for a `subpixel` below 1.

    >>> ThreeStep(subpixel=2, entropy=False).name
    'three-step-subpixel-2-without-entropy'
    """

    subpixel: int = 1
    threshold: bool = True
    boundary: bool = True
    entropy: bool = True

    def __post_init__(self) -> None:
        M = self.subpixel
        if isinstance(M, bool) or not isinstance(M, int | np.integer) or M < 1:
            raise InputError(f"subpixel: expected a whole number of at least 1, got {M!r}")

    @property
    def name(self) -> str:
        """Name of the results: three-step, and the settings that differ from the defaults."""
        missing = [f"without-{step.name}" for step in fields(self) if getattr(self, step.name) is False]
        fine = [f"subpixel-{self.subpixel}"] if self.subpixel > 1 else []
        return "-".join(["three-step", *fine, *missing])

    def __call__(self, counts: PhotonCounts, requested: Sections) -> Segmented:
        """In-focus masks (Z, H, W) of the requested sections, with the maps of each step in `steps`.

        Step 1: `mean` and `variance` of the non-zero samples, `threshold` (T of Eq. 7), `answered` (where
        there are enough samples) and `kept`. Step 2: `edges` (Roberts magnitude), `bright` (inside its
        outlines), `regions` (their numbers, from 1). Step 3: `entropy` of each region at each plane in bits,
        0 outside, and `winner`, the plane of least entropy, -1 outside; from Z on these are probe planes.
        With `subpixel` = M > 1 `fine` holds the masks (Z, H M, W M) of the voxels.
        """
        planes = with_probes(requested.planes, clear_px=PROBE_STEP_PX)
        sections = extend(requested, counts, planes)
        count = len(requested.planes)
        cell_px = _cell_px(sections)
        step1 = [
            adaptive_threshold(counts, planes, p, cell_px, _tolerance_px(planes, p)) for p in range(count)
        ]
        steps = {name: np.stack([maps[name] for maps in step1]) for name in step1[0]}

        window_px = section_window_px(sections)
        pooled = pooled_estimate(sections, window_px)
        edges = np.stack([_edges(plane, _samples(sections, p, window_px)) for p, plane in enumerate(pooled)])
        smooth = _smoothed(edges)
        fine = np.stack([self._bright(counts, pooled[p], sections, p, window_px) for p in range(count)])
        bright = _half_of_each_pixel(fine, self.subpixel)
        bright_at_any: np.ndarray = np.logical_or.reduce(bright)
        margin = int(LARGEST_BLUR_PX)
        if self.boundary:
            ridges = smooth[:count].max(axis=0)
            regions = pieces_along_ridges(bright_at_any, ridges, margin**2)
        else:
            ridges, regions = None, _tiles(bright_at_any, 2 * margin)
        steps |= {"edges": edges[:count], "bright": bright, "regions": _repeated(regions, count)}

        kept = np.ones_like(bright)
        if self.threshold:
            kept &= steps["kept"]
        if self.entropy:
            entropies = edge_entropies(smooth, regions, margin)
            winner = planes_of_least_entropy(entropies, regions, ridges, window_px)[regions]
            kept &= winner == np.arange(count)[:, None, None]
            steps |= {"entropy": entropies.T[:count][:, regions], "winner": _repeated(winner, count)}
        if self.subpixel > 1:
            M = self.subpixel
            steps["fine"] = fine & kept.repeat(M, axis=1).repeat(M, axis=2)
        return Segmented(bright & kept, self.name, requested, steps)

    def _bright(
        self,
        counts: PhotonCounts,
        pooled: np.ndarray,
        sections: Sections,
        plane: int,
        window_px: int,
    ) -> np.ndarray:
        """Step 2 on voxels M times finer, (H M, W M) bool; without it voxels with a photon near."""
        M = self.subpixel
        samples = _samples(sections, plane, window_px)
        if M > 1:
            finer = reconstruct(counts, sections.planes.take([plane]), subpixel=M)
            window = 2 * ((window_px * M - 1) // 2) + 1  # odd, and no wider than in pixels
            pooled, samples = pooled_estimate(finer, window)[0], _samples(finer, 0, window)
        if not self.boundary:
            return pooled.max(axis=-1) > 0
        return outlined(pooled, samples, SMALLEST_REGION_PX, M)[1]


def adaptive_threshold(
    counts: PhotonCounts, planes: FocalPlanes, plane: int, cell_px: int, tolerance_px: float
) -> dict[str, np.ndarray]:
    """Step 1: where the variance of the non-zero samples is at most T (Eq. 7), with the maps it follows from.

    Maps (H, W): `mean`, `variance` and `threshold` float32, `kept` and `answered` bool. T is the variance of
    non-zero Poisson samples of the same mean, plus `SIGMAS` times the sampling error of a variance, about var
    sqrt(2 / (n - 1)) for n samples, plus the variance due to the slope of the section, over shifts that a
    surface in focus may have: `tolerance_px` either way and the rounding to whole pixels, both uniform.
    Points with fewer than `FEWEST_SAMPLES` are kept, and so are rejected regions smaller than a window of
    cells.
    """
    samples = view_samples(counts, planes, plane, cell_px=cell_px, window_cells=WINDOW_CELLS)
    limit = _threshold(samples, cell_px, tolerance_px)
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
    return {name: cells_to_pixels(cells, cell_px, counts.grid) for name, cells in maps.items()}


def _threshold(samples: ViewSamples, cell_px: int, tolerance_px: float) -> np.ndarray:
    noise = truncated_poisson_variance(samples.mean)
    noise = noise * (1 + SIGMAS * np.sqrt(2 / np.maximum(samples.number - 1, 1)))
    # The two diagonal differences of Roberts' cross square to twice the squared slope per cell.
    slope2 = roberts_magnitude(samples.mean) ** 2 / (2 * cell_px**2)
    return noise + slope2 * (tolerance_px**2 / 3 + 1 / 12)


def _tolerance_px(planes: FocalPlanes, plane: int) -> float:
    """Blur half-extent halfway to the nearest other plane: points closer to this plane may remain."""
    apart = np.abs(planes.total_disparity_px - planes.total_disparity_px[plane])
    others = apart[apart > 0]
    return float(others.min()) / 4 if others.size else 0.0


def _cell_px(sections: Sections) -> int:
    """Cell size at which a window holds `PHOTONS_PER_SAMPLE` photons per view where the photons are."""
    per_view = photons_around_a_photon(sections) / sections.grid.view_count
    if per_view == 0:
        return LARGEST_CELL_PX
    window_px = np.sqrt(PHOTONS_PER_SAMPLE / per_view)
    return int(np.clip(np.ceil(window_px / WINDOW_CELLS), 1, LARGEST_CELL_PX))


def _samples(sections: Sections, plane: int, window: int) -> float:
    """Samples of all colours in a window of a plane."""
    return window**2 * float(sections.coverage[plane].mean()) * sections.coverage.shape[-1]


def _edges(pooled: np.ndarray, samples_per_window: float) -> np.ndarray:
    return roberts_magnitude(brightness(pooled, samples_per_window)).astype(np.float32)


def _smoothed(edges: np.ndarray) -> np.ndarray:
    from scipy.ndimage import gaussian_filter, uniform_filter

    # Roberts magnitudes belong to pixel corners: the mean of four moves them to pixel centres.
    return gaussian_filter(uniform_filter(edges, 2, axes=(1, 2)), EDGE_SMOOTHING_PX, axes=(1, 2))


def _half_of_each_pixel(fine: np.ndarray, M: int) -> np.ndarray:
    """Pixels (Z, H, W) of which at least half of the M x M voxels are set."""
    Z, H, W = fine.shape
    voxels = fine.reshape(Z, H // M, M, W // M, M)
    return 2 * voxels.sum(axis=(2, 4), dtype=np.int64) >= M * M


def _tiles(mask: np.ndarray, side_px: int) -> np.ndarray:
    """Square tiles of a mask (H, W), numbered from 1; 0 outside the mask."""
    row, col = (np.arange(size) // side_px for size in mask.shape)
    numbers = 1 + row[:, None] * (col[-1] + 1) + col
    return np.where(mask, numbers, 0).astype(np.int32)


def _repeated(values: np.ndarray, planes: int) -> np.ndarray:
    return np.broadcast_to(values, (planes, *values.shape))
