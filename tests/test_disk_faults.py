"""Disks that break, are read-only or full while a command runs: it says so, and nothing is lost."""

import json
import random
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from broken_disk import BrokenDisk, break_disk
from digests import digest
from tiny import with_radiance

from pcii.app import commands as pcii_commands
from pcii.base import command_line
from pcii.evaluation.rows import key_of, read_rows
from pcii.store.dataset_layout import MANIFEST
from pcii.store.hashes import hash_file
from pcii.store.results_list import read_results
from pcii.store.verification import verify
from simgen.app import commands as simgen_commands

pytestmark = pytest.mark.renders
DATASET = with_radiance(1).replace("seed = { range = [0, 1] }\n", "") + "[analysis]\nz_mm = [540, 620]\n"
APPS = {"simgen": simgen_commands.app, "pcii": pcii_commands.app}
SIZES = 10
Content = dict[Any, Any]


class Said(NamedTuple):
    """How a command ended, and what it said on standard error."""

    code: int
    error: str


class Work(NamedTuple):
    """Commands that fill a folder: what is there before, the one whose disk fails, and what is compared."""

    package: str
    before: list[list[str]]
    command: list[str]
    content: Callable[[Path], Content]

    def here(self, out: Path, command: list[str] | None = None) -> int:
        """Run the command in this process."""
        return command_line.run(APPS[self.package], [*(command or self.command), "-o", str(out)])

    def apart(self, out: Path) -> Said:
        """Run the command in a process of its own."""
        main = f"from {self.package}.app.commands import main; raise SystemExit(main())"
        program = [sys.executable, "-c", main, *self.command, "-o", str(out)]
        done = subprocess.run(program, text=True, capture_output=True, check=False)
        return Said(done.returncode, done.stderr)


def results_of(out: Path) -> Content:
    """Hash of every listed file, but of the report, which tells the times."""
    files = read_results(out)["files"]
    return {name: hash_file(out / name) for name in files if name != "report.html"}


def rows_of(out: Path) -> Content:
    """Every row, but for the time, by its key."""
    return {key_of(row): json.dumps(row | {"seconds": 0, "date": ""}) for row in read_rows(out)}


def datasets_of(out: Path) -> Content:
    """Hashes of the files of every finished dataset."""
    return {path.parent.name: json.dumps(digest(path.parent)) for path in out.glob(f"*/{MANIFEST}")}


@pytest.fixture(scope="module")
def works(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Work]:
    place = tmp_path_factory.mktemp("place")
    recipe, one = place / "one.toml", place / "one"
    recipe.write_text(DATASET)
    generate, method = ["generate", str(recipe)], ["--method", "brightness"]
    evaluate, run, segment = (
        ["evaluate", str(one), *method],
        ["run", str(one), *method],
        ["segment", str(one)],
    )
    assert command_line.run(APPS["simgen"], [*generate, "-o", str(one)]) == 0
    other = ["--method", "variance"]
    return {
        "dataset": Work("simgen", [], generate, digest),
        "collection": Work(
            "simgen",
            [[*generate, "--seeds", "1"]],
            [*generate, "--seeds", "3", "--workers", "2"],
            datasets_of,
        ),
        "results": Work("pcii", [[*segment, *other]], run, results_of),
        "evaluation": Work("pcii", [evaluate], [*evaluate, *other], rows_of),
    }


class Folders:
    """What each work finds and what it leaves on a good disk, made when it is asked for."""

    def __init__(self, works: dict[str, Work], root: Path) -> None:
        self.works, self.root = works, root

    def before(self, name: str, out: Path) -> Content:
        """Fill `out` with what is there before, if anything is; its content."""
        work, kept = self.works[name], self.root / f"{name}-before"
        if not work.before:
            return {}
        if not kept.exists():
            for command in work.before:
                assert work.here(kept, command) == 0
        shutil.copytree(kept, out)
        return work.content(out)

    def after(self, name: str) -> Content:
        """Content of what the work leaves."""
        whole = self.root / name
        if not whole.exists():
            self.before(name, whole)
            assert self.works[name].here(whole) == 0
        return self.works[name].content(whole)


@pytest.fixture(scope="module")
def folders(works: dict[str, Work], tmp_path_factory: pytest.TempPathFactory) -> Folders:
    return Folders(works, tmp_path_factory.mktemp("folders"))


def check_failure(said: Said, out: Path) -> None:
    """The last line is the one sentence that names the folder, and the exit code tells of a failure.

    Of a collection there can be one sentence for each dataset that was not made.
    """
    assert said.code in (1, 2), said
    assert "Traceback" not in said.error
    lines = said.error.rstrip().splitlines()
    errors = [line for line in lines if line.startswith(("error: ", "not made: "))]
    assert errors, said
    assert errors == lines[-len(errors) :], said
    assert len(errors) == 1 or all(line.startswith("not made: ") for line in errors), said
    assert all(str(out) in line for line in errors), said


