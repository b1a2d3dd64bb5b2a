"""What ours is compared with does the same job."""

import sys

import numpy as np
import pytest

from benchmarks.peers import plain_pipeline
from benchmarks.peers.shifted_means import by_opencv, by_scipy, by_slices
from benchmarks.processes import run_process
from benchmarks.textures import Texture, plane_views
from pcii.sections.reconstruction import reconstruct
from pcii.types.bayer import mosaic
from pcii.types.camera_grid import CameraGrid
from pcii.types.images import Views

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


def test_the_plain_script_has_the_same_bayer_pattern() -> None:
    image = np.random.default_rng(3).random((6, 8, 3))
    assert np.array_equal(plain_pipeline.bayer(image), mosaic(image, "GRBG"))


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


def test_processes_are_timed_and_their_failure_is_told() -> None:
    done = run_process([sys.executable, "-c", "import time; time.sleep(0.2); print('x' * 3)"])
    assert done.output == "xxx\n"
    assert done.seconds > 0.2
    assert done.peak_mb is None or done.peak_mb > 1
    with pytest.raises(Exception, match="exit status 3"):
        run_process([sys.executable, "-c", "import sys; sys.exit(3)"])
