"""report.html without a browser: what is in it, what is left out, and numbers that agree with the results."""

import html
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from report_outcomes import COUNTS, FOUND, GRID, IDS, TRUTH, Written, outcome_of, page_of

from pcii.app import Outcome
from pcii.app.report_pictures import MAX_SLIDER_PLANES, depth_errors, slider_planes
from pcii.figures import exposed
from pcii.sections import reconstruct
from pcii.types import CameraGrid, PhotonCounts, Truth, total_disparity_px


def words_of(page: str) -> str:
    """What a reader sees of a page without its script and styles."""
    text = re.sub(r"<(script|style)>.*?</\1>", "", page, flags=re.DOTALL)
    return html.unescape(re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", text)))


@pytest.fixture
def full(reports: dict[str, Written]) -> Outcome:
    return reports["full"].outcome


@pytest.fixture
def page(reports: dict[str, Written]) -> str:
    return reports["full"].page


@pytest.mark.parametrize("z_mm", [(500.0,), tuple(np.linspace(400, 900, 40))])
def test_planes_of_the_slider(full: Outcome, z_mm: tuple[float, ...]) -> None:
    z_range_mm = min(z_mm) * 0.8, max(z_mm) * 1.25
    planes = slider_planes(replace(full, sections=reconstruct(COUNTS, z_mm), z_range_mm=z_range_mm))
    assert 2 <= len(planes) <= MAX_SLIDER_PLANES
    np.testing.assert_allclose(planes.z_mm[[0, -1]], z_range_mm)
    steps = -np.diff(total_disparity_px(GRID, planes.z_mm))
    np.testing.assert_allclose(steps, steps[0])
    assert steps[0] > 0.49  # no two planes look the same


def test_one_camera_has_one_section_for_all_depths(tmp_path: Path) -> None:
    grid = CameraGrid(rows=1, cols=1, pitch_mm=(5, 5), focal_mm=50, pixel_mm=0.25, height=40, width=48)
    counts = PhotonCounts.from_dense(np.ones(grid.shape_KLHW, int), grid)
    outcome = outcome_of(tmp_path / "d", counts, None, (500,))
    assert slider_planes(outcome).z_mm.tolist() == [500]
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


def test_what_is_shown_has_the_truth_beside(full: Outcome, page: str, tmp_path: Path) -> None:
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


def test_colours_without_samples_are_those_around() -> None:
    """A uniform grey scene has no tint at a depth at which all shifts are even."""
    grid = CameraGrid(rows=3, cols=3, pitch_mm=(5, 5), focal_mm=50, pixel_mm=0.05, height=16, width=16)
    sections = reconstruct(PhotonCounts.from_dense(np.ones(grid.shape_KLHW, int), grid, cfa="GRBG"), 2500)
    assert (sections.coverage[0, 6:10, 6:10] == 0).any()
    for step in (1, 2, 3):
        (image,) = exposed([(sections.counts[0], sections.coverage[0])], step)
        inside = 3 if step == 1 else 2
        np.testing.assert_array_equal(image[inside:-inside, inside:-inside], 255)


def test_errors_of_depth_and_their_scale() -> None:
    error, limit = depth_errors(FOUND, TRUTH.object_z_mm)
    expected = np.where(IDS > 0, np.broadcast_to(np.linspace(-3, 5, 48), IDS.shape), np.nan)
    np.testing.assert_allclose(error, expected, atol=1e-9)
    assert 0.9 < (np.abs(error[np.isfinite(error)]) <= limit).mean() <= 1


def test_tables_can_be_scrolled_by_keyboard_and_pictures_have_words(page: str) -> None:
    tables = re.findall(r"<div class=\"wide ([^>]*)>\s*<table", page)
    assert len(tables) == page.count("<table")
    assert all('tabindex="0"' in each and "aria-label" in each for each in tables)
    pictures = re.findall(r"<img [^>]*>", page)
    assert len(pictures) > 15
    assert all(re.search(r' alt="[^"]+"', each) for each in pictures)
    assert '<html lang="en">' in page
