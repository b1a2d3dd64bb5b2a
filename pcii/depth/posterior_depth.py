"""Depth and masks from one posterior probability: evidence of texture, smooth surfaces, and a network.

Blocks without evidence follow their neighbours, and where there is none at all the posterior still has a
largest value. So a connected region that may be a surface has an answer if two halves of the cameras show the
same structure in a part of it (`pcii.evidence.half_agreement`).
"""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from pcii.depth.network_inputs import NetworkInputs, hint_of, inputs_of
from pcii.depth.smooth_surface import SurfacePrior
from pcii.depth.surface_network import MULTIPLE, run_network
from pcii.evidence.cells import CELL_PX
from pcii.evidence.half_agreement import halves_of
from pcii.evidence.hot_pixels import without_hot_pixels
from pcii.evidence.texture_evidence import CELL_BLOCKS, TextureEvidence, TextureModel, evidence_of_texture
from pcii.imaging.blocks import on_pixels
from pcii.imaging.bright_regions import box_around
from pcii.types.estimates import DepthMap, DepthPosterior
from pcii.types.focal_planes import FocalPlanes
from pcii.types.geometry import depth_of_total_disparity_mm, total_disparity_px
from pcii.types.images import Views
from pcii.types.photon_counts import PhotonCounts

MOST_VALUES = 1 << 25
"""Blocks times planes, which decides on the memory: some 2 GB. Where there are more, blocks are larger."""
NO_DEPTHS = np.zeros(0)


