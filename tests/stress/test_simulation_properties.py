"""Properties of what simulates a sensor and its cameras, without a renderer."""

import numpy as np
import pytest
from camera_grids import grids
from hypothesis import given
from hypothesis import strategies as st
from twins import unit_grid

from pcii.types import PATTERNS, CameraGrid, channel_count
from simgen.cameras import as_rig, disparities, film_slopes, slopes_behind_lens, with_larger_pixels
from simgen.photons import ranks_in_scopes
from simgen.photons.candidates import even_film_points
from simgen.sensor import PhotonTable, draw_counts, fixed_totals, full_light_image, nested_subset
from simgen.spec import FullLight, Lens, Photons, Sensor

GRID = unit_grid(2, 2, 4, 5)
SEEDS = st.integers(0, 2**63 - 1)
SHARES = st.floats(0, 1)


def photons_of(seed: int, number: int, most: int = 1, scopes: int = 0) -> PhotonTable:
    """Photons anywhere, in the order of their scopes if they have any."""
    rng = np.random.default_rng(seed)
    k, l, i, j = (rng.integers(0, size, number) for size in GRID.shape_KLHW)
    scope = np.sort(rng.integers(0, scopes, number)) if scopes else None
    rank = None if scope is None else ranks_in_scopes(scope)
    return PhotonTable(k, l, i, j, rng.integers(1, most + 1, number), scope, rank)


def film_of(table: PhotonTable) -> np.ndarray:
    film = np.zeros(GRID.shape_KLHW, np.int64)
    np.add.at(film, (table.k, table.l, table.i, table.j), table.n)
    return film


# The sensor


@given(SEEDS, st.integers(1, 80), st.integers(1, 5), st.data())
def test_a_smaller_budget_is_the_first_of_the_larger(seed, number, scopes, data) -> None:
    small, large = sorted(data.draw(st.tuples(st.integers(1, 50), st.integers(51, 99))))
    photons = Photons(budget=large, nested=(small,), statistics="multinomial")
    table = photons_of(seed, number, scopes=scopes)
    belongs = nested_subset(table, table, photons, small, seed)
    assert table.scope is not None
    for scope in range(scopes):
        assert belongs[table.scope == scope].sum() == min(small, (table.scope == scope).sum())


@given(SEEDS, st.sampled_from([*PATTERNS, None]), st.integers(0, 10**12))
def test_fixed_totals_are_drawn_exactly(seed: int, cfa: str | None, total: int) -> None:
    rng = np.random.default_rng(seed)
    rates = rng.uniform(0.01, 1, (6, 7)) * 10.0 ** rng.integers(-200, 200)
    for totals in (np.array([total]), np.full(channel_count(cfa), total)):
        counts = draw_counts(rates, cfa, rng, totals)
        assert counts.sum() == totals.sum()
        assert (counts >= 0).all()


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


@given(
    SEEDS,
    st.floats(1, 1e6),
    st.floats(0, 100),
    st.integers(1, 24),
    st.floats(0, 1e6),
    st.sampled_from([1, 3]),
)
def test_full_light_is_finite_and_no_brighter_than_the_full_well(
    seed: int, well: float, noise: float, bits: int, level: float, channels: int
) -> None:
    light = FullLight(full_well_e=well, read_noise_e=noise, adc_bits=bits)
    radiance = np.full((3, 4, channels), level)
    rng = np.random.default_rng(seed)
    image = full_light_image(radiance, "RGGB" if channels == 1 else None, 2.0, Sensor(full_light=light), rng)
    assert np.isfinite(image).all()
    assert (image >= 0).all()
    assert (image <= well / 2.0 * (1 + 1e-6)).all()


# Cameras


@given(grids, st.floats(1.0, 1e6), st.sampled_from([*PATTERNS, None]))
def test_every_camera_gives_each_voxel_one_colour(grid: CameraGrid, z_mm: float, cfa: str | None) -> None:
    found = disparities.colour_samples(grid, cfa, z_mm)
    assert (found.sum(axis=-1) == grid.view_count).all()
    assert 0 <= disparities.share_seen_by_all(grid, z_mm) <= 1
    without = disparities.shares_without(grid, cfa, z_mm)
    assert ((without >= 0) & (without <= 1)).all()


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


# Photons to be drawn


@given(grids, st.integers(1, 500), SEEDS)
def test_points_of_the_film_are_on_the_film(grid: CameraGrid, number: int, seed: int) -> None:
    view, i, j = even_film_points(grid, number, seed)
    assert ((i >= 0) & (i < grid.height) & (j >= 0) & (j < grid.width)).all()
    assert ((view >= 0) & (view < grid.view_count)).all()
    assert number / 2 - 1 <= view.size <= 2 * number + 1


# What people write


@given(grids, st.floats(1, 50), st.integers(1, 8))
def test_larger_pixels_keep_the_disparity_in_mm(grid: CameraGrid, scale: float, least: int) -> None:
    coarse = with_larger_pixels(grid, scale, least_px=least)
    assert min(coarse.height, coarse.width) >= least
    fine, other = (np.array(disparities.disparities_px(g, 777.0)) * g.pixel_mm for g in (grid, coarse))
    np.testing.assert_allclose(fine, other, rtol=1e-9, atol=1e-9)
