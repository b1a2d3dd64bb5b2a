"""Collections whose making is killed again and again: what remains is whole and goes on to the same bytes."""

import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from digests import digest
from tiny import with_radiance

from pcii.io.collection import open_collection
from pcii.io.dataset_layout import MANIFEST, MARKER
from pcii.io.verification import verify

pytestmark = [pytest.mark.renders, pytest.mark.slow]
KILLS = 200
TOML = with_radiance(12)


def start(recipe: Path, out: Path, workers: int) -> subprocess.Popen[bytes]:
    main = "from simgen.app.commands import main; raise SystemExit(main())"
    command = [sys.executable, "-c", main, "generate", str(recipe), "-o", str(out), "--workers", str(workers)]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)


@pytest.mark.parametrize("workers", [1, 2])
def test_what_kills_leave_is_whole_and_goes_on_to_the_same_bytes(tmp_path: Path, workers: int) -> None:
    recipe, out, chance = tmp_path / "killed.toml", tmp_path / "out", random.Random(workers)
    recipe.write_text(TOML)
    first = start(recipe, tmp_path / "whole", 1)
    assert first.wait() == 0
    rows = open_collection(tmp_path / "whole").rows
    whole = {row["path"]: digest(tmp_path / "whole" / row["path"]) for row in rows}
    killed, finished = 0, 0
    while killed < KILLS // 2:
        process = start(recipe, out, workers)
        begun = time.monotonic()
        wait_s = chance.uniform(0.5, 4.0)
        while process.poll() is None and time.monotonic() - begun < wait_s:
            time.sleep(0.01)
        if process.poll() is None:
            process.send_signal(signal.SIGKILL)
            killed += 1
        process.wait()
        for folder in out.glob("seed_*"):
            if (folder / MANIFEST).is_file() and not (folder / MARKER).exists():
                verify(folder)
        if process.returncode == 0:
            finished += 1
            assert verify(out) > 0
            assert {row["path"]: digest(out / row["path"]) for row in open_collection(out).rows} == whole
            shutil.rmtree(out)
        else:
            assert process.returncode == -signal.SIGKILL, process.stderr and process.stderr.read().decode()
    while start(recipe, out, workers).wait():
        pass
    assert verify(out) > 0
    assert {row["path"]: digest(out / row["path"]) for row in open_collection(out).rows} == whole
