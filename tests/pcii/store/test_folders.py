"""Whose folder it is, its document, its list of files, for every kind of folder alike."""

import hashlib
import json
from pathlib import Path
from typing import Any

import pytest
from stored_datasets import flip_a_bit, one_sentence

from pcii.base import write_bytes_safely
from pcii.store import (
    COLLECTION_FOLDER,
    DATASET_FOLDER,
    EVALUATION_FOLDER,
    RESULTS_FOLDER,
    check_free,
    check_size,
    list_files,
    read_listed,
    unlisted_files,
)

FOLDERS: list[Any] = [DATASET_FOLDER, COLLECTION_FOLDER, RESULTS_FOLDER, EVALUATION_FOLDER]


@pytest.fixture(params=FOLDERS, ids=lambda kind: kind.what)
def kind(request: pytest.FixtureRequest) -> Any:
    return request.param


def test_new_and_empty_folders_and_those_of_its_kind_may_be_written_to(kind: Any, tmp_path: Path) -> None:
    assert kind.guard(tmp_path / "new" / "deep") == kind.guard(tmp_path) == set()
    (tmp_path / f".{kind.document}.x1.tmp").touch()  # left by a kill
    assert kind.guard(tmp_path) == set()
    for mark in kind.marks:
        out = tmp_path / mark
        out.mkdir()
        (out / mark).touch()
        (out / "part").touch()
        assert kind.guard(out) == {mark, "part"}


def test_what_else_there_is_is_refused(kind: Any, tmp_path: Path) -> None:
    file = tmp_path / "thesis.tex"
    file.write_text("years of work")
    for check in (kind.guard, lambda folder: check_free(folder, kind.what)):
        assert "holds something else; name a new" in one_sentence(lambda c=check: c(tmp_path), tmp_path)
        assert f"name a folder for the {kind.what}" in one_sentence(lambda c=check: c(file), file)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


def test_a_document_that_is_missing_or_of_others_is_refused(kind: Any, tmp_path: Path) -> None:
    path, nowhere = tmp_path / kind.document, tmp_path / "nowhere"
    assert f"no such {kind.what} folder" in one_sentence(lambda: kind.read(nowhere), nowhere)
    assert f"`{kind.command}` makes one" in one_sentence(lambda: kind.read(tmp_path), tmp_path)
    for change in ({"format": "of others"}, {"format_version": kind.version + 1}, {"format_version": None}):
        kind.write(tmp_path, change)
        assert f"expected a {kind.format}" in one_sentence(lambda: kind.read(tmp_path), path)
    for content in (b"", b"[]", b'{"\xff": 1}'):
        path.write_bytes(content)
        assert "damaged" in one_sentence(lambda: kind.read(tmp_path), path)


def test_every_bit_and_byte_of_the_manifest_of_a_dataset_is_guarded(tmp_path: Path) -> None:
    DATASET_FOLDER.write(tmp_path, {"a": 1})
    path = tmp_path / DATASET_FOLDER.document
    content = path.read_bytes()
    stated = json.loads(content)["sha256"]
    assert hashlib.sha256(content.replace(stated.encode(), b"0" * 64)).hexdigest() == stated

    def refused() -> None:
        one_sentence(lambda: DATASET_FOLDER.read(tmp_path), path)

    for bit in range(0, 8 * len(content), 7):
        flip_a_bit(path, bit)
        refused()
        path.write_bytes(content)
    for other in (*(content[:length] for length in range(len(content))), content + b"\n", 2 * content):
        path.write_bytes(other)
        refused()


def test_files_are_listed_with_their_sizes_and_hashes(tmp_path: Path) -> None:
    write_bytes_safely(tmp_path / "b" / "c.bin", b"abc")
    write_bytes_safely(tmp_path / "a.bin", b"")
    listed = list_files(tmp_path, ["b", "a.bin"])
    # The SHA-256 of nothing and of "abc" are those of the standard's examples.
    assert {name: (entry["bytes"], entry["sha256"][:16]) for name, entry in listed.items()} == {
        "b/c.bin": (3, "ba7816bf8f01cfea"),
        "a.bin": (0, "e3b0c44298fc1c14"),
    }
    flip_a_bit(tmp_path / "b" / "c.bin", 3)
    check_size(tmp_path, "b/c.bin", listed["b/c.bin"])
    path = tmp_path / "b" / "c.bin"
    one_sentence(lambda: read_listed(tmp_path, "b/c.bin", listed["b/c.bin"]), path)
    (tmp_path / "b" / "link").symlink_to(path)
    assert unlisted_files(tmp_path, ["a.bin", "b/c.bin"]) == ["b/link"]
