"""Photon limiting: normalisation, and the statistics of what is drawn."""

import numpy as np
import pytest

from pcii.core.bayer import colour_index
from pcii.core.photon_limit import Light, photon_rates, scope_energies, sense
from simgen.base import random_streams as seeds
from simgen.sensor.mosaic import draw_counts, fixed_totals
from simgen.spec.recipe import Photons


def ramp(height: int = 12, width: int = 10) -> np.ndarray:
    return np.arange(1.0, height * width + 1).reshape(height, width)


def test_view_scope_shares_the_budget_in_proportion() -> None:
    raw = ramp()
    rates = photon_rates(raw, "GRBG", Light(500), scope_energies(raw, "GRBG", "view"))
    np.testing.assert_allclose(rates, 500 * raw / raw.sum(), rtol=1e-12)


def test_channel_scope_gives_every_colour_the_budget() -> None:
    raw = ramp()
    rates = photon_rates(raw, "RGGB", Light(500, "channel"), scope_energies(raw, "RGGB", "channel"))
    colours = colour_index(12, 10, "RGGB")
    for colour in range(3):
        assert rates[colours == colour].sum() == pytest.approx(500, rel=1e-12)


def test_darkness_gets_no_photons_and_no_warning() -> None:
    raw = np.zeros((8, 8))
    for scope in ("view", "channel", "scene"):
        energies = scope_energies(raw, "GRBG", scope)
        assert (photon_rates(raw, "GRBG", Light(500, scope), energies) == 0).all()


def test_a_monochrome_sensor_sees_luminance() -> None:
    white = np.full((2, 2, 3), 7.0)
    np.testing.assert_allclose(sense(white, None), 7.0, rtol=1e-12)


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
def test_multinomial_totals_are_exact(scope: str) -> None:
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


def test_streams_are_keyed_and_do_not_collide() -> None:
    keys = [
        (s, v, st) for s in (0, 1, 5) for v in (0, 1, 2) for st in ("radiance", "photons", "budget totals")
    ]
    drawn = {seeds.integer(s, view=v, stage=st) for s, v, st in keys}  # type: ignore[arg-type]
    assert len(drawn) == len(keys)
    assert seeds.integer(5, view=2, stage="photons") == seeds.integer(5, view=2, stage="photons")
