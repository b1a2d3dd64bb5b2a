"""Fixtures shared by all tests: the small dataset, made once per worker."""

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def small_dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The dataset of data_recipes/small.toml: 6 x 6 views of 256 x 256, GRBG, with radiance."""
    from simgen.generate import generate
    from simgen.recipe import load_recipe

    out = tmp_path_factory.mktemp("data") / "small"
    recipe, near = load_recipe(str(ROOT / "data_recipes" / "small.toml"))
    generate(recipe, near, out)
    return out
