"""Depth and masks from one posterior probability: evidence of texture, smooth surfaces, a network, and, of
photon counts, sheets that explain what all cameras see.

Blocks without evidence follow their neighbours, and where there is none at all the posterior still has a
largest value. So a connected region that may be a surface, at any plane, has an answer if a depth is shown in
a part of it (`pcii.evidence.shown_depth`).
"""

from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from pcii.base import box_around, on_pixels, window_sums
from pcii.depth.explained_views import explain_posterior
from pcii.depth.network_inputs import NetworkInputs, SurfacePrior, hint_of, inputs_of
from pcii.depth.sheets import SheetModel, cut_sheets
from pcii.depth.surface_network import MULTIPLE, run_network
from pcii.evidence import (
    PHOTON_CELL_BLOCKS,
    ShownDepth,
    TextureEvidence,
    TextureModel,
    doubled,
    evidence_of_texture,
    without_hot_pixels,
)
from pcii.sections import in_memory
from pcii.types import (
    CameraGrid,
    DepthMap,
    DepthPosterior,
    FocalPlanes,
    PhotonCounts,
    Views,
    depth_of_total_disparity_mm,
    total_disparity_px,
)

MOST_VALUES = 1 << 25
"""Blocks times planes, which decides on the memory: some 2 GB. Where there are more, blocks are larger."""
PLANES_PER_BLOCK = 2
"""Planes in which the total disparity grows by a block, as in what the network was trained on."""
AROUND_PX = 20.0
"""Depths are compared so far beyond requested planes in total disparity: what is defocused is to be found as
well."""
BEYOND_PX = 7.0
"""Depths are compared so far beyond the ends of a range, so that a surface that is there is most probable
there, and has no answer. If it is smaller, more of what is outside is answered at the ends; if it is larger,
more planes are compared for nothing."""
OUTSIDE_WEIGHT = 0.5
"""Prior probability of a plane outside the range, or farther than `FOCUS_BLOCKS` from all requested planes
where there is no range, relative to one inside: the range says where surfaces are expected. If it is larger,
plain walls near an end have no answer; if it is smaller, more of what is outside, and plain light around a
thing, is answered."""
FOCUS_BLOCKS = 2.0
"""Without a range masks are of surfaces so far beyond the requested planes in total disparity at most, in
coarse blocks: a blur half-extent of a block. If it is smaller, parts of bulky things are lost; if it is
larger, things are claimed that are in focus at none of the planes."""
END_TOLERANCE_PX = 0.5
"""Half the distance between planes: a surface at an end of a range may be found so far beyond it."""
UNSUPPORTED_CONFIDENCE = 0.5
"""Of the probability of a depth that the photons around do not support. If it is larger, plain light around a
thing is too sure; if it is smaller, walls with little detail are less sure than they are right."""
NO_DEPTHS = np.zeros(0)


class FilmOutputs(NamedTuple):
    """Probabilities, float32, of blocks: of planes (Z, h, w), of no surface (1, h, w), of being in focus at
    requested planes (R, h, w). Of `TextureEvidence` the photons (Z, h / 4, w / 4), and `nats` at the planes
    that it was made for."""

    maps: tuple[np.ndarray, np.ndarray, np.ndarray]
    photons: np.ndarray
    planes: FocalPlanes
    nats: np.ndarray


