"""Properties of sections, photons, light and masks, for any numbers: see also every other `@given`."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra import numpy as nst
from rational_sections import variance_of
from twins import unit_grid

import pcii
from pcii.base import block_sums, on_pixels
from pcii.metrics import boundary_f, mask_agreement
from pcii.sections import view_samples
from pcii.types import PATTERNS, FocalPlanes, Light, photon_rates, scope_energies

SMALL = unit_grid(2, 3, 4, 5, (1.3, 0.8))
DEPTHS = st.floats(0.3, 30)
SEEDS = st.integers(0, 2**32 - 1)
MASKS = nst.arrays(bool, st.tuples(st.integers(1, 12), st.integers(1, 12)))
MOSAICS = nst.arrays(np.float64, st.tuples(st.integers(2, 7), st.integers(2, 7)), elements=st.floats(0, 1e6))


def light_of(grid: pcii.CameraGrid, seed: int, channels: int = 1) -> np.ndarray:
    """Whole numbers, whose sums are exact, some of them 0."""
    rng = np.random.default_rng(seed)
    return rng.integers(0, 1 << 20, (*grid.shape_KLHW, channels)).astype(np.float64) * rng.integers(0, 2)


def film_of(grid: pcii.CameraGrid, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.poisson(rng.choice([0.05, 1.0, 1e4]), grid.shape_KLHW)


# What is accepted


@given(nst.arrays(np.float64, (2, 3, 4, 5, 1), elements=st.floats(width=64)), DEPTHS)
def test_radiance_gives_finite_sections_or_is_refused(light: np.ndarray, z_mm: float) -> None:
    try:
        sections = pcii.reconstruct(pcii.Views(light, SMALL), z_mm, variance=True)
    except pcii.InputError as fault:
        assert str(fault).startswith("radiance: ")  # noqa: PT017
        assert not np.isfinite(light).all() or np.abs(light).max() > 1e150  # its square is too large
        return
    assert sections.variance is not None
    assert np.isfinite(sections.estimate).all()
    assert np.isfinite(sections.variance).all()
    assert (sections.variance >= 0).all()


# Photons


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
        seen = [Fraction(sample) for sample in samples if sample]
        assert found.number[y, x] == len(seen)
        if seen:
            np.testing.assert_allclose(found.mean[y, x], float(sum(seen) / len(seen)), rtol=4e-16)
            np.testing.assert_allclose(found.variance[y, x], float(variance_of(seen)), rtol=1e-14)


# Sections


@given(SEEDS, DEPTHS, st.integers(-800, 400))
def test_sections_scale_with_the_light(seed: int, z_mm: float, power: int) -> None:
    light = light_of(SMALL, seed)
    plain, scaled = (pcii.reconstruct(pcii.Views(light * unit, SMALL), z_mm) for unit in (1.0, 2.0**power))
    np.testing.assert_array_equal(plain.counts * 2.0**power, scaled.counts)
    np.testing.assert_array_equal(plain.coverage, scaled.coverage)


@given(SEEDS, DEPTHS, st.integers(-(2**30), 2**30))
def test_variance_does_not_change_with_what_is_added_to_all(seed, z_mm, added) -> None:
    light = light_of(SMALL, seed)
    plain, moved = (
        pcii.reconstruct(pcii.Views(light + offset, SMALL), z_mm, variance=True).variance
        for offset in (0, added)
    )
    assert plain is not None
    assert moved is not None
    np.testing.assert_array_equal(plain, moved)


@given(SEEDS, st.lists(DEPTHS, min_size=1, max_size=4), st.integers(1, 3))
def test_planes_one_at_a_time_are_planes_together(seed: int, z_mm: list[float], subpixel: int) -> None:
    counts = pcii.PhotonCounts.from_dense(film_of(SMALL, seed), SMALL, cfa="GBRG")
    together = pcii.reconstruct(counts, z_mm, subpixel=subpixel)
    each = [pcii.reconstruct(counts, z, subpixel=subpixel) for z in z_mm]
    for name in ("counts", "coverage", "estimate"):
        alone = np.concatenate([getattr(one, name) for one in each])
        np.testing.assert_array_equal(alone, getattr(together, name))


@given(MOSAICS, st.sampled_from(PATTERNS), st.integers(-900, 900))
def test_colours_scale_with_the_light(raw: np.ndarray, cfa: str, power: int) -> None:
    assume(not ((raw > 0) & (raw < 1e-20)).any())  # which would fall below the smallest normal number
    plain, scaled = (pcii.demosaic(raw * unit, cfa=cfa) for unit in (1.0, 2.0**power))
    np.testing.assert_array_equal(plain * 2.0**power, scaled)


# Scores


@given(MASKS, SEEDS)
def test_agreement_is_a_share_and_knows_no_order(claimed: np.ndarray, seed: int) -> None:
    true = np.random.default_rng(seed).random(claimed.shape) < 0.5
    found, turned = mask_agreement(claimed, true), mask_agreement(true, claimed)
    shares = [*found.pop("everything").values(), *found.values()]
    assert all(value is None or 0 <= value <= 1 for value in shares)
    assert found["precision"] == turned["recall"]
    if claimed.any() and true.any():
        assert found["iou"] == turned["iou"]
    assert boundary_f(claimed, true) == pytest.approx(boundary_f(true, claimed))
    same = mask_agreement(claimed, claimed)
    assert same["false_share"] == 0
    assert same["iou"] == same["f1"] == (1 if claimed.any() else None)
    if claimed.any() and not claimed.all():  # one that fills the frame has no outline, and 0
        assert same["boundary_f"] == 1


@given(nst.arrays(np.int64, st.tuples(st.integers(1, 9), st.integers(1, 9)), elements=st.integers(0, 2**50)))
def test_cells_have_all_that_their_pixels_have(pixels: np.ndarray) -> None:
    for side in (1, 2, 3, 4):
        cells = block_sums(pixels, side, np.int64)
        assert int(cells.sum()) == int(pixels.sum())
        assert on_pixels(cells, side, pixels.shape).shape == pixels.shape
