"""Properties of sections, photons, light and masks, for any numbers: see also every other `@given`."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from camera_grids import grids
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as nst
from twins import unit_grid, variance_of

import pcii
from pcii.sections import view_samples
from pcii.types import PATTERNS, FocalPlanes, Light, photon_rates, scope_energies
from simgen.cameras import as_rig
from simgen.dataset import fixed_totals
from simgen.spec import Lens, Photons

SMALL = unit_grid(2, 3, 4, 5, (1.3, 0.8))
DEPTHS = st.floats(0.3, 30)
SEEDS = st.integers(0, 2**32 - 1)


def film_of(grid: pcii.CameraGrid, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.poisson(rng.choice([0.05, 1.0, 1e4]), grid.shape_KLHW)


@given(nst.arrays(np.float64, (2, 3, 4, 5, 1), elements=st.floats(width=64)), DEPTHS)
def test_radiance_gives_finite_sections_or_is_refused(light: np.ndarray, z_mm: float) -> None:
    try:
        sections: Any = pcii.reconstruct(pcii.Views(light, SMALL), z_mm, variance=True)
    except pcii.InputError as fault:
        assert str(fault).startswith("radiance: ")  # noqa: PT017
        assert not np.isfinite(light).all() or np.abs(light).max() > 1e150  # its square is too large
        return
    assert np.isfinite(sections.estimate).all()
    assert np.isfinite(sections.variance).all()
    assert (sections.variance >= 0).all()


@given(SEEDS, st.sampled_from([*PATTERNS, None]), st.floats(1e-3, 1e12), st.integers(-1000, 900))
def test_expected_photons_add_up_to_the_budget(seed: int, cfa: str | None, budget: float, power: int) -> None:
    raw = np.random.default_rng(seed).uniform(0, 1, (5, 6)) * 2.0**power
    for scope in ("view", "channel"):
        rates = photon_rates(raw, cfa, Light(budget, scope), scope_energies(raw, cfa, scope))
        parts = 1 if scope == "view" or cfa is None else 3
        assert (rates >= 0).all()
        np.testing.assert_allclose(rates.sum(), parts * budget, rtol=1e-12 if power > -900 else 1e-3)


@given(SEEDS, st.integers(1, 3), st.integers(1, 4), DEPTHS)
def test_samples_of_windows_are_those_of_fractions(seed: int, cell: int, window: int, z_mm: float) -> None:
    film = film_of(SMALL, seed)
    planes = FocalPlanes.at_depths(SMALL, z_mm)
    counts = pcii.PhotonCounts.from_dense(film, SMALL)
    found = view_samples(counts, planes, 0, cell_px=cell, window_cells=window)
    rows, cols = planes.voxel_indices()

    def near(index: np.ndarray, centre: int, size: int) -> np.ndarray:
        """Pixels that fall into the window about a cell, which reaches further up and left if it is even."""
        first, last = centre - window // 2, centre + (window - 1) // 2
        return (index >= 0) & (index < size) & (index // cell >= first) & (index // cell <= last)

    for y, x in np.ndindex(found.number.shape):
        samples = [
            int(film[k, l][np.ix_(near(rows[0, k], y, 4), near(cols[0, l], x, 5))].sum())
            for k, l in np.ndindex(2, 3)
        ]
        seen = [sample for sample in samples if sample]
        assert found.number[y, x] == len(seen)
        if seen:
            np.testing.assert_allclose(found.mean[y, x], sum(seen) / len(seen), rtol=4e-16)
            np.testing.assert_allclose(found.variance[y, x], variance_of(seen), rtol=1e-14)


LONG_SEEDS = st.integers(0, 2**63 - 1)
SHARES = st.floats(0, 1)


@given(LONG_SEEDS, st.integers(1, 10**12), st.integers(1, 9), st.integers(-290, 290))
def test_a_scene_s_budget_is_shared_out_to_the_last_photon(seed, budget, views, power) -> None:
    energies = np.random.default_rng(seed).uniform(0, 1, (views, 1)) * 10.0**power
    photons = Photons(budget=budget, scope="scene", statistics="multinomial")
    totals: Any = fixed_totals(photons, energies, np.random.default_rng(seed))
    assert totals.sum() == budget
    none: Any = fixed_totals(photons, 0 * energies, np.random.default_rng(seed))
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
    point = ((u - 0.5) * aperture, (v - 0.5) * aperture)
    chief = as_rig(grid).slopes(row, col, (0.0, 0.0), point)
    bent = replace(as_rig(grid), lens=lens).slopes(row, col, (0.0, 0.0), point)
    for axis in (0, 1):
        assert point[axis] + focus * bent[axis] == pytest.approx(focus * chief[axis], abs=1e-9 * focus)
