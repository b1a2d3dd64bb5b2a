"""The renderer's variant after tests in spectra."""

import sys
from collections.abc import Iterator

import pytest

from simgen.renderer import backend


@pytest.fixture(autouse=True, scope="module")
def variant_is_put_back() -> Iterator[None]:
    yield
    if "mitsuba" in sys.modules:
        backend.load()
