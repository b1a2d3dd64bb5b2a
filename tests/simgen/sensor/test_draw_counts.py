"""Counts drawn from expected ones: Poisson, or of an exact total."""

import numpy as np
import pytest

from pcii.types import Light, Scope, colour_index, photon_rates, scope_energies
from simgen.sensor import draw_counts, fixed_totals
from simgen.spec import Photons


def ramp(height: int = 12, width: int = 10) -> np.ndarray:
    return np.arange(1.0, height * width + 1).reshape(height, width)


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


@pytest.mark.parametrize("scope", ["view", "channel", "scene"])
def test_multinomial_totals_are_exact(scope: Scope) -> None:
    photons = Photons.model_validate({"budget": 700, "scope": scope, "statistics": "multinomial"})
    raws = [ramp(), 3 * ramp()]
    energies = np.array([scope_energies(raw, "GRBG", scope) for raw in raws])
    totals = fixed_totals(photons, energies, np.random.default_rng(1))
    assert totals is not None
    rng = np.random.default_rng(2)
    drawn = [
        draw_counts(photon_rates(raw, "GRBG", Light(700, scope), e), "GRBG", rng, t)
        for raw, e, t in zip(raws, energies, totals, strict=True)
    ]
    if scope == "scene":
        assert sum(int(counts.sum()) for counts in drawn) == 700
    elif scope == "view":
        assert [int(counts.sum()) for counts in drawn] == [700, 700]
    else:
        colours = colour_index(12, 10, "GRBG")
        assert [int(drawn[0][colours == c].sum()) for c in range(3)] == [700, 700, 700]
