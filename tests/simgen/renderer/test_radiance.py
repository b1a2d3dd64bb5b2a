"""Dense radiance: fewer samples where no object can be seen."""

from dataclasses import replace

import numpy as np
import pytest
from lit_scenes import two_balls

from pcii.types import CameraGrid
from simgen.cameras import as_rig
from simgen.renderer import render_view, windows_of_objects
from simgen.spec import Lens
from simgen.truth import first_hits_of_view

pytestmark = pytest.mark.renders
GRID = CameraGrid(
    rows=1,
    cols=2,
    pitch_mm=(9.0, 5.0),
    focal_mm=50.0,
    pixel_mm=0.5,
    height=70,
    width=80,
    shear_px=(1.5, 0.0),
)


def test_objects_have_their_samples_and_the_background_fewer() -> None:
    scene = two_balls()
    sparse, least, dense = (
        render_view(scene, GRID, 0, 1, samples_per_pixel=samples, background_samples=fewer, seed=4)
        for samples, fewer in ((256, 1), (1, None), (256, None))
    )
    windows, saved = windows_of_objects(scene, as_rig(GRID).camera(0, 1), 256, 1)
    is_window = np.zeros((GRID.height, GRID.width), dtype=bool)
    for rows, cols in windows:
        is_window[rows, cols] = True
    np.testing.assert_array_equal(sparse[~is_window], least[~is_window])
    # Where objects are, two renderings of 256 samples: each pixel of a window that were one pixel off would
    # differ by half the brightest light at outlines.
    assert np.abs(sparse - dense)[is_window].max() < 0.1 * dense.max()
    assert not np.array_equal(sparse[is_window], dense[is_window])
    assert is_window[first_hits_of_view(scene, GRID, 0, 1).object_id > 0].all()
    assert saved == 255 * GRID.height * GRID.width - 256 * is_window.sum()

    # With a lens all of the film is one.
    lens = replace(as_rig(GRID), lens=Lens(aperture_mm=5.0, focus_mm=500.0))
    assert windows_of_objects(scene, lens.camera(0, 1), 256, 1)[0] == [(slice(0, 70), slice(0, 80))]

    # Windows that would cost more are not rendered.
    plain, fewer = (
        render_view(scene, GRID, 0, 0, samples_per_pixel=2, background_samples=n, seed=4) for n in (None, 2)
    )
    np.testing.assert_array_equal(plain, fewer)
