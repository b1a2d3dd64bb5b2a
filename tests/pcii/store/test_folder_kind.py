"""Whose folder it is, and its document, for every kind of folder alike."""

from pathlib import Path

import pytest
from stored_datasets import flip_a_bit, one_sentence

from pcii.store.collection_layout import COLLECTION_FOLDER
from pcii.store.dataset_layout import DATASET_FOLDER, MARKER
from pcii.store.evaluation_layout import EVALUATION_FOLDER, ROWS
from pcii.store.folder_kind import FolderKind, check_free
from pcii.store.sealed_json import write_sealed

KINDS = {kind.what: kind for kind in (DATASET_FOLDER, COLLECTION_FOLDER, EVALUATION_FOLDER)}


@pytest.fixture(params=KINDS)
def kind(request: pytest.FixtureRequest) -> FolderKind:
    return KINDS[request.param]


def test_new_and_empty_folders_and_those_of_its_kind_may_be_written_to(
    kind: FolderKind, tmp_path: Path
) -> None:
    assert kind.guard(tmp_path / "new" / "deep") == kind.guard(tmp_path) == set()
    for mark in kind.marks:
        out = tmp_path / mark
        out.mkdir()
        (out / mark).touch()
        (out / "part").touch()
        assert kind.guard(out) == {mark, "part"}


def test_what_else_there_is_is_refused(kind: FolderKind, tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("years of work")
    assert "holds something else; name a new" in one_sentence(lambda: kind.guard(tmp_path), tmp_path)
    file = tmp_path / "thesis.tex"
    assert f"name a folder for the {kind.what}" in one_sentence(lambda: kind.guard(file), file)
    assert "holds something else; name a new" in one_sentence(lambda: check_free(tmp_path, "x"), tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


def test_a_kill_while_a_folder_is_begun_leaves_it_new(kind: FolderKind, tmp_path: Path) -> None:
    (tmp_path / f".{kind.document}.x1.tmp").touch()
    assert kind.guard(tmp_path) == set()


def test_marks_of_unfinished_work_are_known() -> None:
    assert MARKER in DATASET_FOLDER.marks
    assert ROWS in EVALUATION_FOLDER.marks


def test_a_document_comes_back_after_its_format(kind: FolderKind, tmp_path: Path) -> None:
    kind.write(tmp_path, {"a": [1]})
    found = kind.read(tmp_path)
    assert list(found) == ["format", "format_version", "a"]
    assert (found["format"], found["a"]) == (f"photon-integral-imaging {kind.what}", [1])


def test_a_document_that_is_missing_changed_or_of_others_is_refused(kind: FolderKind, tmp_path: Path) -> None:
    path, none = tmp_path / kind.document, tmp_path / "none"
    assert f"no such {kind.what} folder" in one_sentence(lambda: kind.read(none), none)
    assert kind.absent in one_sentence(lambda: kind.read(tmp_path), tmp_path)
    kind.write(tmp_path, {})
    flip_a_bit(path, 30)
    assert kind.remedy in one_sentence(lambda: kind.read(tmp_path), path)
    other = {"format": "of others", "format_version": kind.version}
    write_sealed(path, other)
    assert f"not of a {kind.format}" in one_sentence(lambda: kind.read(tmp_path), path)
    for version in (kind.version + 1, 0, None, str(kind.version)):
        write_sealed(path, {"format": kind.format, "format_version": version})
        message = one_sentence(lambda: kind.read(tmp_path), path)
        assert f"{version!r} is not supported" in message
    with path.open("wb") as file:
        file.truncate(kind.largest_bytes + 1)
    assert "larger than" in one_sentence(lambda: kind.read(tmp_path), path)
