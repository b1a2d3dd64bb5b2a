"""A clock that tests advance themselves, so that no test of timing depends on speed."""

from types import SimpleNamespace

import pytest


class SlowClock:
    """In the place of the clock of `pcii.evaluation.measurement` until the test ends."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_s = 0.0
        monkeypatch.setattr(
            "pcii.evaluation.measurement.time", SimpleNamespace(perf_counter=lambda: self.now_s)
        )

    def go_on(self, seconds: float) -> None:
        self.now_s += seconds
