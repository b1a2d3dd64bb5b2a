"""docs/numerical_limits.md is what its script makes of real calls, and nothing in it is a surprise."""

import runpy
from pathlib import Path
from typing import Any

import pytest

import pcii
import simgen

DOCS = Path(__file__).resolve().parent.parent / "docs"
PAGE = DOCS / "numerical_limits.md"
SLOW_CALLS = {"segment", "estimate_depth", "reconstruct"}
CELLS = {"value", "NaN, documented", "refused", "·", "value or refused", "value or NaN, documented"}


@pytest.fixture(scope="module")
def script() -> dict[str, Any]:
    return runpy.run_path(str(DOCS / "make_numerical_limits.py"))


def test_lines_of_the_page_are_what_the_script_makes(script: dict[str, Any]) -> None:
    lines = [line for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith("| ")][1:]
    rows = script["rows"]()
    assert len(lines) == len(rows)
    assert {cell for line in lines for cell in line.strip("|").split("|")[1:]} <= CELLS
    for line, (label, (name, call)) in zip(lines, rows.items(), strict=True):
        if name not in SLOW_CALLS:
            assert line == script["row"](label, name, call)


@pytest.mark.slow
def test_the_page_is_what_the_script_makes(script: dict[str, Any]) -> None:
    """A call that fails with another error, warns, or gives NaN that is not documented stops the script."""
    assert script["page"]() == PAGE.read_text(encoding="utf-8"), "run docs/make_numerical_limits.py"


def test_every_public_name_is_on_the_page(script: dict[str, Any]) -> None:
    called = {name.removeprefix("simgen.") for name, _ in script["rows"]().values()}
    assert called | set(script["NO_NUMBERS"]) == {*pcii.__all__, *simgen.__all__}
    assert not called & set(script["NO_NUMBERS"])
