"""What pictures and `.plot()` show: the right values in the right places, bright enough to be seen."""

import io
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from matplotlib import style
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from mpl_toolkits.axes_grid1.anchored_artists import AnchoredSizeBar
from twins import unit_grid

import pcii
from pcii.figures import (
    DEPTH_COLOURS,
    accuracy_chart,
    calibration_chart,
    exposed,
    map_image,
    smoothed,
    smoothing_for,
)

GRID = unit_grid(3, 3, 12, 16, pitch_mm=(10.0, 5.0))
Z_MM = [1.0, 2.0]


@pytest.fixture(autouse=True)
def new_figures() -> Iterator[None]:
    from matplotlib import pyplot

    with mpl.rc_context({"backend": "agg"}):
        yield
        pyplot.close("all")


def photons(grid: pcii.CameraGrid, **at: int) -> pcii.PhotonCounts:
    """One photon, of camera (k, l) at pixel (i, j); none if no place is given."""
    dense = np.zeros(grid.shape_KLHW, dtype=int)
    if at:
        dense[at["k"], at["l"], at["i"], at["j"]] = 1
    return pcii.PhotonCounts.from_dense(dense, grid)


def picture(axes: Axes) -> np.ndarray:
    """The image that axes show, 8-bit RGB."""
    (image,) = axes.get_images()
    return np.asarray(image.get_array())


def colour_bar(axes: Any) -> Axes:
    """The axes of the only colour bar in a figure."""
    (bar,) = [each for each in axes.figure.axes if each.get_label() == "<colorbar>"]
    return bar


def test_a_photon_is_drawn_in_its_view_at_its_pixel() -> None:
    counts = photons(GRID, k=0, l=2, i=3, j=5)
    image = picture(counts.plot(view=(0, 2))[0])
    assert np.argwhere(image.any(axis=-1)).tolist() == [[3, 5]]
    assert not picture(counts.plot()[0]).any()
    radiance = np.zeros((3, 3, 12, 16, 3))
    radiance[0, 1, 2, 3] = 1, 0, 0
    views = pcii.Views(radiance, GRID)
    assert np.argwhere(picture(views.plot(view=(0, 1))[0])).tolist() == [[2, 3, 0]]


def test_truth_shows_depth_of_the_objects_and_their_names() -> None:
    z_mm, ids = np.full((12, 16), 3000.0), np.zeros((12, 16), int)
    z_mm[2:5, 3:6], ids[2:5, 3:6] = 540, 1
    z_mm[7:9, 9:12], ids[7:9, 9:12] = 620, 2
    depth, objects = pcii.Truth(z_mm, ids, {1: "ball", 2: "a$b"}).plot()
    assert max(colour_bar(depth).get_ylim()) < 700
    assert picture(depth)[0, 0].tolist() == picture(objects)[0, 0].tolist() == [128] * 3
    legend = objects.get_legend()
    assert [text.get_text() for text in legend.get_texts()] == ["ball", r"a\$b"]
    for patch, (i, j) in zip(legend.get_patches(), ((3, 4), (7, 9)), strict=True):
        np.testing.assert_allclose(picture(objects)[i, j], 255 * np.array(patch.get_facecolor()[:3]), atol=1)


@pytest.mark.parametrize("size", [(1, 1, 1, 1), (1, 3, 1, 9), (2, 2, 12, 16)])
def test_hardly_any_data_is_drawn_without_a_warning(size: tuple[int, int, int, int]) -> None:
    grid, film = unit_grid(*size), size[2:]
    dense = np.zeros(grid.shape_KLHW, dtype=int)
    dense[0, 0, 0, 0] = film == (1, 1)
    counts = pcii.PhotonCounts.from_dense(dense, grid, cfa="GRBG")
    sections = pcii.reconstruct(counts, Z_MM)
    depth = pcii.DepthMap(np.full(film, 1.0 if dense.any() else np.nan), np.ones(film))
    nothing = pcii.Truth(np.full(film, np.inf), np.zeros(film, int), {})
    focus = pcii.Segmented(sections.counts.sum(axis=-1) > 0, "any", sections)
    for value in (counts, sections, depth, nothing, focus, pcii.Views(np.zeros((*size, 3)), grid)):
        value.plot()[0].figure.draw_without_rendering()


