"""A collection that is killed again and again: what remains is whole and goes on to the same bytes."""

import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from digests import digest
from tiny import with_radiance

from pcii.store import MANIFEST, MARKER, open_collection, verify

pytestmark = [pytest.mark.renders, pytest.mark.slow]
KILLS = 20


@pytest.mark.parametrize("workers", [1, 2])
def test_what_kills_leave_is_whole_and_goes_on_to_the_same_bytes(tmp_path: Path, workers: int) -> None:
    recipe, whole, out = tmp_path / "killed.toml", tmp_path / "whole", tmp_path / "out"
    recipe.write_text(with_radiance(12))
    main = "from simgen.app.commands import main; raise SystemExit(main())"
    command = [sys.executable, "-c", main, "generate", str(recipe), "--workers", str(workers), "-o"]
    subprocess.run([*command, str(whole)], check=True, capture_output=True)
    chance = random.Random(workers)
    for _ in range(KILLS):
        process = subprocess.Popen([*command, str(out)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        time.sleep(chance.uniform(0.5, 4.0))
        process.send_signal(signal.SIGKILL)
        assert process.wait() in (0, -signal.SIGKILL)
        for folder in out.glob("seed_*"):
            if (folder / MANIFEST).is_file() and not (folder / MARKER).exists():
                verify(folder)
    subprocess.run([*command, str(out)], check=True, capture_output=True)
    assert verify(out) > 0
    names = [row["path"] for row in open_collection(whole).rows]
    assert [row["path"] for row in open_collection(out).rows] == names
    assert {name: digest(out / name) for name in names} == {name: digest(whole / name) for name in names}
