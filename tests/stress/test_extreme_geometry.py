"""Films of 1 x 1 to 8192 x 8192, depths from below a micrometre to beyond the stars."""

import numpy as np
import pytest

import pcii
from pcii.types import total_disparity_px

RANGE_MM = (300.0, 900.0)


def grid_of(rows: int, cols: int, height: int, width: int) -> pcii.CameraGrid:
    return pcii.CameraGrid(
        rows=rows, cols=cols, pitch_mm=(5.0, 5.0), focal_mm=50.0, pixel_mm=0.25, height=height, width=width
    )


def sparse(grid: pcii.CameraGrid, photons: int, cfa: str | None = None) -> pcii.PhotonCounts:
    rng = np.random.default_rng(0)
    k, l, i, j = (rng.integers(0, size, photons) for size in grid.shape_KLHW)
    return pcii.PhotonCounts.from_events(k, l, i, j, np.ones(photons, int), grid, cfa=cfa)


@pytest.mark.parametrize(
    ("size", "cfa"),
    [((1, 1), None), ((1, 17), "BGGR"), pytest.param((13, 64), "BGGR", marks=pytest.mark.slow)],
)
def test_every_method_answers_on_films_of_any_size(size: tuple[int, int], cfa: str | None) -> None:
    grid = grid_of(2, 3, *size)
    counts = pcii.PhotonCounts.from_dense(np.random.default_rng(1).poisson(2, grid.shape_KLHW), grid, cfa=cfa)
    for method in pcii.removal_methods():
        focus = pcii.segment(counts, [400.0, 500.0], method=method)
        assert focus.in_focus.shape == (2, *size)
    views = pcii.Views(np.random.default_rng(2).uniform(0, 1, (*grid.shape_KLHW, 3)), grid)
    for data in (counts, views):
        for method in pcii.depth_methods(data):
            check_depth(pcii.estimate_depth(data, RANGE_MM, method=method), size)


def check_depth(depth: pcii.DepthMap, size: tuple[int, int]) -> None:
    """NaN where there is no depth, and nowhere else."""
    assert depth.z_mm.shape == size
    answered = np.isfinite(depth.z_mm)
    assert (np.isnan(depth.z_mm) | answered).all()
    slack = 1 + 1e-9
    assert (depth.z_mm[answered] >= RANGE_MM[0] / slack).all()
    assert (depth.z_mm[answered] <= RANGE_MM[1] * slack).all()
    assert np.isfinite(depth.confidence).all()
    assert (depth.confidence[~answered] == 0).all()


@pytest.mark.parametrize("z_mm", [1e-3, 1.0, 1e3, 1e7, 1.7e308])
@pytest.mark.parametrize("subpixel", [1, 3])
def test_no_depth_makes_photons_or_loses_those_that_stay(z_mm: float, subpixel: int) -> None:
    grid = grid_of(3, 3, 6, 7)
    counts = sparse(grid, 200)
    sections = pcii.reconstruct(counts, z_mm, subpixel=subpixel)
    if z_mm >= 1e7:  # no view shifts by half a voxel
        assert sections.counts.sum() == 200
    if z_mm <= 1:  # all views but the middle one leave the film
        assert sections.counts.sum() == counts.view(1, 1).sum()
    assert np.isfinite(sections.estimate).all()


@pytest.mark.parametrize("z_mm", [5e-324, 1e-300, 1.0, 1.7e308])
@pytest.mark.parametrize("pixel_mm", [5e-324, 0.05, 1e300])
@pytest.mark.parametrize("length_mm", [1e-300, 5.0, 1e300])
@pytest.mark.parametrize("cameras", [1, 2])
def test_lengths_whose_products_no_number_holds_are_refused_or_right(
    z_mm: float, pixel_mm: float, length_mm: float, cameras: int
) -> None:
    grid = pcii.CameraGrid(
        rows=1,
        cols=cameras,
        pitch_mm=(length_mm, length_mm),
        focal_mm=length_mm,
        pixel_mm=pixel_mm,
        height=2,
        width=3,
    )
    total_disparity_px(grid, z_mm)  # without a warning
    counts = sparse(grid, 10)
    try:
        section = pcii.reconstruct(counts, z_mm)
    except pcii.InputError as fault:
        assert str(fault).startswith("z_mm: ")  # noqa: PT017
        return
    assert section.counts.sum() <= 10
    assert np.isfinite(section.planes.total_disparity_px).all()


@pytest.mark.stress
@pytest.mark.parametrize("side", [1024, 4096, 8192])
@pytest.mark.parametrize("cfa", [None, "GRBG"])
def test_the_largest_films_keep_every_photon(side: int, cfa: str | None) -> None:
    """2 x 2 views of up to 8192 x 8192 pixels hold a million photons; none shifts out at infinity."""
    counts = sparse(grid_of(2, 2, side, side), 1_000_000, cfa)
    for z_mm, least in ((1e9, 1_000_000), (500.0, 990_000)):
        sections = pcii.reconstruct(counts, z_mm)
        assert least <= int(sections.counts.sum(dtype=np.int64)) <= 1_000_000
