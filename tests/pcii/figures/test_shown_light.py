"""What few photons and unsure depths look like: bright enough to be seen, and taken for nothing else."""

import numpy as np
import pytest

from pcii.figures.exposure import SHOWN_PHOTONS, encoded, filled_means, smoothed, smoothing_for
from pcii.figures.pictures import depth_image


@pytest.mark.parametrize("per_pixel", [0.02, 0.2, 1.5])
def test_few_photons_of_a_bright_scene_are_smoothed_until_they_are_bright(per_pixel: float) -> None:
    counts = np.random.default_rng(3).poisson(per_pixel / 3, (200, 240, 3))
    samples = np.ones_like(counts)
    sigma = smoothing_for([counts, counts])
    sums, weights = smoothed(counts, samples, sigma)
    (image,) = encoded([(filled_means(sums, weights), weights)])
    assert np.median(image) > 150
    (raw,) = encoded([(counts / samples, samples)])
    assert np.median(raw) == 0
    # Its noise is that of the photons which are said to be under the Gaussian.
    middle = sums[40:-40, 40:-40].sum(axis=-1)  # some 150 independent places at the fewest photons
    assert middle.std() / middle.mean() == pytest.approx(SHOWN_PHOTONS**-0.5, rel=0.25)


def test_many_photons_none_and_hot_pixels_change_no_smoothing() -> None:
    assert smoothing_for([np.full((40, 40, 1), 100)]) == 0
    assert smoothing_for([np.zeros((40, 40, 3), int)]) == 0
    counts = np.random.default_rng(3).poisson(0.5, (80, 80, 1))
    usual = smoothing_for([counts])
    counts[::40, ::40] = 200  # four pixels with a fifth of all photons
    assert smoothing_for([counts]) == pytest.approx(usual, rel=0.1)


def test_light_does_not_leak_from_where_there_are_no_samples() -> None:
    samples = np.ones((30, 30, 1))
    samples[:, 15:] = 0
    mean = filled_means(*smoothed(2 * samples, samples, 1.5))
    np.testing.assert_allclose(mean[:, :18], 2)


def test_depth_is_brighter_the_nearer_and_paler_the_less_sure() -> None:
    z_mm = np.array([[400.0, 500.0, 600.0]])
    sure = depth_image(z_mm, 400, 600, np.ones((1, 3)))
    np.testing.assert_array_equal(sure, depth_image(z_mm, 400, 600))
    assert (np.diff(sure.sum(axis=-1, dtype=int)[0]) < 0).all()
    unsure = depth_image(z_mm, 400, 600, np.full((1, 3), 0.5))
    np.testing.assert_allclose(unsure, (sure + 255.0) / 2, atol=1)
    assert (depth_image(z_mm, 400, 600, np.zeros((1, 3))) == 255).all()