@dataclass(frozen=True)
class PosteriorDepth:
    """The method with its constants; docs/experiments/depth.md has what they change."""

    model: TextureModel = field(default_factory=TextureModel)
    prior: SurfacePrior = field(default_factory=SurfacePrior)
    step_px: float = 1.0
    """Total disparity between planes."""
    block_px: int = 2
    window_px: float = 8.0
    """Standard deviation of the window in which there are to be photons."""
    least_photons: float = 10.0
    """Their least number, in a Gaussian of weight 1 at its centre."""
    margin_blocks: int = 64
    """The network is run so far beyond the blocks with so many photons: two cells of its coarsest level."""

    max_empty: float = 0.5
    """Largest probability of no surface where one is answered."""
    clear_photons: float = 40.0
    """Mean number of photons of all views in 8 x 8 px below which the whole film is tested, since no part of
    it is clear enough."""
    min_film_agreement: float = 4.0
    """Smallest t of a whole film that has answers. Some seven of 1000 films of noise exceed it."""
    min_line_agreement: float = 6.0
    """The same of cameras in a line, where shading does not blur either. Of 80 films without depth the
    largest t is 5.4; the paper's scene has 7 to 10 from 300 photons per view on."""
    min_agreed_share: float = 0.02
    """Smallest share of a connected region in which two halves of the cameras show the same structure. A
    smaller one would let noise pass, of which they agree in 1 cell of 1000."""

    def __call__(
        self, data: PhotonCounts | Views, z_range_mm: tuple[float, float], z_mm: np.ndarray = NO_DEPTHS
    ) -> DepthMap:
        """Depth (H, W), and the posterior probability that it is within a plane, 1 px, of the truth."""
        return depth_map_of(self.posterior(data, z_range_mm, z_mm))

    def posterior(
        self, data: PhotonCounts | Views, z_range_mm: tuple[float, float], z_mm: np.ndarray = NO_DEPTHS
    ) -> DepthPosterior:
        """The posterior of planes through the range, and masks of the planes at `z_mm` (R,)."""
        if isinstance(data, PhotonCounts):
            data = without_hot_pixels(data)
        planes = FocalPlanes.between(data.grid, *z_range_mm, self.step_px)
        block_px = self.block_px
        while len(planes) * data.grid.height * data.grid.width / block_px**2 > MOST_VALUES:
            block_px *= 2
        evidence = evidence_of_texture(data, planes, block_px, self.model)
        requested_px = total_disparity_px(data.grid, z_mm)
        # Where there are no photons there is no surface, and the depth map has no answer.
        probability, nothing = np.zeros_like(evidence.nats), np.ones_like(evidence.nats[0])
        in_focus = np.zeros((z_mm.size, *nothing.shape), np.float32)
        part = self._part_with_photons(evidence.photons, block_px)
        if part is not None:
            requested_planes = np.interp(requested_px, planes.total_disparity_px, np.arange(len(planes)))
            inputs = self.network_inputs(evidence, planes, block_px, requested_px, part)
            for film, own in zip(
                (probability, nothing, in_focus), run_network(inputs, requested_planes), strict=True
            ):
                target = film[..., *part]
                target[...] = own[..., : target.shape[-2], : target.shape[-1]]
        maps = probability, nothing, block_px, in_focus
        posterior = DepthPosterior(planes, *maps, is_detected=np.zeros(nothing.shape, bool))
        return replace(posterior, is_detected=self._detected(data, posterior, evidence.photons))

    def _detected(
        self, data: PhotonCounts | Views, posterior: DepthPosterior, photons: np.ndarray
    ) -> np.ndarray:
        """Where a surface is detected (h, w) bool."""
        from scipy.ndimage import label

        plane, _, _ = posterior.most_probable()
        is_possible = self._has_photons(photons, plane, posterior.block_px)
        if isinstance(data, PhotonCounts):  # the network has not learned where radiance shows none
            is_possible &= posterior.no_surface <= self.max_empty
            is_clear = photons.mean() >= self.clear_photons * (posterior.block_px / self.block_px) ** 2
            # Regions are compared by blur, and edges along a line of cameras blur at no plane.
            is_line = min(data.grid.rows, data.grid.cols) == 1
            if is_line or not is_clear:
                least = self.min_line_agreement if is_line else self.min_film_agreement
                return is_possible & (_agreement_of_film(data, posterior.planes) >= least)
        agree = _halves_agree(data, posterior.planes, plane, posterior.block_px, is_possible) & is_possible
        labelled: Any = label(is_possible)
        region = np.asarray(labelled[0]).ravel()
        cells = np.bincount(region).clip(min=1)
        agreed_share = (np.bincount(region, agree.ravel()) / cells)[region].reshape(agree.shape)
        return agree | is_possible & (agreed_share >= self.min_agreed_share)

    def network_inputs(
        self,
        evidence: TextureEvidence,
        planes: FocalPlanes,
        block_px: int,
        requested_px: np.ndarray,
        part: tuple[slice, slice] | None = None,
    ) -> NetworkInputs:
        """What the network is given for a part of the film, or for all of it.

        `requested_px` (R,) are the total disparities of planes that are asked about; `part` is rows and
        columns of blocks.
        """
        rows, cols = (slice(0, -(-size // MULTIPLE) * MULTIPLE) for size in evidence.nats.shape[1:])
        hint = hint_of(planes.total_disparity_px, requested_px)
        samples_per_block = planes.grid.view_count * block_px**2
        return inputs_of(evidence, samples_per_block, self.prior, part or (rows, cols), hint)

    def _part_with_photons(self, photons: np.ndarray, block_px: int) -> tuple[slice, slice] | None:
        """The smallest box of rows and columns, in blocks, that the network has to be run on; None if empty.

        It holds all blocks with enough photons around them at any plane, with a margin, and is a whole number
        of cells of the network's coarsest level, the last of which may reach beyond the film.
        """
        enough = np.max(self._photons_around(photons, block_px), axis=0) >= self.least_photons
        if not enough.any():
            return None
        margin = self.margin_blocks // CELL_BLOCKS
        step = MULTIPLE // CELL_BLOCKS
        rows, cols = (
            slice(axis.start // step * MULTIPLE, -(-axis.stop // step) * MULTIPLE)
            for axis in box_around(enough, (margin, margin))
        )
        return rows, cols

    def _has_photons(self, photons: np.ndarray, best: np.ndarray, block_px: int) -> np.ndarray:
        """Whether there are enough photons (h, w) around a block at the plane `best` (h, w)."""
        i, j = (np.arange(size) // CELL_BLOCKS for size in best.shape)
        return self._photons_around(photons, block_px)[best, i[:, None], j] >= self.least_photons

    def _photons_around(self, photons: np.ndarray, block_px: int) -> np.ndarray:
        """Photons (Z, h / 4, w / 4) in a Gaussian window of weight 1 at its centre."""
        from scipy.ndimage import gaussian_filter

        sigma = self.window_px / (block_px * CELL_BLOCKS)
        return gaussian_filter(photons, sigma, mode="constant", axes=(1, 2)) * (2 * np.pi * sigma**2)


def depth_map_of(posterior: DepthPosterior) -> DepthMap:
    """Depth and confidence of pixels, where the posterior has an answer."""
    grid = posterior.planes.grid
    _, confidence, total_px = posterior.most_probable()
    depth_mm = np.where(posterior.is_detected, depth_of_total_disparity_mm(grid, total_px), np.nan)
    maps = depth_mm, np.where(posterior.is_detected, confidence, 0.0)
    return DepthMap(*(on_pixels(part, posterior.block_px, grid.shape_HW) for part in maps))


def _agreement_of_film(counts: PhotonCounts, planes: FocalPlanes) -> float:
    """How well two halves of the cameras agree on structure anywhere on the film, as t."""
    halves = halves_of(counts, planes.take(slice(None, None, 2)))
    is_cell = np.ones(halves.inside[0].p.shape[1:], bool)
    return halves.agreement_over(slice(None), slice(None), is_cell)


def _halves_agree(
    data: PhotonCounts | Views, planes: FocalPlanes, best: np.ndarray, block_px: int, where: np.ndarray
) -> np.ndarray:
    """Whether two halves of the cameras agree (h, w) that there is structure at the plane `best` (h, w).

    Structure is there at neighbouring planes as well, so that every other one is enough. Only the blocks
    `where` (h, w) bool are decided, which saves the sums over the windows around all others.
    """
    every_other = planes.take(slice(None, None, 2))
    i, j = (
        np.minimum(np.arange(-(-size // CELL_PX)) * CELL_PX // block_px, blocks - 1)
        for size, blocks in zip(data.grid.shape_HW, best.shape, strict=True)
    )
    plane = best[np.ix_(i, j)] // 2
    is_wanted = np.zeros(plane.shape, bool)
    i, j = (index * block_px // CELL_PX for index in np.nonzero(where))
    is_wanted[i, j] = True
    agree = halves_of(data, every_other, out_of_focus=True).agree(plane, is_wanted)
    agree = on_pixels(agree, CELL_PX, data.grid.shape_HW)
    return agree[::block_px, ::block_px]
