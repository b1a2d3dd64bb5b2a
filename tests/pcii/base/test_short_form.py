"""What values say of themselves: a line, and a table that shows names as text."""

import re
from pathlib import Path

import numpy as np
import pytest
from hostile_names import NAMES
from tiny_datasets import NESTED, OWN, by_count, write_dataset

from pcii.base.plain_text import visible
from pcii.base.short_form import listed
from pcii.core.estimates import DepthMap
from pcii.core.images import Views
from pcii.core.photon_counts import PhotonCounts
from pcii.core.truth import PhotonTruth, Truth
from pcii.io.dataset import open_dataset
from pcii.metrics.scoring import score
from pcii.sections.reconstruction import reconstruct


@pytest.fixture
def values(tmp_path: Path) -> list[tuple[object, str]]:
    """A value of each kind, and what it says."""
    dataset = open_dataset(write_dataset(tmp_path / "data", 1, {NESTED: 4, OWN: 5}))
    counts, truth = dataset.counts, dataset.truth
    assert truth is not None
    sections = reconstruct(counts, [1.0, 2.0])
    focus = by_count(counts, sections)
    z_mm = np.full((8, 12), np.nan)
    z_mm[0, :6] = np.arange(500, 506)
    depth = DepthMap(z_mm, np.zeros((8, 12)))
    photons = PhotonTruth(*np.ones((6, 5), dtype=int))
    views = Views(np.zeros((*dataset.grid.shape_KLHW, 1)), dataset.grid, "GRBG")
    dense = PhotonCounts.from_dense(np.ones(dataset.grid.shape_KLHW, int), dataset.grid, cfa="RGGB")
    kept = int(sections.counts.sum())
    return [
        (
            dataset,
            "Dataset(name=data, shape=2 x 2 x 8 x 12, budgets=[20, 50], z_mm=[1, 2], has=[counts, truth])",
        ),
        (counts, "PhotonCounts(shape=2 x 2 x 8 x 12, photons=121, kept=events)"),
        (dense, "PhotonCounts(shape=2 x 2 x 8 x 12, cfa=RGGB, photons=384, kept=dense)"),
        (counts.events, "PhotonEvents(events=111, photons=121)"),
        (truth, "Truth(shape=8 x 12, z_mm=1 to 2, objects=[near, far])"),
        (photons, "PhotonTruth(photons=5, objects=1)"),
        (views, "Views(shape=2 x 2 x 8 x 12 x 1, cfa=GRBG)"),
        (sections, f"Sections(z_mm=[1, 2], shape=2 x 8 x 12 x 1, photons={kept}, subpixel=1)"),
        (focus, "Segmented(method=by count, z_mm=[1, 2], shape=2 x 8 x 12, in_focus=[5.21%, 10.42%])"),
        (depth, "DepthMap(shape=8 x 12, answered=6.25%, z_mm=500 to 505)"),
        (score(focus, None, truth), "Score(methods=[by count], planes=4, objects=2)"),
    ]


def test_each_value_says_what_it_is_in_a_line(values: list[tuple[object, str]]) -> None:
    assert [repr(value) for value, _ in values] == [line for _, line in values]
    for value, line in values:
        page = value._repr_html_()  # type: ignore[attr-defined]
        assert page.startswith("<table><caption>")
        assert len(line) < 120


def test_a_score_shows_its_planes(values: list[tuple[object, str]]) -> None:
    page = values[-1][0]._repr_html_()  # type: ignore[attr-defined]
    assert page.count("<tr>") == 1 + 4
    assert "<td>1</td><td>by count</td><td>object</td><td>near</td><td>0.5</td>" in page
    assert "<td>–</td>" in page  # no object is named by pixel


def test_names_of_strangers_show_as_text_on_one_line() -> None:
    shape = (2, 3)
    for name in NAMES:
        truth = Truth(np.ones(shape), np.ones(shape, dtype=int), {1: name})
        assert len(repr(truth)) < 120
        assert visible(repr(truth)) == repr(truth)
        for tag in set(re.findall("</?([^>]*)>", truth._repr_html_())):
            assert tag in ("table", "caption", "tr", "th", "td")


def test_nothing_seen_has_no_depth() -> None:
    depth = DepthMap(np.full((1, 1), np.nan), np.zeros((1, 1)))
    truth = Truth(np.full((1, 1), np.inf), np.zeros((1, 1), int), {})
    assert repr(depth) == "DepthMap(shape=1 x 1, answered=0.00%)"
    assert repr(truth) == "Truth(shape=1 x 1, objects=[])"


def test_long_lists_tell_their_ends() -> None:
    assert listed([540.0, 540.25, 620]) == "[540, 540.25, 620]"
    assert listed(list(range(450, 480))) == "[450 .. 479: 30 in all]"
