"""What values say of themselves: a line, and for notebooks a picture."""

import base64
import io
import re
from pathlib import Path

import numpy as np
import pytest
from hostile_names import NAMES
from PIL import Image
from tiny_datasets import NESTED, OWN, by_count, write_dataset
from twins import unit_grid

from pcii.base import visible
from pcii.metrics import score
from pcii.sections import reconstruct
from pcii.store import open_dataset
from pcii.types import DepthMap, Truth, Views


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
    photons_by_plane = [int(plane.sum()) for plane in sections.counts]
    return [
        (
            dataset,
            "Dataset(name=data, shape=2 x 2 x 8 x 12, budgets=[20, 50], z_mm=[1, 2], has=[counts, truth])",
        ),
        (counts, "PhotonCounts(shape=2 x 2 x 8 x 12, cfa=mono, photons=121, storage=events)"),
        (truth, "Truth(shape=8 x 12, z_mm=1 to 2, objects=[near, far])"),
        (sections, f"Sections(z_mm=[1, 2], shape=2 x 8 x 12 x 1, photons={photons_by_plane}, subpixel=1)"),
        (focus, "Segmented(method=by count, z_mm=[1, 2], shape=2 x 8 x 12, in_focus=[5.21%, 10.42%])"),
        (depth, "DepthMap(shape=8 x 12, answered=6.25%, z_mm=500 to 505)"),
        (score(focus, None, truth), "Score(methods=[by count], planes=4, objects=2)"),
    ]


def test_each_value_says_what_it_is_in_a_line(values: list[tuple[object, str]]) -> None:
    assert [repr(value) for value, _ in values] == [line for _, line in values]
    assert all(len(line) < 120 for _, line in values)


@pytest.mark.filterwarnings("ignore:Glyph")
def test_notebooks_show_what_plot_draws_and_names_as_text(values: list[tuple[object, str]]) -> None:
    from matplotlib import pyplot

    before = pyplot.get_fignums()
    for value, _ in values:
        if hasattr(value, "_repr_html_"):
            _, page = value._repr_html_().split('<img src="data:image/png;base64,')  # type: ignore[attr-defined]
            Image.open(io.BytesIO(base64.b64decode(page.removesuffix('">')))).verify()
    assert pyplot.get_fignums() == before
    views = Views(np.full((1, 2, 8, 12, 1), np.nan), unit_grid(1, 2, 8, 12))
    assert "<img" not in views._repr_html_()
    for name in NAMES:
        truth = Truth(np.ones((2, 3)), np.ones((2, 3), dtype=int), {1: name})
        assert visible(repr(truth)) == repr(truth)
        assert re.findall("<([^>]*)>", truth._repr_html_().partition("<img ")[0]) == ["pre", "/pre"]
