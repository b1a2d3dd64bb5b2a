"""Which surface a ray meets, how many pixels see a cell, and what a labelling costs, against slow twins."""

import numpy as np
import pytest
from twins import unit_grid

from pcii.core.estimates import DepthPosterior
from pcii.core.focal_planes import FocalPlanes
from pcii.core.photon_counts import PhotonCounts
from pcii.scene_model.energy import SceneEnergy
from pcii.scene_model.parameters import SceneParameters
from pcii.scene_model.ray_kernels import behind
from pcii.scene_model.rays import Rays
from pcii.scene_model.starts import starts_of
from pcii.scene_model.surfaces import prior_nats, surfaces_of

SIDE_PX, CAMERAS, CELL_PX = 64, 5, 2
TOTAL_PX = np.arange(8.0, 24.0)


def rays_of(dense: np.ndarray | None = None) -> Rays:
    """Photons of a small grid through sixteen depths: one in every pixel unless others are given."""
    grid = unit_grid(CAMERAS, CAMERAS, SIDE_PX, SIDE_PX)
    counts = np.ones(grid.shape_KLHW, int) if dense is None else dense
    planes = FocalPlanes.at_total_disparity(grid, TOTAL_PX)
    return Rays(PhotonCounts.from_dense(counts, grid), planes, CELL_PX)


