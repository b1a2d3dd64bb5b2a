"""Disks that break or are full while a command runs: it says so, and nothing is lost."""

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
from pcii.evaluation import read_rows
from pcii.evaluation.rows import key_of
from pcii.store import MANIFEST, hash_file, read_results, verify
from simgen.app import commands as simgen_commands

pytestmark = pytest.mark.renders
DATASET = with_radiance(1).replace("seed = { range = [0, 1] }\n", "") + "[analysis]\nz_mm = [540, 620]\n"
APPS = {"simgen": simgen_commands.app, "pcii": pcii_commands.app}
SIZES = 10
Content = dict[Any, Any]


class Work(NamedTuple):
    """Commands that fill a folder: those before, the one whose disk fails, and what is compared."""

    package: str
    before: list[list[str]]
    command: list[str]
    content: Callable[[Path], Content]

    def here(self, out: Path, command: list[str] | None = None) -> int:
        """Run the command in this process; its exit code."""
        return command_line.run(APPS[self.package], [*(command or self.command), "-o", str(out)])

    def apart(self, out: Path) -> tuple[int, str]:
        """Run the command in a process of its own; its exit code and standard error."""
        main = f"from {self.package}.app.commands import main; raise SystemExit(main())"
        program = [sys.executable, "-c", main, *self.command, "-o", str(out)]
        ended = subprocess.run(program, text=True, capture_output=True, check=False)
        return ended.returncode, ended.stderr


def results_of(out: Path) -> Content:
    """Hash of every listed file, but of the report, which tells the times."""
    return {name: hash_file(out / name) for name in read_results(out).files if name != "report.html"}


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
    generate, method, other = (
        ["generate", str(recipe)],
        ["--method", "brightness"],
        ["--method", "shape-from-focus"],
    )
    evaluate, run = ["evaluate", str(one), *method], ["run", str(one), *method]
    assert command_line.run(APPS["simgen"], [*generate, "-o", str(one)]) == 0
    many = [*generate, "--seeds", "3", "--workers", "2"]
    return {
        "dataset": Work("simgen", [], generate, digest),
        "collection": Work("simgen", [[*generate, "--seeds", "1"]], many, datasets_of),
        "results": Work("pcii", [], run, results_of),
        "evaluation": Work("pcii", [evaluate], [*evaluate, *other], rows_of),
    }


class Folders:
    """What each work starts from and what it leaves on a good disk, made when it is first needed."""

    def __init__(self, works: dict[str, Work], root: Path) -> None:
        self.works, self.root = works, root

    def before(self, name: str, out: Path) -> Content:
        """Fill `out` with what is there before, if anything is; its content."""
        work, start = self.works[name], self.root / f"{name}-before"
        if not work.before:
            return {}
        if not start.exists():
            for command in work.before:
                assert work.here(start, command) == 0
        shutil.copytree(start, out)
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


def check_failure(code: int, error: str, out: Path) -> None:
    """The exit code tells of a failure, and the last lines are sentences that name the folder."""
    assert code in (1, 2), error
    assert "Traceback" not in error
    *_, last = error.rstrip().splitlines()
    assert last.startswith(("error: ", "not made: ")), error  # of a collection, one for each dataset
    assert out.name in last, error  # or a temporary file beside it


def check_after_all(work: Work, out: Path, before: Content, whole: Content) -> None:
    """Nothing is lost, and on a good disk the same command goes on to what it always gives."""
    assert not before or before.items() <= work.content(out).items()
    assert work.here(out) == 0
    assert work.content(out) == whole
    assert verify(out) > 0


@pytest.mark.parametrize("name", ["dataset", "results", "evaluation"])
@pytest.mark.parametrize("at", ["some changes", pytest.param("any change", marks=pytest.mark.slow)])
def test_a_disk_that_breaks_is_named_and_loses_nothing(
    folders: Folders, name: str, at: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It breaks after a number of changes: for good, as a disk that is read-only, or for one change."""
    work, out, failures = folders.works[name], tmp_path / "out", 0
    folders.before(name, out)
    break_disk(counting := BrokenDisk(str(out.parent), sys.maxsize))  # results are written beside
    assert work.here(out) == 0
    break_disk(None)
    whole = work.content(out)
    shutil.rmtree(out)
    chosen: Iterable[int] = range(counting.done)
    if at == "some changes":
        chosen = random.Random(name).sample(chosen, 2)
    for number, good in enumerate(chosen):
        before = folders.before(name, out)
        capsys.readouterr()
        break_disk(BrokenDisk(str(out.parent), good, heals=number % 2 == 1))
        code = work.here(out)
        break_disk(None)
        if code:  # else what failed was not needed
            check_failure(code, capsys.readouterr().err, out)
            failures += 1
        check_after_all(work, out, before, whole)
        shutil.rmtree(out)
    assert failures > (0 if at == "some changes" else 15)


@pytest.fixture
def mount(tmp_path: Path) -> Iterator[Callable[[str], Path]]:
    """Mounts a file system in memory with these options, or mounts it again; where it is."""
    place, mounted = tmp_path / "disk", list[str]()
    place.mkdir()

    def mount_with(options: str) -> Path:
        again = "remount," if mounted else ""
        command = ["mount", "-t", "tmpfs", "-o", f"{again}{options}", "tmpfs", str(place)]
        if subprocess.run(command, capture_output=True, check=bool(mounted)).returncode:
            pytest.skip("needs the right to mount a file system")
        mounted.append(options)
        return place

    yield mount_with
    if mounted:
        subprocess.run(["umount", str(place)], check=True)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["dataset", "collection", "results", "evaluation"])
def test_a_full_disk_is_named(folders: Folders, name: str, mount: Callable[[str], Path]) -> None:
    work, whole, failures = folders.works[name], folders.after(name), 0
    free_kb = sum(file.stat().st_blocks for file in (folders.root / name).rglob("*")) // 2 + 4096
    for step in range(SIZES):
        out = mount(f"size={free_kb}k") / "out"
        before = folders.before(name, out)
        used_kb = sum(file.stat().st_blocks for file in out.rglob("*")) // 2
        mount(f"size={used_kb + 16 + step * (free_kb - 4096 - used_kb) // SIZES}k")
        code, error = work.apart(out)
        if code:
            check_failure(code, error, out)
            failures += 1
        mount(f"size={2 * free_kb}k")
        check_after_all(work, out, before, whole)
        shutil.rmtree(out)
    assert failures >= SIZES // 4
