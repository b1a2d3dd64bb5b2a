"""What a grid of cameras does to depth, by hand and beside the reconstruction."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from twins import paper_grid

from pcii.sections import reconstruct
from pcii.types import CameraGrid, PhotonCounts
from simgen.cameras import apart_px, mending_pitch_mm, share_seen_by_all, shares_without


def at_disparity(pixels: float, **more: Any) -> tuple[CameraGrid, float]:
    """A grid and a depth with so many px of disparity per camera in both axes."""
    grid = CameraGrid(rows=4, cols=4, pitch_mm=(5.0, 5.0), focal_mm=50.0, pixel_mm=0.05, height=32, width=32)
    return replace(grid, **more), 5000 / pixels


def test_objects_of_the_paper_are_15_px_of_blur_apart() -> None:
    grid = paper_grid()
    by_hand = 9 * (50 * 5 / 0.0352) * (1 / 540 - 1 / 620)
    assert apart_px(grid, 540, 620) == pytest.approx(by_hand)
    # The longer axis decides, be it of columns or of rows.
    assert apart_px(replace(grid, rows=2), 540, 620) == pytest.approx(by_hand)
    assert apart_px(replace(grid, rows=2, pitch_mm=(5.0, 90.0)), 540, 620) == pytest.approx(2 * by_hand)


def test_views_overlap_by_hand() -> None:
    grid, z = at_disparity(4.0, cols=3)
    # By 6, 2, 2 and 6 px up or down, and by 4, 0 and 4 px to the side.
    assert share_seen_by_all(grid, z) == (32 - 12) / 32 * (32 - 8) / 32


@pytest.mark.parametrize("cfa", ["GRBG", "RGGB", "BGGR", "GBRG"])
@pytest.mark.parametrize("pixels", [0.5, 1.0, 2.3, 2.5, 4.0])  # a half pixel is the hard case
def test_missing_colours_and_overlap_are_those_of_the_reconstruction(cfa: str, pixels: float) -> None:
    grid, z = at_disparity(pixels, rows=3, cols=5, shear_px=(0.3, -0.7))
    empty = PhotonCounts.from_dense(np.zeros(grid.shape_KLHW, int), grid, cfa=cfa)
    coverage = reconstruct(empty, z_mm=z).coverage[0]
    middle = coverage[16:18, 16:18]  # rows and columns 0 and 1 modulo 2
    np.testing.assert_array_equal(shares_without(grid, cfa, z), (middle == 0).mean(axis=(0, 1)))
    assert share_seen_by_all(grid, z) == pytest.approx((coverage.sum(axis=-1) == grid.view_count).mean())


def test_even_shifts_leave_colours_out_and_another_pitch_mends_it() -> None:
    grid, z = at_disparity(4.0)
    np.testing.assert_array_equal(shares_without(grid, "GRBG", z), [0.75, 0.5, 0.75])
    row, z_row = at_disparity(3.0, rows=1)  # columns mix, rows do not: two colours a row
    np.testing.assert_array_equal(shares_without(row, "GRBG", z_row), [0.5, 0, 0.5])
    pitch: Any = mending_pitch_mm(grid, [z])
    assert not shares_without(replace(grid, pitch_mm=pitch), "GRBG", z).any()
    assert abs(pitch[0] - 5) < 1  # 4 px +- 1/3 mix four cameras: shifts of 6.5 px, say, round to 7
    assert mending_pitch_mm(replace(grid, rows=1), [z]) is None
