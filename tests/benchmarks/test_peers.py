"""What ours is compared with does the same job."""

import numpy as np
import pytest

from benchmarks.peers import plain_pipeline
from benchmarks.peers.shifted_means import by_opencv, by_scipy, by_slices
from benchmarks.studies.sections import Texture, plane_views
from pcii.sections import reconstruct
from pcii.types import CameraGrid, Views

# Three cameras a side and a whole disparity: all shifts are whole, and all peers are exact.
GRID = CameraGrid(rows=3, cols=3, pitch_mm=(4.0, 4.0), focal_mm=1.0, pixel_mm=1.0, height=32, width=36)
IMAGES = np.random.default_rng(2).random(GRID.shape_KLHW, dtype=np.float32)
INNER = np.s_[5:-5, 5:-5]


def test_peers_make_the_section_that_we_make() -> None:
    own = reconstruct(Views(IMAGES[..., None], GRID), 1.0).estimate[0, ..., 0][INNER]
    for peer in (by_scipy, by_slices):
        assert peer(IMAGES, GRID, 1.0)[INNER] == pytest.approx(own, abs=1e-6)
    pytest.importorskip("cv2")
    assert by_opencv(IMAGES, GRID, 1.0)[INNER] == pytest.approx(own, abs=1e-6)


def test_the_plain_script_moves_views_as_we_do() -> None:
    total, squares = plain_pipeline.stack(IMAGES.astype(np.float64), 1.0, 4.0)
    assert total / 9 == pytest.approx(by_slices(IMAGES, GRID, 1.0), abs=1e-6)
    assert (squares[INNER] / 9 >= (total[INNER] / 9) ** 2 - 1e-9).all()


def test_views_of_the_texture_meet_at_its_depth() -> None:
    texture = Texture()
    (views,) = plane_views(texture, 3.0, 48, [None])
    pixels = np.arange(48)
    found = reconstruct(views, 1.0).estimate[0, ..., 0]
    inner = np.s_[16:-16, 16:-16]
    # With ten cameras and a whole disparity, nearest shifts round half up: half a pixel in each axis.
    error = found - texture.seen_at(pixels - 0.5, pixels - 0.5)[..., 1]
    off = found - texture.seen_at(pixels + 2, pixels)[..., 1]
    assert np.abs(error[inner]).mean() < 0.5 * np.abs(off[inner]).mean()
