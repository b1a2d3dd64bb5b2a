"""What `.plot()` draws: the right values in the right places, for ordinary and for hardly any data."""

import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from twins import unit_grid

import pcii
from pcii.figures.object_maps import draw_objects, spread_out
from pcii.figures.panels import new_figure
from pcii.types.focal_planes import FocalPlanes

GRID = unit_grid(3, 3, 12, 16, pitch_mm=(10.0, 5.0))
Z_MM = [1.0, 2.0]


@pytest.fixture(autouse=True)
def new_figures() -> Iterator[None]:
    from matplotlib import pyplot

    with mpl.rc_context({"backend": "agg"}):
        yield
        pyplot.close("all")


def photons(grid: pcii.CameraGrid, cfa: str | None = None, **at: int) -> pcii.PhotonCounts:
    """One photon, of camera (k, l) at pixel (i, j); none if no place is given."""
    dense = np.zeros(grid.shape_KLHW, dtype=int)
    if at:
        dense[at["k"], at["l"], at["i"], at["j"]] = 1
    return pcii.PhotonCounts.from_dense(dense, grid, cfa=cfa)


def picture(axes: Axes) -> np.ndarray:
    """The image that axes show, 8-bit RGB."""
    (image,) = axes.get_images()
    return np.asarray(image.get_array())


def words(axes: Axes) -> str:
    texts = [axes.get_title(), axes.get_xlabel(), axes.get_ylabel(), *(t.get_text() for t in axes.texts)]
    return " | ".join(texts)


def test_cameras_stand_where_the_grid_says() -> None:
    (axes,) = GRID.plot()
    x, y = axes.collections[0].get_offsets().data.T  # type: ignore[union-attr]
    assert sorted(set(x)) == [-10, 0, 10]
    assert sorted(set(y)) == [-5, 0, 5]
    assert axes.yaxis_inverted()  # Y is down
    assert "baseline 20 mm" in words(axes)
    assert "baseline 10 mm" in words(axes)
    assert "X, right (mm)" in words(axes)


def test_a_photon_is_drawn_in_its_view_at_its_pixel() -> None:
    counts = photons(GRID, k=0, l=2, i=3, j=5)
    image = picture(counts.plot(view=(0, 2))[0])
    assert np.argwhere(image.any(axis=-1)).tolist() == [[3, 5]]
    assert not picture(counts.plot()[0]).any()
    assert "photons: 1" in counts.plot(view="mean")[0].get_title()
    assert picture(counts.plot(view="mean")[0]).any()


@pytest.mark.parametrize(("j", "channel"), [(4, 1), (5, 0)])
def test_means_of_a_mosaic_have_its_colours(j: int, channel: int) -> None:
    image = picture(photons(GRID, "GRBG", k=1, l=1, i=4, j=j).plot(view="mean")[0])
    assert image[4, j, channel] == 255
    assert not np.delete(image[4, j], channel).any()


def test_views_are_drawn_one_by_one() -> None:
    radiance = np.zeros((3, 3, 12, 16, 3))
    radiance[0, 1, 2, 3] = 1, 0, 0
    views = pcii.Views(radiance, GRID)
    assert np.argwhere(picture(views.plot(view=(0, 1))[0])).tolist() == [[2, 3, 0]]


def test_single_bright_voxels_do_not_darken_a_section() -> None:
    planes = FocalPlanes.at_depths(GRID, Z_MM)
    counts = np.full((2, 12, 16, 3), 10)
    counts[0, 0, 0] = 100_000
    coverage = np.full(counts.shape, 9)
    first, second = pcii.Sections(planes, counts, coverage).plot()
    assert (picture(first) == 255).all()
    assert (picture(second) == 255).all()
    assert "1 mm" in first.get_title()
    assert "2 mm" in second.get_title()


