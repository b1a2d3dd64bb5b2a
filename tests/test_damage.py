"""Finished folders of every kind whose files are damaged at random: `verify` finds all of it."""

import random
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from tiny import with_radiance

from pcii.app import commands as pcii_commands
from pcii.base import command_line
from pcii.base.errors import InputError
from pcii.io.verification import verify
from simgen.app import commands as simgen_commands

pytestmark = [pytest.mark.renders, pytest.mark.slow]
TIMES = 1000
ANALYSIS = "[analysis]\nz_mm = [540, 620]\n"


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """One of each kind, as the commands make them."""
    root = tmp_path_factory.mktemp("whole")
    recipe = root / "damaged.toml"
    recipe.write_text(with_radiance(4) + ANALYSIS)
    made = {name: root / name for name in ("collection", "results", "evaluation")}
    dataset = made["dataset"] = made["collection"] / "seed_0"
    for app, arguments, out in (
        (simgen_commands.app, ["generate", str(recipe)], made["collection"]),
        (pcii_commands.app, ["run", str(dataset)], made["results"]),
        (pcii_commands.app, ["evaluate", str(made["collection"]), "--method", "depth"], made["evaluation"]),
        (pcii_commands.app, ["evaluate", str(dataset), "--method", "variance"], made["evaluation"]),
    ):
        assert command_line.run(app, [*arguments, "-o", str(out)]) == 0
    return made


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


@pytest.mark.parametrize("kind", ["dataset", "collection", "results", "evaluation"])
@pytest.mark.parametrize("harm", [flip, cut, lose, add])
def test_all_damage_is_found(
    folders: dict[str, Path], tmp_path: Path, kind: str, harm: Callable[[Path, random.Random], None]
) -> None:
    whole, out, chance = folders[kind], tmp_path / "damaged", random.Random(f"{kind} {harm.__name__}")
    shutil.copytree(whole, out)
    files = sorted(file.relative_to(whole) for file in whole.rglob("*") if file.is_file())
    count = verify(out)
    assert count == len(files) - (kind != "collection")
    for _ in range(TIMES):
        name = chance.choice(files)
        harm(out / name, chance)
        with pytest.raises(InputError, match=r"^[^\n]+$"):
            verify(out)
        for new in (out / name).parent.glob("new-*"):
            new.unlink()
        shutil.copy(whole / name, out / name)
    assert verify(out) == count
