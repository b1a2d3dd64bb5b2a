"""Every example runs and says something; every notebook runs, and has the outputs of its code."""

import re
import runpy
from base64 import b64decode
from copy import deepcopy
from pathlib import Path
from typing import Any

import matplotlib as mpl
import nbformat
import pytest
from guide_blocks import blocks
from make_notebooks import MOST_NOTEBOOK_BYTES, MOST_PICTURE_BYTES, NOTEBOOKS, run

ROOT = Path(__file__).resolve().parent.parent
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
NUMBER = re.compile(r"-?\d+(?:\.\d+)?")
pytestmark = [pytest.mark.guide, pytest.mark.renders]


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda file: file.stem)
def test_an_example_runs(example: Path, tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", [str(example)])
    with mpl.rc_context({"backend": "agg"}):
        runpy.run_path(str(example), run_name="__main__")
    assert len(capsys.readouterr().out.splitlines()) >= 2


def test_the_first_lines_of_the_readme_print_what_stands_below_them(capsys) -> None:
    code, text = (
        next(block.text for block in blocks(ROOT / "README.md") if block.language == language)
        for language in ("python", "text")
    )
    exec(code, {})
    printed, found = (NUMBER.findall(each) for each in (capsys.readouterr().out, text))
    assert [float(number) for number in found] == pytest.approx([*map(float, printed)], rel=0.02, abs=0.03)


def shown(cell: Any) -> tuple[list[Any], list[str], list[float]]:
    """Kinds of the outputs of a cell, and the words and the numbers of their texts."""
    texts = " ".join(out.get("text") or out.data["text/plain"] for out in cell.outputs)
    kinds = [(out.output_type, sorted(out.get("data", {}))) for out in cell.outputs]
    return kinds, NUMBER.sub("#", texts).split(), [float(number) for number in NUMBER.findall(texts)]


@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
def test_a_notebook_has_been_run_and_shows_what_its_code_prints(file: Path) -> None:
    notebook: Any = nbformat.read(file, as_version=4)
    nbformat.validate(notebook)
    again = deepcopy(notebook)
    run(again)
    cells, fresh = ([cell for cell in each.cells if cell.cell_type == "code"] for each in (notebook, again))
    assert [cell.execution_count for cell in cells] == list(range(1, len(cells) + 1))
    pictures = [
        out.data["image/png"] for cell in cells for out in cell.outputs if "image/png" in out.get("data", ())
    ]
    assert len(pictures) >= 2
    assert max(len(b64decode(picture)) for picture in pictures) <= MOST_PICTURE_BYTES
    assert file.stat().st_size <= MOST_NOTEBOOK_BYTES
    for cell, run_again in zip(cells, fresh, strict=True):
        kinds, words, numbers = shown(cell)
        assert (kinds, words) == shown(run_again)[:2], "run `make notebooks`"
        # Other renderers draw other photons: scores then differ by some hundredths.
        assert numbers == pytest.approx(shown(run_again)[2], rel=0.02, abs=0.03), "run `make notebooks`"
