"""Dense radiance: fewer samples where no object can be seen."""

from dataclasses import replace

import numpy as np
import pytest
from lit_scenes import card, lit, two_balls

from pcii.types import CameraGrid
from simgen.cameras import as_rig
from simgen.renderer import RenderScene, render_view, windows_of_objects
from simgen.spec import Lens
from simgen.truth import first_hits_of_view

pytestmark = pytest.mark.renders
GRID = CameraGrid(
    rows=1, cols=2, pitch_mm=(9.0, 5.0), focal_mm=50.0, pixel_mm=0.5, height=70, width=80, shear_px=(1.5, 0.0)
)


def in_windows(scene: RenderScene) -> tuple[np.ndarray, int]:
    """Pixels (H, W) of a camera that are in a window, and how many paths that saves."""
    windows, saved = windows_of_objects(scene, as_rig(GRID).camera(0, 1), 256, 1)
    found = np.zeros((GRID.height, GRID.width), dtype=bool)
    for window in windows:
        found[window] = True
    return found, saved


def test_windows_show_all_of_a_card_and_not_much_more() -> None:
    scene = lit([card(600.0, 200.0, at_mm=(20.0, -30.0))])
    is_window, _ = in_windows(scene)
    is_card = first_hits_of_view(scene, GRID, 0, 1).object_id > 0
    assert is_window[is_card].all()
    assert is_window.sum() < 2 * is_card.sum()


def test_objects_have_their_samples_and_the_background_fewer() -> None:
    scene = two_balls()
    sparse, least, dense = (
        render_view(scene, GRID, 0, 1, samples_per_pixel=samples, background_samples=fewer, seed=4)
        for samples, fewer in ((256, 1), (1, None), (256, None))
    )
    is_window, saved = in_windows(scene)
    np.testing.assert_array_equal(sparse[~is_window], least[~is_window])
    # Where objects are, two renderings of 256 samples: each pixel of a window that were one pixel off would
    # differ by half the brightest light at outlines.
    assert np.abs(sparse - dense)[is_window].max() < 0.1 * dense.max()
    assert not np.array_equal(sparse[is_window], dense[is_window])
    assert saved == 255 * GRID.height * GRID.width - 256 * is_window.sum()

    # With a lens all of the film is one.
    lens = replace(as_rig(GRID), lens=Lens(aperture_mm=5.0, focus_mm=500.0))
    assert windows_of_objects(scene, lens.camera(0, 1), 256, 1)[0] == [(slice(0, 70), slice(0, 80))]

    # Windows that would cost more are not rendered.
    plain, fewer = (
        render_view(scene, GRID, 0, 0, samples_per_pixel=2, background_samples=n, seed=4) for n in (None, 2)
    )
    np.testing.assert_array_equal(plain, fewer)
