"""report.html without a browser: what is in it, what is left out, and numbers that agree with the results."""

import html
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from report_outcomes import COUNTS, FOUND, GRID, IDS, LIGHT, TRUTH, Written, decoded, outcome_of, page_of
from stored_datasets import rewrite_manifest

from pcii.app import report_origin
from pcii.app.pipeline import Outcome
from pcii.app.report_figures import Crop, Shown, block_estimate, encoded
from pcii.app.report_slider import MOST_PLANES, slider, slider_planes
from pcii.base.progress import silent
from pcii.sections.reconstruction import reconstruct
from pcii.store.dataset import open_dataset
from pcii.store.dataset_layout import MANIFEST
from pcii.types.camera_grid import CameraGrid
from pcii.types.focal_planes import FocalPlanes
from pcii.types.geometry import total_disparity_px
from pcii.types.photon_counts import PhotonCounts
from pcii.types.section_stack import Sections
from pcii.types.truth import Truth


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


def test_the_slider_reads_out_what_the_results_say(full: Outcome) -> None:
    shown = slider(Shown(full, Crop(slice(3, 40), slice(5, 48), 2), 0.0), silent)
    blocks = shown["crop"]
    assert (blocks.step_px, blocks.rows.start, blocks.cols.start) == (1, 3, 5)
    maps = {each["name"]: each for each in shown["maps"]}
    part = np.s_[3:40, 5:48]
    for name, true in (("estimate", FOUND), ("confidence", full.depth.confidence)):
        values = decoded(maps[name], blocks)
        np.testing.assert_allclose(values, true[part], atol=0.51 * maps[name]["step"], rtol=0)
    truth = decoded(maps["truth"], blocks)
    assert (np.isfinite(truth) == (IDS[part] > 0)).all()  # nothing was hit elsewhere
    names = np.array(shown["names"])[decoded(maps["object"], blocks).astype(int)]
    expected = np.select([IDS == 3, IDS == 7], ["ball", "card"], "none")[part]
    assert (names == expected).all()
    for z, coded in zip(shown["z_mm"], shown["planes"], strict=True):
        photons = reconstruct(COUNTS, float(z)).counts[0].sum(axis=-1)[part]
        np.testing.assert_array_equal(decoded(coded, blocks), photons)


