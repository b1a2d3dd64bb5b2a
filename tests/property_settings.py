"""How many cases a test takes by default, and how many more `-m slow` or the profile of Hypothesis add."""

from collections.abc import Collection, Iterable
from typing import Any

import pytest
from hypothesis import settings


def at_least(number: int) -> settings:
    """Settings of so many cases, or of 10 000 with `--hypothesis-profile=stress`."""
    return settings(max_examples=max(number, settings().max_examples), deadline=None)


def mostly_slow(cases: Iterable[Any], quick: Collection[Any]) -> list[Any]:
    """All cases for `parametrize`, of which those that are not `quick` are slow tests."""
    every = list(cases)
    assert all(case in every for case in quick)
    marks = {False: [pytest.mark.slow], True: []}
    return [
        pytest.param(*(case if isinstance(case, tuple) else (case,)), marks=marks[case in quick])
        for case in every
    ]
