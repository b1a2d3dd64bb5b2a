"""Every skip that claims the same bytes gives them, on one small scene."""

import pytest
from property_settings import mostly_slow

from benchmarks.skip_pairs import SKIPS, World
from benchmarks.studies.skips import are_same, random_world

EXACT = {skip.name: skip for skip in SKIPS if skip.exact}
QUICK = [name for name in EXACT if name.startswith(("exploration", "visibility"))]


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> World:
    found = random_world(2, 32, tmp_path_factory.mktemp("world"))
    found.prepare_all()
    return found


@pytest.mark.renders
@pytest.mark.parametrize("name", mostly_slow(EXACT, quick=QUICK))
def test_skipped_work_is_not_missed(world: World, name: str) -> None:
    skip = EXACT[name]
    on, off = skip.on(world, f"{skip.name}, on"), skip.off(world, f"{skip.name}, off")
    assert on
    assert are_same(on, off)
