import numpy as np
from twins import unit_grid

from pcii.depth.posterior_depth import PosteriorDepth
from pcii.removal.methods import segment
from pcii.removal.posterior_masks import PosteriorMasks
from pcii.types.estimates import DepthPosterior
from pcii.types.focal_planes import FocalPlanes


def test_a_plane_has_what_is_nearer_to_it_than_to_the_next_and_within_reach():
    total_px = np.arange(20.0, 61.0)
    grid = unit_grid(5, 5, 2, 2)
    probability = np.zeros((total_px.size, 1, 1), np.float32)
    probability[:, 0, 0] = 0.5 ** np.arange(1, total_px.size + 1)
    planes = FocalPlanes.at_total_disparity(grid, total_px)
    posterior = DepthPosterior(planes, probability, 1 - probability.sum(axis=0), 2)
    near = PosteriorMasks(within_px=10.0).in_focus_probability(posterior, np.array([55.0, 22.0, 28.0, 22.0]))
    of = dict(zip(total_px, probability[:, 0, 0], strict=True))
    expected = [
        sum(of[px] for px in total_px if low < px <= high)
        for low, high in ((45, 65), (12, 25), (25, 38), (12, 25))
    ]
    np.testing.assert_allclose(near[:, 0, 0], expected, rtol=1e-5)


def test_nothing_is_claimed_where_the_depth_map_has_no_answer(two_squares):
    method = PosteriorMasks()
    near_mm, far_mm = method.range_mm(FocalPlanes.at_depths(two_squares.grid, two_squares.z_mm))
    depth = PosteriorDepth()(two_squares.counts, (near_mm, far_mm))
    focus = segment(two_squares.counts, two_squares.z_mm, method="posterior")
    claimed = focus.in_focus.any(axis=0)
    assert claimed.any()
    assert np.isfinite(depth.z_mm[claimed]).all()
    assert (focus.steps["probability"][focus.in_focus] > 0.5).all()
