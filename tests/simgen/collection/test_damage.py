"""Collections that are damaged at random, and full file systems: all of it is found, nothing is lost."""

import random
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from digests import digest
from tiny import with_radiance

from pcii.base.errors import InputError
from pcii.io.collection import open_collection
from pcii.io.verification import verify
from simgen.collection.whole_collection import generate_collection
from simgen.spec.sweeps import Sweep, load_sweep

pytestmark = [pytest.mark.renders, pytest.mark.slow]
TIMES = 1000
SIZES = 20
TOML = with_radiance(4)


@pytest.fixture(scope="module")
def sweep(tmp_path_factory: pytest.TempPathFactory) -> Sweep:
    path = tmp_path_factory.mktemp("recipe") / "damaged.toml"
    path.write_text(TOML)
    return load_sweep(str(path))


@pytest.fixture(scope="module")
def whole(sweep: Sweep, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("whole") / "out"
    assert generate_collection(sweep, out) == []
    return out


def flip(file: Path, chance: random.Random) -> None:
    content = bytearray(file.read_bytes())
    content[chance.randrange(len(content))] ^= 1 << chance.randrange(8)
    file.write_bytes(content)


def cut(file: Path, chance: random.Random) -> None:
    file.write_bytes(file.read_bytes()[: chance.randrange(file.stat().st_size)])


def lose(file: Path, chance: random.Random) -> None:
    file.unlink()


def add(file: Path, chance: random.Random) -> None:
    (file.parent / f"new-{chance.randrange(10**6)}").write_bytes(b"more")


@pytest.mark.parametrize("harm", [flip, cut, lose, add])
def test_all_damage_is_found(
    whole: Path, tmp_path: Path, harm: Callable[[Path, random.Random], None]
) -> None:
    out, chance = tmp_path / "damaged", random.Random(harm.__name__)
    shutil.copytree(whole, out)
    files = sorted(file.relative_to(whole) for file in whole.rglob("*") if file.is_file())
    assert verify(out) == len(files)
    for _ in range(TIMES):
        name = chance.choice(files)
        harm(out / name, chance)
        with pytest.raises(InputError):
            verify(out)
        for new in (out / name).parent.glob("new-*"):
            new.unlink()
        shutil.copy(whole / name, out / name)
    assert verify(out) == len(files)


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Callable[[int], Path]]:
    """A file system of so many kilobytes, which can be made larger."""
    place = tmp_path / "disk"
    place.mkdir()
    mounted = False

    def size(kilobytes: int) -> Path:
        nonlocal mounted
        options = f"{'remount,' * mounted}size={kilobytes}k"
        command = ["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(place)]
        if subprocess.run(command, capture_output=True, check=False).returncode:
            pytest.skip("needs the right to mount a file system")
        mounted = True
        return place

    yield size
    if mounted:
        subprocess.run(["umount", str(place)], check=True)


def test_a_full_disk_is_named_and_what_was_made_is_kept(
    sweep: Sweep, whole: Path, small_disk: Callable[[int], Path]
) -> None:
    needed = sum(file.stat().st_size for file in whole.rglob("*") if file.is_file()) // 1024
    expected = {row["path"]: digest(whole / row["path"]) for row in open_collection(whole).rows}
    main = "from simgen.app.commands import main; raise SystemExit(main())"
    command = [sys.executable, "-c", main, "generate", sweep.source, "-o"]
    for step in range(SIZES):
        disk = small_disk(max(16, needed * step // SIZES))
        out = disk / "out"
        done = subprocess.run([*command, str(out)], capture_output=True, text=True, check=False)
        assert done.returncode != 0
        assert "Traceback" not in done.stderr
        assert str(disk) in done.stderr, done.stderr
        small_disk(8 * needed + 4096)
        done = subprocess.run([*command, str(out)], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        assert verify(out) > 0
        assert {row["path"]: digest(out / row["path"]) for row in open_collection(out).rows} == expected
        shutil.rmtree(out)