@dataclass(frozen=True)
class PosteriorDepth:
    """The method with its constants; docs/experiments/depth.md has what they change."""

    model: TextureModel = field(default_factory=TextureModel)
    prior: SurfacePrior = field(default_factory=SurfacePrior)
    shown: ShownDepth = field(default_factory=ShownDepth)
    sheets: SheetModel = field(default_factory=SheetModel)
    step_px: float = 1.0
    """Total disparity between planes of the posterior."""
    block_px: int = 2
    trained_blocks: int = 256
    """Blocks along the longer side of the films that the network was trained on, which other films are made
    to look like by larger blocks, or by blocks in four: see `_blocks_px`. If it is larger, films of 1024 px
    are seen in blocks of 2 px alone; if smaller, films of 256 px."""
    window_px: float = 8.0
    """Standard deviation of the window in which there are to be photons."""
    least_photons: float = 10.0
    """Their least number, in a Gaussian of weight 1 at its centre."""
    margin_blocks: int = 64
    """The network is run this far beyond the blocks with `least_photons`: two cells of its coarsest level."""

    max_empty: float = 0.5
    """Largest probability of no surface where one is answered."""
    least_shown: float = 0.02
    """Smallest share of a connected region in which a depth is shown, if all of it is answered."""

    def __call__(
        self, data: PhotonCounts | Views, z_range_mm: tuple[float, float], z_mm: np.ndarray = NO_DEPTHS
    ) -> DepthMap:
        """Depth (H, W), and the posterior probability that it is within a plane, 1 px, of the truth."""
        return depth_map_of(self.posterior(data, z_range_mm, z_mm), z_range_mm)

    def posterior(
        self, data: PhotonCounts | Views, z_range_mm: tuple[float, float] | None, z_mm: np.ndarray = NO_DEPTHS
    ) -> DepthPosterior:
        """The posterior of planes through the range, if any, and around the planes at `z_mm` (R,); masks of
        these."""
        z_mm, order = np.unique(z_mm, return_inverse=True)
        compared_px = _ends_px(data.grid, z_range_mm, z_mm, BEYOND_PX, AROUND_PX)
        near_mm, far_mm = depth_of_total_disparity_mm(data.grid, compared_px).tolist()
        planes = FocalPlanes.between(data.grid, near_mm, far_mm, self.step_px)
        coarse_px, block_px = self._blocks_px(planes)
        focus_px = 0.0 if z_range_mm else FOCUS_BLOCKS * coarse_px
        answered_px, replaced = _ends_px(data.grid, z_range_mm, z_mm, 0.0, focus_px), 0
        inside = _within(planes, answered_px)
        if isinstance(data, PhotonCounts):
            data, replaced = without_hot_pixels(data, planes.take(inside))
        else:
            data = in_memory(data)
        network = coarse = self._film_outputs(data, planes, inside, block_px, z_mm)
        if coarse_px > block_px:
            coarse = self._film_outputs(data, planes, inside, coarse_px, z_mm)
            for mean, other in zip(network.maps, coarse.maps, strict=True):
                mean += doubled(other, *mean.shape[1:])
                mean /= 2
        probability, nothing, in_focus = network.maps
        maps = probability, nothing[0], block_px, in_focus
        nowhere = np.zeros(nothing[0].shape, bool)
        posterior = DepthPosterior(planes, *maps, nowhere, nowhere, hot_pixels=replaced)
        plane, _, total_px = posterior.most_probable()
        is_inside = _is_between(total_px, answered_px)
        is_possible = self._has_photons(network.photons, plane, block_px)
        if isinstance(data, PhotonCounts):  # the network has not learned where radiance shows no surface
            is_possible &= posterior.no_surface <= self.max_empty
        on_film_px = on_pixels(total_px, block_px, data.grid.shape_HW)
        side_px, answered = max(coarse_px, self.block_px), _within(coarse.planes, answered_px)
        depth = _nearest(coarse.planes, on_film_px[::side_px, ::side_px])
        shown, supported = (
            on_pixels(part, side_px, data.grid.shape_HW)[::block_px, ::block_px]
            for part in self.shown(data, coarse.planes, answered, coarse.nats, depth, side_px, self.model)
        )
        is_detected = is_inside & self._detected(is_possible, shown & is_inside)
        posterior = replace(posterior, is_detected=is_detected, is_supported=supported)
        if isinstance(data, PhotonCounts) and self.sheets.sweeps > 0:
            sheets = cut_sheets(posterior, total_px, total_disparity_px(data.grid, z_mm), self.sheets)
            if sheets.probability.any():
                posterior = explain_posterior(data, posterior, sheets, self.sheets)
        return replace(posterior, in_focus=posterior.in_focus[order])

    def _blocks_px(self, planes: FocalPlanes) -> tuple[int, int]:
        """Sides of the coarse and of the fine blocks in which the network sees the film.

        In coarse ones it is most like the films of training. Fine ones are half as large, since small things
        are lost in coarse ones; but not smaller than those of the evidence, so that of small films both are
        the same.
        """
        height, width = planes.grid.shape_HW
        octaves = round(np.log2(max(height, width) / (self.block_px * self.trained_blocks)))
        coarse_px = int(self.block_px * 2.0 ** max(octaves, -1))
        fine_px = min(coarse_px, max(coarse_px // 2, self.block_px))
        while len(planes) * height * width / fine_px**2 > MOST_VALUES:
            fine_px *= 2
        return max(coarse_px, fine_px), fine_px

    def _film_outputs(
        self, data: PhotonCounts | Views, planes: FocalPlanes, inside: slice, block_px: int, z_mm: np.ndarray
    ) -> FilmOutputs:
        """What the network says of the planes, seeing the film in blocks of one size; surfaces are expected
        at those `inside`."""
        grid, step_px = data.grid, block_px / PLANES_PER_BLOCK
        own_planes = planes
        if step_px != self.step_px:
            own_planes = FocalPlanes.between(grid, planes.z_mm.min(), planes.z_mm.max(), step_px)
        evidence = evidence_of_texture(data, own_planes, max(block_px, self.block_px), self.model)
        nats = evidence.nats
        if block_px < self.block_px:
            evidence = _in_four(evidence, grid.shape_HW)
        h, w = evidence.nats.shape[1:]
        # Where there are no photons there is no surface, and the depth map has no answer.
        probability = np.zeros((len(planes), h, w), np.float32)
        nothing, in_focus = np.ones((1, h, w), np.float32), np.zeros((z_mm.size, h, w), np.float32)
        part = self._part_with_photons(evidence.photons, block_px)
        if part is not None:
            numbers, total_px = np.arange(len(own_planes)), own_planes.total_disparity_px
            requested_planes = np.interp(total_disparity_px(grid, z_mm), total_px, numbers)
            inputs = self.network_inputs(evidence, own_planes, block_px, requested_planes, part)
            outputs = run_network(inputs, requested_planes)
            h, w = nothing[0][part].shape
            prior = np.full(len(planes), OUTSIDE_WEIGHT, np.float32)
            prior[inside] = 1
            probability[:, *part] = _at_planes(outputs.probability[:, :h, :w], len(planes), prior)
            nothing[:, *part] = outputs.no_surface[:h, :w]
            in_focus[:, *part] = outputs.in_focus[:, :h, :w]
        nearest = np.linspace(0, len(own_planes) - 1, len(planes)).round().astype(int)
        return FilmOutputs((probability, nothing, in_focus), evidence.photons[nearest], own_planes, nats)

    def _detected(self, is_possible: np.ndarray, shown: np.ndarray) -> np.ndarray:
        """Where a surface is detected (h, w) bool, from where one is possible and where a depth is shown."""
        from scipy.ndimage import label

        labelled: Any = label(is_possible)
        shown = shown & is_possible
        region = np.asarray(labelled[0]).ravel()
        cells = np.bincount(region).clip(min=1)
        shown_share = (np.bincount(region, shown.ravel()) / cells)[region].reshape(shown.shape)
        return shown | is_possible & (shown_share >= self.least_shown)

    def network_inputs(
        self,
        evidence: TextureEvidence,
        planes: FocalPlanes,
        block_px: int,
        requested_planes: np.ndarray,
        part: tuple[slice, slice] | None = None,
    ) -> NetworkInputs:
        """What the network is given for a part of the film, or for all of it.

        `requested_planes` (R,) are the positions of requested planes among the planes; `part` is rows and
        columns of blocks.
        """
        rows, cols = (slice(0, -(-size // MULTIPLE) * MULTIPLE) for size in evidence.nats.shape[1:])
        hint = hint_of(len(planes), requested_planes)
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
        margin = self.margin_blocks // PHOTON_CELL_BLOCKS
        step = MULTIPLE // PHOTON_CELL_BLOCKS
        rows, cols = (
            slice(axis.start // step * MULTIPLE, -(-axis.stop // step) * MULTIPLE)
            for axis in box_around(enough, (margin, margin))
        )
        return rows, cols

    def _has_photons(self, photons: np.ndarray, best: np.ndarray, block_px: int) -> np.ndarray:
        """Whether there are enough photons (h, w) around a block at the plane `best` (h, w)."""
        i, j = (np.arange(size) // PHOTON_CELL_BLOCKS for size in best.shape)
        return self._photons_around(photons, block_px)[best, i[:, None], j] >= self.least_photons

    def _photons_around(self, photons: np.ndarray, block_px: int) -> np.ndarray:
        """Photons (Z, h / 4, w / 4) in a Gaussian window of weight 1 at its centre."""
        return window_sums(photons, self.window_px / (block_px * PHOTON_CELL_BLOCKS))


def _ends_px(
    grid: CameraGrid,
    z_range_mm: tuple[float, float] | None,
    z_mm: np.ndarray,
    beyond_px: float,
    around_px: float,
) -> np.ndarray:
    """Nearest and farthest total disparity (2,), `beyond_px` beyond the range, if any, and `around_px` around
    the depths `z_mm`, if any, but at the far end no less than half of their own."""
    ends_px = list[float]()
    for depths_mm, margin_px in ((z_range_mm, beyond_px), (z_mm, around_px)):
        if depths_mm is not None and len(depths_mm):
            total_px = total_disparity_px(grid, np.array(depths_mm))
            ends_px += [total_px.max() + margin_px, max(total_px.min() - margin_px, total_px.min() / 2)]
    return np.array([max(ends_px), min(ends_px)])


def _nearest(planes: FocalPlanes, total_px: np.ndarray) -> np.ndarray:
    """The number of the plane nearest to total disparities, an array of their shape."""
    numbers = np.arange(len(planes))
    return np.interp(total_px, planes.total_disparity_px, numbers).round().astype(int)


def _within(planes: FocalPlanes, ends_px: np.ndarray) -> slice:
    """The planes from that nearest to the farthest end to that nearest to the nearest."""
    nearest, farthest = _nearest(planes, ends_px).tolist()
    return slice(farthest, nearest + 1)


def _is_between(total_px: np.ndarray, ends_px: np.ndarray) -> np.ndarray:
    nearest_px, farthest_px = ends_px
    return (total_px > farthest_px - END_TOLERANCE_PX) & (total_px < nearest_px + END_TOLERANCE_PX)


def depth_map_of(posterior: DepthPosterior, z_range_mm: tuple[float, float]) -> DepthMap:
    """Depth and confidence of pixels, where the posterior has an answer within the range."""
    grid = posterior.planes.grid
    _, confidence, total_px = posterior.most_probable()
    ends_px = total_disparity_px(grid, np.array(z_range_mm))
    is_answered = posterior.is_detected & _is_between(total_px, ends_px)
    depth_mm = depth_of_total_disparity_mm(grid, np.clip(total_px, *ends_px[::-1]))
    confidence = np.where(posterior.is_supported, confidence, UNSUPPORTED_CONFIDENCE * confidence)
    maps = np.where(is_answered, depth_mm, np.nan), np.where(is_answered, confidence, 0.0)
    on_film = (on_pixels(part, posterior.block_px, grid.shape_HW) for part in maps)
    return DepthMap(*on_film, hot_pixels=posterior.hot_pixels)


def _in_four(evidence: TextureEvidence, shape_HW: tuple[int, int]) -> TextureEvidence:
    """The evidence of each block on four blocks of a quarter of its area, as many as cover the film."""
    h, w = shape_HW
    nats, sums, samples = (on_pixels(part, 2, (h, w)) / np.float32(4) for part in evidence[:3])
    cells = -(-h // PHOTON_CELL_BLOCKS), -(-w // PHOTON_CELL_BLOCKS)
    return TextureEvidence(nats, sums, samples, on_pixels(evidence.photons, 2, cells) / np.float32(4))


def _at_planes(probability: np.ndarray, count: int, prior: np.ndarray) -> np.ndarray:
    """Probabilities of `count` planes (count, h, w) from those of others (Z, h, w) between the same ends,
    times the `prior` (count,) of the planes.

    Planes are evenly apart. That of a plane between two of fewer planes is given to both, as it is near; of
    more planes it is interpolated. The sum stays as it is.
    """
    Z = len(probability)
    if count == Z:
        resampled = probability * prior[:, None, None]
    else:
        fewer, more = sorted((count, Z))
        places = np.linspace(0, fewer - 1, more)
        nearness = np.stack([np.interp(places, np.arange(fewer), row) for row in np.eye(fewer)])
        weights = prior[:, None] * (nearness if count < Z else nearness.T).astype(np.float32)
        resampled = np.tensordot(weights, probability, axes=1)
    resampled *= probability.sum(axis=0) / np.maximum(resampled.sum(axis=0), np.finfo(np.float32).tiny)
    return resampled
