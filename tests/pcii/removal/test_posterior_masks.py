import numpy as np

from pcii.depth import depth_map_of, depth_posterior
from pcii.removal import masks_of, segment
from pcii.sections import reconstruct
from pcii.store import sample
from pcii.types import DepthPosterior, FocalPlanes


def test_a_block_belongs_to_the_most_probable_plane_or_to_none(two_squares):
    sections = reconstruct(two_squares.counts, two_squares.z_mm)
    h, w = (-(-size // 2) for size in two_squares.grid.shape_HW)
    planes = FocalPlanes.at_depths(two_squares.grid, two_squares.z_mm)
    in_focus = np.zeros((2, h, w), np.float32)
    in_focus[:, 0, :4] = [[0.6, 0.3, 0.2, 0.9], [0.3, 0.4, 0.1, 0.1]]
    is_detected = np.ones((h, w), bool)
    is_detected[0, 3] = False
    depths = np.full((2, h, w), 0.5, np.float32)
    no_surface = np.zeros((h, w), np.float32)
    posterior = DepthPosterior(planes, depths, no_surface, 2, in_focus, is_detected, is_detected)
    masks = masks_of(posterior, sections).in_focus
    assert masks[:, 0, :8:2].tolist() == [[True, False, False, False], [False, True, False, False]]
    assert masks.sum() == 8


def test_nothing_is_claimed_where_the_depth_map_has_no_answer():
    counts, z_mm, range_mm = sample().counts, [540, 620], (450, 750)
    posterior = depth_posterior(counts, range_mm, z_mm=FocalPlanes.at_depths(counts.grid, z_mm))
    focus = segment(counts, z_mm, z_range_mm=range_mm, method="posterior")
    claimed = focus.in_focus.any(axis=0)
    assert claimed.any()
    assert np.isfinite(depth_map_of(posterior, range_mm).z_mm[claimed]).all()
    np.testing.assert_array_equal(masks_of(posterior, focus.sections).in_focus, focus.in_focus)
