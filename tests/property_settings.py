"""Which cases a test takes by default, and which only `-m slow` does."""

from collections.abc import Collection, Iterable
from typing import Any

import pytest


def mostly_slow(cases: Iterable[Any], quick: Collection[Any]) -> list[Any]:
    """All cases for `parametrize`, of which those that are not `quick` are slow tests."""
    every = list(cases)
    assert all(case in every for case in quick)
    marks = {False: [pytest.mark.slow], True: []}
    return [
        pytest.param(*(case if isinstance(case, tuple) else (case,)), marks=marks[case in quick])
        for case in every
    ]
