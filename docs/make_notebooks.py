"""Run notebooks, by default all, and store their outputs: `python docs/make_notebooks.py [NOTEBOOK ...]`.

A cell shows what Jupyter would show of it: what it prints, its last value unless a semicolon follows, and its
figures. Nothing that differs from run to run is stored: neither times nor progress.
"""

import ast
import base64
import contextlib
import io
import sys
import tempfile
from pathlib import Path
from typing import Any

import matplotlib as mpl
import nbformat
from matplotlib import pyplot
from nbformat import NotebookNode, v4
from PIL import Image

NOTEBOOKS = sorted((Path(__file__).resolve().parent.parent / "examples" / "notebooks").glob("*.ipynb"))
MOST_PICTURE_BYTES = 40_000
MOST_NOTEBOOK_BYTES = 250_000
SIZES = [(256, 100), (256, 75), *((64, dots_per_inch) for dots_per_inch in range(100, 30, -5))]
"""Colours and dots per inch of a stored picture: the first with which it is small enough."""


def run(notebook: NotebookNode) -> None:
    """Run all cells, in order, in an empty working folder, and replace their outputs."""
    names: dict[str, Any] = {"__name__": "__main__"}
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    with (
        mpl.rc_context({"backend": "agg"}),
        tempfile.TemporaryDirectory() as folder,
        contextlib.chdir(folder),
    ):
        pyplot.close("all")  # what is open is no cell's
        for number, cell in enumerate(cells, start=1):
            cell.execution_count = number
            cell.outputs = outputs_of(cell.source, number, names)


def outputs_of(source: str, number: int, names: dict[str, Any]) -> list[NotebookNode]:
    """Run a cell, and give what it prints, its value and its figures."""
    tree, printed, value, outputs = ast.parse(source), io.StringIO(), None, []
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    with contextlib.redirect_stdout(printed):
        exec(compile(tree, "cell", "exec"), names)
        if isinstance(last, ast.Expr):
            value = eval(compile(ast.Expression(last.value), "cell", "eval"), names)
    if printed.getvalue():
        outputs.append(v4.new_output("stream", name="stdout", text=printed.getvalue()))
    if value is not None and not source.rstrip().endswith(";"):
        shown = {"text/plain": repr(value)}
        if hasattr(value, "_repr_html_"):
            shown["text/html"] = value._repr_html_()
        if hasattr(value, "_repr_png_"):
            shown["image/png"] = stored_picture(value.figure)
        outputs.append(v4.new_output("execute_result", shown, execution_count=number))
    for figure in map(pyplot.figure, pyplot.get_fignums()):
        shown = {"text/plain": repr(figure), "image/png": stored_picture(figure)}
        outputs.append(v4.new_output("display_data", shown))
    pyplot.close("all")
    return outputs


def stored_picture(figure: Any) -> str:
    """A figure as PNG of few colours, in base64."""
    for colours, dots_per_inch in SIZES:
        drawn, stored = io.BytesIO(), io.BytesIO()
        figure.savefig(drawn, dpi=dots_per_inch, bbox_inches="tight", facecolor="white")
        picture = Image.open(drawn).convert("RGB").quantize(colours, dither=Image.Dither.NONE)
        picture.save(stored, "png", optimize=True)
        if stored.tell() <= MOST_PICTURE_BYTES:
            return base64.b64encode(stored.getvalue()).decode()
    raise SystemExit(f"a picture has more than {MOST_PICTURE_BYTES} bytes; draw less in it")


def main(files: list[Path]) -> None:
    """Run the notebooks, and say how large they are with their outputs."""
    for file in files:
        notebook: Any = nbformat.read(file, as_version=4)
        run(notebook)
        text = nbformat.writes(notebook)
        if len(text) > MOST_NOTEBOOK_BYTES:
            raise SystemExit(f"{file.name}: {len(text)} bytes; it may have {MOST_NOTEBOOK_BYTES}")
        file.write_text(text + "\n", encoding="utf-8")
        print(f"{file.name}: {len(text) / 1000:.0f} kB")


if __name__ == "__main__":
    main([Path(name) for name in sys.argv[1:]] or NOTEBOOKS)
