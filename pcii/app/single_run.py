"""Analysis of one dataset with all its results written: sections, masks, depth, scores and report."""

from collections.abc import Sequence
from pathlib import Path

from pcii.app.long_steps import KeptSteps
from pcii.app.pipeline import Outcome, analyse
from pcii.app.report import write_report
from pcii.app.results import REPORT, Results
from pcii.base.progress import Report, silent
from pcii.depth.methods import DEFAULT_METHOD
from pcii.store.dataset import Dataset


def run(
    dataset: Dataset,
    out: Path,
    z_mm: Sequence[float] | None,
    report: Report = silent,
    methods: Sequence[str] | None = None,
    depth_method: str = DEFAULT_METHOD,
) -> Outcome:
    """Analyse `dataset` and write all results into `out`, each of the long steps as soon as it is done.

    Masks and depth maps that an earlier run left there, interrupted or not, are kept if they are valid.

    Raises `InputError` if `out` is no folder for results of this dataset, and as `analyse` does.
    """
    results = Results(out, dataset)
    results.check()
    outcome = analyse(dataset, z_mm, report, methods, KeptSteps(results), depth_method)
    with results.writing():
        results.save_sections(outcome.sections)
        results.save_score(outcome.score)
        with results.replacing(REPORT) as page:
            write_report(page, outcome, report)
    return outcome
