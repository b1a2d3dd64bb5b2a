"""Where there is a depth to be seen at all: evidence that is lost behind infinity.

What belongs to the films or to the light, and noise, is as sharp at a plane as at that of the opposite total
disparity, behind infinity: hot pixels, vignetting, shading, views that differ in brightness. A surface is
sharp in front of infinity alone. So a depth is shown where the evidence in a window, at its best plane,
exceeds that of the planes behind infinity, and is no less than that of planes outside the range.

Of noise a coefficient of an octave has evidence with a variance of 1/2 square nat at most. It counts
4^-octave and stands for 4^octave blocks, so that the sum over many blocks has a variance of some 2/3 for each
of them: in a Gaussian window of standard deviation s blocks, of weight 1 at its centre, a standard deviation
of 1.4 s nats.

Near a depth that is shown a plain block is given one that need not be its own. It is supported if the
evidence in a window at its depth exceeds that behind infinity, and is a large part of that at the best plane.
"""

from dataclasses import dataclass, replace

import numpy as np

from pcii.base import block_sums, each_in_threads, on_pixels, window_sums
from pcii.evidence.texture_evidence import TextureModel, evidence_of_texture
from pcii.types import FocalPlanes, PhotonCounts, Views, parallax_per_total


@dataclass(frozen=True)
class ShownDepth:
    """The test with its constants; docs/experiments/depth.md has what they change."""

    windows: int = 4
    """Gaussian windows, each twice as wide as the one before: wide ones are for little light."""
    smallest_blocks: float = 4.0
    """Standard deviation of the smallest window, in blocks."""
    noise_sigmas: float = 12.0
    """What the gain is to exceed, in standard deviations of the noise that planes behind infinity show."""
    least_gain: float = 1.0
    most_gain: float = 4.0
    """Ends of what it is to exceed, in nats per block of the window's standard deviation."""
    support_sigmas: float = 6.0
    """As `noise_sigmas`, of the evidence for the depth of a block, where a depth is shown around."""
    support_share: float = 0.5
    """Least share that it has of the evidence at the best plane: things out of focus have some as well."""
    support_planes: int = 2
    """Planes between the depth of a block and that evidence, since depths may be a little off."""
    step_blocks: float = 4.0
    """Total disparity, in blocks, between planes outside the range, the first of which is half as far from
    its end, and the least of planes behind infinity."""

    def __call__(
        self,
        data: PhotonCounts | Views,
        planes: FocalPlanes,
        inside: slice,
        nats: np.ndarray,
        depth: np.ndarray,
        block_px: int,
        model: TextureModel,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Where (h, w) bool the evidence (Z, h, w) shows a depth, and where it supports that of a block.

        `nats` are `evidence_of_texture(data, planes, block_px, model).nats`, of the planes `inside` the range
        and beyond it. `depth` (h, w) are numbers of planes; those beyond the range are taken for its ends.
        """
        from scipy.ndimage import maximum_filter

        all_px, step_px = planes.total_disparity_px, self.step_blocks * block_px
        inside_px = all_px[inside]
        # Less than a step behind infinity a surface with little disparity would be sharp still.
        behind_px = -np.unique(np.maximum(inside_px, step_px))
        behind, outside = (
            _evidence_at(total_px, data, block_px, model)
            for total_px in (behind_px, _outside_px(all_px, step_px))
        )
        outside, nats = np.concatenate([nats[: inside.start], nats[inside.stop :], outside]), nats[inside]
        (h, w), side = nats.shape[1:], 1
        shown, supported = np.zeros((h, w), bool), np.zeros((h, w), bool)
        squares = np.mean(behind**2, axis=0)
        depth = np.clip(depth - inside.start, 0, len(nats) - 1)
        i, j = np.indices((h, w), sparse=True)
        for _ in range(self.windows):
            # Each window has the same standard deviation in cells, which grow with it.
            side *= 2
            nats, behind, outside, squares = (
                block_sums(part, 2, np.float32) for part in (nats, behind, outside, squares)
            )
            # What a single camera has seen is so far from its place, in cells, at the plane behind infinity.
            reach = 2 * int(np.ceil(np.abs(behind_px).max() / block_px / side)) + 1
            sigma_cells = self.smallest_blocks / 2
            # The square of a Gaussian is one of 1 / sqrt(2) the width.
            local_noise = np.sqrt(window_sums(squares, sigma_cells / 2**0.5))
            noise = maximum_filter(local_noise, reach)
            blocks = sigma_cells * side
            least = np.clip(self.noise_sigmas * noise, self.least_gain * blocks, self.most_gain * blocks)
            sums = _in_windows(nats, sigma_cells)
            best, best_behind, best_outside = (
                part.max(axis=0)
                for part in (sums, _in_windows(behind, sigma_cells), _in_windows(outside, sigma_cells))
            )
            is_shown = (best - maximum_filter(best_behind, reach) > least) & (best >= best_outside)
            shown |= on_pixels(is_shown, side, (h, w))
            near = maximum_filter(sums, (2 * self.support_planes + 1, 1, 1))
            enough = best_behind + np.minimum(self.support_sigmas * local_noise, least)
            is_supported = (near > enough) & (near >= best_outside) & (near >= self.support_share * best)
            supported |= is_supported[depth, i // side, j // side]
        return shown, supported


def _outside_px(compared_px: np.ndarray, step_px: float) -> np.ndarray:
    """Total disparities outside those, from infinity to as far in front of them as that is behind."""
    nearest_px = compared_px.max()
    away_px = step_px * (np.arange(np.ceil(nearest_px / step_px)) + 0.5)
    behind_px = compared_px.min() - away_px
    return np.concatenate([behind_px[behind_px > -step_px].clip(min=0), nearest_px + away_px])


def _evidence_at(
    total_px: np.ndarray, data: PhotonCounts | Views, block_px: int, model: TextureModel
) -> np.ndarray:
    """Evidence (Z, h, w) at planes of any total disparity (Z,): of 0, infinitely far, and below it."""
    # Cameras with shear have planes in front of infinity wherever their films are shifted to.
    more_px = 1.0 + np.abs(total_px).max()
    x, y = (np.array(data.grid.shear_px) + more_px * parallax_per_total(data.grid)).tolist()
    grid = replace(data.grid, shear_px=(x, y))
    planes = FocalPlanes.at_total_disparity(grid, total_px + more_px)
    return evidence_of_texture(replace(data, grid=grid), planes, block_px, model).nats


def _in_windows(nats: np.ndarray, sigma: float) -> np.ndarray:
    """Sums (Z, h, w) in the window around each cell."""
    return np.stack(each_in_threads(lambda z: window_sums(nats[z], sigma), range(len(nats))))
