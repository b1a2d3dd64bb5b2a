"""Two processes that make the same dataset, or the same collection, at the same time."""

import random
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from digests import digest
from tiny import GRID_2_X_2, with_radiance
from writers import Writer

from pcii.store import open_collection, verify

pytestmark = [pytest.mark.renders, pytest.mark.slow]
TIMES = 20
REFUSED_WITHIN_S = 1.0
"""From the call of the command in a process that has imported all modules, to its end."""
LATER_S = 1.0
"""The second begins at most so much later; the first takes longer to load the scene alone."""


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("log") / "made.txt"


@pytest.fixture(scope="module")
def writers(log: Path) -> Iterator[tuple[Writer, Writer]]:
    both = Writer(log), Writer(log)
    yield both
    for writer in both:
        writer.close()


def test_of_two_on_one_dataset_one_is_refused_at_once(writers: tuple[Writer, Writer], tmp_path: Path) -> None:
    recipe, alone, chance = tmp_path / "one.toml", tmp_path / "alone", random.Random(1)
    recipe.write_text(with_radiance(1).replace("seed = { range = [0, 1] }\n", ""))
    writers[0].start("generate", str(recipe), "-o", str(alone))
    assert writers[0].end().code == 0
    for number in range(TIMES):
        out = tmp_path / f"shared-{number}"
        first, second = chance.sample(writers, 2)
        first.start("generate", str(recipe), "-o", str(out))
        time.sleep(chance.choice([0, chance.uniform(0, LATER_S)]))
        second.start("generate", str(recipe), "-o", str(out))
        one, other = sorted([first.end(), second.end()])
        assert (one.code, other.code) == (0, 2)
        assert other.seconds < REFUSED_WITHIN_S
        sentence = f"error: {out}: another run writes here; wait for its end"
        assert other.error.splitlines()[-1] == sentence
        assert digest(out) == digest(alone)
        assert verify(out) == verify(alone)


def test_of_two_on_one_collection_one_is_refused_at_once(
    writers: tuple[Writer, Writer], log: Path, tmp_path: Path
) -> None:
    recipe, out = tmp_path / "many.toml", tmp_path / "out"
    recipe.write_text(
        f'scene = "plain_pair"\nseed = {{ range = [0, 5] }}\n{GRID_2_X_2}[photons]\nbudget = 200\n'
    )
    log.unlink(missing_ok=True)
    writers[0].start("generate", str(recipe), "-o", str(out))
    while not log.exists():  # it makes the first dataset
        time.sleep(0.01)
    writers[1].start("generate", str(recipe), "-o", str(out))
    one, other = [writer.end() for writer in writers]
    assert (one.code, other.code) == (0, 2)
    assert other.seconds < REFUSED_WITHIN_S
    assert other.error.splitlines()[-1] == f"error: {out}: another run writes here; wait for its end"
    assert len(open_collection(out)) == 5
    assert verify(out) > 5
