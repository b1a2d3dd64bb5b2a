"""Cards: short, true to the data, the same every time, harmless, and no part of the data."""

import re
from pathlib import Path

import pytest
from hostile_names import NAMES
from markdown_it import MarkdownIt
from stored_datasets import make_dataset, rewrite_manifest

from pcii.base import InputError
from pcii.store import (
    CARD,
    COLLECTION_FOLDER,
    MANIFEST,
    Terms,
    index_row,
    read_manifest,
    verify,
    write_card,
    write_index,
    write_licence,
)
from pcii.store import LICENCE as LICENCE_FILE

MAX_LINES = 30
TERMS = Terms("CC-BY-4.0", ("Ada", "Grace"), "Ada and Grace, Photons, 2026", "https://example.org/photons")


def make_collection(root: Path) -> Path:
    """Two datasets by hand that differ in their budget."""
    root.mkdir()
    rows = []
    for budget in (10.0, 20.0):
        folder = root / f"budget_{budget:g}"
        recipe = {"scene": "by hand", "seed": 3, "photons": {"budget": budget}}
        make_dataset(folder, recipe=recipe, identity=f"{budget}", photons={"total": 5})
        values = {"photons.budget": budget}
        rows.append(index_row(folder.name, values, read_manifest(folder), folder / MANIFEST))
    COLLECTION_FOLDER.write(root, {"fields": ["photons.budget"], "recipe": {"scene": "by hand", "seed": 3}})
    write_index(root, rows)
    return root


@pytest.mark.parametrize("make", [make_dataset, make_collection])
def test_a_card_is_short_and_a_run_that_was_killed_leaves_none(tmp_path, make):
    root = make(tmp_path / "data")
    write_card(root, TERMS)
    text = (root / CARD).read_text()
    assert len(text.splitlines()) <= MAX_LINES
    write_licence(root, TERMS)
    for words in ("CC-BY-4.0", "Ada, Grace", TERMS.citation, TERMS.url):
        assert words in text
        assert words in (root / LICENCE_FILE).read_text()
    if make is make_collection:
        assert text.startswith("# by hand\n")  # the scene, where no title is stated
        assert "2 datasets, which differ in photons.budget" in text
    (root / f".{CARD}.abcd1234.tmp").write_text("# Half a ca")
    with pytest.raises(InputError, match="not listed in"):
        verify(root)
    write_card(root, TERMS)
    assert verify(root)
    assert (root / CARD).read_text() == text


def test_a_card_follows_the_data_and_the_terms_alone(tmp_path):
    root, other = make_dataset(tmp_path / "data"), make_dataset(tmp_path / "other")
    rewrite_manifest(other, timings_s={"photons": 9.5})
    for folder in (root, other):
        write_card(folder, Terms())
    assert (root / CARD).read_bytes() == (other / CARD).read_bytes()
    text = (root / CARD).read_text()
    assert "Licence: none is stated." in text  # what nobody has said
    before = (root / MANIFEST).read_bytes()
    write_card(root, TERMS)
    assert (root / MANIFEST).read_bytes() == before
    assert "none is stated" not in (root / CARD).read_text()
    (root / CARD).write_text("# My own words")
    write_card(root, TERMS)
    assert (root / CARD).read_text() == "# My own words"


@pytest.mark.parametrize("name", NAMES, ids=range(len(NAMES)))
def test_names_with_markup_appear_as_plain_text_in_cards(tmp_path, name):
    root = make_dataset(tmp_path / "data", title=name, objects={"1": name}, recipe={"scene": name})
    for address in (name, f"https://example.org/{name}", f"javascript://{name}"):
        write_card(root, Terms(address, (name,), name, address))
        page = MarkdownIt("gfm-like", {"html": True, "linkify": False}).render((root / CARD).read_text())
        assert {*re.findall(r"<(\w+)", page)} <= {"h1", "p", "code", "pre", "a", "blockquote"}
        assert all(link.startswith("https://") for link in re.findall('href="([^"]*)', page))
