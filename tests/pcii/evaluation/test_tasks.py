"""What an evaluation measures and measures again, bounds beside it, and what is refused."""

import ast
import hashlib
import html
import json
import sys
from collections.abc import Sequence
from importlib.metadata import packages_distributions, version
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_runs import run_pcii
from other_packages import install_package
from tiny_datasets import NESTED, OWN, write_dataset

import pcii
from pcii.app import load_estimates
from pcii.base import InputError
from pcii.depth import estimate_depth
from pcii.evaluation import NamedMethod, evaluate, named_methods, read_rows, software_of, tasks_of
from pcii.metrics import object_bounds
from pcii.removal import removal_methods
from pcii.sections import reconstruct
from pcii.store import Dataset, machine, open_dataset, own_software, save_dataset
from pcii.types import CameraGrid, Light, PhotonCounts, Truth, Views

GRID = CameraGrid(rows=2, cols=3, pitch_mm=(5, 5), focal_mm=50, pixel_mm=0.25, height=40, width=48)
COUNTS = PhotonCounts.from_dense(np.random.default_rng(1).poisson(0.5, GRID.shape_KLHW), GRID)
LIGHT = Views(np.random.default_rng(0).random((*GRID.shape_KLHW, 3)).astype(np.float32), GRID)
IDS = np.zeros((40, 48), np.int16)
IDS[8:32, 8:32] = 1
TRUTH = Truth(np.where(IDS > 0, 500.0, np.inf), IDS, {1: "card"})
OF_COUNTS = ["depth:posterior", "depth:sweep-17", "depth:variance-sweep"]
FULL_LIGHT = "full-light"
OF_VIEWS = ["depth:posterior", "depth:variance-sweep", "depth:structure-tensor"]


def saved(path: Path, images: Any, **depths: Any) -> Dataset:
    depths = depths or {"z_mm": [500, 700], "z_range_mm": (450, 800)}
    return save_dataset(path, images, TRUTH, title=path.name, **depths)


def chosen(datasets: list[Dataset], *methods: str, lights: Sequence[Any] = ()) -> list[tuple[str, Any, str]]:
    tasks = tasks_of(datasets, named_methods(methods), lights)
    return [(task.dataset.name, task.light.stored, task.method.name) for task in tasks]


def test_without_names_every_method_is_scored_on_all_that_it_takes(tmp_path: Path) -> None:
    both, alone = saved(tmp_path / "both", (COUNTS, LIGHT)), saved(tmp_path / "alone", LIGHT)
    nested = open_dataset(write_dataset(tmp_path / "nested", 1, {NESTED: 5, OWN: 5}))
    of_counts = [*removal_methods(), *OF_COUNTS]
    assert chosen([both, alone, nested]) == [
        *(("both", None, name) for name in of_counts),
        *(("both", FULL_LIGHT, name) for name in OF_VIEWS),
        *(("alone", FULL_LIGHT, name) for name in OF_VIEWS),
        *(("nested", budget, name) for budget in (NESTED, OWN) for name in of_counts),
    ]
    # Of what is named each method takes what it can.
    assert chosen([both], "depth:variance-sweep", "brightness") == [
        ("both", None, "depth:variance-sweep"),
        ("both", None, "brightness"),
        ("both", FULL_LIGHT, "depth:variance-sweep"),
    ]
    assert chosen([nested], "depth", lights=[Light(20)]) == [("nested", NESTED, "depth:posterior")]


def test_full_light_is_a_budget_by_name_and_depth_means_the_default(tmp_path: Path) -> None:
    both, out = saved(tmp_path / "both", (COUNTS, LIGHT)), tmp_path / "out"
    methods = ("depth", "depth:posterior", "depth:variance-sweep")
    command = ["evaluate", str(both.path), "-o", str(out), *(f"--method={method}" for method in methods)]
    assert run_pcii(*command, "--budget", FULL_LIGHT) == 0
    rows = {(row["budget"], row["method"]) for row in read_rows(out)}
    assert rows == {(FULL_LIGHT, method) for method in methods[1:]}
    frame = evaluate([both.path], out, methods=["depth"]).frame
    assert frame["light"].cat.categories.tolist() == ["by exposure", FULL_LIGHT]
    assert frame["photons_per_view"].isna().tolist() == [False, True, True]


