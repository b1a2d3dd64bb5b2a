"""Sheets, the few surfaces that a posterior of depth consists of, and what is known of each block of them.

A sheet has a depth everywhere, also behind others and beyond its outline, and a mask, the probability that it
is there. Masks are of sheets and not of what is seen: from near to far, a sheet is seen where it is there and
nothing nearer is. Arrays: L sheets, h x w blocks, R requested planes; depths in px of total disparity.
"""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from pcii.base import helper, shared
from pcii.types import DepthPosterior


@dataclass(frozen=True)
class SheetModel:
    """What is assumed of sheets; docs/experiments/depth.md has what the numbers change."""

    neighbour_blocks: float = 0.75
    """Neighbouring blocks whose depths differ by less are of one part, in total disparity."""
    least_blocks: int = 250
    """Of a part that is a sheet. If it is larger, small things stay as the network sees them; if smaller,
    noise is a sheet, and each takes its time."""
    most_sheets: int = 9
    """Besides flat ones at requested planes; the largest parts."""
    same_blocks: float = 2.5
    """Depths nearer to each other are of one sheet: of parts on average, of a requested plane and the middle
    of a sheet, of a plane of the posterior and a sheet at a block."""
    window_blocks: float = 3.0
    """Standard deviation of the window in which photons decide, and of a Gaussian over the depths of a sheet.
    If it is larger, small things are lost; if smaller, noise decides."""
    octaves: int = 6
    """Textures are smoothed by Gaussians with standard deviations of 1, 2, 4, ... blocks; the light without
    depth by the last. With fewer, plain things have noise for texture in little light."""
    least_weight: float = 0.2
    """Weight in a sheet's texture of blocks where the sheet is not, or not yet: where it is, it is the mask.
    If it is smaller, a hidden sheet has no texture before it has a mask; if larger, its texture is mixed with
    what hides it."""
    least: float = 0.005
    """What is less is nothing: of a probability, and of the mean brightness."""
    most_nats: float = 7.0
    """That a block counts for or against a mask, in the mean of a window: textures are blurred and depths
    are not exact. If it is larger, outlines grow into dark surroundings in much light; if smaller, the
    network decides."""
    most_photons: int = 1 << 20
    """Of more, as many are chosen at random: the time that a sweep takes at most."""
    cameras: int = 7
    """Along either axis, each the mean of some next to each other, of which it is computed what they see of
    a block. With fewer, what outlines hide is less exact; with more, sweeps take longer."""
    sweeps: int = 6
    """At most, as long as the objective rises; with none the network decides alone."""
    wide_octave: int = 4
    """In windows of 2 to this power blocks the share of noise in the evidence is computed. If it is larger,
    small things are judged by what is around; if smaller, noise decides."""


class Sheets(NamedTuple):
    """Depths `total_px` (L, h, w) float32, nearer than `same_px` to each other where they are the same; the
    `probability` (L, h, w) float32 that a sheet is what is seen; whether it `is_at` (R, L) a requested plane;
    and the numbers of the sheets from near to far, `order` (L, h, w)."""

    total_px: np.ndarray
    same_px: float
    probability: np.ndarray
    is_at: np.ndarray
    order: np.ndarray

    def masks(self, least: float) -> np.ndarray:
        """The probability (L, h, w) float32 that each is there, from `least` to 1 - `least`.

        Where all is hidden by nearer ones none is there.
        """
        visible = np.take_along_axis(self.probability, self.order, axis=0)
        nearer = np.cumsum(visible, axis=0) - visible
        masks = np.empty_like(visible)
        np.put_along_axis(masks, self.order, visible / (1 - nearer + np.float32(least)), axis=0)
        return masks.clip(least, 1 - least)

    def visible(self, masks: np.ndarray) -> np.ndarray:
        """The probability (L, h, w) that each is what is seen: it is there, and nothing nearer is."""
        visible, reach = np.empty_like(masks), np.ones_like(masks[:1])
        for sheet in self.order:
            mask = np.take_along_axis(masks, sheet[None], axis=0)
            np.put_along_axis(visible, sheet[None], reach * mask, axis=0)
            reach = reach * (1 - mask)
        return visible


