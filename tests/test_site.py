"""The site: every public name is in the reference, figures have one source."""

import re
import runpy
from pathlib import Path

import pytest

import pcii
import simgen

DOCS = Path(__file__).resolve().parent.parent / "docs"
BOTH = ["README.md", "docs/photons.md"]


def test_every_public_name_has_a_page_in_the_reference() -> None:
    text = (DOCS / "reference.md").read_text(encoding="utf-8")
    for module in (pcii, simgen):
        blocks = re.findall(rf"currentmodule:: {module.__name__}\n(.*?)```", text, re.DOTALL)
        listed = re.findall(r"^   (\w+)$", "\n".join(blocks), re.MULTILINE)
        assert sorted(listed) == sorted(module.__all__)


@pytest.mark.parametrize(
    ("table", "row", "unit", "pages"),
    [
        ("Photon counts of the paper's recipe", "thinning, 1000 photons per view", "ms", BOTH),
        ("Photons: cost", "thinning against dense with 16 samples, the paper's recipe", "×", BOTH),
        ("Sections at the paper's size", "events", "ms", ["README.md"]),
        ("Sections: time", "events against OpenCV, bilinear", "×", ["README.md"]),
    ],
)
def test_figures_that_pages_quote_are_those_of_the_benchmarks(
    table: str, row: str, unit: str, pages: list[str]
) -> None:
    measured = (DOCS / "benchmarks.md").read_text(encoding="utf-8").partition(table)[2]
    cell = measured.partition(f"\n| {row} | ")[2].partition(" |")[0]
    number, interval = cell.split(" ", 1)
    for page in pages:
        text = " ".join((DOCS.parent / page).read_text(encoding="utf-8").split())
        assert f"{number} {unit}" in text, f"{page}: {row}: {cell}"
        if unit == "×":
            assert interval.strip("()") in text, f"{page}: {row}: {cell}"


def test_the_page_of_camera_sets_is_what_its_script_makes_of_the_measurements() -> None:
    script = runpy.run_path(str(DOCS / "make_camera_sets.py"))
    rows = script["read"](DOCS / "camera_sets.csv")
    assert script["page"](rows) == (DOCS / "camera_sets.md").read_text(encoding="utf-8")
