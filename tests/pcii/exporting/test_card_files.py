"""Cards for people and machines: valid, true to the files, the same every time, and no part of the data."""

import hashlib
import json
import re
from html.parser import HTMLParser
from pathlib import Path

import mlcroissant
import pytest
import yaml
from hostile_names import NAMES
from markdown_it import MarkdownIt
from stored_datasets import make_dataset, one_sentence

import pcii
from pcii.base.errors import InputError
from pcii.exporting.card_files import write_card
from pcii.exporting.publication_terms import CITATION, CREATOR, LICENCE, Terms
from pcii.io.collection_layout import COLLECTION_FOLDER, index_row, write_index
from pcii.io.dataset_layout import CARD, CROISSANT, MANIFEST, read_manifest
from pcii.io.verification import verify
from pcii.store.sealed_json import write_sealed

TABLE = ("table", "thead", "tbody", "tr", "th", "td")
ROOT = Path(__file__).resolve().parents[3]
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


@pytest.mark.parametrize("kind", ["dataset", "collection"])
def test_what_a_kill_left_of_a_card_is_swept(tmp_path: Path, kind: str) -> None:
    root = make_collection(tmp_path / "all") if kind == "collection" else make_dataset(tmp_path / "data")
    write_card(root, TERMS)
    before = (root / CARD).read_bytes()
    for name in (CARD, CROISSANT):
        (root / f".{name}.abcd1234.tmp").write_bytes(before[:9])
    with pytest.raises(InputError, match=r"not listed in .*, and read by nothing"):
        verify(root)
    write_card(root, TERMS)
    assert verify(root)
    assert (root / CARD).read_bytes() == before


def read_croissant(root: Path) -> tuple[mlcroissant.Dataset, dict]:
    """The document as MLCommons' own reader has it, which raises an exception if it is not valid."""
    dataset = mlcroissant.Dataset(jsonld=str(root / CROISSANT))
    issues = dataset.metadata.ctx.issues
    assert not issues.errors
    # A date would be another one in every run.
    assert all("datePublished" in warning for warning in issues.warnings), issues.report()
    return dataset, json.loads((root / CROISSANT).read_text())


def test_croissant_lists_every_file_of_a_dataset_with_its_hash(tmp_path):
    root = make_dataset(tmp_path / "data", recipe={"scene": "by hand", "seed": 3}, photons={"total": 5})
    write_card(root, TERMS)
    dataset, document = read_croissant(root)
    assert document["conformsTo"] == "http://mlcommons.org/croissant/1.0"
    listed = {part["contentUrl"]: part for part in document["distribution"] if "contentUrl" in part}
    files = {path.relative_to(root).as_posix() for path in root.rglob("*") if path.is_file()}
    assert set(listed) == files - {MANIFEST, CROISSANT}
    for name, part in listed.items():
        content = (root / name).read_bytes()
        assert part["sha256"] == hashlib.sha256(content).hexdigest()
        assert part["contentSize"] == f"{len(content)} B"
    (record,) = dataset.records("datasets")
    assert record == {"datasets/title": b"by hand", "datasets/scene": b"by hand"} | {
        "datasets/seed": 3,
        "datasets/photons": 5,
    }
    arrays = {row["arrays/path"]: row for row in dataset.records("arrays")}
    assert arrays["truth.zarr/z_mm"]["arrays/unit"] == "mm"
    assert arrays["counts.zarr/n"]["arrays/axes"] == "event"
    metadata = dataset.metadata
    assert metadata.license == ["https://spdx.org/licenses/CC-BY-4.0.html"]
    assert [creator.name for creator in metadata.creators] == ["Ada", "Grace"]
    assert (metadata.cite_as, metadata.url) == (TERMS.citation, TERMS.url)


def test_a_collection_has_one_card_and_a_record_for_each_dataset(tmp_path):
    root = make_collection(tmp_path / "two")
    write_card(root, TERMS)
    dataset, _ = read_croissant(root)
    records = list(dataset.records("datasets"))
    assert [record["datasets/photons.budget"] for record in records] == [10.0, 20.0]
    assert [record["datasets/identity"] for record in records] == [b"10.0", b"20.0"]
    assert not list(root.glob(f"*/{CARD}"))
    assert "| `photons.budget` | 2 | 10.0, 20.0 |" in (root / CARD).read_text()
    assert verify(root) == sum(path.is_file() for path in root.rglob("*"))


