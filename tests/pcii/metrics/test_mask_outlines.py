"""Outlines within pixels: discs and straight edges of known place."""

import numpy as np
import pytest
from twins import paper_grid

from pcii.metrics import boundary_f, object_share, score
from pcii.sections import reconstruct
from pcii.types import PhotonCounts, Segmented, Truth


def half_plane(edge_px: float, height: int = 20, width: int = 30) -> np.ndarray:
    """Share of each pixel that is left of the column `edge_px`; pixel j spans j - 1/2 to j + 1/2."""
    row = np.clip(edge_px - (np.arange(width) - 0.5), 0, 1)
    return np.tile(row, (height, 1))


def mask_of(share: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mask, ids and coverage as first hits give them, of an object with this share of each pixel."""
    mask = share > 0.5
    return mask, mask.astype(np.int16), np.where(mask, share, 1 - share).astype(np.float32)


@pytest.mark.parametrize("edge_px", [10.0, 10.2, 10.49, 10.51, 10.8])
def test_the_share_of_a_mask_is_given_back(edge_px: float) -> None:
    share = half_plane(edge_px)
    np.testing.assert_allclose(object_share(*mask_of(share)), share, atol=1e-6)


def test_what_is_beside_another_object_of_the_mask_is_no_edge() -> None:
    mask, ids, coverage = mask_of(half_plane(10.2))
    both = object_share(np.ones_like(mask), ids + 1, coverage)
    np.testing.assert_allclose(both, 1, atol=1e-6)
    neither = object_share(np.zeros_like(mask), ids + 1, coverage)
    assert (neither == 0).all()


def test_a_shift_of_an_outline_by_a_tenth_of_a_pixel_shows() -> None:
    # A claimed edge between the columns 12 and 13, at 12.5: 2.05 px from 10.45, 1.95 px from 10.55.
    claimed = half_plane(12.5) > 0.5
    for edge_px, expected in ((10.45, 0.0), (10.55, 1.0)):
        true, _, _ = mask_of(half_plane(edge_px))
        assert boundary_f(claimed, true, half_plane(edge_px)) == expected


def test_masks_without_an_outline_and_films_of_one_pixel() -> None:
    square = np.zeros((9, 9), dtype=bool)
    square[3:6, 3:6] = True
    empty = np.zeros_like(square)
    assert boundary_f(square, empty, empty.astype(float)) == 0.0
    assert boundary_f(square, square, square.astype(float)) == 1.0
    row = np.array([[True, True, False, False, False, False, False, False]])
    assert boundary_f(row, row, row.astype(float)) == 1.0
    assert boundary_f(row, row[:, ::-1], row[:, ::-1].astype(float)) == 0.0


def test_the_score_uses_the_coverage_if_there_is_one() -> None:
    grid = paper_grid(20, 30)
    mask, ids, coverage = mask_of(half_plane(10.45))
    z = np.where(mask, 540.0, np.inf)
    counts = PhotonCounts.from_dense(np.ones(grid.shape_KLHW, dtype=np.int64), grid)
    claimed = (half_plane(12.5) > 0.5)[None]
    focus = Segmented(claimed, "by hand", reconstruct(counts, [540.0]))
    plain = score(focus, None, Truth(z, ids, {1: "edge"}))
    fine = score(focus, None, Truth(z, ids, {1: "edge"}, coverage=coverage))
    # In whole pixels the outlines are 2 px apart (columns 10 and 12), in truth 2.05 px.
    for coarse_row, fine_row in zip(plain.planes, fine.planes, strict=True):
        assert (coarse_row["boundary_f"], fine_row["boundary_f"]) == (1.0, 0.0)
        assert coarse_row["iou"] == fine_row["iou"]