def random_surfaces(seed: int) -> np.ndarray:
    """A far wall behind rectangles at random depths, with jumps between all of them."""
    rng = np.random.default_rng(seed)
    labels = np.full((SIDE_PX // CELL_PX,) * 2, 2, np.int16)
    for label in np.sort(rng.choice((6, 10, 14), 4)):
        i, j = rng.integers(2, 20, 2)
        h, w = rng.integers(3, 12, 2)
        labels[i : i + h, j : j + w] = label
    return labels


@pytest.mark.parametrize("seed", range(3))
def test_pixels_that_see_cells_are_those_whose_rays_end_there(seed: int):
    energy, labels = SceneEnergy(rays_of()), random_surfaces(seed)
    hidden = behind(labels, energy.rays.largest_step)
    seen = energy.exposure(labels, hidden)
    # There is one photon in every pixel, so that photons of a cell are the pixels that see it.
    owner, _ = energy.owners(labels, hidden)
    photons = np.bincount(owner, minlength=2 * labels.size + 1)
    assert photons.sum() == energy.rays.n.size
    # A camera sees a cell or not; by blocks of 4 x 4 cells that averages out.
    blocks = np.indices(labels.shape) // 4
    number = (blocks[0] * 8 + blocks[1]).ravel()
    for surface in range(2):
        here = photons[surface * labels.size : (surface + 1) * labels.size]
        difference = np.bincount(number, here - seen[surface].ravel())
        assert np.abs(difference).max() < 0.06 * 16 * (CAMERAS * CELL_PX) ** 2
    # Nearly all rays meet something: one surface goes on behind what is nearer, but no second one.
    assert photons[-1] < 0.01 * photons.sum()
    assert seen.sum() == pytest.approx(photons[:-1].sum(), rel=0.005)


def test_a_wall_goes_on_behind_what_is_near_as_far_as_cameras_see_it():
    rays, labels = rays_of(), np.full((32, 32), 2, np.int16)
    labels[8:24, 8:24] = 14
    owner, _ = SceneEnergy(rays).owners(labels, behind(labels, rays.largest_step))
    assert owner.max() < 2 * labels.size
    # The outermost cameras see 12 labels of a quarter of a cell past an outline, and nobody sees more.
    hidden_cells = np.unique(owner[owner >= labels.size]) - labels.size
    depth = np.minimum(*(np.minimum(place - 8, 23 - place) for place in np.divmod(hidden_cells, 32)))
    assert depth.max() == 2


def test_colours_are_predicted_from_those_of_the_same_surface():
    rng = np.random.default_rng(4)
    grid = unit_grid(CAMERAS, CAMERAS, SIDE_PX, SIDE_PX)
    # A green wall: of the sites of a Bayer pattern the green ones alone have photons.
    green = (np.indices((SIDE_PX, SIDE_PX)).sum(axis=0) % 2 == 0) * rng.poisson(0.4, grid.shape_KLHW)
    planes = FocalPlanes.at_total_disparity(grid, TOTAL_PX)
    wall, nats = np.full((32, 32), 6, np.int16), []
    for photons in (green, rng.permuted(green, axis=3)):
        rays = Rays(PhotonCounts.from_dense(photons, grid, cfa="GRBG"), planes, CELL_PX)
        photons_per_px = rays.n.sum() / rays.exposed_px
        nats.append(SceneEnergy(rays).photon_nats(wall).sum() / rays.n.sum() - 1 + np.log(photons_per_px))
    # Green, red and blue in shares of 1/2, 1/4, 1/4 cost their entropy more than green alone.
    assert nats[0] == pytest.approx(0, abs=0.02)
    assert nats[1] == pytest.approx(1.5 * np.log(2), abs=0.02)


def test_a_ray_meets_the_nearest_surface_on_its_way():
    rays, labels = rays_of(), random_surfaces(0)
    hidden = behind(labels, rays.largest_step)
    owner, _ = SceneEnergy(rays).owners(labels, hidden)
    row, col, step_row, step_col = (line.astype(np.float64) for line in rays.lines)
    surfaces = np.concatenate([labels.ravel(), hidden.ravel(), [-1]])
    for ray in range(0, owner.size, 97):
        met = -1
        for z in range(TOTAL_PX.size - 1, -1, -1):
            i, j = int((row[ray] + z * step_row[ray]) // 2), int((col[ray] + z * step_col[ray]) // 2)
            if labels[i, j] == z or hidden[i, j] == z:
                met = z
                break
        assert surfaces[owner[ray]] == met


def test_a_ray_meets_a_slope_between_its_cells_and_no_jump():
    rays = rays_of()
    slope = np.tile(np.arange(2, 10, 0.25).astype(np.int16), (32, 1))
    for labels in (slope, slope[:, ::-1].copy()):
        owner, _ = SceneEnergy(rays).owners(labels, behind(labels, rays.largest_step))
        # Those that end at the sides leave the slope where its depths begin or end.
        middle = (rays.lines[1] > 16) & (rays.lines[1] < 48)
        assert (owner[middle] < labels.size).all()
    steep = np.repeat(slope[:, ::4], 4, axis=1) * 3
    owner, other = SceneEnergy(rays).owners(np.minimum(steep, 15), behind(steep, rays.largest_step))
    assert (other >= 0).mean() > 0.05


def test_a_flat_wall_of_uniform_light_has_the_likelihood_of_its_rate():
    rays = rays_of(np.random.default_rng(3).poisson(0.5, (CAMERAS, CAMERAS, SIDE_PX, SIDE_PX)))
    energy = SceneEnergy(rays)
    wall = np.full(rays.shape, 6, np.int16)
    photons = float(rays.n.sum())
    flat = photons - photons * np.log(photons / rays.exposed_px)
    # Rates are predicted without the photon itself, in windows of some hundred photons or more.
    assert energy.photon_nats(wall).sum() == pytest.approx(flat, abs=0.02 * photons)
    background = np.full(rays.shape, -1, np.int16)
    assert energy.photon_nats(background).sum() == pytest.approx(flat, abs=0.001 * photons)


def test_no_photon_has_a_finite_energy_and_the_background_is_the_least():
    energy = SceneEnergy(rays_of(np.zeros((CAMERAS, CAMERAS, SIDE_PX, SIDE_PX), int)))
    nats = [energy.of(labels).sum() for labels in (np.full((32, 32), -1, np.int16), random_surfaces(1))]
    assert np.isfinite(nats).all()
    assert nats[0] == pytest.approx(SceneParameters().surface_nats)
    assert nats[0] < nats[1]


def test_outlines_cost_their_length_and_surfaces_their_number():
    parameters = SceneParameters(roughness_nats=0.0)
    labels = np.full((60, 60), -1, np.int16)
    assert prior_nats(labels, parameters).sum() == pytest.approx(parameters.surface_nats)
    i, j = np.indices(labels.shape)
    labels[(i - 30) ** 2 + (j - 30) ** 2 < 20**2] = 5
    outline = prior_nats(labels, parameters).sum() - 2 * parameters.surface_nats
    assert outline == pytest.approx(parameters.outline_nats_per_cell * 2 * np.pi * 20, rel=0.05)
    labels[labels == 5] += (j % 3)[labels == 5].astype(np.int16)
    assert prior_nats(labels, parameters).sum() == pytest.approx(outline + 2 * parameters.surface_nats)
    assert prior_nats(labels, SceneParameters()).sum() > outline + 2 * parameters.surface_nats + 10


def test_surfaces_are_connected_cells_without_jumps():
    labels = np.array([[0, 1, 3, 7], [-1, -1, 3, 7], [0, -1, 3, 4]], np.int16)
    assert surfaces_of(labels).tolist() == [[0, 0, 0, 1], [2, 2, 0, 1], [3, 2, 0, 0]]


def test_a_film_may_end_within_a_cell():
    grid = unit_grid(CAMERAS, CAMERAS, 61, 63)
    planes = FocalPlanes.at_total_disparity(grid, TOTAL_PX)
    rays = Rays(PhotonCounts.from_dense(np.ones(grid.shape_KLHW, int), grid), planes, CELL_PX)
    assert rays.shape == (31, 32)
    # With one photon in every pixel, those that count are the pixels that count.
    assert rays.n.sum() == pytest.approx(rays.exposed_px, rel=0.01)
    energy = SceneEnergy(rays)
    labels = np.full(rays.shape, 8, np.int16)
    seen = energy.exposure(labels, behind(labels, rays.largest_step))
    assert seen.sum() == pytest.approx(rays.exposed_px, rel=0.01)


def test_searches_start_from_the_most_probable_depths_and_from_the_near_and_the_far_ones():
    grid = unit_grid(CAMERAS, CAMERAS, 61, 63)
    planes = FocalPlanes.at_total_disparity(grid, TOTAL_PX)
    rays = Rays(PhotonCounts.from_dense(np.ones(grid.shape_KLHW, int), grid), planes, CELL_PX)
    probability = np.zeros((TOTAL_PX.size, 31, 32), np.float32)
    probability[3, :, :16], probability[11, :, :16] = 0.3, 0.6
    nothing = 1 - probability.sum(axis=0)
    starts = starts_of(DepthPosterior(planes, probability, nothing, block_px=2), rays)
    assert all(start.shape == rays.shape and (start[:, 20:] == -1).all() for start in starts)
    assert (starts[0][:, :16] == 11).all()
    assert {int(start[15, 4]) for start in starts} == {3, 11}
