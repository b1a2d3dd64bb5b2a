"""Depth by texture, each pixel in the smallest window that is sure of it.

The evidence S(z) of a window is the sum over its blocks. If a surface is as probable beforehand as none, and
each of the Z planes as probable as the others, the posterior probability of plane z is

    p(z) = exp(S(z)) / (Z + sum over planes of exp(S)),

and what is missing to 1 is that of no surface. In much light a window of some pixels is sure, and keeps to
the outlines of things; in little light it takes the photons of a larger one.
"""

from dataclasses import dataclass, field

import numpy as np

from pcii.core.estimates import DepthMap
from pcii.core.focal_planes import FocalPlanes
from pcii.core.photon_counts import PhotonCounts
from pcii.depth.depth_planes import neighbours_of, peak_depth_mm
from pcii.evidence.hot_pixels import without_hot_pixels
from pcii.evidence.texture_evidence import BLOCK_PX, TextureModel, evidence_of_texture, expanded
from pcii.sections.photon_statistics import cell_sums, cells_to_pixels


@dataclass(frozen=True)
class TextureDepth:
    """The method with its constants; see docs/experiments/depth.md for what they change."""

    model: TextureModel = field(default_factory=TextureModel)
    step_px: float = 1.0
    """Total disparity between planes; the evidence of neighbours is averaged with a deviation of one step."""
    windows_px: tuple[int, ...] = (32, 24, 16, 12, 8, 6, 4)
    """Standard deviations of the Gaussian windows, the largest first."""
    sure: float = 0.9
    """A smaller window decides if its answer is as probable as that."""
    least_confidence: float = 0.5

    def __call__(self, counts: PhotonCounts, z_range_mm: tuple[float, float]) -> DepthMap:
        """Depth (H, W), and the probability that it is within one plane of the truth."""
        from scipy.ndimage import gaussian_filter1d

        planes = FocalPlanes.between(counts.grid, *z_range_mm, self.step_px)
        evidence = evidence_of_texture(without_hot_pixels(counts), planes, self.model)
        evidence = gaussian_filter1d(evidence, 1.0, axis=0, mode="nearest")
        depth, confidence = np.zeros((2, *evidence.shape[1:]))
        for window_px in self.windows_px:
            smaller, probability = _in_windows(evidence, planes, window_px / BLOCK_PX)
            is_sure = (probability >= self.sure) | (window_px == self.windows_px[0])
            depth, confidence = (
                np.where(is_sure, new, old) for new, old in ((smaller, depth), (probability, confidence))
            )
        answered = confidence >= self.least_confidence
        depth, confidence = np.where(answered, depth, np.nan), np.where(answered, confidence, 0.0)
        return DepthMap(*(cells_to_pixels(part, BLOCK_PX, counts.grid) for part in (depth, confidence)))


def _in_windows(evidence: np.ndarray, planes: FocalPlanes, sigma: float) -> tuple[np.ndarray, np.ndarray]:
    """Depth and its probability (h, w) from Gaussian windows of `sigma` blocks."""
    from scipy.ndimage import gaussian_filter

    # A wide window is as good on a coarser grid, four of whose steps it is wide.
    halvings = max(0, int(np.log2(sigma / 4)))
    step = 1 << halvings
    coarse = cell_sums(evidence, step, np.float32)
    blur = (0, sigma / step, sigma / step)
    total = gaussian_filter(coarse, blur, mode="constant") * np.float32(2 * np.pi * (sigma / step) ** 2)
    best = total.argmax(axis=0)
    nearby = neighbours_of(total, best)
    depth = peak_depth_mm(planes, best, nearby)
    top = np.maximum(nearby[1], 0.0)
    whole = len(planes) * np.exp(-top) + np.exp(total - top).sum(axis=0)
    probability = np.exp(nearby - top).sum(axis=0) / whole
    for _ in range(halvings):
        depth, probability = expanded(depth), expanded(probability)
    h, w = evidence.shape[1:]
    return depth[:h, :w], probability[:h, :w]
