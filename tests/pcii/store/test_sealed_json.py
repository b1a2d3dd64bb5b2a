"""Documents that carry a checksum of themselves, and lists of files."""

import hashlib
import json
from pathlib import Path

import pytest
from stored_datasets import flip_a_bit, one_sentence

from pcii.base.safe_files import write_bytes_safely
from pcii.store.file_list import list_files, strays
from pcii.store.sealed_json import read_sealed, write_sealed


@pytest.fixture
def document(tmp_path: Path) -> Path:
    path = tmp_path / "a.json"
    write_sealed(path, {"name": "Ångström", "numbers": [1, 2.5, None]})
    return path


def test_a_document_comes_back_without_its_checksum(document):
    assert read_sealed(document, "again") == {"name": "Ångström", "numbers": [1, 2.5, None]}


def test_the_checksum_can_be_made_by_anyone(document):
    content = document.read_bytes()
    stated = json.loads(content)["sha256"]
    assert hashlib.sha256(content.replace(stated.encode(), b"0" * 64)).hexdigest() == stated


def test_every_bit_is_guarded(document):
    content = document.read_bytes()
    for bit in range(8 * len(content)):
        flip_a_bit(document, bit)
        one_sentence(lambda: read_sealed(document, "again"), document)
        document.write_bytes(content)


def test_every_truncation_and_any_addition_is_found(document):
    content = document.read_bytes()
    for length in range(len(content)):
        document.write_bytes(content[:length])
        one_sentence(lambda: read_sealed(document, "again"), document)
    for more in (b"\n", b" ", content):
        document.write_bytes(content + more)
        one_sentence(lambda: read_sealed(document, "again"), document)


BODIES = {
    "objects": b'{"a":' * 100_000,
    "lists": b"[" * 100_000,
    "NaN": b'{"a": NaN, ',
    "Infinity": b'{"a": Infinity, ',
    "digits": b'{"a": ' + b"9" * 5000 + b", ",
    "not UTF-8": b'{"\xff": 1, ',
    "no start": b"",
}


@pytest.mark.parametrize("body", BODIES.values(), ids=BODIES.keys())
def test_content_that_is_no_json_is_refused_though_its_checksum_is_right(tmp_path, body):
    path = tmp_path / "a.json"
    blank = body + b'"sha256": "' + b"0" * 64 + b'"\n}\n'
    path.write_bytes(blank.replace(b"0" * 64, hashlib.sha256(blank).hexdigest().encode()))
    assert "not valid JSON" in one_sentence(lambda: read_sealed(path, "again"), path)


def test_files_are_listed_by_their_place_in_the_dataset(tmp_path):
    write_bytes_safely(tmp_path / "b" / "c.bin", b"abc")
    write_bytes_safely(tmp_path / "a.bin", b"")
    listed = list_files(tmp_path, ["b", "a.bin"])
    # The SHA-256 of nothing and of "abc" are those of the standard's examples.
    assert listed["a.bin"]["bytes"] == 0
    assert listed["a.bin"]["sha256"].startswith("e3b0c44298fc1c14")
    assert listed["b/c.bin"]["bytes"] == 3
    assert listed["b/c.bin"]["sha256"].startswith("ba7816bf8f01cfea")
    assert len(listed) == 2


def test_strays_are_files_folders_and_links_that_are_not_listed(tmp_path):
    for name in ("a", "b/c", "b/extra", "other/d"):
        write_bytes_safely(tmp_path / name, b"")
    (tmp_path / "b" / "link").symlink_to(tmp_path / "a")
    (tmp_path / "empty").mkdir()
    assert strays(tmp_path, ["a", "b/c"]) == ["b/extra", "b/link", "empty/", "other/"]
    assert strays(tmp_path, ["a", "b/c", "b/extra", "b/link", "other/d"]) == ["empty/"]