def test_single_commands_look_at_full_light_and_run_takes_a_method_of_depth(tmp_path: Path) -> None:
    both = saved(tmp_path / "both", (COUNTS, LIGHT))
    at_light = [str(both.path), "--budget", FULL_LIGHT]
    expected = estimate_depth(LIGHT, (450, 800), method="structure-tensor")
    for number, (command, option) in enumerate([("depth", "--method"), ("run", "--depth-method")]):
        out = tmp_path / str(number)
        arguments = [command, *at_light, option, "structure-tensor", "-o", str(out)]
        assert run_pcii(*arguments) == 0
        _, depth = load_estimates(out, both.at_light(Light.parse(FULL_LIGHT)))
        assert depth is not None
        np.testing.assert_array_equal(depth.z_mm, expected.z_mm)


@pytest.mark.parametrize(
    ("has", "methods", "budgets", "sentence"),
    [
        ("counts", ["depth:structure-tensor"], [], "'depth:structure-tensor' needs radiance, and of .*; use"),
        ("views", ["posterior"], [], "'posterior' needs photon counts, and of .*alone radiance would"),
        ("counts", [], [FULL_LIGHT], "has no budget full-light; there are exposure"),
    ],
)
def test_what_a_method_cannot_take_is_refused_before_any_work(
    tmp_path: Path, has: str, methods: list[str], budgets: list[Any], sentence: str
) -> None:
    data = saved(tmp_path / "alone", {"counts": COUNTS, "views": LIGHT}[has])
    with pytest.raises(InputError, match=sentence):
        evaluate([data.path], tmp_path / "out", methods=methods, budgets=budgets)
    assert not (tmp_path / "out").exists()


def test_depths_that_are_missing_or_too_near(tmp_path: Path) -> None:
    """Without planes removal is left out, and refused by name; a range that cannot be searched is refused."""
    ranged = saved(tmp_path / "ranged", COUNTS, z_range_mm=(450, 800))
    assert chosen([ranged]) == [("ranged", None, name) for name in OF_COUNTS]
    with pytest.raises(InputError, match="suggests no depths"):
        chosen([ranged], "brightness")
    near = saved(tmp_path / "near", COUNTS, z_mm=[500], z_range_mm=(0.5, 800))
    with pytest.raises(InputError, match=r"near: z_range_mm: from .* choose a farther near end"):
        chosen([near], "depth")


def test_the_bound_of_an_objects_depth_stands_beside_it_where_there_is_radiance(tmp_path: Path) -> None:
    both, dark = saved(tmp_path / "both", (COUNTS, LIGHT)), saved(tmp_path / "dark", COUNTS)
    frame = evaluate([both.path, dark.path], tmp_path / "out", methods=["depth", "brightness"]).frame
    z_mm = [500, 700]
    (expected,) = object_bounds(TRUTH, reconstruct(LIGHT, z_mm), reconstruct(COUNTS, z_mm))
    assert expected["depth_sigma_px"] > 0
    known = frame[frame["bound_px"].notna()]
    assert known[["dataset", "light", "method", "bound_px"]].to_numpy().tolist() == [
        ["both", "by exposure", "depth:posterior", expected["depth_sigma_px"]]
    ]
    assert ">bound, px</th>" in (tmp_path / "out" / "evaluation.html").read_text()


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
    distributions = packages_distributions()
    packages = {name for root in roots for name in distributions.get(root, [root])}
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
    earlier.mkdir()
    unknown = {name: value for name, value in rows[1].items() if name != "software"}
    both = rows[0] | {"date": "2026-01-10", "software": {"numpy": "1.0"}}, unknown
    (earlier / "rows.jsonl").write_text("".join(f"{json.dumps(row)}\n" for row in both))
    (sentence,) = evaluate([data], earlier, methods=["shape-from-focus"]).made_again
    assert sentence == "1 scores of shape-from-focus, since what makes them is not known"
    page = html.unescape((earlier / "evaluation.html").read_text())
    digest = hashlib.sha256((earlier / "rows.jsonl").read_bytes()).hexdigest()
    for text in ("2026-01-10 to 20", machine(), digest, f"{version('numpy')} (1 rows); 1.0 (1 rows)"):
        assert text in page
    assert "Not all rows are of the same software (numpy): name all datasets and methods again." in page
