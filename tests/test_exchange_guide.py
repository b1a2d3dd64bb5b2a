"""The guide to exchange does what it says: its commands and its Python run, from top to bottom."""

import re
import shlex
import shutil
import sys
import tomllib
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import pcii
from pcii.base import command_line
from pcii.exporting.card_files import write_card
from pcii.exporting.publication_terms import Terms
from simgen.app import commands as simgen_cli
from simgen.spec.recipe import Recipe, override

GUIDE = (Path(__file__).resolve().parent.parent / "docs" / "exchange.md").read_text()


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", GUIDE, re.DOTALL)


@pytest.mark.renders
def test_commands_and_python_of_the_guide_run(
    nested_dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(nested_dataset, tmp_path / "out" / "small")
    monkeypatch.chdir(tmp_path)
    write_card(Path("out/small"), Terms())
    for line in blocks("sh")[0].splitlines():
        assert command_line.run(simgen_cli.app, shlex.split(line)[1:]) == 0
    shown: list[Any] = []
    viewer = SimpleNamespace(add_image=lambda image, **_: shown.append(image))
    monkeypatch.setitem(sys.modules, "napari", SimpleNamespace(Viewer=lambda: viewer))  # type: ignore[arg-type]
    names: dict[str, Any] = {}
    for block in blocks("python"):
        exec(block, names)
    dataset = pcii.open_dataset("out/small")
    stack = np.array([[dataset.counts.view(k, l) for l in range(3)] for k in range(2)])
    np.testing.assert_array_equal(names["dense"], stack)
    np.testing.assert_array_equal(names["photons"], stack[0, 1])
    assert dataset.truth is not None
    np.testing.assert_array_equal(names["depth"], dataset.truth.z_mm)
    assert shown[0].shape == (2, 64, 60, 3)


def test_the_terms_of_the_guide_are_valid() -> None:
    (table,) = blocks("toml")
    recipe = Recipe.model_validate({"scene": "blank", **tomllib.loads(table)})
    assert recipe.publication.licence == "CC-BY-4.0"
    values: dict[str, Any] = {"scene": "blank"}
    override(values, ["publication.licence=CC0-1.0"])
    assert Recipe.model_validate(values).publication.terms().licence == "CC0-1.0"
