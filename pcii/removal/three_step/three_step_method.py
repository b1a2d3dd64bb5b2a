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

from pcii.base import InputError
from pcii.removal.three_step.bright_regions import (
    EDGE_SMOOTHING_PX,
    SMALLEST_REGION_PX,
    brightness,
    outlined,
    roberts_magnitude,
)
from pcii.removal.three_step.edge_entropy import edge_entropies, planes_of_least_entropy
from pcii.removal.three_step.variance_threshold import adaptive_threshold, cell_px_for, tolerance_px
from pcii.removal.three_step.watershed_pieces import pieces_along_ridges
from pcii.sections import PROBE_STEPS_PX, extend, pooled_plane, reconstruct, section_window_px, with_probes
from pcii.types import PhotonCounts, Sections, Segmented

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
        cell_px = cell_px_for(sections)
        step1 = [
            adaptive_threshold(counts, planes, p, cell_px, tolerance_px(planes, p)) for p in range(count)
        ]
        steps = {name: np.stack([maps[name] for maps in step1]) for name in step1[0]}

        window_px = section_window_px(sections)
        edges = np.stack([_edges(sections, p, window_px) for p in range(len(planes))])
        del sections  # whose probe planes take memory: the masks are of the requested ones
        smooth = _smoothed(edges)
        fine = np.stack([self._bright(counts, requested, p, window_px) for p in range(count)])
        bright = _half_of_each_pixel(fine, self.subpixel)
        bright_at_any: np.ndarray = np.logical_or.reduce(bright)
        margin = int(LARGEST_BLUR_PX)
        if self.boundary:
            ridges = smooth[:count].max(axis=0)
            regions = pieces_along_ridges(bright_at_any, ridges, margin**2)
        else:
            ridges, regions = None, _tiles(bright_at_any, 2 * margin)
        steps |= {"edges": edges[:count], "bright": bright, "regions": _repeated(regions, count)}

        in_focus = np.ones_like(bright)
        if self.threshold:
            in_focus &= steps["kept"]
        if self.entropy:
            entropies = edge_entropies(smooth, regions, margin)
            winner = planes_of_least_entropy(entropies, regions, ridges, window_px)[regions]
            in_focus &= winner == np.arange(count)[:, None, None]
            steps |= {"entropy": entropies.T[:count][:, regions], "winner": _repeated(winner, count)}
        if self.subpixel > 1:
            M = self.subpixel
            steps["fine"] = fine & in_focus.repeat(M, axis=1).repeat(M, axis=2)
        return Segmented(bright & in_focus, self.name, requested, steps)

    def _bright(self, counts: PhotonCounts, sections: Sections, plane: int, window_px: int) -> np.ndarray:
        """Step 2 on voxels M times finer, (H M, W M) bool; without it voxels with a photon near."""
        M = self.subpixel
        if M > 1:
            sections, plane = reconstruct(counts, sections.planes.take([plane]), subpixel=M), 0
            window_px = 2 * ((window_px * M - 1) // 2) + 1  # odd, and no wider than in pixels
        pooled, samples = pooled_plane(sections, plane, window_px), _samples(sections, plane, window_px)
        if not self.boundary:
            return pooled.max(axis=-1) > 0
        return outlined(pooled, samples, SMALLEST_REGION_PX, M)[1]


def _samples(sections: Sections, plane: int, window: int) -> float:
    """Samples of all colours in a window of a plane."""
    return window**2 * float(sections.coverage[plane].mean()) * sections.coverage.shape[-1]


def _edges(sections: Sections, plane: int, window_px: int) -> np.ndarray:
    pooled = pooled_plane(sections, plane, window_px)
    return roberts_magnitude(brightness(pooled, _samples(sections, plane, window_px))).astype(np.float32)


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
