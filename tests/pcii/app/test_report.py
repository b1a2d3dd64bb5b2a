"""report.html without a browser: what is in it, what is left out, and numbers that agree with the results."""

import html
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from report_outcomes import GRID, IDS, TRUTH, Written, outcome_of, page_of

from pcii.types import PhotonCounts, Truth


def words_of(page: str) -> str:
    """What a reader sees of a page without its script and styles."""
    text = re.sub(r"<(script|style)>.*?</\1>", "", page, flags=re.DOTALL)
    return html.unescape(re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", text)))


def test_one_camera_has_one_section_for_all_depths(tmp_path: Path) -> None:
    grid = replace(GRID, rows=1, cols=1)
    counts = PhotonCounts.from_dense(np.ones(grid.shape_KLHW, int), grid)
    outcome = outcome_of(tmp_path / "d", counts, None, (500,))
    assert 'id="plane"' not in page_of(outcome, tmp_path)


def test_without_truth_or_counts_nothing_of_them_is_shown(reports: dict[str, Written]) -> None:
    words = words_of(reports["light"].page)
    assert "section at 700 mm, full light (Eq. 2)" in words
    assert "without photon counts" in words
    words = words_of(reports["counts"].page)
    assert "The truth is not known" in words
    for absent in ("None", "nan", "true depth", "IoU", "oracle", "compared", "recall", "–  –"):
        assert absent not in words, absent
    assert "by hand, 700 mm" in words


def test_what_is_shown_has_the_truth_beside(reports: dict[str, Written], tmp_path: Path) -> None:
    full, page = reports["full"].outcome, reports["full"].page
    words = words_of(page)
    for shown in (
        "truth: objects at 500 mm",
        "by hand, 500 mm, compared with the truth",
        "true depth of the objects",
        "estimated less true depth",
    ):
        assert shown in words, shown
    assert page.count('class="bar"') == 4
    assert f"ball {full.score.objects[0]['entropy']['500']:.3f}" in words
    # Fewer than two photons a voxel are smoothed.
    (width,) = set(re.findall(r"smoothed by ([\d.]+) px", page))
    assert 1 < float(width) < 4
    assert "methods by hand, depth:posterior" in words
    assert str(full.dataset.path.parent) not in words
    first, second = (each.split("How this was made")[0] for each in (page, page_of(full, tmp_path)))
    assert first == second  # dates and machines are below


WALL = Truth(np.full((40, 48), 600.0), 0 * IDS, {})


@pytest.mark.parametrize(("photons", "truth"), [(0, None), (3, TRUTH), (1, WALL)])
def test_hardly_any_photons_and_no_objects_divide_nothing(
    tmp_path: Path, photons: int, truth: Truth | None
) -> None:
    dense = np.zeros(GRID.shape_KLHW, int)
    dense[0, 0, 20, 12] = photons
    counts = PhotonCounts.from_dense(dense, GRID, cfa="GRBG")
    words = words_of(page_of(outcome_of(tmp_path / "d", counts, truth), tmp_path))
    assert f"{photons} photon{'s' * (photons != 1)} in all" in words
    assert "nan" not in words
