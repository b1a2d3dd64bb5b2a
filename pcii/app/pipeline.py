"""Analysis of a dataset, from sections to scores, in the order of the paper's sections 2 and 3."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from pcii.app.long_steps import ALL_STEPS, DEPTH_STEP, Made, Steps, removal_step, timed
from pcii.base.progress import Report, silent
from pcii.depth.methods import DEFAULT_METHOD, estimate_depth, find_depth_method
from pcii.metrics.scoring import score
from pcii.removal.methods import DEFAULT_METHODS, find_method
from pcii.sections.reconstruction import reconstruct
from pcii.store.dataset import Dataset
from pcii.store.suggested_depths import depth_range_of, planes_of
from pcii.types.estimates import DepthMap, Score, Segmented
from pcii.types.focal_planes import FocalPlanes, check_depth_counts
from pcii.types.images import ArrayLike5D, Views
from pcii.types.section_stack import Sections

FULL_LIGHT_STEP = "sections at full light"


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
    kept: tuple[str, ...] = ()
    """Steps whose results are those of an earlier run; `timings_s` is how long they took then."""
    depth_method: str = DEFAULT_METHOD


def analyse(
    dataset: Dataset,
    z_mm: Sequence[float] | None,
    report: Report = silent,
    methods: Sequence[str] | None = None,
    steps: Steps = ALL_STEPS,
    depth_method: str = DEFAULT_METHOD,
) -> Outcome:
    """Reconstruct sections, remove defocused points by each of `methods`, map depth by `depth_method`, score.

    `z_mm` defaults to the depths in the dataset's recipe, `methods` to `DEFAULT_METHODS`. Of a dataset
    without photon counts sections and depth are those of its radiance, and nothing is removed. `steps` does
    the long steps, and may know results of earlier runs. Raises `InputError` without depths, without both
    counts and radiance, and for an unknown method or one of which there are no counts.
    """
    seconds: dict[str, float] = {}
    planes = planes_of(dataset, z_mm)
    z_range_mm = depth_range_of(dataset, planes)
    has_counts = dataset.has_counts or dataset.views is None or bool(methods)
    chosen = methods or (DEFAULT_METHODS if has_counts else ())
    # Unknown names are reported before any work.
    removals = {method: find_method(method) for method in chosen}
    counts = dataset.counts if has_counts else None
    seen = dataset.counts_or_views if counts is None else counts
    find_depth_method(depth_method, seen)
    if counts is not None:
        check_depth_counts(counts)
    total = 4 + len(removals)
    done = 0

    def finished(name: str, result: tuple[Made, float]) -> Made:
        nonlocal done
        made, seconds[name] = result[0], round(result[1], 3)
        done += 1
        report("analysis", done, total)
        return made

    full_light: Sections | None = None
    # Full light and depth need nothing of the other steps, and mostly leave the interpreter to them.
    with ThreadPoolExecutor(2, "beside") as beside:
        summed = beside.submit(timed, partial(full_light_sections, dataset, planes, report))
        if counts is None:
            full_light = finished(FULL_LIGHT_STEP, summed.result())
            assert full_light is not None
            sections = finished("sections", (full_light, 0.0))
        else:
            sections = finished("sections", timed(lambda: reconstruct(counts, planes)))
        focus: list[Segmented] = []
        steps.begin(removals)
        map_depth = partial(estimate_depth, seen, z_range_mm, method=depth_method)
        mapped = beside.submit(steps.depth, depth_method, z_range_mm, map_depth)
        for method, remove_by in removals.items():
            assert counts is not None
            remove = partial(remove_by, counts, sections)
            focus.append(finished(removal_step(method), steps.removal(method, sections, remove)))
        if counts is not None:
            full_light = finished(FULL_LIGHT_STEP, summed.result())
        depth = finished(DEPTH_STEP, mapped.result())
    scored = partial(score, focus, depth, dataset.truth, grid=dataset.grid, full_light=full_light)
    result = finished("score", timed(lambda: scored(dataset=dataset.name)))
    kept = tuple(step for step in seconds if step in steps.kept())
    return Outcome(
        dataset, full_light, sections, tuple(focus), depth, result, z_range_mm, seconds, kept, depth_method
    )


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
        self.shape, self.dtype = radiance.shape, getattr(radiance, "dtype", None)

    def __getitem__(self, index: Any, /) -> Any:
        self._done += 1
        self._report("views at full light", self._done, self._total)
        return self._radiance[index]