def test_sections_have_a_panel_each_and_of_very_many_some() -> None:
    counts = photons(GRID, k=1, l=1, i=4, j=4)
    shown = pcii.reconstruct(counts, np.linspace(1, 4, 31)).plot()
    assert len(shown) == 12
    assert [axes.get_title() for axes in shown[[0, -1]]] == ["section at 1 mm", "section at 4 mm"]


@pytest.mark.parametrize("subpixel", [1, 3])
def test_large_and_fine_sections_lie_over_the_pixels_of_a_view(subpixel: int) -> None:
    grid = unit_grid(1, 2, 400, 700)
    sections = pcii.reconstruct(photons(grid, k=0, l=0, i=0, j=0), [1.0], subpixel=subpixel)
    (axes,) = sections.plot()
    assert axes.get_xlim() == (-0.5, 699.5)
    assert axes.get_ylim() == (399.5, -0.5)
    assert max(picture(axes).shape) <= 320
    left, right, bottom, top = axes.get_images()[0].get_extent()
    block = (right - left) / picture(axes).shape[1]
    assert block == pytest.approx((bottom - top) / picture(axes).shape[0])
    assert right >= 699.5
    assert right - block < 699.5


def test_an_outline_follows_the_sides_of_the_mask() -> None:
    counts = photons(GRID, k=1, l=1, i=4, j=4)
    mask = np.zeros((2, 12, 16), dtype=bool)
    mask[0, 4, 6:8] = True
    first, second = pcii.Segmented(mask, "$by_hand$", pcii.reconstruct(counts, Z_MM)).plot()
    (lines,) = (one for one in first.collections if isinstance(one, LineCollection))
    ends = np.concatenate(lines.get_segments())
    assert ends.min(axis=0).tolist() == [5.5, 3.5]
    assert ends.max(axis=0).tolist() == [7.5, 4.5]
    assert len(lines.get_segments()) == 6
    assert not second.collections[0].get_segments()
    assert r"\$by_hand\$" in first.get_title()
    assert not picture(second).any()


def test_depth_is_greyer_where_less_sure_and_its_scale_is_in_mm() -> None:
    depth = pcii.DepthMap(np.full((12, 16), 600.0), np.linspace(0, 1, 16)[None].repeat(12, axis=0))
    (axes,) = depth.plot(z_range_mm=(500, 700))
    colourful = np.ptp(picture(axes).astype(int), axis=-1)[0]
    assert (np.diff(colourful) > 0).all()
    bar = axes.figure.axes[-1]
    assert bar.get_ylabel() == "depth z (mm)"
    assert sorted(bar.get_ylim()) == [500, 700]


def test_neither_an_outlying_depth_nor_rounding_sets_the_scale() -> None:
    z_mm = np.linspace(540, 620, 500).reshape(20, 25)
    z_mm[0, 0] = 1e6
    bar = pcii.DepthMap(z_mm, np.ones(z_mm.shape)).plot()[0].figure.axes[-1]
    assert 535 < min(bar.get_ylim()) < max(bar.get_ylim()) < 625
    flat = pcii.DepthMap(np.array([[540.0, 540.0001]]), np.ones((1, 2))).plot()[0].figure.axes[-1]
    assert sorted(flat.get_ylim()) == pytest.approx([539.5, 540.5], abs=1e-3)


def test_a_posterior_shows_a_pixel_or_all_entropies() -> None:
    planes = FocalPlanes.at_depths(GRID, Z_MM)
    probability = np.full((2, 6, 8), 0.25, dtype=np.float32)
    probability[:, 0, 0] = 0.9, 0.0
    no_surface = (1 - probability.sum(axis=0)).astype(np.float32)
    posterior = pcii.DepthPosterior(planes, probability, no_surface, 2)
    curve = posterior.plot(pixel=(1, 1))[0].lines[0]
    assert np.asarray(curve.get_xdata()).tolist() == Z_MM
    np.testing.assert_allclose(np.asarray(curve.get_ydata(), float), [0.9, 0], atol=1e-6)
    bits = posterior.entropy_bits()
    np.testing.assert_allclose(bits[0, :2], [-0.9 * np.log2(0.9) - 0.1 * np.log2(0.1), 1.5], atol=1e-5)
    (axes,) = posterior.plot()
    assert axes.get_images()[0].get_extent() == [-0.5, 15.5, 11.5, -0.5]
    assert axes.figure.axes[-1].get_ylabel() == "entropy (bits)"


