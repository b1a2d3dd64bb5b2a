"""The card of a generated dataset: its recipe makes the data again, and terms are no part of them."""

import re
import shutil
import tomllib
from pathlib import Path

import pytest

from pcii.base import command_line
from pcii.exporting.card_files import write_card
from pcii.exporting.publication_terms import Terms
from pcii.io.dataset_layout import CARD, CROISSANT, read_manifest
from pcii.io.verification import verify
from simgen.app import commands as cli
from simgen.dataset.prepared import prepare
from simgen.spec.recipe import Recipe, load_recipe

pytestmark = pytest.mark.renders


def test_the_recipe_in_the_card_is_that_of_the_data(nested_dataset: Path, tmp_path: Path) -> None:
    root = tmp_path / "copy"
    shutil.copytree(nested_dataset, root)
    write_card(root, Terms())
    block = re.search(r"````toml\n(.*?)\n````", (root / CARD).read_text(), re.DOTALL)
    assert block is not None
    recipe = Recipe.model_validate(tomllib.loads(block[1]))
    manifest = read_manifest(root)
    prepared = prepare(recipe, None)
    assert prepared.recipe_of_data == manifest["recipe"]
    assert prepared.identity == manifest["identity"]
    assert verify(root) == len(manifest["files"]) + 2


def test_terms_are_no_part_of_a_dataset() -> None:
    plain, near = load_recipe("small")
    licensed, _ = load_recipe("small", ["publication.licence=CC0-1.0", 'publication.creators=["Ada"]'])
    assert licensed.publication.terms() == Terms("CC0-1.0", ("Ada",))
    assert prepare(plain, near).identity == prepare(licensed, near).identity


def test_generate_writes_the_card_and_writes_it_again_for_other_terms(tmp_path: Path) -> None:
    out = tmp_path / "out"
    small = "grid.rows=1 grid.cols=2 grid.height=8 grid.width=8 products.radiance=none photons.budget=20"
    command = ["generate", "small", "-o", str(out)]
    command += [part for value in small.split() for part in ("--set", value)]
    assert command_line.run(cli.app, command) == 0
    manifest, card = (out / "manifest.json").read_bytes(), (out / CARD).read_text()
    assert "BSD-3-Clause" in card
    assert command_line.run(cli.app, [*command, "--set", "publication.licence=CC0-1.0"]) == 0
    assert (out / "manifest.json").read_bytes() == manifest
    assert "CC0-1.0" in (out / CARD).read_text()
    assert "CC0-1.0" in (out / CROISSANT).read_text()
    assert command_line.run(cli.app, ["verify", str(out)]) == 0
