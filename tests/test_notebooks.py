"""Every notebook is kept without outputs, and runs from top to bottom, showing what its cells end with."""

import ast
from pathlib import Path
from typing import Any

import matplotlib as mpl
import nbformat
import pytest

NOTEBOOKS = sorted((Path(__file__).resolve().parent.parent / "examples" / "notebooks").glob("*.ipynb"))


def _case(file: Path) -> object:
    marks = [pytest.mark.renders] if "import simgen" in file.read_text(encoding="utf-8") else []
    return pytest.param(file, id=file.stem, marks=marks)


def run_cell(source: str, names: dict[str, Any]) -> None:
    """Run a cell, and show the value of its last expression as a notebook does."""
    tree = ast.parse(source)
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, "cell", "exec"), names)
    if isinstance(last, ast.Expr):
        value = eval(compile(ast.Expression(last.value), "cell", "eval"), names)
        assert isinstance(value._repr_html_() if hasattr(value, "_repr_html_") else repr(value), str)


@pytest.mark.parametrize("file", [_case(file) for file in NOTEBOOKS])
def test_a_notebook_runs(file: Path) -> None:
    from matplotlib import pyplot

    notebook: Any = nbformat.read(file, as_version=4)
    nbformat.validate(notebook)
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert not any(cell.outputs or cell.execution_count for cell in cells)
    names: dict[str, Any] = {"__name__": "__main__"}
    drawn = 0
    with mpl.rc_context({"backend": "agg"}):
        for cell in cells:
            run_cell(cell.source, names)
            for number in pyplot.get_fignums():
                pyplot.figure(number).canvas.draw()
                drawn += 1
            pyplot.close("all")
    assert drawn >= 2
