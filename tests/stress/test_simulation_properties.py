"""Properties of what simulates a sensor and its cameras, without a renderer."""

import numpy as np
import pytest
from camera_grids import grids
from hypothesis import given
from hypothesis import strategies as st

from simgen.cameras import as_rig, film_slopes, slopes_behind_lens
from simgen.sensor import fixed_totals
from simgen.spec import Lens, Photons

SEEDS = st.integers(0, 2**63 - 1)
SHARES = st.floats(0, 1)


@given(SEEDS, st.integers(1, 10**12), st.integers(1, 9), st.integers(-290, 290))
def test_a_scene_s_budget_is_shared_out_to_the_last_photon(seed, budget, views, power) -> None:
    energies = np.random.default_rng(seed).uniform(0, 1, (views, 1)) * 10.0**power
    photons = Photons(budget=budget, scope="scene", statistics="multinomial")
    totals = fixed_totals(photons, energies, np.random.default_rng(seed))
    assert totals is not None
    assert totals.sum() == budget
    none = fixed_totals(photons, 0 * energies, np.random.default_rng(seed))
    assert none is not None
    assert not none.any()


@given(grids, st.floats(-20, 20), st.floats(-20, 20), st.floats(1, 1e5))
def test_a_ray_through_a_point_of_the_film_leads_back_to_it(grid, row, col, z_mm) -> None:
    rig = as_rig(grid)
    for k, l in ((0, 0), (grid.rows - 1, grid.cols - 1)):
        camera = rig.camera(k, l)
        point = camera.position_mm + z_mm * camera.towards(np.array([row]), np.array([col]))
        from_middle = camera.film_px(point)[0]
        middle = np.array([(grid.width - 1) / 2, (grid.height - 1) / 2])
        np.testing.assert_allclose(from_middle + middle, [col, row], rtol=1e-6, atol=1e-5)


@given(grids, st.floats(0.1, 50), st.floats(10, 1e4), st.floats(-9, 9), st.floats(-9, 9), SHARES, SHARES)
def test_rays_of_a_lens_meet_where_it_is_in_focus(grid, aperture, focus, row, col, u, v) -> None:
    lens = Lens(aperture_mm=aperture, focus_mm=focus)
    chief = film_slopes(grid, row, col, (0.0, 0.0))
    point = ((u - 0.5) * aperture, (v - 0.5) * aperture)
    bent = slopes_behind_lens(chief, lens, point)
    for axis in (0, 1):
        assert point[axis] + focus * bent[axis] == pytest.approx(focus * chief[axis], abs=1e-9 * focus)