@pytest.mark.parametrize("make", [make_dataset, make_collection])
def test_cards_have_the_same_bytes_in_every_run(tmp_path, make, monkeypatch):
    first, second = make(tmp_path / "first"), make(tmp_path / "second")
    for folder in [second, *second.glob("budget_*")]:
        if (folder / MANIFEST).exists():
            write_sealed(folder / MANIFEST, read_manifest(folder) | {"timings_s": {"photons": 9.5}})
    if make is make_collection:
        rows = pcii.open_collection(second).rows
        again = [
            index_row(row["path"], row["values"], read_manifest(second / row["path"]), folder / MANIFEST)
            for row, folder in zip(rows, sorted(second.glob("budget_*")), strict=True)
        ]
        write_index(second, again)
    for root in (first, second):
        write_card(root, TERMS)
    for name in (CARD, CROISSANT):
        assert (first / name).read_bytes() == (second / name).read_bytes()


def test_a_card_can_be_written_again_with_other_terms(tmp_path):
    root = make_dataset(tmp_path / "data")
    before = (root / MANIFEST).read_bytes()
    write_card(root, Terms())
    write_card(root, TERMS)
    assert verify(root) == len(read_manifest(root)["files"]) + 2
    assert (root / MANIFEST).read_bytes() == before
    assert "CC-BY-4.0" in (root / CARD).read_text()
    assert LICENCE not in (root / CARD).read_text()
    root.chmod(0o500)
    written = (root / CARD).stat().st_mtime_ns
    write_card(root, TERMS)  # nothing to do
    assert (root / CARD).stat().st_mtime_ns == written
    root.chmod(0o700)


@pytest.mark.parametrize("make", [make_dataset, make_collection])
def test_every_change_to_a_card_is_found(tmp_path, make):
    root = make(tmp_path / "data")
    write_card(root, TERMS)
    for name in (CARD, CROISSANT):
        content = (root / name).read_bytes()
        for changed in (content.replace(b"Grace", b"Grave", 1), content[:-1], content + b"\n"):
            (root / name).write_bytes(changed)
            assert name in one_sentence(lambda: verify(root), root / name)
        (root / name).write_bytes(content)
    (root / CARD).unlink()
    assert "missing" in one_sentence(lambda: verify(root), root / CARD)


def test_a_card_of_other_data_or_of_nobody_is_an_error(tmp_path):
    root, other = make_dataset(tmp_path / "data"), make_dataset(tmp_path / "other", sparse=False)
    for folder in (root, other):
        write_card(folder, TERMS)
    for name in (CARD, CROISSANT):
        (root / name).write_bytes((other / name).read_bytes())
    assert "other files" in one_sentence(lambda: verify(root), root / CROISSANT)
    (root / CROISSANT).unlink()
    assert CARD in one_sentence(lambda: verify(root), root)
    assert "move it away" in one_sentence(lambda: write_card(root, TERMS), root / CARD)
    write_sealed(root / CROISSANT, {"distribution": [{"contentUrl": CARD, "contentSize": "x"}]})
    assert "damaged" in one_sentence(lambda: verify(root), root / CROISSANT)


class Shown(HTMLParser):
    """Elements of a page, and where its links lead."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags, self.links = set[str](), list[str]()
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)
        self.links += [value for _, value in attrs]


@pytest.mark.parametrize("name", NAMES, ids=range(len(NAMES)))
def test_names_with_markup_appear_as_plain_text_in_cards(tmp_path, name):
    root = make_dataset(tmp_path / "data", title=name, objects={"1": name})
    for address in (name, f"https://example.org/{name}", f"javascript://{name}"):
        write_card(root, Terms(address, (name,), name, address))
        front, body = (root / CARD).read_text().removeprefix("---\n").split("\n---\n", 1)
        values = yaml.safe_load(front)
        assert values["pretty_name"].encode(errors="replace") == name.encode(errors="replace")
        assert (values.get("license_link") or values["license"]).lower().startswith(address[:1].lower())
        page = Shown(MarkdownIt("gfm-like", {"html": True, "linkify": False}).render(body))
        assert page.tags <= {"h1", "h2", "p", "code", "pre", "a", "blockquote", *TABLE}
        assert all(str(link).startswith(("https://", "language-")) for link in page.links)


def test_the_default_terms_are_those_of_the_project():
    citation = (ROOT / "CITATION.cff").read_text()
    assert f"license: {LICENCE}" in citation
    assert f'name: "{CREATOR}"' in citation
    title = re.search(r'^title: "(.*)"$', citation, re.MULTILINE)
    assert title is not None
    assert CITATION.startswith(title[1])
    assert (ROOT / "LICENSE").read_text().startswith("BSD 3-Clause License")