def test_charts_draw_means_with_intervals_and_bins_on_their_places() -> None:
    values: dict[str, Any] = {"photons_per_view": [10, 100, 10, None], "seconds": [1.0, 2, 3, 4], "n": 3}
    values |= {"mean": [0.5, 0.75, 0.25, 0.9], "low": [0.25, 0.75, 0.25, 0.9], "high": [1.0, 0.75, 0.25, 0.9]}
    means = pd.DataFrame({"method": ["a", "a", "b", "b"]} | values)
    figure: Any = accuracy_chart(means, ["b", "a"], "IoU", is_share=True)
    by_photons, by_seconds = figure.axes
    b, _, _, a, _, _ = (np.asarray(line.get_xydata()).tolist() for line in by_photons.lines)
    assert a == [[10, 0.5], [100, 0.75]]
    assert b == [[10, 0.25]]  # full light has no number of photons
    _, bars = (each for each in by_photons.collections if isinstance(each, LineCollection))
    assert bars.get_segments()[0].tolist() == [[10, 0.25], [10, 1]]
    assert np.shape(by_seconds.lines[0].get_xydata()) == (2, 2)
    figure.draw_without_rendering()
    assert accuracy_chart(means.iloc[:0], ["a"], "IoU", is_share=True) is None
    bins = pd.DataFrame([{"method": "a", "light": "x", "confidence": 0.9, "correct": 0.8, "share": 1.0}])
    (panel,) = calibration_chart(bins, ["b", "a"]).axes
    assert panel.collections[0].get_offsets().tolist() == [[0.9, 0.8]]  # type: ignore[union-attr]


def test_paper_style_has_scale_bars_in_mm_of_each_depth_and_is_written_as_pdf_and_svg() -> None:
    grid = replace(unit_grid(3, 3, 12, 100), pixel_mm=0.5)  # at 1 mm a pixel is 0.5 mm wide
    counts = pcii.PhotonCounts.from_dense(np.ones(grid.shape_KLHW, int), grid)
    sections = pcii.reconstruct(counts, [1.0, 10.0])
    focus = pcii.Segmented(np.zeros((2, 12, 100), bool), "by hand", sections)
    depth = pcii.DepthMap(np.full((12, 100), 9.0), np.ones((12, 100)))
    with style.context("dark_background"):
        panels = [*sections.plot(style="paper"), *focus.plot(style="paper"), *depth.plot(style="paper")]
    labels = []
    for axes in panels:
        (bar,) = (each for each in axes.artists if isinstance(each, AnchoredSizeBar))
        labels.append(bar.txt_label.get_text())
        assert axes.figure.get_facecolor() == (1, 1, 1, 1)
        assert axes.get_xlabel() == ""
    assert labels == ["10 mm", "100 mm"] * 2 + ["20 px"]
    for suffix, start in (("pdf", b"%PDF"), ("svg", b"<?xml")):
        panels[0].figure.savefig(file := io.BytesIO(), format=suffix)
        assert file.getvalue().startswith(start)
    with pytest.raises(pcii.InputError, match="style: expected"):
        sections.plot(style="print")


@pytest.mark.parametrize("per_pixel", [0.02, 0.2, 1.5])
def test_few_photons_of_a_bright_scene_are_smoothed_until_they_are_bright(per_pixel: float) -> None:
    counts = np.random.default_rng(3).poisson(per_pixel / 3, (200, 240, 3))
    samples = np.ones_like(counts)
    sigma = smoothing_for([counts, counts])
    (image,) = exposed([(counts, samples)], 1, sigma)
    assert np.median(image) > 150
    (raw,) = exposed([(counts, samples)], 1)
    assert np.median(raw) == 0
    # Its noise is that of the photons which are said to be under the Gaussian.
    sums, _ = smoothed(counts, samples, sigma)
    middle = sums[40:-40, 40:-40].sum(axis=-1)  # some 150 independent places at the fewest photons
    assert middle.std() / middle.mean() == pytest.approx(80**-0.5, rel=0.25)


def test_depth_is_brighter_the_nearer_and_paler_the_less_sure() -> None:
    z_mm = np.array([[400.0, 500.0, 600.0]])
    sure = map_image(z_mm, DEPTH_COLOURS, (400, 600), np.ones((1, 3)))
    np.testing.assert_array_equal(sure, map_image(z_mm, DEPTH_COLOURS, (400, 600)))
    assert (np.diff(sure.sum(axis=-1, dtype=int)[0]) < 0).all()
    unsure = map_image(z_mm, DEPTH_COLOURS, (400, 600), np.full((1, 3), 0.5))
    np.testing.assert_allclose(unsure, (sure + 255.0) / 2, atol=1)
