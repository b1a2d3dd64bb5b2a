"""Intervals and paired tests: against SciPy, by hand, and by simulation with planted faults."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy import stats

from pcii.base.errors import InputError
from pcii.evaluation.paired_tests import (
    EXACT_UP_TO,
    FLIPS,
    Mean,
    mean_interval,
    paired_difference,
    positive_mean_interval,
)


@pytest.mark.parametrize("n", [2, 3, 20])
def test_the_interval_is_students(n: int) -> None:
    x = np.random.default_rng(n).normal(0.7, 0.1, n)
    known = stats.ttest_1samp(x, 0).confidence_interval(0.95)
    found = mean_interval(x.tolist())
    assert (found.n, found.mean) == (n, pytest.approx(x.mean()))
    assert (found.low, found.high) == (pytest.approx(known.low), pytest.approx(known.high))


def test_three_values_by_hand() -> None:
    # t(0.975, 2) = 4.302653; the standard deviation is 0.2: 4.302653 * 0.2 / sqrt(3) = 0.496828
    found = mean_interval([0.6, 0.8, 1.0], (0.0, 1.0))
    assert found.mean == pytest.approx(0.8)
    assert found.low == pytest.approx(0.303172, abs=1e-6)
    assert found.high == 1.0  # 1.297 is no share


def test_one_value_has_no_interval_and_equal_ones_one_without_width() -> None:
    one = mean_interval([0.4])
    assert (one.n, one.mean, one.low, one.high) == (1, 0.4, None, None)
    same = mean_interval([0.5, 0.5, 0.5])
    assert same.low == same.mean == same.high == 0.5


@pytest.mark.parametrize("values", [[], [0.5, float("nan")], [float("inf")]])
@pytest.mark.parametrize("interval", [mean_interval, positive_mean_interval])
def test_what_has_no_mean_is_refused(interval: Callable[..., Mean], values: list[float]) -> None:
    with pytest.raises(InputError, match="at least one finite number"):
        interval(values)


def test_times_have_no_negative_interval() -> None:
    # Mean 2, deviation 1: 4.302653 / (2 sqrt(3)) = 1.242069, whose exponential is 3.462770.
    found = positive_mean_interval([1.0, 2.0, 3.0])
    assert found.mean == 2.0
    assert found.low == pytest.approx(2 / 3.462770, abs=1e-6)
    assert found.high == pytest.approx(2 * 3.462770, abs=1e-5)
    # One of five took a hundred times as long: Student's interval of the mean itself is from -32 to 74.
    found = positive_mean_interval([1.0, 1.0, 1.0, 1.0, 100.0])
    assert found.low is not None
    assert 0 < found.low < found.mean
    assert (mean_interval([1.0, 1.0, 1.0, 1.0, 100.0]).low or 0) < -30


def test_times_of_nothing_and_negative_ones() -> None:
    none = positive_mean_interval([0.0, 0.0])
    assert (none.mean, none.low, none.high) == (0.0, 0.0, 0.0)
    assert positive_mean_interval([0.3]).low is None
    with pytest.raises(InputError, match="at least 0"):
        positive_mean_interval([1.0, -1.0])


TRIALS = 4000
# Share of trials that a 95 % interval covers: standard deviation sqrt(0.95 * 0.05 / 4000) = 0.0034.
TOLERANCE = 4 * 0.0034


def test_the_interval_covers_the_truth_as_often_as_it_says() -> None:
    rng = np.random.default_rng(3)
    covered, by_normal = 0, 0
    for x in rng.normal(0.5, 0.1, (TRIALS, 5)):
        found = mean_interval(x.tolist())
        assert found.low is not None
        assert found.high is not None
        covered += found.low <= 0.5 <= found.high
        by_normal += abs(x.mean() - 0.5) <= 1.96 * x.std(ddof=1) / np.sqrt(5)
    assert abs(covered / TRIALS - 0.95) < TOLERANCE
    # The planted fault: the normal distribution's 1.96 instead of Student's 2.78 covers 88 %.
    assert abs(by_normal / TRIALS - 0.95) > TOLERANCE


def test_the_interval_of_times_covers_skewed_ones_better_than_students() -> None:
    rng = np.random.default_rng(8)
    covered, by_student = 0, 0
    for x in rng.exponential(1.0, (TRIALS, 5)):
        found, student = positive_mean_interval(x.tolist()), mean_interval(x.tolist())
        assert found.low is not None
        assert found.high is not None
        assert student.low is not None
        assert student.high is not None
        covered += found.low <= 1.0 <= found.high
        by_student += student.low <= 1.0 <= student.high
    # 0.93 and 0.88 of 20 000 trials of the same kind.
    assert abs(covered / TRIALS - 0.93) < TOLERANCE
    assert covered - by_student > TOLERANCE * TRIALS


@pytest.mark.parametrize(
    ("differences", "p"),
    [
        ([1, 2, 3], 2 / 8),  # only all signs kept or all flipped are as far as 6
        ([1, 2, -3], 1.0),  # the sum is 0, and nothing is nearer
        ([4, 2, -1], 4 / 8),  # as far as 5: 4+2+1, 4+2-1 and their opposites
        ([0.1, 0.1, 0.1], 2 / 8),
        ([0, 0, 0, 0], 1.0),
        ([5], 1.0),
    ],
)
def test_few_signs_are_flipped_by_hand(differences: list[float], p: float) -> None:
    found = paired_difference(differences, [0.0] * len(differences))
    assert found.exact
    assert found.p == p
    assert found.difference.mean == pytest.approx(np.mean(differences))


ALL = 1 << 20  # more than there are


def permuted(x: np.ndarray, y: np.ndarray) -> float:
    """SciPy's own paired permutation test, of all assignments."""
    result = stats.permutation_test(
        (x, y), lambda a, b: np.mean(a - b), permutation_type="samples", n_resamples=ALL
    )
    return float(result.pvalue)