def cut_sheets(
    posterior: DepthPosterior, total_px: np.ndarray, requested_px: np.ndarray, model: SheetModel
) -> Sheets:
    """The sheets of a posterior whose most probable depths are `total_px` (h, w).

    They are connected parts of smooth depth, those at the same depth in one; and flat ones at the requested
    planes (R,) at which there is none. There may be none at all.
    """
    block_px = posterior.block_px
    same_px = model.same_blocks * block_px
    # A surface is more probable than none.
    depths = _smooth_parts(total_px, posterior.no_surface < 0.5, block_px, model)
    middle_px = [float(np.median(depth[part])) for part, depth in depths]
    sheets = [depth for _, depth in depths]
    for plane_px in requested_px:
        if not any(abs(plane_px - px) < same_px for px in middle_px):
            middle_px.append(float(plane_px))
            sheets.append(np.full(total_px.shape, plane_px, np.float32))
    shape = (len(sheets), *total_px.shape)
    total = np.array(sheets, np.float32).reshape(shape)
    is_at = np.abs(np.subtract.outer(requested_px, middle_px)) < same_px
    probability = np.zeros(shape, np.float32)
    planes_px = posterior.planes.total_disparity_px
    _share_planes(probability, posterior.probability, planes_px, total, same_px)
    # An object in focus is a surface, also where the network does not know its depth.
    claimed = np.zeros(shape, np.float32)
    for in_focus, members in zip(posterior.in_focus, is_at, strict=True):
        share = probability[members] + np.finfo(np.float32).eps
        claimed[members] += in_focus * share / share.sum(axis=0)
    np.maximum(probability, claimed, out=probability)
    probability /= np.maximum(probability.sum(axis=0), 1)
    return Sheets(total, same_px, probability, is_at, np.argsort(-total, axis=0))


