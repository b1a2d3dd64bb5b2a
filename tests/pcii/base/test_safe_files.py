"""Writing that survives a kill, and locks."""

import os
import signal
import subprocess
import sys

import pytest
from stored_datasets import DENSE, make_dataset

import pcii
from pcii.base import locked, new_folder_safely, sweep_temporaries, write_bytes_safely
from pcii.store import COUNTS, RADIANCE, open_dataset


def disk_is_full(handle: int) -> None:
    raise OSError("disk is full")


def test_a_file_is_whole_under_its_name_and_leaves_no_temporary(tmp_path):
    path = tmp_path / "new" / "folder" / "a.bin"
    for content in (b"", b"first", b"second, longer"):
        write_bytes_safely(path, content)
        assert path.read_bytes() == content
        assert [p.name for p in path.parent.iterdir()] == ["a.bin"]
    assert path.stat().st_mode & 0o777 == 0o644


def test_a_failed_write_leaves_the_old_content_and_no_temporary(tmp_path, monkeypatch):
    path = tmp_path / "a.bin"
    write_bytes_safely(path, b"old")
    monkeypatch.setattr(os, "fsync", disk_is_full)
    with pytest.raises(OSError, match=r"disk is full"):
        write_bytes_safely(path, b"new")
    assert path.read_bytes() == b"old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.bin"]


@pytest.mark.parametrize("moment", ["os.fsync", "Path.replace"])
def test_a_kill_leaves_no_half_file(tmp_path, moment):
    path = tmp_path / "a.bin"
    write_bytes_safely(path, b"old")
    script = f"""
import os, signal
from pathlib import Path
from pcii.base import write_bytes_safely
{moment} = lambda *_: os.kill(os.getpid(), signal.SIGKILL)
write_bytes_safely(Path({str(path)!r}), b"new" * 10_000)
"""
    killed = subprocess.run([sys.executable, "-c", script], check=False)
    assert killed.returncode == -signal.SIGKILL
    assert path.read_bytes() == b"old"
    sweep_temporaries(tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["a.bin"]


def test_a_killed_runs_scraps_are_swept_and_the_rest_is_kept(tmp_path):
    root = make_dataset(tmp_path / "d")
    (root / ".manifest.json.x1.tmp").write_bytes(b"half")
    (root / f".{COUNTS}.x2.tmp").mkdir()
    (root / f".{COUNTS}.x2.tmp" / "chunk").write_bytes(b"half")
    (root / RADIANCE / ".view_00_00.exr.7.tmp").write_bytes(b"half")
    sweep_temporaries(root)
    assert [p.name for p in root.rglob("*.tmp")] == []
    assert open_dataset(root).counts.total == DENSE.sum()


def test_a_folder_takes_the_place_of_another_as_a_whole(tmp_path):
    place = tmp_path / "group"
    for content in ("first", "second"):
        with new_folder_safely(place) as folder:
            (folder / "inner").mkdir()
            (folder / "inner" / content).write_text(content)
            assert not (place / "inner" / content).exists()
        assert [p.name for p in (place / "inner").iterdir()] == [content]
        assert [p.name for p in tmp_path.iterdir()] == ["group"]


def test_what_a_link_leads_to_is_replaced(tmp_path):
    (tmp_path / "disk").mkdir()
    link = tmp_path / "link"
    link.symlink_to(tmp_path / "disk")
    with new_folder_safely(link) as new:
        (new / "file").write_text("whole")
    assert link.is_symlink()
    assert (tmp_path / "disk" / "file").read_text() == "whole"


def test_one_writer_at_a_time(tmp_path):
    path = tmp_path / "new" / "lock"
    second = locked(path, tmp_path)
    with locked(path, tmp_path), pytest.raises(pcii.InputError, match="another run writes here"):
        second.__enter__()
    with locked(path, tmp_path):
        path.unlink()  # as its holder may
    with locked(path, tmp_path) as file:
        assert os.path.samestat(os.fstat(file.fileno()), path.stat())
