"""Means and standard deviations of NIST's reference data, with their certified values, through sections.

One datum is one view of one pixel, so that the mean and the variance of a section far away are those of the
data. Certified values: Statistical Reference Datasets, National Institute of Standards and Technology.
"""

from math import log10

import numpy as np
import pytest
from twins import unit_grid

import pcii

FAR_MM = 1e9


def alternating(middle: float, low: float, high: float) -> list[float]:
    return [middle, *[low, high] * 500]


# Data, certified mean and standard deviation. As float64 NumAcc4 is off its decimals by 2e-9 of the
# deviation, which leaves 8 digits. In float32, which has seven, only whole numbers are those of the data.
SETS: dict[str, tuple[list[float], float, float]] = {
    "NumAcc1": ([10000001, 10000003, 10000002], 10000002, 1),
    "NumAcc2": (alternating(1.2, 1.1, 1.3), 1.2, 0.1),
    "NumAcc3": (alternating(1000000.2, 1000000.1, 1000000.3), 1000000.2, 0.1),
    "NumAcc4": (alternating(10000000.2, 10000000.1, 10000000.3), 10000000.2, 0.1),
}


def digits(found: float, certified: float) -> float:
    """Number of correct decimal digits, at most 15: the logarithm of the relative error."""
    return 15.0 if found == certified else min(15.0, -log10(abs(found / certified - 1)))


@pytest.mark.parametrize(("name", "dtype"), [(n, "f8") for n in SETS] + [("NumAcc1", "f4")])
def test_sections_of_radiance(name: str, dtype: str) -> None:
    data, mean, deviation = SETS[name]
    grid = unit_grid(1, len(data), 1, 1)
    light = np.array(data).astype(dtype).reshape(*grid.shape_KLHW, 1)
    sections = pcii.reconstruct(pcii.Views(light, grid), FAR_MM, variance=True)
    assert sections.variance is not None
    single = sections.counts.dtype == np.float32  # results are rounded to it once
    assert digits(sections.estimate.item(), mean) > (7 if single else 14)
    least = 7 if single else {"NumAcc3": 8.5, "NumAcc4": 8.0}.get(name, 11.5)
    assert digits(float(np.sqrt(sections.variance, dtype=np.float64).item()), deviation) > least