def check_after_all(folders: Folders, name: str, out: Path, before: Content) -> None:
    """Nothing is lost, and on a good disk the same command goes on to what it always gives."""
    work = folders.works[name]
    assert not before or before.items() <= work.content(out).items()
    assert work.here(out) == 0
    assert work.content(out) == folders.after(name)
    assert verify(out) > 0


def broken_at(
    folders: Folders,
    name: str,
    out: Path,
    capsys: pytest.CaptureFixture[str],
    chosen: Callable[[int], Iterable[int]],
) -> int:
    """Let the disk break after each of the chosen numbers of changes; how often the command failed."""
    work, failed = folders.works[name], 0
    folders.before(name, out)
    counting = BrokenDisk(str(out), sys.maxsize)
    break_disk(counting)
    assert work.here(out) == 0
    break_disk(None)
    shutil.rmtree(out)
    for number, good in enumerate(chosen(counting.done)):
        before = folders.before(name, out)
        capsys.readouterr()
        break_disk(BrokenDisk(str(out), good, heals=number % 2 == 1))
        code = work.here(out)
        break_disk(None)
        if code:  # else what failed was not needed
            check_failure(Said(code, capsys.readouterr().err), out)
            failed += 1
        check_after_all(folders, name, out, before)
        shutil.rmtree(out)
    return failed


@pytest.mark.parametrize("name", ["dataset", "results", "evaluation"])
@pytest.mark.parametrize("at", ["some changes", pytest.param("any change", marks=pytest.mark.slow)])
def test_a_disk_that_breaks_is_told_and_loses_nothing(
    folders: Folders, name: str, at: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    chance = random.Random(name)

    def chosen(changes: int) -> Iterable[int]:
        return chance.sample(range(changes), 2) if at == "some changes" else range(changes)

    assert broken_at(folders, name, tmp_path / "out", capsys, chosen) > (0 if at == "some changes" else 15)


class Mount:
    """A file system in memory, of a size and for reading alone or not, both of which can be changed."""

    def __init__(self, place: Path) -> None:
        self.place, self.mounted = place, False
        place.mkdir()

    def be(self, options: str) -> None:
        """Mount it with these options, or mount it again."""
        given = f"{'remount,' * self.mounted}{options}"
        command = ["mount", "-t", "tmpfs", "-o", given, "tmpfs", str(self.place)]
        done = subprocess.run(command, capture_output=True, check=self.mounted)
        if done.returncode:
            pytest.skip("needs the right to mount a file system")
        self.mounted = True


@pytest.fixture
def mount(tmp_path: Path) -> Iterator[Mount]:
    mount = Mount(tmp_path / "disk")
    yield mount
    if mount.mounted:
        subprocess.run(["umount", str(mount.place)], check=True)


@pytest.mark.parametrize(
    "name",
    ["dataset", pytest.param("collection", marks=pytest.mark.slow), "results", "evaluation"],
)
def test_a_read_only_disk_is_named(
    folders: Folders, name: str, mount: Mount, capsys: pytest.CaptureFixture[str]
) -> None:
    out = mount.place / "out"
    mount.be("rw")
    before = folders.before(name, out)
    mount.be("ro")
    capsys.readouterr()
    check_failure(Said(folders.works[name].here(out), capsys.readouterr().err), out)
    mount.be("rw")
    check_after_all(folders, name, out, before)
    if folders.works[name].package == "simgen":  # where nothing is left to do nothing is written
        mount.be("ro")
        assert folders.works[name].here(out) == 0


@pytest.mark.slow
@pytest.mark.parametrize("name", ["dataset", "collection", "results", "evaluation"])
def test_a_full_disk_is_named(folders: Folders, name: str, mount: Mount) -> None:
    out, failed = mount.place / "out", 0
    folders.after(name)
    free_kb = sum(file.stat().st_blocks for file in (folders.root / name).rglob("*")) // 2 + 4096
    for step in range(SIZES):
        mount.be(f"size={free_kb}k")
        before = folders.before(name, out)
        used_kb = sum(file.stat().st_blocks for file in out.rglob("*")) // 2
        mount.be(f"size={used_kb + 16 + step * (free_kb - 4096 - used_kb) // SIZES}k")
        said = folders.works[name].apart(out)
        if said.code:
            check_failure(said, out)
            failed += 1
        mount.be(f"size={2 * free_kb}k")
        check_after_all(folders, name, out, before)
        shutil.rmtree(out)
    assert failed >= SIZES // 4
