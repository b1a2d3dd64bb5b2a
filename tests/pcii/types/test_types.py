"""Bayer patterns, and what the central types refuse."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from twins import colour_of, unit_grid

from pcii.base import InputError
from pcii.sections import reconstruct
from pcii.types import (
    PATTERNS,
    DepthMap,
    FocalPlanes,
    PhotonCounts,
    Sections,
    Segmented,
    Truth,
    Views,
    colour_cells,
    colour_index,
    mosaic,
)

NAN = float("nan")


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        *(("rows", value, "at least 1") for value in (0, 2.0)),
        *(("focal_mm", value, "above 0 mm") for value in (0, NAN)),
        ("pitch_mm", 5.0, "above 0 mm"),
        ("shear_px", (1.0, NAN), "numbers"),
    ],
)
def test_a_camera_grid_that_cannot_be_is_refused_by_name(name, value, words):
    with pytest.raises(InputError, match=f"^{name}: .*{words}"):
        replace(unit_grid(2, 3, 4, 6), **{name: value})


FILM = unit_grid(1, 1, 2, 2)
ONES, IDS = np.ones((2, 2)), np.zeros((2, 2), dtype=int)
STACK, MASKS = np.zeros((1, 2, 2, 1)), np.zeros((1, 2, 2), dtype=bool)


def sections() -> Sections:
    return Sections(FocalPlanes.at_depths(FILM, 1.0), STACK, STACK)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Views(np.zeros((1, 1, 2, 3, 3)), FILM), "radiance: expected shape"),
        (lambda: Views(np.zeros((1, 1, 2, 2, 3)), FILM, cfa="GRBG"), "radiance: a Bayer mosaic has one"),
        (lambda: Views(np.ones((1, 1, 2, 2, 1), ">u2"), FILM), "radiance: .*sRGB"),
        (lambda: Sections(FocalPlanes.at_depths(FILM, [1.0, 2.0]), STACK, STACK), "counts: "),
        (lambda: Segmented(MASKS * 1.0, "none", sections()), "in_focus: expected bool"),
        (lambda: DepthMap(ONES, ONES[:1]), "z_mm, confidence: "),
        (lambda: Truth(ONES * NAN, IDS, {}), "z_mm: true depths are above 0 mm and never NaN"),
        (lambda: Truth(ONES, IDS + 2, {1: "ball"}), "object_id: id 2 has no name"),
        (lambda: Truth(ONES, IDS, {}, coverage=ONES), r"coverage: expected float32 \(2, 2\)"),
        (lambda: PhotonCounts.from_dense(IDS, {"rows": 1}), "grid: expected a CameraGrid, got dict"),  # type: ignore[arg-type]
        (lambda: reconstruct(IDS, [1.0]), r"data: expected PhotonCounts or Views .*, got ndarray"),  # type: ignore[arg-type]
    ],
)
def test_what_does_not_fit_is_refused_by_name(make, words):
    with pytest.raises(InputError, match=f"^{words}"):
        make()


def test_no_array_of_a_result_can_be_written_to():
    grid = unit_grid(1, 2, 2, 2)
    sections = reconstruct(PhotonCounts.from_dense(np.ones(grid.shape_KLHW, dtype=int), grid), 1.0)
    focus = Segmented(np.ones((1, 2, 2), dtype=bool), "none", sections)
    depth = DepthMap(np.ones((2, 2)), np.ones((2, 2)))
    truth = Truth(np.ones((2, 2)), np.zeros((2, 2), dtype=int), {})
    views = Views(np.ones((*grid.shape_KLHW, 1)), grid)
    arrays = (sections.counts, sections.coverage, sections.estimate, sections.z_mm, focus.in_focus)
    more = (depth.z_mm, depth.confidence, truth.z_mm, truth.object_id, views.radiance)
    assert not any(np.asarray(a).flags.writeable for a in (*arrays, *more))


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_view_with_nan_or_infinity_is_refused_by_its_place(bad):
    radiance = np.zeros((2, 2, 3, 3, 1))
    radiance[1, 0, 2, 2] = bad
    views = Views(radiance, unit_grid(2, 2, 3, 3))
    np.testing.assert_array_equal(views.view(0, 1), np.zeros((3, 3, 1)))
    with pytest.raises(InputError, match=r"view \(1, 0\) holds NaN or infinity"):
        reconstruct(views, 1.0)


R, G, B = 0, 1, 2


@pytest.mark.parametrize(("cfa", "cells"), [("GRBG", [[G, R], [B, G]]), (None, [[0, 0], [0, 0]])])
def test_a_pattern_is_named_by_its_first_two_rows(cfa, cells):
    np.testing.assert_array_equal(colour_cells(cfa), cells)


@given(
    cfa=st.sampled_from(PATTERNS), height=st.integers(1, 7), width=st.integers(1, 7), seed=st.integers(0, 9)
)
def test_a_mosaic_keeps_the_colour_that_each_pixel_sees(cfa, height, width, seed):
    rgb = np.random.default_rng(seed).integers(0, 1000, size=(2, height, width, 3))
    raw, colours = mosaic(rgb, cfa), colour_index(height, width, cfa)
    for i, j in np.ndindex(height, width):
        assert colours[i, j] == colour_of(i, j, cfa)
        np.testing.assert_array_equal(raw[:, i, j], rgb[:, i, j, colour_of(i, j, cfa)])


def test_what_is_no_mosaic_is_refused():
    with pytest.raises(InputError, match=r"^rgb: "):
        mosaic(np.zeros((4, 4, 4)), "GRBG")
    with pytest.raises(InputError, match=f"^cfa: .*'grbg'.* {', '.join(PATTERNS)}, or none"):
        colour_index(2, 2, "grbg")
