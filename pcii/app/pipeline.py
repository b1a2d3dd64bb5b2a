"""Analysis of a dataset, from sections to scores, in the order of the paper's sections 2 and 3."""

import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from typing import TypeVar

import numpy as np

from pcii.base import Report, silent
from pcii.depth import (
    DEFAULT_METHOD,
    depth_map_of,
    depth_posterior,
    estimate_depth,
    find_depth_method,
    find_surfaces,
)
from pcii.metrics import score
from pcii.removal import DEFAULT_METHODS, find_method, masks_of
from pcii.sections import reconstruct
from pcii.store import Dataset
from pcii.types import (
    DepthMap,
    DepthPosterior,
    FocalPlanes,
    PhotonCounts,
    Score,
    Sections,
    Segmented,
    Views,
    check_depth_counts,
    depth_of_total_disparity_mm,
    total_disparity_px,
)

Result = TypeVar("Result")


@dataclass(frozen=True)
class Outcome:
    """Results of the analysis of a dataset."""

    dataset: Dataset
    full_light: Sections | None
    """Sections of the radiance (Eq. 2), if the dataset has it."""
    sections: Sections
    """Sections of the photon counts (Eq. 3), or of the radiance if there are no counts."""
    focus: tuple[Segmented, ...]
    depth: DepthMap
    score: Score
    z_range_mm: tuple[float, float]
    """Nearest and farthest depth that was searched."""
    timings_s: dict[str, float] = field(default_factory=dict)
    depth_method: str = DEFAULT_METHOD


def analyse(
    dataset: Dataset,
    planes: FocalPlanes,
    z_range_mm: tuple[float, float],
    methods: Sequence[str] = (),
    depth_method: str = DEFAULT_METHOD,
    report: Report = silent,
) -> Outcome:
    """Reconstruct sections, remove defocused points by each of `methods`, map depth by `depth_method`, score.

    `methods` defaults to `DEFAULT_METHODS`. Of a dataset without photon counts sections and depth are those
    of its radiance, and nothing is removed. Raises `InputError` without both counts and radiance, and for an
    unknown method or one of which there are no counts.
    """
    counts = dataset.counts if dataset.has_counts or dataset.views is None or methods else None
    data = dataset.views if counts is None else counts
    assert data is not None
    names = methods or DEFAULT_METHODS if counts is not None else ()
    removals = {name: find_method(name) for name in names}  # unknown names before any work
    find_depth_method(depth_method, data)
    if counts is not None:
        check_depth_counts(counts)
    seconds: dict[str, float] = {}

    def timed(step: str, work: Callable[[], Result]) -> Result:
        start = time.perf_counter()
        result = work()
        seconds[step] = round(time.perf_counter() - start, 3)
        return result

    def at_full_light() -> Sections | None:
        return None if dataset.views is None else reconstruct(dataset.views, planes)

    # Full light and depth need nothing of the other steps, and mostly leave the interpreter to them.
    with ThreadPoolExecutor(2) as pool:
        light = pool.submit(timed, "sections at full light", at_full_light)
        sections = None if counts is None else timed("sections", partial(reconstruct, counts, planes))
        estimate = partial(_depth_of, data, z_range_mm, planes, depth_method)
        depth = pool.submit(timed, "depth", estimate)
        focus: list[Segmented] = []
        for name, remove in removals.items():
            assert counts is not None
            assert sections is not None
            posterior = depth.result()[1] if name == DEFAULT_METHOD else None
            work = partial(remove, counts) if posterior is None else partial(masks_of, posterior)
            focus.append(timed(f"removal, {name}", partial(work, sections)))
            report("removal", len(focus), len(removals))
        full_light, (depth_map, _) = light.result(), depth.result()
    sections = full_light if sections is None else sections
    assert sections is not None
    options = {"grid": dataset.grid, "full_light": full_light, "dataset": dataset.name}
    result = timed("score", partial(score, focus, depth_map, dataset.truth, **options))
    return Outcome(
        dataset, full_light, sections, tuple(focus), depth_map, result, z_range_mm, seconds, depth_method
    )


def _depth_of(
    data: PhotonCounts | Views, z_range_mm: tuple[float, float], planes: FocalPlanes, method: str
) -> tuple[DepthMap, DepthPosterior | None]:
    """The depth map, and the posterior that it is read from, if it is, as masks of the planes can be."""
    if method != DEFAULT_METHOD:
        return estimate_depth(data, z_range_mm, method=method), None
    posterior = depth_posterior(data, z_range_mm, z_mm=planes)
    return depth_map_of(posterior, z_range_mm), posterior


def surface_depths(
    data: PhotonCounts | Views, z_range_mm: tuple[float, float], method: str = DEFAULT_METHOD
) -> tuple[tuple[float, ...], str]:
    """Depths in mm where the depth map has most surfaces, and a sentence on them and how sure they are."""
    depths_mm, sure = find_surfaces(data, z_range_mm, method)
    if not depths_mm:
        return (), ""
    farthest_mm = max(depths_mm)
    total_px = total_disparity_px(data.grid, np.array(farthest_mm))
    px_mm = farthest_mm - float(depth_of_total_disparity_mm(data.grid, total_px + 1))
    right = f"{sure:.0%} of its depths are right to 1 px of total disparity, {px_mm:.2g} mm"
    surfaces = f"the depth map has most surfaces at {depths_text(depths_mm)} mm"
    return depths_mm, f"{surfaces}; {right} at {depths_text([farthest_mm])} mm"


def depths_text(z_mm: Sequence[float]) -> str:
    """Depths with three digits and without exponents.

    >>> depths_text([1868.2, 45])
    '1870, 45'
    """
    return ", ".join(f"{float(f'{z:.3g}'):g}" for z in z_mm)
