"""Removal of defocused points by likelihood: what is in focus at each plane, down to a few photons a pixel.

1. The section at each depth predicts where photons land; what it predicts better than a blurred one would
   is evidence of focus (`pcii.evidence.focus_likelihood`), summed over windows that stop at its
   edges.
2. Each cell of 4 px takes the requested plane that has most of it, and every change costs (`best_labels`).
3. Connected pieces of what is bright are judged as wholes: a piece without evidence of its own joins its
   neighbour (evidence that is largest midway between two planes counts for neither), and one that a depth far
   from every plane explains surely better is defocused.
   (`pcii.removal.likelihood.regions`)
4. Where pieces of several planes touch, and everywhere if light is scarce, opaque layers are fitted to all
   photons together: what a nearer one hides says nothing of those behind it (`layers`, `layer_search`).
5. Each region is outlined to the pixel at its own depth (`outline`).

Nothing is told about the number of objects, their colours or their depths, and nothing is claimed without
evidence, nor without two halves of the cameras agreeing on it (`pcii.evidence.half_agreement`): of films
that show noise alone at most 1 pixel in 1000 is claimed.

Muniraj et al. 2017 ask for the same masks; their three steps are in `pcii.removal.three_step`.
"""

from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np

from pcii.evidence.cells import CELL_PX
from pcii.evidence.focus_likelihood import (
    JUMP_NATS,
    best_labels,
    focus_evidence,
    photon_weighted_mean,
    windowed,
)
from pcii.evidence.half_agreement import halves_of
from pcii.evidence.hot_pixels import without_hot_pixels
from pcii.imaging.blocks import on_pixels
from pcii.imaging.bright_regions import box_around, dilated
from pcii.removal.likelihood.layer_search import layered
from pcii.removal.likelihood.outline import outlined
from pcii.removal.likelihood.regions import (
    HALO_CELLS,
    SURE_NATS,
    Planes,
    Region,
    bright_cells,
    dark_pieces,
    regions_of,
    settled,
    where_planes_touch,
)
from pcii.sections.reconstruction import reconstruct
from pcii.types.camera_grid import CameraGrid
from pcii.types.estimates import Segmented
from pcii.types.focal_planes import FocalPlanes
from pcii.types.photon_counts import PhotonCounts
from pcii.types.section_stack import Sections

SEARCH_STEP_PX = 2.0
SEARCHED_PX = 30.0
"""Depths are searched this far beyond the planes, in px of total disparity: there is evidence of what is
defocused, too."""
NEAR_PX, FOCUS_PX = 4.5, 10.0
"""A surface is a plane's if it is within 4.5 px of total disparity; a round object's outline lies behind what
is seen of it, so that a region may be 10 px away, 5 px of blur, before it counts as defocused."""
MISPLACED_PX = 1.0 + SEARCH_STEP_PX / 2
"""Largest distance, in px of total disparity, between a surface and the searched depth at which its evidence
is largest: 1 px, since the whole-pixel shifts of the cameras at both ends are half a pixel off, and half a
step of the search."""
STEP_NATS = 0.05
OUTLINE_CELLS = 3
"""Between things that layers told apart a border is theirs; outlines are drawn this near to the dark."""
ENOUGH_PHOTONS, ENOUGH_PER_PX = 500_000, 2.0
"""Of all views together, in all or per px of a large film; with fifteen times as many masks are the same."""
FAINT_PER_PX = 1.0
"""Below a photon per px in what is seen the depth within a thing shows nowhere."""


def remove_by_likelihood(counts: PhotonCounts, sections: Sections) -> Segmented:
    """In-focus masks (Z, H, W) of the sections, and which photons came from there.

    `steps` holds `evidence`, the gain of each plane in nats over a window (Z, H, W) float32; `bright`,
    what is not dark (H, W repeated); `region`, the numbers of regions that are in focus.
    """
    grid = counts.grid
    own_disparity_px, which = np.unique(sections.planes.total_disparity_px, return_inverse=True)
    planes = searched_planes(own_disparity_px)
    # More photons would not tell planes apart better, only later; outlines take all of them.
    most = max(ENOUGH_PHOTONS, ENOUGH_PER_PX * grid.height * grid.width)
    enough = without_hot_pixels(counts).subsample(most, np.random.default_rng(0))
    searched = FocalPlanes.at_total_disparity(grid, planes.total_disparity_px)
    focus, halves = focus_evidence(enough, searched), halves_of(enough, searched)
    close = np.flatnonzero(planes.away_px <= NEAR_PX)
    evidence = windowed(focus.gain[close], focus.photons[close])
    label = best_labels(
        evidence, STEP_NATS * np.diff(planes.total_disparity_px[close]) / SEARCH_STEP_PX, JUMP_NATS
    )
    photons = focus.photons[close].sum(axis=1)
    shown = np.take_along_axis(photons, label[None], axis=0)[0]
    bright = bright_cells(shown)
    plane = settled(planes.nearest[close][label], bright, focus, planes)
    faint = photon_weighted_mean(shown) < FAINT_PER_PX * CELL_PX**2
    numbers, regions = regions_of(plane, bright, focus, planes, halves)
    touching = where_planes_touch(bright, numbers, regions)
    plane, fitted = np.where(bright, plane, -1), np.zeros_like(bright)
    if faint or touching.any():
        # A thing by itself in the dark has been judged as a whole: of a round one each depth explains a part,
        # and none is to have it. It is left alone, unless there is too little light to see where it ends.
        fitted = ~dilated(bright & ~touching & (not faint), HALO_CELLS)
        plane = np.where(fitted, layered(enough, own_disparity_px, plane), plane)
        plane = np.where(dark_pieces(plane, bright), -1, plane)
        numbers, regions = regions_of(plane, plane >= 0, focus, planes, halves)
    inner = fitted & ~dilated(plane < 0, OUTLINE_CELLS)
    masks, belongs = _outlines(counts, regions, numbers, inner, own_disparity_px.size)
    # Surfaces are opaque: of several planes that a photon may have come from, it came from the nearest.
    own = np.where(belongs.any(axis=0), own_disparity_px.size - 1 - np.argmax(belongs[::-1], axis=0), -1)
    best = np.stack([evidence[planes.nearest[close] == p].max(axis=0) for p in range(own_disparity_px.size)])
    in_focus = masks[which]
    steps = {
        "evidence": np.stack([_on_pixels(best[p], grid) for p in which]),
        "bright": np.broadcast_to(_on_pixels(bright, grid), in_focus.shape),
        "region": np.broadcast_to(_on_pixels(numbers, grid), in_focus.shape),
    }
    return Segmented(in_focus, "likelihood", sections, steps, own == which[:, None])


