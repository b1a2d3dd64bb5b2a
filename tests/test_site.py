"""The site: links lead somewhere, every public name is in the reference, figures have one source."""

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


def test_links_that_lead_nowhere_are_found(tmp_path: Path) -> None:
    (tmp_path / "api").mkdir()
    (tmp_path / "index.html").write_text(
        '<p id="top"><a href="api/a.html#there">1</a><a href="#top">2</a><a href="https://zarr.dev">3</a>'
        '<a href="api/b.html">4</a><a href="api/a.html#gone">5</a><a href="tcp://10.0.0.1">6</a>'
        '<img src="x.png">'
    )
    (tmp_path / "api" / "a.html").write_text('<a id="there" href="../index.html">up</a>')
    broken_links = runpy.run_path(str(DOCS / "check_links.py"))["broken_links"]
    assert [line.split(": ")[1] for line in broken_links(tmp_path)] == [
        "api/b.html",
        "api/a.html#gone",
        "tcp://10.0.0.1",
        "x.png",
    ]


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
