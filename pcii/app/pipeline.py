"""Analysis of a dataset, from sections to scores, in the order of the paper's sections 2 and 3."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from pcii.base.progress import Report, silent
from pcii.core.estimates import DepthMap, Score, Segmented
from pcii.core.focal_planes import FocalPlanes
from pcii.core.images import ArrayLike5D, Views
from pcii.core.photon_counts import check_depth_counts
from pcii.core.section_stack import Sections
from pcii.depth.methods import estimate_depth
from pcii.io.dataset import Dataset
from pcii.io.suggested_depths import depth_range_of, planes_of
from pcii.metrics.scoring import score
from pcii.removal.methods import DEFAULT_METHODS, find_method
from pcii.sections.reconstruction import reconstruct


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
    timings_s: dict[str, float] = field(default_factory=dict)


def analyse(
    dataset: Dataset,
    z_mm: Sequence[float] | None,
    report: Report = silent,
    methods: Sequence[str] | None = None,
) -> Outcome:
    """Reconstruct sections, remove defocused points by each of `methods`, map depth, score.

    `z_mm` defaults to the depths in the dataset's recipe, `methods` to `DEFAULT_METHODS`. Of a dataset
    without photon counts sections and depth are those of its radiance, and nothing is removed. Raises
    `InputError` without depths, without both counts and radiance, and for an unknown method or one of which
    there are no counts.
    """
    seconds: dict[str, float] = {}
    planes, z_range = planes_of(dataset, z_mm), depth_range_of(dataset, z_mm)
    has_counts = dataset.has_counts or dataset.views is None or bool(methods)
    chosen = tuple(dict.fromkeys(methods or (DEFAULT_METHODS if has_counts else ())))
    counts = dataset.counts if has_counts else None
    if counts is not None:
        check_depth_counts(counts)
    total = 4 + len(chosen)
    done = 0

    def finished(name: str, start: float) -> None:
        nonlocal done
        done += 1
        seconds[name] = round(time.perf_counter() - start, 3)
        report("analysis", done, total)

    start = time.perf_counter()
    full_light = full_light_sections(dataset, planes, report)
    finished("sections at full light", start)

    start = time.perf_counter()
    if counts is None:
        assert full_light is not None
        sections = full_light
    else:
        sections = reconstruct(counts, planes)
    finished("sections", start)

    focus: list[Segmented] = []
    for method in chosen:
        start = time.perf_counter()
        assert counts is not None
        focus.append(find_method(method)(counts, sections))
        finished(f"removal, {method}", start)

    start = time.perf_counter()
    seen = dataset.views if counts is None else counts
    assert seen is not None
    depth = estimate_depth(seen, z_range)
    finished("depth", start)

    start = time.perf_counter()
    result = score(
        focus, depth, dataset.truth, grid=dataset.grid, full_light=full_light, dataset=dataset.name
    )
    finished("score", start)
    return Outcome(dataset, full_light, sections, tuple(focus), depth, result, seconds)


def full_light_sections(dataset: Dataset, planes: FocalPlanes, report: Report = silent) -> Sections | None:
    """Sections of the radiance at the planes (Eq. 2); None if the dataset has none."""
    views = dataset.views
    if views is None:
        return None
    radiance = _ReportedRadiance(views.radiance, views.grid.view_count, report)
    return reconstruct(Views(radiance, views.grid, views.cfa), planes)


class _ReportedRadiance:
    """Radiance that reports progress with each view that is read."""

    def __init__(self, radiance: ArrayLike5D, total: int, report: Report) -> None:
        self._radiance, self._total, self._report, self._done = radiance, total, report, 0
        self.shape = radiance.shape

    def __getitem__(self, index: Any, /) -> Any:
        self._done += 1
        self._report("views at full light", self._done, self._total)
        return self._radiance[index]
