"""Windows of a film: everything in the boxes is seen in one, no pixel is in two."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pcii.types import CameraGrid
from simgen.cameras import Camera
from simgen.renderer.radiance import object_windows
from simgen.spec import Lens

GRID = CameraGrid(rows=1, cols=1, pitch_mm=(5.0, 5.0), focal_mm=50.0, pixel_mm=0.2, height=150, width=200)
WHOLE = [(slice(0, 150), slice(0, 200))]


def camera(
    shift_px: tuple[float, float] = (0.0, 0.0), lens: Lens | None = None, turn_deg: float = 0
) -> Camera:
    rotation = Rotation.from_euler("y", turn_deg, degrees=True).as_matrix()
    return Camera(GRID, np.array([3.0, -2.0, 0.0]), rotation, shift_px, lens)


def corners_mm(middle_mm: tuple[float, float, float], half_mm: float) -> np.ndarray:
    signs = np.array(list(np.ndindex(2, 2, 2))) * 2.0 - 1
    return np.array(middle_mm) + half_mm * signs


def covered(windows: list[tuple[slice, slice]]) -> np.ndarray:
    """How many windows each pixel is in."""
    found = np.zeros((150, 200), int)
    for window in windows:
        found[window] += 1
    return found


def test_a_window_is_where_the_box_projects_to() -> None:
    # From 3 mm to the right of and 2 mm above the box's middle, its near face at 250 mm is 40 px across.
    ((rows, cols),) = object_windows(camera(), corners_mm((3.0, -2.0, 270.0), 20.0)[None])
    assert (rows, cols) == (slice(55, 95), slice(80, 120))


PLACE = st.tuples(st.floats(-200, 200), st.floats(-200, 200), st.floats(60, 900))
BOXES = st.lists(st.tuples(PLACE, st.floats(0.1, 50)), max_size=6)


@given(boxes=BOXES, right=st.floats(-40, 40), turn_deg=st.floats(-5, 5), seed=st.integers(0, 2**32 - 1))
def test_what_is_in_the_boxes_is_seen_in_a_window(
    boxes: list[tuple[tuple[float, float, float], float]], right: float, turn_deg: float, seed: int
) -> None:
    seen_by = camera((right, -7.0), turn_deg=turn_deg)
    corners = np.array([corners_mm(*box) for box in boxes]).reshape(-1, 8, 3)
    windows = object_windows(seen_by, corners)
    found = covered(windows)
    assert found.max() <= 1
    shares = np.random.default_rng(seed).dirichlet(np.full(8, 0.3), size=(len(corners), 40))
    points_mm = np.einsum("nps,nsx->npx", shares, corners).reshape(-1, 3)
    points_mm = points_mm[seen_by.on_film(points_mm)]
    cols, rows = np.floor(seen_by.film_px(points_mm) + np.array([100, 75])).astype(int).T
    assert found[np.clip(rows, 0, 149), np.clip(cols, 0, 199)].all()


def test_what_has_no_outline_takes_the_whole_film() -> None:
    box = corners_mm((0.0, 0.0, 500.0), 10.0)[None]
    assert object_windows(camera(lens=Lens(aperture_mm=5.0, focus_mm=500.0)), box) == WHOLE
    assert object_windows(camera(), corners_mm((0.0, 0.0, 20.0), 30.0)[None]) == WHOLE


def test_nothing_has_no_window() -> None:
    assert object_windows(camera(), np.zeros((0, 8, 3))) == []
    assert object_windows(camera(), corners_mm((400.0, 0.0, 500.0), 10.0)[None]) == []


def test_a_window_of_a_camera_sees_what_the_camera_sees_there() -> None:
    seen_by = camera((12.5, -7.0))
    part = seen_by.of_window(slice(20, 61), slice(101, 130))
    assert (part.grid.height, part.grid.width) == (41, 29)
    np.testing.assert_allclose(
        part.towards(np.array(3), np.array(5)), seen_by.towards(np.array(23), np.array(106)), rtol=1e-14
    )