def test_blocks_of_pixels_are_read_out_where_there_are_many(
    full: Outcome, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pcii.app.report_slider.MOST_BLOCKS", 250)
    shown = slider(Shown.of(full, 0.0), silent)
    blocks, estimate = shown["crop"], shown["maps"][0]
    assert blocks.step_px == 3
    rows, cols = np.minimum(np.arange(0, 40, 3) + 1, 39), np.arange(0, 48, 3) + 1
    expected = FOUND[rows][:, cols]
    np.testing.assert_allclose(decoded(estimate, blocks), expected, atol=0.51 * estimate["step"], rtol=0)
    photons = np.add.reduceat(reconstruct(COUNTS, float(shown["z_mm"][0])).counts[0].sum(axis=-1), rows - 1)
    whole = sum(decoded(each, blocks).sum() for each in shown["planes"][:1])
    assert whole == photons.sum()


@pytest.mark.parametrize("z_mm", [(500.0,), (500.0, 700.0), tuple(np.linspace(400, 900, 40))])
def test_planes_of_the_slider(full: Outcome, z_mm: tuple[float, ...]) -> None:
    z_range_mm = min(z_mm) * 0.8, max(z_mm) * 1.25
    planes, own = slider_planes(replace(full, sections=reconstruct(COUNTS, z_mm), z_range_mm=z_range_mm))
    assert len(planes) <= 2 * MOST_PLANES
    assert (np.diff(planes.z_mm) > 0).all()
    # To the ends of the range, or to a plane of the analysis that looks the same.
    ends = total_disparity_px(GRID, np.array(z_range_mm))
    assert np.abs(total_disparity_px(GRID, planes.z_mm[[0, -1]]) - ends).max() < 0.51
    assert [z_mm[there] for there in own.values()] == [planes.z_mm[here] for here in own]
    assert len(own) == min(len(z_mm), MOST_PLANES)
    # No two planes look the same, but where the analysis has them.
    steps = -np.diff(total_disparity_px(GRID, planes.z_mm))
    if len(z_mm) < 3:
        assert steps.min() > 0.49


def test_one_camera_has_one_section_for_all_depths(tmp_path: Path) -> None:
    grid = CameraGrid(rows=1, cols=1, pitch_mm=(5, 5), focal_mm=50, pixel_mm=0.25, height=40, width=48)
    counts = PhotonCounts.from_dense(np.ones(grid.shape_KLHW, int), grid)
    outcome = outcome_of(tmp_path / "d", counts, None, (500,))
    assert slider_planes(outcome)[0].z_mm.tolist() == [500]
    page = page_of(outcome, tmp_path)
    assert 'id="plane"' not in page
    assert "The section at 500 mm" in words_of(page)


def test_without_truth_nothing_of_it_is_shown(reports: dict[str, Written]) -> None:
    page = reports["counts"].page
    words = words_of(page)
    assert "The truth is not known" in words
    for absent in (
        "None",
        "nan",
        "true depth",
        "IoU",
        "oracle",
        "Table 1",
        "Figure",
        "compared",
        "recall",
        "–  –",
    ):
        assert absent not in words.replace("figures and tables are numbered", ""), absent
    assert "by hand, 700 mm: after removal" in words
    assert page.count('<th scope="col"') == 5  # plane, method, entropy before and after, claimed share
    assert 'data-name="truth"' not in page


def test_radiance_alone_has_light_to_read_out(reports: dict[str, Written]) -> None:
    words, outcome = words_of(reports["light"].page), reports["light"].outcome
    assert "light, share of the most" in words
    assert "photons in the section" not in words
    shown = slider(Shown.of(outcome, 0.0), silent)
    light = np.stack([decoded(each, shown["crop"]) for each in shown["planes"]])
    means = np.stack([reconstruct(LIGHT, float(z)).estimate[0].mean(axis=-1) for z in shown["z_mm"]])
    np.testing.assert_allclose(light, means / means.max(), atol=2e-5)


def test_only_the_papers_scene_has_the_papers_numbers(full: Outcome, page: str, tmp_path: Path) -> None:
    titles = ("Figure 6", "Figure 7", "Table 1")
    words = words_of(page)
    assert not any(title in words for title in titles)
    assert "In the paper" not in words
    assert "Entropy of the objects" in words
    manifest = full.dataset.manifest.model_copy(update={"recipe": {"scene": "two_objects", "seed": 1}})
    paper = replace(
        full, dataset=replace(full.dataset, manifest=manifest), sections=reconstruct(COUNTS, (540, 620))
    )
    words = words_of(page_of(paper, tmp_path))
    assert all(title in words for title in titles)


def test_entropies_have_intervals(full: Outcome, page: str, tmp_path: Path) -> None:
    words = words_of(page)
    bits = full.score.objects[0]["entropy"]["500"]
    assert re.search(rf"ball {bits:.3f} ± \d\.\d\d\d ", words)
    assert "unseen" not in words.split("How this was made")[0].split("Entropy of the objects")[1]
    one = np.zeros(GRID.shape_KLHW, dtype=int)
    one[0, 0, 20, 12] = 3
    few = PhotonCounts.from_dense(one, GRID, cfa="GRBG")
    words = words_of(page_of(outcome_of(tmp_path / "few", few, TRUTH), tmp_path))
    assert "There are no intervals" in words
    assert "±" not in words


def test_no_photons_are_said_and_divide_nothing(tmp_path: Path) -> None:
    dark = PhotonCounts.from_dense(np.zeros(GRID.shape_KLHW, int), GRID, cfa="GRBG")
    words = words_of(page_of(outcome_of(tmp_path / "d", dark, None), tmp_path))
    assert "No photon was counted" in words


def test_a_scene_without_objects_says_so(tmp_path: Path) -> None:
    wall = Truth(np.full((40, 48), 600.0), 0 * IDS, {})
    words = words_of(page_of(outcome_of(tmp_path / "d", COUNTS, wall), tmp_path))
    assert "There are no objects" in words
    assert "none at this plane" in words
    assert "Entropy of the objects" not in words


def test_how_it_was_made(full: Outcome, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    skipped = [
        {"what": "a <b>", "why": "no need", "saved": 2_500_000, "unit": "bytes before compression"},
        {"what": "rays", "why": "none asked", "saved": 1200.0, "unit": "rays"},
    ]
    (tmp_path / MANIFEST).write_bytes((full.dataset.path / MANIFEST).read_bytes())
    rewrite_manifest(tmp_path, skipped=skipped, versions={"mitsuba": "3.9.1"}, files={})
    monkeypatch.setattr(report_origin, "_of_analysis", lambda *_: [])
    rows = report_origin.origin(replace(full, dataset=open_dataset(tmp_path)), None)
    assert rows["skipped"].rows == (
        ("a <b>", "no need", "2.5 MB before compression"),
        ("rays", "none asked", "1,200 rays"),
    )
    assert ("software", "mitsuba 3.9.1") in rows["data"]
    assert ("identity", full.dataset.manifest.identity) in rows["data"]


def test_smoothing_is_said_and_can_be_left_out(full: Outcome, page: str, tmp_path: Path) -> None:
    """Fewer than two photons a voxel are smoothed; the slider shows them as they are too."""
    toggles = re.compile(r'name="light"[^>]*> ([^<]*)</label>')
    (width,) = set(re.findall(r"smoothed by ([\d.]+) px", page))
    assert 1 < float(width) < 4
    assert toggles.findall(page) == [
        f"photon counts, smoothed by {width} px",
        "photon counts as they are",
        "full light",
    ]
    assert f"by hand, 500 mm: after removal, smoothed by {width} px" in words_of(page)
    assert "--smoothing-px" not in words_of(page).split("How this was made")[1]
    page = page_of(full, tmp_path, smoothing_px=0)
    assert "smoothed" not in page
    assert toggles.findall(page) == ["photon counts", "full light"]
    assert "--smoothing-px 0" in words_of(page)


def test_the_command_makes_the_same_report(full: Outcome, page: str, tmp_path: Path) -> None:
    words = words_of(page)
    assert "pcii run d -o RESULTS --z-mm 500 --z-mm 700 --method 'by hand'" in words
    assert str(full.dataset.path.parent) not in words
    first, second = (each.split("How this was made")[0] for each in (page, page_of(full, tmp_path)))
    assert first == second  # dates and machines are below


def test_colours_without_samples_are_those_around() -> None:
    """A uniform grey scene has no tint at a depth at which all shifts are even."""
    grid = CameraGrid(rows=3, cols=3, pitch_mm=(5, 5), focal_mm=50, pixel_mm=0.05, height=16, width=16)
    sections = reconstruct(PhotonCounts.from_dense(np.ones(grid.shape_KLHW, int), grid, cfa="GRBG"), 2500)
    assert (sections.coverage[0, 6:10, 6:10] == 0).any()
    for step in (1, 2, 3):
        estimate, _ = block_estimate(sections, 0, Crop(slice(2, 14), slice(2, 14), step))
        np.testing.assert_allclose(estimate[1:-1, 1:-1], 1)


def test_few_bright_voxels_do_not_set_the_exposure() -> None:
    """A corner that one view reaches has a mean as large as its only photon."""
    planes = FocalPlanes.at_depths(GRID, [500])
    counts, coverage = np.full((1, 40, 48, 1), 6), np.full((1, 40, 48, 1), 60)
    counts[0, :4], coverage[0, :4] = 1, 1  # a tenth of all voxels
    estimate = block_estimate(Sections(planes, counts, coverage), 0, Crop(slice(0, 40), slice(0, 48)))
    (image,) = encoded([estimate])
    assert (image[10:] == 255).all()


def test_errors_of_depth_and_their_scale(full: Outcome) -> None:
    error, limit = Shown.of(full).error_mm
    expected = np.where(IDS > 0, np.broadcast_to(np.linspace(-3, 5, 48), IDS.shape), np.nan)
    np.testing.assert_allclose(error, expected, atol=1e-9)
    inside = np.abs(error[np.isfinite(error)]) <= limit
    assert 0.9 < inside.mean() <= 1


def test_tables_can_be_scrolled_by_keyboard_and_pictures_have_words(page: str) -> None:
    tables = re.findall(r"<div class=\"wide\"([^>]*)>\s*<table", page)
    assert len(tables) == page.count("<table")
    assert all('tabindex="0"' in each and "aria-label" in each for each in tables)
    pictures = re.findall(r"<img [^>]*>", page)
    assert len(pictures) > 25
    assert all(re.search(r' alt="[^"]+"', each) for each in pictures)
    assert page.count('role="application"') == page.count('class="frame')
    assert '<html lang="en">' in page
