"""Means and standard deviations of NIST's reference data, with their certified values, through sections.

One datum is one view of one pixel, so that the mean and the variance of a section far away are those of the
data. Certified values: Statistical Reference Datasets, National Institute of Standards and Technology.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import log10, sqrt

import numpy as np
import pytest
from nist_univariate import LEW, LOTTERY
from rational_sections import variance_of
from twins import unit_grid

import pcii

FAR_MM = 1e9


def alternating(middle: str, low: str, high: str) -> list[str]:
    return [middle, *[low, high] * 500]


@dataclass(frozen=True)
class Certified:
    """A data set as decimal text, and the 15 certified digits of its mean and standard deviation."""

    data: Sequence[str]
    mean: float
    deviation: float

    @property
    def side(self) -> tuple[int, int]:
        """Rows and columns of cameras, one for each datum."""
        rows = next(n for n in range(int(sqrt(len(self.data))), 0, -1) if len(self.data) % n == 0)
        return rows, len(self.data) // rows


SETS = {
    "Lottery": Certified(LOTTERY.split(), 518.958715596330, 291.699727470969),
    "Lew": Certified(LEW.split(), -177.435000000000, 277.332168044316),
    "NumAcc1": Certified(["10000001", "10000003", "10000002"], 10000002, 1),
    "NumAcc3": Certified(alternating("1000000.2", "1000000.1", "1000000.3"), 1000000.2, 0.1),
    "NumAcc4": Certified(alternating("10000000.2", "10000000.1", "10000000.3"), 10000000.2, 0.1),
}
IN_FLOAT32 = ("Lottery", "Lew", "NumAcc1")
"""Whole numbers below 2^24. Of the others float32 holds seven digits, of which a mean of 10^7 takes all."""
COUNTED = ("Lottery", "NumAcc1")
"""What photons can be: whole numbers of at least 0."""


def digits(found: float, certified: float) -> float:
    """Number of correct decimal digits, at most 15: the logarithm of the relative error."""
    return 15.0 if found == certified else min(15.0, -log10(abs(found / certified - 1)))


@pytest.mark.parametrize("name", SETS)
def test_the_data_are_the_certified_ones(name: str) -> None:
    """As fractions they have the certified values to all digits; a datum mistyped would show."""
    certified = SETS[name]
    data = [Fraction(text) for text in certified.data]
    assert digits(float(sum(data) / len(data)), certified.mean) > 14
    assert digits(sqrt(variance_of(data)), certified.deviation) > 14


@pytest.mark.parametrize(("name", "dtype"), [(n, "f8") for n in SETS] + [(n, "f4") for n in IN_FLOAT32])
def test_sections_of_radiance(name: str, dtype: str) -> None:
    """As float64 NumAcc4 is off its decimals by 2e-9 of the deviation, which leaves 8 digits."""
    certified = SETS[name]
    grid = unit_grid(*certified.side, 1, 1)
    light = np.array(certified.data, dtype=np.float64).astype(dtype).reshape(*grid.shape_KLHW, 1)
    sections = pcii.reconstruct(pcii.Views(light, grid), FAR_MM, variance=True)
    assert sections.variance is not None
    single = sections.counts.dtype == np.float32  # results are rounded to it once
    assert digits(sections.estimate.item(), certified.mean) > (7 if single else 14)
    least = 7 if single else {"NumAcc3": 8.5, "NumAcc4": 8.0}.get(name, 11.5)
    assert digits(float(np.sqrt(sections.variance, dtype=np.float64).item()), certified.deviation) > least


@pytest.mark.parametrize("name", COUNTED)
@pytest.mark.parametrize("dense", [True, False])
def test_sections_of_photons(name: str, dense: bool) -> None:
    certified = SETS[name]
    grid = unit_grid(*certified.side, 1, 1)
    film = np.array(certified.data, dtype=np.int64).reshape(grid.shape_KLHW)
    k, l, i, j = np.nonzero(film)
    counts = (
        pcii.PhotonCounts.from_dense(film, grid)
        if dense
        else pcii.PhotonCounts.from_events(k, l, i, j, film[k, l, i, j], grid)
    )
    sections = pcii.reconstruct(counts, FAR_MM, variance=True)
    assert sections.variance is not None
    assert digits(sections.estimate.item(), certified.mean) > 14
    assert digits(sqrt(sections.variance.item()), certified.deviation) > 14
