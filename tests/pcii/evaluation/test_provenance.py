"""What other software made is made again, in evaluations and in results alike, and it is said why."""

import ast
import hashlib
import html
import sys
from importlib.metadata import packages_distributions, version
from pathlib import Path

import pytest
from other_packages import install_package
from tiny_datasets import OWN, write_dataset

import pcii
from pcii.evaluation import NamedMethod, evaluate, read_rows, software_of
from pcii.evaluation.rows import writing_rows
from pcii.store import machine, own_software

COMPUTES = ("base", "types", "sections", "evidence", "depth", "removal", "metrics")
DRAWS_TALKS_OR_LOADS = {"matplotlib", "xarray", "rich", "cyclopts", "distributed", "lazy-loader"}
CODE = """
from pcii import DepthMap, Segmented
from pathlib import Path
import numpy as np

def remove(counts, sections):
    threshold = float((Path(__file__).parent / "weights.txt").read_text())
    return Segmented(sections.counts.sum(axis=-1) > threshold, "learned", sections)

def map_depth(data, z_range_mm):
    film = data.grid.height, data.grid.width
    return DepthMap(np.full(film, z_range_mm[0]), np.ones(film))
"""
POINTS = {"pcii.methods": {"learned": "strange:remove"}, "pcii.depth_methods": {"near": "strange:map_depth"}}


def test_every_package_that_computes_is_recorded() -> None:
    imported = set[str]()
    for room in COMPUTES:
        for file in (Path(pcii.__file__).parent / room).rglob("*.py"):
            for node in ast.walk(ast.parse(file.read_text())):
                if isinstance(node, ast.Import):
                    imported |= {alias.name for alias in node.names}
                elif isinstance(node, ast.ImportFrom) and node.module:
                    imported.add(node.module)
    roots = {name.split(".")[0] for name in imported} - sys.stdlib_module_names - {"pcii"}
    packages = {name for root in roots for name in packages_distributions().get(root, [root])}
    assert packages - DRAWS_TALKS_OR_LOADS <= set(own_software())


def test_rows_of_other_software_are_measured_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package, out = tmp_path / "package", tmp_path / "out"
    package.mkdir()
    data = write_dataset(tmp_path / "data", 1, {OWN: 5})
    methods = ["brightness", "learned", "depth:near", "depth:own_method.py:map_depth"]
    monkeypatch.chdir(tmp_path)

    def made_again() -> tuple[str, ...]:
        return evaluate([data], out, methods=methods).made_again

    def install(weights: str, end: str = "") -> None:
        files = {"strange/__init__.py": CODE, "strange/weights.txt": weights}
        install_package(package, monkeypatch, POINTS, files)
        Path("own_method.py").write_text(CODE + end)

    install("1")
    assert made_again() == made_again() == ()
    before = (out / "rows.jsonl").read_bytes()
    install("2", "\n")
    assert {*made_again()} == {
        "2 scores of depth:near, learned, since the source of strange has changed",
        "1 scores of depth:map_depth, since the source of own_method.py has changed",
    }
    assert (out / "rows.jsonl").read_bytes().startswith(before)
    rows = read_rows(out)
    assert len(rows) == 4
    assert {row["method"]: row["software"] for row in rows}["learned"] == software_of(NamedMethod("learned"))
    assert made_again() == ()


def test_the_page_says_what_made_it(tmp_path: Path) -> None:
    data, out = write_dataset(tmp_path / "data", 1, {OWN: 5}), tmp_path / "out"
    evaluate([data], out, methods=["brightness", "shape-from-focus"])
    rows = read_rows(out)
    earlier = tmp_path / "earlier"
    with writing_rows(earlier) as file:
        file.add(rows[0] | {"date": "2026-01-10", "software": {"numpy": "1.0"}})
        file.add({name: value for name, value in rows[1].items() if name != "software"})
    (sentence,) = evaluate([data], earlier, methods=["shape-from-focus"]).made_again
    assert sentence == "1 scores of shape-from-focus, since what makes them is not known"
    page = html.unescape((earlier / "evaluation.html").read_text())
    digest = hashlib.sha256((earlier / "rows.jsonl").read_bytes()).hexdigest()
    for text in ("2026-01-10 to 20", machine(), digest, f"{version('numpy')} (1 rows); 1.0 (1 rows)"):
        assert text in page
    assert "Not all rows are of the same software (numpy): name all datasets and methods again." in page
