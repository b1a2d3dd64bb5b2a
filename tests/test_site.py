"""The site: every public name is in the reference."""

import re
from pathlib import Path

import pcii
import simgen

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