def test_truth_shows_depth_of_the_objects_and_their_names() -> None:
    z_mm, ids = np.full((12, 16), 3000.0), np.zeros((12, 16), int)
    z_mm[2:5, 3:6], ids[2:5, 3:6] = 540, 1
    z_mm[7:9, 9:12], ids[7:9, 9:12] = 620, 2
    depth, objects = pcii.Truth(z_mm, ids, {1: "ball", 2: "a$b"}).plot()
    assert max(depth.figure.axes[-1].get_ylim()) < 700
    assert not picture(depth)[0, 0].any()
    assert [text.get_text() for text in objects.texts] == ["ball", r"a\$b"]  # left and right of the picture
    ends = [np.array(line.get_xydata())[0].tolist() for line in objects.lines[::2]]
    assert ends == [[4, 3], [9, 7]]
    colours = [picture(objects)[i, j].tolist() for i, j in ((0, 0), (3, 4), (7, 9))]
    assert len(set(map(tuple, colours))) == 3


def test_names_of_two_dozen_objects_do_not_overlap() -> None:
    names = {number: f"specimen_{number}" for number in range(1, 25)}
    object_id = np.zeros((240, 240), dtype=np.int16)
    rng = np.random.default_rng(2)
    for number in names:  # half of them in one corner
        i, j = rng.integers(0, 60 if number % 2 else 230, 2)
        object_id[i : i + 9, j : j + 9] = number
    figure = new_figure(9, 5, None)
    axes = figure.subplots()
    draw_objects(axes, object_id, names)
    figure.canvas.draw()
    boxes = [text.get_window_extent() for text in axes.texts]
    assert len(boxes) == len(np.unique(object_id)) - 1
    for number, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[number + 1 :])


def test_places_are_moved_apart_and_no_further_than_needed() -> None:
    np.testing.assert_allclose(spread_out(np.array([20.0, 50.0, 90.0]), 100), [20, 50, 90])
    np.testing.assert_allclose(spread_out(np.array([50.0, 50.0]), 100), [47.5, 52.5])  # 5 apart
    crowded = spread_out(np.full(30, 99.0), 100)
    np.testing.assert_allclose(np.diff(crowded), 100 / 30)
    assert crowded[0] > 0
    assert crowded[-1] < 100
    assert spread_out(np.zeros(0), 100).size == 0


def test_a_score_draws_what_it_has() -> None:
    planes = tuple(
        {"z_mm": z, "method": method, "object": "ball", "truth": truth, "iou": iou}
        for z, method, iou in ((540.0, "a", 0.5), (540.0, "b", 0.8), (620.0, "a", 0.0))
        for truth in ("object", "pixel")
    )
    bins = {"0.9-1.0": {"share": 1.0, "confidence": 0.95, "correct": 0.8}}
    depth = {"bad_1px": 0.2, "coverage": 0.9, "median_mm": 3.0, "reliability": bins}
    bounds = {"planes": [{"iou_oracle": 0.9}] * 6}
    masks, errors, confidence = pcii.Score(planes, (), depth, bounds=bounds).plot()
    assert [bar.get_width() for bar in masks.patches] == [0.5, 0.0, 0.8]  # type: ignore[attr-defined]
    assert [label.get_text() for label in masks.get_legend().get_texts()] == ["a", "b", "best by true depth"]
    assert "3 mm" in errors.get_title()
    assert confidence.collections[0].get_offsets().tolist() == [[0.95, 0.8]]  # type: ignore[union-attr]
    (nothing,) = pcii.Score((), (), {}).plot()
    assert "nothing is scored" in words(nothing)