def _smooth_parts(
    total_px: np.ndarray, is_surface: np.ndarray, block_px: int, model: SheetModel
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Connected parts of smooth depth, the largest first: their blocks (h, w) bool and their depth, continued
    to all blocks. Parts that continue each other are one."""
    parts = list[tuple[np.ndarray, np.ndarray]]()
    for part in _connected(total_px, is_surface, block_px, model):
        depth = _continued(total_px, part, model.window_blocks)
        for place, (known, known_depth) in enumerate(parts):
            apart_px = _mean_distance(known_depth, total_px, part), _mean_distance(depth, total_px, known)
            if max(apart_px) < model.same_blocks * block_px:
                together = part | known
                parts[place] = together, _continued(total_px, together, model.window_blocks)
                break
        else:
            parts.append((part, depth))
    return sorted(parts, key=lambda part: -int(part[0].sum()))[: model.most_sheets]


def _connected(
    total_px: np.ndarray, is_surface: np.ndarray, block_px: int, model: SheetModel
) -> list[np.ndarray]:
    """Connected parts (h, w) bool of a surface whose depth differs little from block to block, the largest
    first."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    number, near_px = np.arange(total_px.size).reshape(total_px.shape), model.neighbour_blocks * block_px
    pairs = list[np.ndarray]()
    for axis in (0, 1):
        depth, surface, block = (np.moveaxis(part, axis, 0) for part in (total_px, is_surface, number))
        joined = surface[1:] & surface[:-1] & (np.abs(np.diff(depth, axis=0)) < near_px)
        pairs.append(np.stack([block[1:][joined], block[:-1][joined]]))
    ends = np.concatenate(pairs, axis=1)
    graph = coo_array((np.ones(ends.shape[1], bool), tuple(ends)), shape=(number.size, number.size))
    label = connected_components(graph, directed=False)[1].reshape(total_px.shape)
    blocks = np.bincount(label[is_surface])
    largest = np.argsort(-blocks, kind="stable")
    return [(label == part) & is_surface for part in largest if blocks[part] >= model.least_blocks]


def _mean_distance(depth: np.ndarray, total_px: np.ndarray, part: np.ndarray) -> float:
    return float(np.abs(depth - total_px)[part].mean())


def _continued(total_px: np.ndarray, part: np.ndarray, sigma: float) -> np.ndarray:
    """The depth (h, w) float32 of a part, everywhere that of its nearest block, smoothed."""
    from scipy.ndimage import distance_transform_edt, gaussian_filter

    nearest: Any = distance_transform_edt(~part, return_distances=False, return_indices=True)
    return gaussian_filter(total_px[tuple(nearest)].astype(np.float32), sigma, mode="nearest")


def posterior_after(
    posterior: DepthPosterior, sheets: Sheets, before: np.ndarray, after: np.ndarray, least: float
) -> DepthPosterior:
    """The posterior whose planes near a sheet grow by the root of how much more it is seen.

    Probabilities (L, h, w) that each sheet is what is seen are `before` by the network alone and `after` by
    the photons. No surface and planes far from all sheets grow with the light without depth. Where the
    photons around do not tell the depth the network's stays. The probability of being in focus at a requested
    plane grows by as much as the sheets at the plane do, that of no plane by as much as the others and the
    light without depth. Where nothing changes the posterior does not either.
    """
    before, after = (_with_nothing(visible) for visible in (before, after))
    growth = _by_depth(sheets, after, least) / _by_depth(sheets, before, least)
    in_focus = _in_focus_after(posterior.in_focus, sheets, before, growth)
    probability, no_surface = posterior.probability.copy(), posterior.no_surface.copy()
    planes_px = posterior.planes.total_disparity_px
    # The network's planes know the same photons already, so that what sheets say of them counts half.
    _grow_planes(probability, no_surface, planes_px, sheets.total_px, sheets.same_px, np.sqrt(growth))
    is_supported = posterior.is_supported
    probability = np.where(is_supported, probability, posterior.probability)
    no_surface = np.where(is_supported, no_surface, posterior.no_surface)
    return replace(posterior, probability=probability, no_surface=no_surface, in_focus=in_focus)


def _with_nothing(visible: np.ndarray) -> np.ndarray:
    """The probabilities (L + 1, h, w) of sheets (L, h, w), and of the light without depth."""
    return np.concatenate([visible, 1 - visible.sum(axis=0, keepdims=True)])


def _by_depth(sheets: Sheets, visible: np.ndarray, least: float) -> np.ndarray:
    """The probability (L + 1, h, w) that a sheet, or another at its depth, is what is seen, more by `least`;
    and of the light without depth."""
    depths, same_px = sheets.total_px, sheets.same_px
    near = [(visible[:-1] * (np.abs(depths - depth) < same_px)).sum(axis=0) for depth in depths]
    return np.stack([*near, visible[-1]]) + np.float32(least)


def _in_focus_after(
    in_focus: np.ndarray, sheets: Sheets, before: np.ndarray, growth: np.ndarray
) -> np.ndarray:
    """Probabilities (R, h, w) of being in focus, each times the mean `growth` of its sheets, normalised."""
    weight = before + np.finfo(np.float32).eps
    # The sheets of each requested plane, then those of no plane and the light without depth.
    members = [np.append(is_at_plane, False) for is_at_plane in sheets.is_at]
    members.append(np.append(~sheets.is_at.any(axis=0), True))
    claimed = np.concatenate([in_focus, (1 - in_focus.sum(axis=0, keepdims=True)).clip(0)])
    for probability, member in zip(claimed, members, strict=True):
        probability *= (weight[member] * growth[member]).sum(axis=0) / weight[member].sum(axis=0)
    return claimed[:-1] / claimed.sum(axis=0)


@helper
def _nearest_sheet(total_px: np.ndarray, i: int, j: int, plane_px: float, near_px: float) -> int:
    """The sheet of total_px (L, h, w) nearest to a plane at a block; L if none is nearer than `near_px`."""
    nearest, distance = len(total_px), np.float32(near_px)
    for sheet in range(len(total_px)):
        away = abs(total_px[sheet, i, j] - plane_px)
        if away < distance:
            nearest, distance = sheet, away
    return nearest


@shared(lambda probability, *_: probability.shape[1])
def _share_planes(
    first: int,
    last: int,
    probability: np.ndarray,
    planes: np.ndarray,
    planes_px: np.ndarray,
    total_px: np.ndarray,
    near_px: float,
) -> None:
    """Add the planes (Z, h, w) of a posterior to the `probability` (L, h, w) of the sheet near them."""
    for i in range(first, last):
        for z in range(len(planes)):
            for j in range(probability.shape[2]):
                nearest = _nearest_sheet(total_px, i, j, planes_px[z], near_px)
                if nearest < len(total_px):
                    probability[nearest, i, j] += planes[z, i, j]


@shared(lambda probability, *_: probability.shape[1])
def _grow_planes(
    first: int,
    last: int,
    probability: np.ndarray,
    no_surface: np.ndarray,
    planes_px: np.ndarray,
    total_px: np.ndarray,
    near_px: float,
    growth: np.ndarray,
) -> None:
    """Multiply the `probability` (Z, h, w) of planes near a sheet, and that of `no_surface` (h, w), by how
    many times more (L + 1, h, w) the sheet is seen, and the light without depth is; normalised."""
    Z, _, w = probability.shape
    L = len(total_px)
    for i in range(first, last):
        for j in range(w):
            no_surface[i, j] *= growth[L, i, j]
        total = no_surface[i].copy()
        for z in range(Z):
            for j in range(w):
                nearest = _nearest_sheet(total_px, i, j, planes_px[z], near_px)
                probability[z, i, j] *= growth[nearest, i, j]
                total[j] += probability[z, i, j]
        for j in range(w):
            no_surface[i, j] /= total[j]
            probability[:, i, j] /= total[j]
