"""One dataset, everything: analyse it and leave sections, masks, depth, scores and the report."""

from collections.abc import Sequence
from pathlib import Path

from pcii import results
from pcii.console import Report, silent
from pcii.dataset import Dataset
from pcii.pipeline import Outcome, analyse, planes_of
from pcii.report import write_report
from pcii.segment import DEFAULT_METHODS, find_method


def run(
    dataset: Dataset,
    out: Path,
    z_mm: Sequence[float] | None,
    report: Report = silent,
    methods: Sequence[str] = DEFAULT_METHODS,
) -> Outcome:
    """Analyse `dataset` and write everything into `out`.

    Raises `InputError` if `out` holds something else, and like `analyse`.
    """
    for method in methods:  # a misspelt name is told before the work, and leaves no folder behind
        find_method(method)
    planes_of(dataset, z_mm)
    results.claim(out, dataset)
    outcome = analyse(dataset, z_mm, report, methods)
    results.save_sections(out, outcome.sections)
    for focus in outcome.focus:
        results.save_segmented(out, focus)
    results.save_depth(out, outcome.depth)
    results.save_score(out, outcome.score)
    write_report(out / "report.html", outcome)
    return outcome
