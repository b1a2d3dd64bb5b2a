"""What values say of themselves: a line, and for notebooks a table and a picture."""

import base64
import io
import re
from pathlib import Path

import numpy as np
import pytest
from hostile_names import NAMES
from matplotlib import pyplot
from PIL import Image
from tiny_datasets import NESTED, OWN, by_count, write_dataset

from pcii.base.plain_text import visible
from pcii.metrics.scoring import score
from pcii.sections.reconstruction import reconstruct
from pcii.store.dataset import open_dataset
from pcii.types.estimates import DepthMap
from pcii.types.truth import Truth


def test_values_say_what_they_are_in_a_line_and_show_notebooks_what_plot_draws(tmp_path: Path) -> None:
    dataset = open_dataset(write_dataset(tmp_path / "data", 1, {NESTED: 4, OWN: 5}))
    sections = reconstruct(dataset.counts, [1.0, 2.0])
    focus = by_count(dataset.counts, sections)
    has = "has=[counts, truth]"
    lines = [
        (dataset, f"Dataset(name=data, shape=2 x 2 x 8 x 12, budgets=[20, 50], z_mm=[1, 2], {has})"),
        (dataset.counts, "PhotonCounts(shape=2 x 2 x 8 x 12, photons=121, storage=events)"),
        (dataset.truth, "Truth(shape=8 x 12, z_mm=1 to 2, objects=[near, far])"),
        (focus, "Segmented(method=by count, z_mm=[1, 2], shape=2 x 8 x 12, in_focus=[5.21%, 10.42%])"),
        (score(focus, None, dataset.truth), "Score(methods=[by count], planes=4, objects=2)"),
    ]
    for value, line in lines:
        assert repr(value) == line
        page, *pictures = value._repr_html_().split('<img src="data:image/png;base64,')
        assert page.startswith("<table><caption>")
        assert len(pictures) == hasattr(value, "plot")
        for picture in pictures:
            Image.open(io.BytesIO(base64.b64decode(picture.removesuffix('">')))).verify()
    assert not pyplot.get_fignums()


@pytest.mark.filterwarnings("ignore:Glyph")
def test_names_of_strangers_show_as_text_on_one_line() -> None:
    shape = (2, 3)
    for name in NAMES:
        truth = Truth(np.ones(shape), np.ones(shape, dtype=int), {1: name})
        assert len(repr(truth)) < 120
        assert visible(repr(truth)) == repr(truth)
        table, _, picture = truth._repr_html_().partition("<img ")
        assert set(re.findall("</?([^>]*)>", table)) <= {"table", "caption", "tr", "td"}
        assert re.fullmatch('src="[a-zA-Z0-9/+=:;,]*">', picture)


def test_nothing_seen_has_no_depth() -> None:
    depth = DepthMap(np.full((1, 1), np.nan), np.zeros((1, 1)))
    truth = Truth(np.full((1, 1), np.inf), np.zeros((1, 1), int), {})
    assert repr(depth) == "DepthMap(shape=1 x 1, answered=0.00%)"
    assert repr(truth) == "Truth(shape=1 x 1, objects=[])"
