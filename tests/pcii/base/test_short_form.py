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


@pytest.mark.filterwarnings("ignore:Glyph")
def test_values_say_what_they_are_in_a_line_and_show_what_plot_draws(tmp_path: Path) -> None:
    from matplotlib import pyplot

    dataset = open_dataset(write_dataset(tmp_path / "data", 1, {NESTED: 4, OWN: 5}))
    z_mm = np.full((8, 12), np.nan)
    z_mm[0, :6] = np.arange(500, 506)
    sections = reconstruct(dataset.counts, [1.0, 2.0])
    focus, depth = by_count(dataset.counts, sections), DepthMap(z_mm, np.zeros((8, 12)))
    before = pyplot.get_fignums()
    for value, words in (
        (dataset, "Dataset(name=data, shape=2 x 2 x 8 x 12, budgets=[20, 50], z_mm=[1, 2], has=[counts, "),
        (dataset.counts, "PhotonCounts(shape=2 x 2 x 8 x 12, cfa=mono, photons=121, storage=events)"),
        (dataset.truth, "Truth(shape=8 x 12, z_mm=1 to 2, objects=[near, far])"),
        (sections, f"photons={[int(plane.sum()) for plane in sections.counts]}"),
        (focus, "Segmented(method=by count, z_mm=[1, 2], shape=2 x 8 x 12, in_focus=[5.21%, 10.42%])"),
        (depth, "DepthMap(shape=8 x 12, answered=6.25%, z_mm=500 to 505)"),
        (score(focus, None, dataset.truth), "Score(methods=[by count], planes=4, objects=2)"),
    ):
        assert words in repr(value)
        assert len(repr(value)) < 120
        if page := getattr(value, "_repr_html_", str)():
            picture = page.split('<img src="data:image/png;base64,')[1].removesuffix('">')
            Image.open(io.BytesIO(base64.b64decode(picture))).verify()
    assert pyplot.get_fignums() == before
    views = Views(np.full((1, 2, 8, 12, 1), np.nan), unit_grid(1, 2, 8, 12))
    assert "<img" not in views._repr_html_()
    for name in NAMES:
        truth = Truth(np.ones((2, 3)), np.ones((2, 3), dtype=int), {1: name})
        assert visible(repr(truth)) == repr(truth)
        assert re.findall("<([^>]*)>", truth._repr_html_().partition("<img ")[0]) == ["pre", "/pre"]