def test_the_exact_test_is_scipys() -> None:
    rng = np.random.default_rng(4)
    x, y = rng.normal(0.8, 0.1, 10), rng.normal(0.75, 0.1, 10)
    assert paired_difference(x.tolist(), y.tolist()).p == pytest.approx(permuted(x, y))
    # The planted fault: pairs torn apart give another p.
    assert paired_difference(x.tolist(), y[::-1].tolist()).p != pytest.approx(permuted(x, y))


def test_many_signs_are_drawn_and_agree_with_all_of_them() -> None:
    rng = np.random.default_rng(5)
    n = EXACT_UP_TO + 1
    x, y = rng.normal(0.80, 0.1, n), rng.normal(0.75, 0.1, n)
    found = paired_difference(x.tolist(), y.tolist())
    assert not found.exact
    p = permuted(x, y)
    assert abs(found.p - p) < 4 * np.sqrt(p * (1 - p) / FLIPS)  # four standard deviations of the share
    assert paired_difference(x.tolist(), y.tolist()).p == found.p
    assert paired_difference((x + 1).tolist(), y.tolist()).p == 1 / (1 + FLIPS)


def test_chance_is_seldom_called_a_difference() -> None:
    rng = np.random.default_rng(6)
    found = [paired_difference(x.tolist(), [0.0] * 8).p for x in rng.normal(0, 1, (2000, 8))]
    # p comes in steps of 2 / 256, of which 0.05 is none: at most 12 / 256 are below. 4 deviations of it.
    share = 12 / 256
    assert abs(np.mean(np.array(found) <= 0.05) - share) < 4 * np.sqrt(share / 2000)
    # The planted fault: a difference of one standard deviation is found far more often.
    found = [paired_difference(x.tolist(), [0.0] * 8).p for x in rng.normal(1, 1, (2000, 8))]
    assert np.mean(np.array(found) <= 0.05) > 0.5


def test_values_that_do_not_pair_are_refused() -> None:
    with pytest.raises(InputError, match="same datasets"):
        paired_difference([1.0, 2.0], [1.0])
    with pytest.raises(InputError, match="at least one"):
        paired_difference([], [])