def searched_planes(own_disparity_px: np.ndarray) -> Planes:
    """The planes' own depths, and others in steps of 2 px of total disparity up to 30 px around each."""
    steps = np.arange(-SEARCHED_PX, SEARCHED_PX + SEARCH_STEP_PX, SEARCH_STEP_PX)
    between = np.unique(np.round((own_disparity_px[:, None] + steps) / SEARCH_STEP_PX)) * SEARCH_STEP_PX
    between = between[between >= SEARCH_STEP_PX]
    apart = np.abs(between[:, None] - own_disparity_px[None]).min(axis=1)
    disparity_px = np.sort(np.concatenate([own_disparity_px, between[apart >= SEARCH_STEP_PX / 2]]))
    away = np.abs(disparity_px[:, None] - own_disparity_px[None])
    nearest, away_px = np.argmin(away, axis=1), away.min(axis=1)
    # A depth midway between planes may be of a surface at either; that of a plane is its own.
    alone = (away <= away_px[:, None] + 2 * MISPLACED_PX).sum(axis=1) == 1
    sure = (away_px <= NEAR_PX) & (alone | (away_px == 0))
    return Planes(disparity_px, nearest, away_px, sure, FOCUS_PX)


def _outlines(
    counts: PhotonCounts, regions: Sequence[Region], numbers: np.ndarray, inner: np.ndarray, planes: int
) -> tuple[np.ndarray, np.ndarray]:
    """Masks (P, H, W) of the planes' regions to the pixel, and which events (P, N) land in them.

    What is `inner` (h, w) stays as it is: an outline parts a thing from the dark around it.
    """
    from pcii.base.compiled_loops import threads

    grid = counts.grid
    inner = _on_pixels(inner, grid)
    # What nothing speaks for is free to be taken; what is defocused is not.
    firm = [0, *(region.number for region in regions if region.gain_nats > SURE_NATS)]
    number_of = _on_pixels(np.where(np.isin(numbers, firm), numbers, 0), grid)
    masks = np.zeros((planes, *grid.shape_HW), dtype=bool)
    belongs = np.zeros((planes, counts.events.n.size), dtype=bool)
    disparities_px = sorted({region.total_disparity_px for region in regions if region.is_there})
    found: list[tuple[Region, tuple[slice, slice], Future[np.ndarray]]] = []
    with ThreadPoolExecutor(threads()) as pool:
        for disparity_px in disparities_px:
            section = reconstruct(counts, FocalPlanes.at_total_disparity(grid, disparity_px))
            for region in regions:
                if not region.is_there or region.total_disparity_px != disparity_px:
                    continue
                start = number_of == region.number
                box = box_around(start)
                taken = ((number_of > 0) & ~start)[box]
                _close_frame(taken, box, grid)
                photons, samples = (
                    part[0][box].astype(np.float32) for part in (section.counts, section.coverage)
                )
                found.append((region, box, pool.submit(outlined, photons, samples, start[box], taken)))
    for disparity_px in disparities_px:
        row, col, inside = FocalPlanes.at_total_disparity(grid, disparity_px).project(counts.events, 0)
        for region, box, outline in found:
            if region.total_disparity_px == disparity_px:
                mask = np.zeros(grid.shape_HW, dtype=bool)
                mask[box] = np.where(inner[box], number_of[box] == region.number, outline.result())
                masks[region.plane] |= mask
                belongs[region.plane, inside] |= mask[row[inside], col[inside]]
    return masks, belongs


def _close_frame(taken: np.ndarray, box: tuple[slice, slice], grid: CameraGrid) -> None:
    """The box's frame is nobody's, but where it is the film's: filling the box would save outline."""
    rows, cols = box
    taken[0] |= rows.start > 0
    taken[-1] |= rows.stop < grid.height
    taken[:, 0] |= cols.start > 0
    taken[:, -1] |= cols.stop < grid.width


def _on_pixels(cells: np.ndarray, grid: CameraGrid) -> np.ndarray:
    return on_pixels(cells, CELL_PX, grid.shape_HW)
