"""Counts drawn from expected ones: Poisson, or of an exact total."""

import numpy as np
import pytest

from simgen.sensor import draw_counts


@pytest.mark.parametrize("rate", [0.34, 1e-3])  # the paper's brightest pixels, and low light
def test_poisson_counts_have_mean_and_variance_of_their_rate(rate: float) -> None:
    rates = np.full((400, 500), rate)
    counts = draw_counts(rates, None, np.random.default_rng(3), None)
    # Standard errors of mean and variance for n draws of a Poisson variable; 4 sigma.
    n = counts.size
    assert abs(counts.mean() - rate) < 4 * np.sqrt(rate / n)
    assert abs(counts.var() - rate) < 4 * np.sqrt((rate + 2 * rate**2) / n)
    doubled = 2 * counts  # the fault of a well-known simulator at low light
    assert abs(doubled.mean() - rate) > 4 * np.sqrt(rate / n)
