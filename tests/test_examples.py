"""Every example runs and says something; every notebook runs, and is kept without outputs."""

import ast
import runpy
from pathlib import Path
from typing import Any

import matplotlib as mpl
import nbformat
import pytest

ROOT = Path(__file__).resolve().parent.parent
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
NOTEBOOKS = sorted((ROOT / "examples" / "notebooks").glob("*.ipynb"))
pytestmark = [pytest.mark.guide, pytest.mark.renders]


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda file: file.stem)
def test_an_example_runs(
    example: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", [str(example)])
    with mpl.rc_context({"backend": "agg"}):
        runpy.run_path(str(example), run_name="__main__")
    assert len(capsys.readouterr().out.splitlines()) >= 2


def run_cell(source: str, names: dict[str, Any]) -> None:
    """Run a cell, and show the value of its last expression as a notebook does."""
    tree = ast.parse(source)
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, "cell", "exec"), names)
    if isinstance(last, ast.Expr):
        value = eval(compile(ast.Expression(last.value), "cell", "eval"), names)
        assert isinstance(value._repr_html_() if hasattr(value, "_repr_html_") else repr(value), str)


@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
def test_a_notebook_runs(file: Path) -> None:
    from matplotlib import pyplot

    notebook: Any = nbformat.read(file, as_version=4)
    nbformat.validate(notebook)
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert not any(cell.outputs or cell.execution_count for cell in cells)
    names: dict[str, Any] = {"__name__": "__main__"}
    figures = 0
    with mpl.rc_context({"backend": "agg"}):
        for cell in cells:
            run_cell(cell.source, names)
            for number in pyplot.get_fignums():
                pyplot.figure(number).canvas.draw()
                figures += 1
            pyplot.close("all")
    assert figures >= 2