def test_pictures_are_drawn_into_given_axes() -> None:
    from matplotlib.figure import Figure

    left, right = Figure().subplots(1, 2)
    counts = photons(GRID, k=1, l=1, i=4, j=4)
    assert counts.plot(left).tolist() == [left]
    assert pcii.reconstruct(counts, Z_MM).plot([left, right]).tolist() == [left, right]
    assert pcii.reconstruct(counts, 1.0).plot(right).tolist() == [right]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda counts: counts.plot(axes="left"), "axes: expected Matplotlib axes, got str"),
        (lambda counts: pcii.reconstruct(counts, Z_MM).plot(counts.plot()), "axes: 2 panels are drawn"),
        (lambda counts: counts.plot(view=(3, 0)), r"view: expected a camera \(k, l\) of 3 x 3, got \(3, 0\)"),
        (lambda counts: counts.plot(view="middle"), "view: expected a camera"),
        (lambda counts: counts.plot(view=(0, 0.5)), "view: expected a camera"),
    ],
)
def test_what_cannot_be_drawn_is_named(call: Any, message: str) -> None:
    with pytest.raises(pcii.InputError, match=message):
        call(photons(GRID))


@pytest.mark.parametrize("pixel", [(12, 0), (-1, 0), (0,), 3, (0.0, 1.0)])
def test_a_pixel_outside_the_view_is_refused(pixel: Any) -> None:
    planes = FocalPlanes.at_depths(GRID, Z_MM)
    posterior = pcii.DepthPosterior(planes, np.zeros((2, 12, 16), np.float32), np.ones((12, 16)), 1)
    with pytest.raises(pcii.InputError, match="pixel: "):
        posterior.plot(pixel=pixel)


@pytest.mark.parametrize(
    ("size", "lit"), [((1, 1, 1, 1), True), ((1, 3, 1, 9), False), ((2, 2, 12, 16), False)]
)
def test_hardly_any_data_is_drawn_without_a_warning(size: tuple[int, int, int, int], lit: bool) -> None:
    grid = unit_grid(*size)
    dense = np.zeros(grid.shape_KLHW, dtype=int)
    dense[0, 0, 0, 0] = lit
    counts = pcii.PhotonCounts.from_dense(dense, grid, cfa="GRBG")
    sections = pcii.reconstruct(counts, Z_MM)
    film = size[2:]
    depth = pcii.DepthMap(np.full(film, 1.0 if lit else np.nan), np.ones(film))
    nothing = pcii.Truth(np.full(film, np.inf), np.zeros(film, int), {})
    focus = pcii.Segmented(sections.counts.sum(axis=-1) > 0, "any", sections)
    values: list[Any] = [grid, counts, sections, depth, nothing, focus]
    values += [pcii.Views(np.zeros((*size, 3)), grid), pcii.score(focus, depth, nothing, grid=grid)]
    for value in values:
        axes = value.plot()
        assert isinstance(axes, np.ndarray)
        axes[0].figure.draw_without_rendering()


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e308, -1.0])
def test_numbers_that_are_no_light_are_drawn_without_a_warning(value: float) -> None:
    planes = FocalPlanes.at_depths(GRID, Z_MM)
    sections = pcii.Sections(planes, np.full((2, 12, 16, 3), value), np.ones((2, 12, 16, 3)))
    sections.plot()[0].figure.draw_without_rendering()
    assert sections._repr_html_().count("<img") == 1


def test_matplotlib_is_loaded_by_the_first_picture() -> None:
    script = (
        "import sys, pcii, numpy as np;"
        "grid = pcii.CameraGrid(rows=1, cols=2, pitch_mm=(1, 1), focal_mm=1, pixel_mm=1, height=2, width=2);"
        "counts = pcii.PhotonCounts.from_dense(np.ones(grid.shape_KLHW, int), grid);"
        "repr(counts); print('matplotlib' in sys.modules, 'PIL' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "False"]
