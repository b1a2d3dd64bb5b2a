"""One dataset, everything: analyse it and leave sections, masks, depth, scores and the report."""

from collections.abc import Sequence
from pathlib import Path

from pcii import results
from pcii.console import Report, silent
from pcii.dataset import Dataset
from pcii.pipeline import Outcome, analyse
from pcii.report import write_report
from pcii.segment import DEFAULT_METHODS


def run(
    dataset: Dataset,
    out: Path,
    z_mm: Sequence[float] | None,
    report: Report = silent,
    methods: Sequence[str] = DEFAULT_METHODS,
) -> Outcome:
    """Analyse `dataset` and write everything into `out`; `InputError` if `out` holds something else."""
    results.claim(out, dataset)
    outcome = analyse(dataset, z_mm, report, methods)
    results.save_sections(out, outcome.sections)
    for focus in outcome.focus:
        results.save_segmented(out, focus)
    results.save_depth(out, outcome.depth)
    results.save_score(out, outcome.score)
    write_report(out / "report.html", outcome)
    return outcome
