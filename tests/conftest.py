"""Fixtures shared by all tests: small datasets, made once per worker."""

from pathlib import Path

import pytest
from hypothesis import settings
from tiny import TINY_RECIPE

collect_ignore = ["simgen/importing/by_blender"]
"""Blender runs the script that exports its scene; it is no module of the tests."""

settings.register_profile("fast", max_examples=15, deadline=None)
settings.register_profile("stress", max_examples=10_000, deadline=None)
settings.load_profile("fast")  # unless --hypothesis-profile names another


@pytest.fixture(scope="session")
def nested_dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """2 x 3 views of 64 x 60 with 400 photons each, of which 120 and 30 are kept as smaller budgets."""
    from simgen.dataset import generate
    from simgen.spec import Recipe

    recipe = TINY_RECIPE | {
        "seed": 5,
        "photons": {"budget": 400, "nested": [30, 120]},
        "sensor": {"dark_counts": 0.01},
        "analysis": {"z_mm": [540, 620], "z_range_mm": [500, 700]},
    }
    out = tmp_path_factory.mktemp("data") / "nested"
    generate(Recipe.model_validate(recipe), Path(), out)
    return out


@pytest.fixture(scope="session")
def small_benchmark(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """That of `small_benchmark`: two scenes of 2 x 2 views, with the certificate that publishes it."""
    from small_benchmark import written

    from pcii.store import CERTIFICATE
    from simgen.dataset import certify, make_benchmark

    folder = tmp_path_factory.mktemp("benchmark")
    definition, file = written(folder)
    assert make_benchmark(definition, file, folder / "made") == []
    assert certify(definition, file, folder / "made").problems  # nothing is published yet
    (folder / "made" / CERTIFICATE).rename(file.with_suffix(f".{CERTIFICATE}"))
    return folder / "made"
