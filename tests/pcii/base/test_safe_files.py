"""Writing that survives a kill, and locks."""

import os
import signal
import subprocess
import sys
from unittest.mock import Mock

import pytest

import pcii
from pcii.base import locked, new_folder_safely, sweep_temporaries, write_bytes_safely


def test_a_file_is_whole_or_as_it_was_and_leaves_no_temporary(tmp_path, monkeypatch):
    path = tmp_path / "new" / "folder" / "a.bin"
    for content in (b"", b"first", b"second, longer"):
        write_bytes_safely(path, content)
        assert path.read_bytes() == content
        assert [p.name for p in path.parent.iterdir()] == ["a.bin"]
    assert path.stat().st_mode & 0o777 == 0o644
    monkeypatch.setattr(os, "fsync", Mock(side_effect=OSError("disk is full")))
    with pytest.raises(OSError, match=r"disk is full"):
        write_bytes_safely(path, b"new")
    assert path.read_bytes() == b"second, longer"
    assert [p.name for p in path.parent.iterdir()] == ["a.bin"]


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
    (tmp_path / "inner" / ".group.x2.tmp").mkdir(parents=True)
    (tmp_path / "inner" / ".group.x2.tmp" / "chunk").write_bytes(b"half")
    sweep_temporaries(tmp_path)
    (tmp_path / "inner").rmdir()
    assert [p.name for p in tmp_path.iterdir()] == ["a.bin"]


def test_a_folder_or_what_a_link_leads_to_is_replaced_as_a_whole(tmp_path):
    (tmp_path / "link").symlink_to(tmp_path / "group")
    for place, content in (("group", "first"), ("group", "second"), ("link", "third")):
        with new_folder_safely(tmp_path / place) as folder:
            (folder / "inner").mkdir()
            (folder / "inner" / content).write_text(content)
            assert not (tmp_path / "group" / "inner" / content).exists()
        assert [p.name for p in (tmp_path / "group" / "inner").iterdir()] == [content]
        assert sorted(p.name for p in tmp_path.iterdir()) == ["group", "link"]
    assert (tmp_path / "link").is_symlink()


def test_one_writer_at_a_time(tmp_path):
    path = tmp_path / "new" / "lock"
    second = locked(path, tmp_path)
    with locked(path, tmp_path), pytest.raises(pcii.InputError, match="another run writes here"):
        second.__enter__()
    with locked(path, tmp_path):
        path.unlink()  # as its holder may
    with locked(path, tmp_path) as file:
        assert os.path.samestat(os.fstat(file.fileno()), path.stat())
