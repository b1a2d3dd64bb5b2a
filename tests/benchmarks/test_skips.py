"""Every skip that claims the same bytes gives them, on one small scene."""

import pytest

from benchmarks.skips import SKIPS, Skip, World
from benchmarks.studies.skips import are_same, random_world

EXACT = [skip for skip in SKIPS if skip.exact]


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> World:
    found = random_world(2, 32, tmp_path_factory.mktemp("world"))
    found.prepare_all()
    return found


@pytest.mark.renders
@pytest.mark.parametrize("skip", EXACT, ids=lambda skip: skip.name.partition(":")[0])
def test_skipped_work_is_not_missed(world: World, skip: Skip) -> None:
    on, off = skip.on(world, f"{skip.name}, on"), skip.off(world, f"{skip.name}, off")
    assert on
    assert are_same(on, off)
