"""Reports that several tests look at, each written once per worker."""

import pytest
from report_outcomes import COUNTS, LIGHT, TRUTH, Written, outcome_of

from pcii.app.report import write_report


@pytest.fixture(scope="session")
def reports(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Written]:
    """Reports with everything, of counts alone, and of light alone; where nothing is true."""
    found: dict[str, Written] = {}
    for name, images, truth in (
        ("full", (COUNTS, LIGHT), TRUTH),
        ("counts", COUNTS, None),
        ("light", LIGHT, None),
    ):
        folder = tmp_path_factory.mktemp(name)
        found[name] = Written(outcome_of(folder / "d", images, truth), folder / "report.html")
        write_report(found[name].path, found[name].outcome)
    return found
