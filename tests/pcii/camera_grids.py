"""Camera grids drawn by Hypothesis: sheared ones, single cameras and single pixels among them."""

from hypothesis import strategies as st

from pcii.types import CameraGrid

grids = st.builds(
    CameraGrid,
    rows=st.integers(1, 6),
    cols=st.integers(1, 6),
    pitch_mm=st.tuples(st.floats(0.5, 10), st.floats(0.5, 10)),
    focal_mm=st.floats(10, 100),
    pixel_mm=st.floats(0.01, 0.1),
    height=st.integers(1, 9),
    width=st.integers(1, 9),
    shear_px=st.tuples(st.sampled_from([0.0, 1.5, -7.25]), st.sampled_from([0.0, 3.0, -0.5])),
)
