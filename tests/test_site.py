"""The site: every public name is in the reference, and every quoted figure is a measured one."""

import re
from pathlib import Path

import pytest

import pcii
import simgen
from benchmarks.quoted import MARK, pages, read_figures, rewritten, text_of
from benchmarks.results import Value
from pcii.base import InputError

DOCS = Path(__file__).resolve().parent.parent / "docs"


def test_every_public_name_has_a_page_in_the_reference() -> None:
    text = (DOCS / "reference.md").read_text(encoding="utf-8")
    for module in (pcii, simgen):
        blocks = re.findall(rf"currentmodule:: {module.__name__}\n(.*?)```", text, re.DOTALL)
        listed = re.findall(r"^   (\w+)$", "\n".join(blocks), re.MULTILINE)
        assert sorted(listed) == sorted(module.__all__)


def test_the_glossary_names_rooms_and_modules_that_are_there() -> None:
    text = (DOCS / "glossary.md").read_text(encoding="utf-8")
    last_cells = re.findall(r"^\|.*\|(.*)\|$", text, re.MULTILINE)
    places = [place for cell in last_cells for place in re.findall(r"`([\w.]+)`", cell)]
    assert len(places) > 20
    for place in places:
        folder = "" if place.startswith("simgen") else "pcii"
        path = DOCS.parent / folder / place.replace(".", "/")
        assert path.is_dir() or path.with_suffix(".py").is_file(), place


GENERATED = {"benchmarks.md", "gallery.md", "camera_sets.md"}
"""Pages whose tables scripts write or print."""
RESULTS = re.compile(
    r"\bIoU(?:\W+\w+){0,2}?\W+[01]?\.\d"  # an IoU with a number
    r"|\d (?:ms|µs|s|seconds?|minutes?|hours?)\b"  # a time
    r"|\d (?:×|x|times) (?:as (?:fast|long|slow)|the time|faster|slower)"  # a ratio of times
    r"|\d (?:px|mm) (?:in the median|too (?:far|near))|median error (?:\w+ ){0,2}\d"  # an error of depth
    r"|\d ?% of the (?:depths|pixels|answers|surfaces)\b|\bright(?: \w+){0,4} [01]?\.\d"  # a share
    r"|\d ± \d"  # a mean with its interval
)
NO_RESULTS = {
    "| a pixel, for 10 ms |": "light.md: an exposure time of an example",
    "× 0.01 s |": "light.md: the same",
    "1.41 ± 0.04 px": "theory.md: simulated for the bound, of no method of ours",
}


def unmarked_results(text: str) -> list[str]:
    """What looks like a measured figure outside marks, comments, code and equations."""
    text = re.sub(r"^```.*?^```", "", MARK.sub("", text), flags=re.DOTALL | re.MULTILINE)
    for known in NO_RESULTS:
        text = text.replace(known, "")
    return [match[0] for match in RESULTS.finditer(re.sub(r"`[^`\n]+`|\$+[^$]+\$+|\s+", " ", text))]


@pytest.mark.parametrize("page", pages(), ids=lambda page: page.name)
def test_figures_of_a_page_are_those_of_the_last_publishing(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert rewritten(page.name, text, read_figures()["figures"]) == text
    assert not re.search(r"^<!-- ", text, re.MULTILINE), "a line that begins with a mark is HTML to Markdown"
    if page.name not in GENERATED:
        assert unmarked_results(text) == []


def test_figures_have_a_source_and_say_their_value() -> None:
    content = read_figures()
    for name, figure in content["figures"].items():
        assert figure["text"] == text_of(name, Value(figure["value"], figure["low"], figure["high"]))
        assert {"command", "machine", "date", "commit"} <= {*content["sources"][figure["source"]]}


def test_a_mark_of_no_figure_is_refused() -> None:
    assert rewritten("x.md", "<!-- a -->1 s<!-- -->", {"a": {"text": "2 s"}}) == "<!-- a -->2 s<!-- -->"
    with pytest.raises(InputError, match=r"x\.md: quotes 'a'"):
        rewritten("x.md", "<!-- a -->1 s<!-- -->", {})
