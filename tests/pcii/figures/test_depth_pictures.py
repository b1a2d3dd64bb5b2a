import numpy as np

from pcii.figures.pictures import depth_image


def test_depth_is_brighter_the_nearer_and_the_surer_and_black_where_unknown() -> None:
    z_mm = np.array([[400.0, 500.0, 600.0, np.nan]])
    luminance = depth_image(z_mm, 400, 600).sum(axis=-1)[0]
    assert luminance[0] > luminance[1] > luminance[2] > luminance[3] == 0
    unsure = depth_image(z_mm, 400, 600, np.array([[0.5, 0.5, 0.0, 0.9]]))
    np.testing.assert_allclose(unsure[0, :2], depth_image(z_mm, 400, 600)[0, :2] / 2, atol=1)
    assert not unsure[0, 2:].any()
