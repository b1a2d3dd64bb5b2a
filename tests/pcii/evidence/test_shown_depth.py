"""A depth is shown by a surface in the range, and by nothing that belongs to noise, films or light."""

import numpy as np
import pytest
from twins import blocky_texture, patch_views, unit_grid

from pcii.evidence import ShownDepth, TextureModel, evidence_of_texture
from pcii.types import FocalPlanes, PhotonCounts

MODEL, BLOCK_PX, DISPARITIES_PX = TextureModel(), 2, (4.0, 4.5, 5.0, 5.5, 6.0)
PATCH = np.s_[18:42, 26:50]  # blocks well inside the texture of `patch_of`


def shown_and_supported(counts: PhotonCounts, plane: int = 2) -> tuple[np.ndarray, np.ndarray]:
    """Where a depth is shown, and where that of a plane, 5 px, is supported."""
    steps = max(counts.grid.rows, counts.grid.cols) - 1
    planes = FocalPlanes.at_total_disparity(counts.grid, steps * np.array(DISPARITIES_PX))
    nats = evidence_of_texture(counts, planes, BLOCK_PX, MODEL).nats
    depth = np.full(nats.shape[1:], plane)
    return ShownDepth(support_planes=0)(counts, planes, slice(0, len(planes)), nats, depth, BLOCK_PX, MODEL)


def shown(counts: PhotonCounts) -> np.ndarray:
    return shown_and_supported(counts)[0]


def patch_of(disparity_px: int, *, photons: float, shear_px: int = 0) -> PhotonCounts:
    """A square with texture on a dark film of 5 x 7 cameras, as shear leaves it."""
    rng = np.random.default_rng(0)
    square = photons * blocky_texture(rng, 64, 64)
    films = patch_views(square, 32, 48, disparity_px - shear_px, unit_grid(5, 7, 128, 160))
    grid = unit_grid(5, 7, 128, 160, shear_px=(shear_px, shear_px))
    return PhotonCounts.from_dense(rng.poisson(films[..., 0]), grid)


@pytest.mark.parametrize("shear_px", [0, 5, 8])
@pytest.mark.parametrize("photons", [0.05, 100.0])
def test_a_surface_in_the_range_shows_its_depth(photons: float, shear_px: int) -> None:
    counts = patch_of(5, photons=photons, shear_px=shear_px)
    for part in shown_and_supported(counts):
        assert part[PATCH].mean() > 0.95


def test_a_depth_where_the_surface_is_out_of_focus_is_not_supported() -> None:
    counts = patch_of(5, photons=1.0)
    for plane, is_supported in ((2, True), (4, False)):  # that is 6 px of total disparity away
        assert (shown_and_supported(counts, plane)[1][PATCH] == is_supported).mean() > 0.95


def test_what_lies_outside_the_range_shows_no_depth_in_it() -> None:
    # The textures at 0, of the films themselves, and at 8 are sharper there than in the range of 4 to 6.
    for disparity_px in (0, 2, 8):
        assert not shown(patch_of(disparity_px, photons=1.0)).any()


def test_noise_that_all_cameras_share_is_a_surface_where_they_put_it() -> None:
    # The planted fault: with the opposite order of cameras the same noise is none.
    noise = np.random.default_rng(2).poisson(1.0, (200, 200, 1))
    grid = unit_grid(3, 3, 128, 128)
    film = patch_views(noise, -36, -36, 5, grid)[..., 0].astype(int)
    assert shown(PhotonCounts.from_dense(film, grid)).mean() > 0.9
    assert not shown(PhotonCounts.from_dense(film[::-1, ::-1], grid)).any()


def test_a_gain_is_compared_with_the_noise_of_all_that_a_camera_may_have_brought_there() -> None:
    # Three cameras see a dim square: half of it gains no more than twelve deviations of the noise in reach,
    # all of it more than those of the noise at its own place behind infinity.
    rng, grid = np.random.default_rng(0), unit_grid(1, 3, 64, 96)
    films = patch_views(0.2 * blocky_texture(rng, 32, 32), 16, 16, 5, grid)[..., 0]
    assert shown(PhotonCounts.from_dense(rng.poisson(films), grid))[8:24, 8:24].mean() == 0.5
